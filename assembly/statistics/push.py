"""Where play sits once it is pushed until it is taken up; compiled."""

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import kernel
from assembly.solvers.interior import interior_point


@kernel
def push_all(
    rows: NDArray, starts: NDArray, free: NDArray, u: NDArray,
    pushes: NDArray, ends: NDArray,
) -> None:  # fmt: skip
    """Go from every row of u (k, nu) as far as a push leads: play is then taken up.

    Args:
        rows: (p, nu) orthonormal, zero where not ``free``.
        starts: (cones + 1,) first column of each cone, and nu.
        free: (nu,) bool, which may move; whole cones.
        u: (k, nu) points of the set.
        pushes: (k, nu) what pushes each clearance.
        ends: (k, nu) to fill: the farthest points, not a number where the interior
            point breaks down, as it may in a set without an inside.
    """
    nu = u.shape[1]
    none, nothing = np.zeros((0, nu)), np.zeros(0)
    p = len(rows)
    for i in range(len(u)):
        push, size = np.empty(nu), 0.0
        for c in range(nu):
            ends[i, c], push[c] = u[i, c], pushes[i, c] if free[c] else 0.0
            size += push[c] * push[c]
        size = np.sqrt(size)
        if not size > 0.0:
            continue
        for c in range(nu):
            push[c] /= size
        right = np.zeros(p)
        for l in range(p):
            for c in range(nu):
                if free[c]:
                    right[l] += rows[l, c] * u[i, c]
        found, _, steps = interior_point(
            none, nothing, push, rows, right, starts, 1e-9, 0.0
        )
        for c in range(nu):
            if free[c]:
                ends[i, c] = found[c] if steps >= 0 else np.nan
