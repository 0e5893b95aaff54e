"""Operations on vectors whose components are grouped into cones of radius 1."""

import numpy as np
from numpy.typing import NDArray


def cone_starts(group: NDArray) -> NDArray:
    """Return the index of each cone's first component, followed by nu, (cones + 1,)."""
    return np.append(0, np.cumsum(np.bincount(group)))


def cone_sums(values: NDArray, group: NDArray) -> NDArray:
    """Return the sum of the components of each cone, (..., cones)."""
    if values.ndim == 1:
        return np.bincount(group, weights=values)
    return values @ (group[:, None] == np.arange(np.bincount(group).size))


def cone_sizes(values: NDArray, group: NDArray) -> NDArray:
    """Return the Euclidean norm of the components of each cone, (..., cones)."""
    return np.sqrt(cone_sums(values**2, group))


def into_cones(u: NDArray, group: NDArray) -> NDArray:
    """Scale the components of each cone to a norm of at most 1."""
    return u / np.maximum(1.0, cone_sizes(u, group))[group]
