"""Central differences extrapolated to step zero, with their uncertainty.

The error of differences has a part of the step's square and a part of rounding over the
step: the first dominates for large steps, the second for small ones.  Two neighbouring
steps are extrapolated to step zero.  Of all pairs the one is taken that differs least
from the one before it; this difference is its uncertainty.

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
    """Return the neighbouring differences extrapolated to step zero.

    Args:
        steps: k of them, falling.
        differences: values of the same shape, one for each step.

    Returns:
        k - 1 arrays, without the error of the step's square.
    """
    squares = [(one / two) ** 2 for one, two in pairwise(steps)]
    pairs = zip(squares, pairwise(differences), strict=True)
    return [(square * two - one) / (square - 1) for square, (one, two) in pairs]


def steadiest(
    found: Sequence[NDArray], size: Callable[[NDArray], float]
) -> tuple[NDArray, NDArray]:
    """Return the array that differs least from the one before it.

    Args:
        found: at least two arrays of the same shape.
        size: size of a change, which makes changes comparable.

    Returns:
        The array, and its absolute change.
    """
    changes = [np.abs(two - one) for one, two in pairwise(found)]
    best = int(np.argmin([size(change) for change in changes]))
    return found[best + 1], changes[best]
