"""Farthest positions of clearances along given directions; compiled."""

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import kernel
from assembly.solvers.interior import Programme, interior_point
from assembly.solvers.vectors import matrix, vector


@kernel
def move_to_contact(
    rows: NDArray, starts: NDArray, free: NDArray,
    positions: NDArray, directions: NDArray, ends: NDArray,
) -> None:  # fmt: skip
    """The farthest point of the clearances' set along each direction.

    Args:
        rows: (p, nu) orthonormal, zero where not ``free``.
        starts: (cones + 1,) first column of each cone, and nu.
        free: (nu,) bool, which may move; whole cones.
        positions: (k, nu) points of the set.
        directions: (k, nu) linear objectives to be maximised.
        ends: (k, nu) overwritten with the farthest points; NaN where the interior point
            method fails, as it may in a set with empty interior.
    """
    nu = positions.shape[1]
    no_springs, no_offset = matrix(0, nu), vector(0)
    constraints = len(rows)
    for i in range(len(positions)):
        direction, size = vector(nu), 0.0
        for c in range(nu):
            ends[i, c] = positions[i, c]
            direction[c] = directions[i, c] if free[c] else 0.0
            size += direction[c] * direction[c]
        size = np.sqrt(size)
        if not size > 0.0:
            continue
        for c in range(nu):
            direction[c] /= size
        right_side = vector(constraints)
        for l in range(constraints):
            for c in range(nu):
                if free[c]:
                    right_side[l] += rows[l, c] * positions[i, c]
        programme = Programme(
            no_springs, no_offset, direction, rows, right_side, starts
        )
        position, _, steps = interior_point(programme, 1e-9, 0.0)
        for c in range(nu):
            if free[c]:
                ends[i, c] = position[c] if steps >= 0 else np.nan
