"""Operations on vectors of clearances, grouped by cones of radius 1."""

import numpy as np
from numpy.typing import NDArray


def cone_starts(group: NDArray) -> NDArray:
    """Return (cones + 1,) indices: the first column of each cone, then nu."""
    return np.append(0, np.cumsum(np.bincount(group)))


def cone_sums(values: NDArray, group: NDArray) -> NDArray:
    """Return (..., cones) sums of the components of (..., nu) vectors in each cone."""
    if values.ndim == 1:
        return np.bincount(group, weights=values)
    return values @ (group[:, None] == np.arange(np.bincount(group).size))


def cone_sizes(values: NDArray, group: NDArray) -> NDArray:
    """Return the (..., cones) Euclidean norm of the components in each cone."""
    return np.sqrt(cone_sums(values**2, group))


def into_cones(u: NDArray, group: NDArray) -> NDArray:
    """Project vectors onto the unit cones, leaving vectors inside unchanged."""
    return u / np.maximum(1.0, cone_sizes(u, group))[group]
