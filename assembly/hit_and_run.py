"""Where play may sit: points uniform in it, or at its contacts; compiled.

The set is {u : rows (u - start) = 0, |u_k| <= 1 for each cone k}, the rows orthonormal.

Sources:
    Smith (1984), Efficient Monte Carlo procedures for generating points uniformly
    distributed over bounded regions (hit-and-run).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from assembly.interior import interior_point


@njit(cache=True, error_model="numpy", nogil=True)
def hit_and_run(
    rows: NDArray, starts: NDArray, free: NDArray, u: NDArray, steps: int, seed: int
) -> None:
    """Walk: along a random chord through the set, to a point uniform on it.

    Args:
        rows: (p, nu) orthonormal, zero where not ``free``.
        starts: (cones + 1,) first column of each cone, and nu.
        free: (nu,) bool, which may move; whole cones.
        u: (nu,) a point of the set; leaves holding the last point.
        steps: how many.
        seed: below 2^32.
    """
    np.random.seed(seed)
    nu = len(u)
    z = np.zeros(nu)
    for _ in range(steps):
        for c in range(nu):
            z[c] = np.random.standard_normal() if free[c] else 0.0
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
        step = least + (most - least) * np.random.random()
        for c in range(nu):
            u[c] += step * z[c]


@njit(cache=True, error_model="numpy", nogil=True)
def walk_all(
    rows: NDArray,
    starts: NDArray,
    free: NDArray,
    u: NDArray,
    steps: int,
    seeds: NDArray,
) -> None:
    """A walk of its own from every row of u (k, nu); see :func:`hit_and_run`.

    Args:
        rows: see there.
        starts: see there.
        free: see there.
        u: (k, nu) points of the set; leaves holding the last ones.
        steps: of each.
        seeds: (k,).
    """
    for i in range(len(u)):
        hit_and_run(rows, starts, free, u[i], steps, seeds[i])


@njit(cache=True, error_model="numpy", nogil=True)
def push_all(
    rows: NDArray, starts: NDArray, free: NDArray, u: NDArray, pushes: NDArray
) -> None:
    """Go from every row of u (k, nu) as far as a push leads: play is then taken up.

    Args:
        rows: (p, nu) orthonormal, zero where not ``free``.
        starts: (cones + 1,) first column of each cone, and nu.
        free: (nu,) bool, which may move; whole cones.
        u: (k, nu) points of the set; leaves holding the farthest ones.
        pushes: (k, nu) what pushes each clearance.
    """
    nu = u.shape[1]
    none, nothing = np.zeros((0, nu)), np.zeros(0)
    p = len(rows)
    for i in range(len(u)):
        push = pushes[i] * free
        size = np.sqrt(np.sum(push * push))
        if not size > 0.0:
            continue
        right = np.zeros(p)
        for l in range(p):
            for c in range(nu):
                if free[c]:
                    right[l] += rows[l, c] * u[i, c]
        found = interior_point(none, nothing, push / size, rows, right, starts, 1e-9)[0]
        # rounding may have left the rows: taken out, then back within the cones
        step = np.where(free, found - u[i], 0.0)
        for l in range(p):
            along = np.sum(rows[l] * step)
            step -= along * rows[l]
        factor = 1.0
        for k in range(len(starts) - 1):
            zz, uz, uu = 0.0, 0.0, 0.0
            for c in range(starts[k], starts[k + 1]):
                zz += step[c] * step[c]
                uz += u[i, c] * step[c]
                uu += u[i, c] * u[i, c]
            if zz > 0.0 and free[starts[k]]:
                root = np.sqrt(uz * uz + zz * max(0.0, 1.0 - uu))
                factor = min(factor, max(0.0, (-uz + root) / zz))
        u[i] += factor * step
