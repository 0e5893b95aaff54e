"""Estimate the errors of functions outside the range of their variable.

The range of a function's variable is divided into five parts, each of which is
predicted by a fit to the other four.  The fit uses the prior standard deviations of the
model and the leave-block-out identity (:mod:`.gaussian`), without iteration.  Random
held-out rows do not test extrapolation, because they are surrounded by fitted rows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.variables import variable
from forcefit.validation.diagnosis.candidates import Candidate
from forcefit.validation.diagnosis.gaussian import leave_block_out
from forcefit.validation.diagnosis.states import State

PARTS = 5  # number of parts of a range, equal to the number of folds
_DISTINCT = 4  # smallest number of different values in each part


@dataclass(frozen=True)
class RangeError:
    """Errors of a function on unfitted parts of its variable's range.

    Attributes:
        variable: public name of the variable.
        without: [sigma] rms of all readings, predicted by the model without the
            function.
        after: [sigma] rms of all readings, predicted by the model with the function.
    """

    variable: str
    without: float
    after: float


def range_error(
    candidate: Candidate, best: State, without: State, rows: NDArray
) -> RangeError | None:
    """Return the extrapolation error of a function in a model.

    With several variables, the largest error is returned.  The result is None if no
    variable has enough distinct values.  ``without`` is the model without the function.
    ``rows`` (n,) are the rows of the fitted cells.
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
