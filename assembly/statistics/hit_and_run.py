"""Where play may sit: points uniform in it, or at its contacts; compiled.

The set is {u : rows (u - start) = 0, |u_k| <= 1 for each cone k}, the rows orthonormal.

Sources:
    Smith (1984), Efficient Monte Carlo procedures for generating points uniformly
    distributed over bounded regions (hit-and-run).
"""

import numpy as np
from numpy.typing import NDArray

from assembly.compiled import kernel
from assembly.solvers.cone_solvers import ConeSolvers


@kernel(nogil=True)
def hit_and_run(
    rows: NDArray, starts: NDArray, free: NDArray, u: NDArray, steps: int,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Walk: along a random chord through the set, to a point uniform on it.

    Args:
        rows: (p, nu) orthonormal, zero where not ``free``.
        starts: (cones + 1,) first column of each cone, and nu.
        free: (nu,) bool, which may move; whole cones.
        u: (nu,) a point of the set; leaves holding the last point.
        steps: how many.
        rng: of random numbers.
    """
    nu = len(u)
    z = np.zeros(nu)
    for _ in range(steps):
        for c in range(nu):
            z[c] = rng.standard_normal() if free[c] else 0.0
        for i in range(len(rows)):
            along = 0.0
            for c in range(nu):
                along += rows[i, c] * z[c]
            for c in range(nu):
                z[c] -= along * rows[i, c]
        least, most = -np.inf, np.inf
        for k in range(len(starts) - 1):
            zz, uz, uu = 0.0, 0.0, 0.0
            for c in range(starts[k], starts[k + 1]):
                zz += z[c] * z[c]
                uz += u[c] * z[c]
                uu += u[c] * u[c]
            if not (zz > 1e-24 and free[starts[k]]):
                continue
            # a point on the boundary may lie outside by rounding
            root = np.sqrt(uz * uz + zz * max(0.0, 1.0 - uu))
            least, most = max(least, (-uz - root) / zz), min(most, (-uz + root) / zz)
        if not (most > least and np.isfinite(most - least)):
            continue
        step = least + (most - least) * rng.random()
        for c in range(nu):
            u[c] += step * z[c]


@kernel(nogil=True)
def push_all(
    solvers: ConeSolvers, rows: NDArray, starts: NDArray, free: NDArray, u: NDArray,
    pushes: NDArray, ends: NDArray,
) -> None:  # fmt: skip
    """Go from every row of u (k, nu) as far as a push leads: play is then taken up.

    Args:
        solvers: of :func:`assembly.solvers.cone_solvers.cone_solvers`.
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
        found, _, steps = solvers.interior_point(
            none, nothing, push, rows, right, starts, 1e-9, 0.0
        )
        for c in range(nu):
            if free[c]:
                ends[i, c] = found[c] if steps >= 0 else np.nan
