"""How well functions hold where their variable has not been.

Each fifth of the range of a function's variable is predicted by a fit to the others, at
the model's prior sizes: without refits, by the leave-block-out identity
(:mod:`.gaussian`).  Random rows lie between others; a wave that fits them may be
anything beyond the range.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.variables import variable
from validation.diagnosis.candidates import Candidate
from validation.diagnosis.gaussian import leave_block_out
from validation.diagnosis.states import State

PARTS = 5  # of a range, as folds of rows
_DISTINCT = 4  # values of a variable for each part, at least


@dataclass(frozen=True)
class RangeError:
    """Errors on parts of a variable's range, each left out in turn.

    Attributes:
        variable: its public name.
        without: [sigma] rms of all readings, predicted by the model without the
            function.
        after: [sigma] the same with it.
    """

    variable: str
    without: float
    after: float


def range_error(
    candidate: Candidate, best: State, without: State, rows: NDArray
) -> RangeError | None:
    """Return the error where a function of a model must extrapolate.

    Of its variables that with the largest error, None where none has enough values.
    ``without`` is the model without it, ``rows`` (n,) are those of the fitted cells.
    """
    conditions = best.readings.columns.conditions
    names = dict.fromkeys(v for part in candidate.parts for v in part.variables)
    found = []
    for name in names:
        if name.startswith("wrench."):
            continue
        x = variable(conditions, name)[rows]
        if not np.isfinite(x).all() or len(np.unique(x)) < _DISTINCT * PARTS:
            continue
        levels = np.quantile(np.unique(x), np.linspace(0, 1, PARTS + 1)[1:-1])
        part = np.searchsorted(levels, x, side="right")
        errors = [_rms(leave_block_out(s.marginal, part)[0]) for s in (without, best)]
        found.append(RangeError(name, *errors))
    return max(found, key=lambda one: one.after, default=None)


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
