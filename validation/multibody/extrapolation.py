"""Central differences extrapolated to step zero, with an estimate of uncertainty.

The error of a difference has a part proportional to the square of the step, and a part
of rounding over the step.  The first dominates for large steps, the second for small
steps.  Two neighbouring steps are extrapolated to step zero.  Of all pairs, the one is
chosen that differs least from the pair before it; this difference is the uncertainty.

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
    """Return neighbouring differences extrapolated to step zero.

    Args:
        steps: k decreasing steps.
        differences: values of the same shape, one for each step.

    Returns:
        k - 1 arrays, without the error proportional to the square of the step.
    """
    squares = [(one / two) ** 2 for one, two in pairwise(steps)]
    pairs = zip(squares, pairwise(differences), strict=True)
    return [(square * two - one) / (square - 1) for square, (one, two) in pairs]


def steadiest(
    found: Sequence[NDArray], size: Callable[[NDArray], float]
) -> tuple[NDArray, NDArray]:
    """Return the array that differs least from the array before it.

    Args:
        found: at least two arrays of the same shape.
        size: function that returns the size of a change, by which changes are compared.

    Returns:
        The array, and its absolute change.
    """
    changes = [np.abs(two - one) for one, two in pairwise(found)]
    best = int(np.argmin([size(change) for change in changes]))
    return found[best + 1], changes[best]
