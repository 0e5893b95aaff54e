"""Estimate the extrapolation errors of functions.

The range of a variable is divided into five intervals. The readings in each interval
are predicted by a fit to the other four intervals, with the prior standard deviations
of the model.  Random held-out rows do not test extrapolation, because they are
surrounded by fitted rows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.variables import variable
from forcefit.validation.diagnosis.candidates import Candidate
from forcefit.validation.diagnosis.gaussian import leave_block_out
from forcefit.validation.diagnosis.states import State

PARTS = 5  # number of intervals into which the range of a variable is divided
_DISTINCT = 4  # smallest number of distinct values in each interval


@dataclass(frozen=True)
class RangeError:
    """Extrapolation errors of models with and without a function.

    Attributes:
        variable: public name of the variable.
        without: [sigma] rms error of the model without the function.
        after: [sigma] rms error of the model with the function.
    """

    variable: str
    without: float
    after: float


def range_error(
    candidate: Candidate, best: State, without: State, rows: NDArray
) -> RangeError | None:
    """Return the extrapolation error of a function in a model.

    Args:
        candidate: the function.
        best: model with the function.
        without: model without the function.
        rows: (n,) row of each reading used in the fit.

    Returns:
        The largest error over the variables of the function.  None if no variable has
        enough distinct values.
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
