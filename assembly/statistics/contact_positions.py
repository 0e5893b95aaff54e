"""Clearance positions that lie farthest along given directions in clearance space."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.solvers.one_problem import farthest_points

_PRECISION = 1e-9  # relative precision of the largest component in a direction


def move_to_contact(
    rows: NDArray, starts: NDArray, free: NDArray, positions: NDArray,
    directions: NDArray,
) -> NDArray:  # fmt: skip
    """Find the point of the clearance set that lies farthest along each direction.

    Args:
        rows: (p, nu) orthonormal rows, zero for clearances that are not ``free``.
        starts: (cones + 1,) index of the first clearance of each cone, and finally nu.
        free: (nu,) bool, True for clearances that may move; the same for all components
            of a cone.
        positions: (k, nu) points of the set.
        directions: (k, nu) directions in which the component is maximised.

    Returns:
        (k, nu) farthest points; NaN if the interior-point method fails, for example
        because the interior of the set is empty.
    """
    ends = positions.copy()
    along = np.where(free, directions, 0.0)
    size = np.linalg.norm(along, axis=1)
    moving = size > 0.0
    points, _, solved = farthest_points(
        rows, starts, along[moving] / size[moving, None],
        np.where(free, positions[moving], 0.0) @ rows.T,
        np.full(np.count_nonzero(moving), _PRECISION),
    )  # fmt: skip
    points[~solved] = np.nan
    ends[moving] = np.where(free, points, positions[moving])
    return ends
