"""Joint positions within clearances that are farthest along given directions."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.solvers.one_problem import farthest_points

_PRECISION = 1e-9  # relative precision of the maximum


def move_to_contact(
    rows: NDArray, starts: NDArray, free: NDArray, positions: NDArray,
    directions: NDArray,
) -> NDArray:  # fmt: skip
    """Find the joint positions that are farthest along each direction.

    Args:
        rows: (p, nu) orthonormal rows of the closure equations; entries are zero for
            clearances that are not ``free``.
        starts: (cones + 1,) index of the first clearance of each cone, and finally nu.
        free: (nu,) bool, True for clearances in which the joint may move; equal for all
            components of a cone.
        positions: (k, nu) points of the set.
        directions: (k, nu) directions.

    Returns:
        Farthest points, (k, nu); NaN if the interior-point method fails, for example
        because the set has no interior.
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
