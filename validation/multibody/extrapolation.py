"""Central differences at step zero, and how well they are known.

Differences of falling steps are off by the steps' square and by rounding over the
step: large steps leave the one, small ones the other.  Two neighbouring steps are
extrapolated to none, and of all such pairs that is taken which differs least from the
one before it; by so much it is known.

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
    """Return the neighbouring differences extrapolated to no step.

    Args:
        steps: k of them, falling.
        differences: of the same shape, one for each step.

    Returns:
        k - 1 arrays, without the error that grows with the step's square.
    """
    squares = [(one / two) ** 2 for one, two in pairwise(steps)]
    pairs = zip(squares, pairwise(differences), strict=True)
    return [(square * two - one) / (square - 1) for square, (one, two) in pairs]


def steadiest(
    found: Sequence[NDArray], size: Callable[[NDArray], float]
) -> tuple[NDArray, NDArray]:
    """Return the one that differs least from the one before it.

    Args:
        found: at least two arrays of the same shape.
        size: of a change, so that changes can be compared.

    Returns:
        The array, and its absolute change.
    """
    changes = [np.abs(two - one) for one, two in pairwise(found)]
    best = int(np.argmin([size(change) for change in changes]))
    return found[best + 1], changes[best]
