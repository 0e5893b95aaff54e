"""Extrapolate central differences to zero step and estimate the uncertainty.

The truncation error of a central difference is proportional to the square of the step,
and the round-off error is proportional to the inverse of the step.  Each pair of
consecutive steps is extrapolated to zero step.  The result is the extrapolated value
with the smallest difference from the preceding value.  This difference is the estimated
uncertainty.

Sources:
    Ridders (1982), Accurate computation of F'(x) and F'(x) F''(x).
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def without_squares(
    steps: Sequence[float], differences: Sequence[NDArray]
) -> list[NDArray]:
    """Extrapolate pairs of consecutive central differences to zero step.

    Args:
        steps: k decreasing steps.
        differences: central differences of equal shape, one for each step.

    Returns:
        k - 1 arrays, in which the error proportional to the square of the step is
        eliminated.
    """
    squares = [(one / two) ** 2 for one, two in pairwise(steps)]
    pairs = zip(squares, pairwise(differences), strict=True)
    return [(square * two - one) / (square - 1) for square, (one, two) in pairs]


def steadiest(
    found: Sequence[NDArray], size: Callable[[NDArray], float]
) -> tuple[NDArray, NDArray]:
    """Return the array with the smallest difference from the preceding array.

    Args:
        found: at least two arrays of the same shape.
        size: function that returns the norm of a difference.

    Returns:
        The array, and its absolute difference from the preceding array.
    """
    changes = [np.abs(two - one) for one, two in pairwise(found)]
    best = int(np.argmin([size(change) for change in changes]))
    return found[best + 1], changes[best]
