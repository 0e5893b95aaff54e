"""A compiled Newton method for the dual of problem (22), made smooth by its own answer.

    maximise  y.h - |y|^2 / 2 - sum_k |G_k^T y - d_k|   over the springs y

is smooth wherever every clearance presses on its bound: a few Newton steps suffice.
Where a clearance stays within its bound the dual has a kink, -|z|.  In its place goes

    min over |u| <= 1 of  u.z + |u - u_old|^2 / (2 sigma),

the kink rounded where u_old says it is; each answer's u is the next u_old and sigma
grows, which converges to the dual's own maximum for any sigma.  With u at hand the gap
is known exactly at every step: |G u + h - y|^2 / 2 + sum_k (|z_k| + z_k.u_k).  Rows
H u = k that no spring can take up are further rows of G, h = -k, with no |y|^2 / 2.

Sources:
    Rockafellar (1976), Augmented Lagrangians and applications of the proximal point
    algorithm in convex programming; Li, Sun, Toh (2018), A highly efficient semismooth
    Newton augmented Lagrangian method for solving lasso problems.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_HALVINGS = 12
_SHARPER = 10.0  # growth of sigma each time u_old moves
_SETTLED = 0.1  # part of the gap that may be the inner problem's
_OPEN = 1e-13  # most that a row without springs may stay open


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def dual_newton(
    Gt: NDArray, h: NDArray, d: NDArray, springs: int, starts: NDArray,
    relative: float, absolute: float, steps: int, sharp: float, u: NDArray, y: NDArray,
) -> int:  # fmt: skip
    """Maximise the dual; ``u`` and ``y`` leave holding the answer.

    Args:
        Gt: (nu, r) columns of G, of order 1, and of H.
        h: (r,) and -k.
        d: (nu,) work of the load along the clearances.
        springs: r of G alone; H's rows come last.
        starts: (cones + 1,) first column of each cone (one or two each), and nu.
        relative: gap asked for, relative to the energy ..
        absolute: .. plus this.
        steps: most Newton steps.
        sharp: first sigma, times the mean |G_k^T h|; the larger, the better u must be.
            0 leaves the dual as it is, kinks and all, and gives up at the first one.
        u: (nu,) first guess, such as 0, within the cones; leaves holding the answer.
        y: (r,) leaves holding the multipliers; of H's rows also the first guess.

    Returns:
        Steps taken; -1 if it did not settle.
    """
    r, nu = len(h), len(u)
    g, S, step, start = np.empty(r), np.empty((r, r)), np.zeros(r), np.empty(r)
    old = u.copy()
    mean = 0.0
    for i in range(springs):
        y[i] = h[i]
        for c in range(nu):
            y[i] += Gt[c, i] * u[c]
    for c in range(nu):
        z = -d[c]
        for i in range(springs):
            z += Gt[c, i] * h[i]
        mean += abs(z) / nu
    sigma = sharp / max(mean, 1e-12) if sharp > 0.0 else 1e30
    before, halvings, taken = -np.inf, 0, 0
    while True:
        smooth, residual, kink, primal = _slopes(
            Gt, h, d, springs, starts, old, sigma, u, y, g, S
        )
        closed = True
        for i in range(springs, r):
            closed = closed and abs(g[i]) <= _OPEN
        if closed and residual + kink <= relative * primal + absolute:
            return taken
        if not smooth >= before - 1e-14:
            halvings += 1
            if halvings > _HALVINGS or sharp == 0.0:
                return -1
            for i in range(r):
                step[i] *= 0.3
                y[i] = start[i] + step[i]
            continue
        if taken == steps:
            return -1
        before, halvings, taken = smooth, 0, taken + 1
        if residual <= _SETTLED * (residual + kink):
            for c in range(nu):
                old[c] = u[c]
            sigma *= _SHARPER
            before = -np.inf
            _slopes(Gt, h, d, springs, starts, old, sigma, u, y, g, S)
        if not _solve(S, g, step):
            return -1
        for i in range(r):
            start[i] = y[i]
            y[i] += step[i]


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _slopes(
    Gt: NDArray, h: NDArray, d: NDArray, springs: int, starts: NDArray, old: NDArray,
    sigma: float, u: NDArray, y: NDArray, g: NDArray, S: NDArray,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Smooth dual at y, the two parts of the gap, and the primal value.

    Args:
        Gt: as in :func:`dual_newton`.
        h: see there.
        d: see there.
        springs: see there.
        starts: see there.
        old: (nu,) the clearances that u is drawn to.
        sigma: how loosely.
        u: (nu,) leaves holding the clearances.
        y: (r,) where.
        g: (r,) leaves holding the slope.
        S: (r, r) leaves holding minus the curvature, lower half.

    Returns:
        The smooth dual, the gap from the slope and from the kinks, the springs' energy.
    """
    r = len(h)
    smooth, kink = 0.0, 0.0
    for i in range(r):
        stretch = y[i] if i < springs else 0.0
        g[i] = h[i] - stretch
        smooth += y[i] * (h[i] - 0.5 * stretch)
        for l in range(i):
            S[i, l] = 0.0
        S[i, i] = 1.0 if i < springs else 0.0
    for c in range(len(starts) - 1):
        a, b = starts[c], starts[c + 1]
        z1, z2 = -d[a], 0.0
        for i in range(r):
            z1 += Gt[a, i] * y[i]
        w1, w2 = old[a] - sigma * z1, 0.0
        if b - a == 2:
            z2 = -d[a + 1]
            for i in range(r):
                z2 += Gt[a + 1, i] * y[i]
            w2 = old[a + 1] - sigma * z2
        size = np.sqrt(w1 * w1 + w2 * w2)
        inside = size <= 1.0
        if not inside:
            w1, w2 = w1 / size, w2 / size
        u[a] = w1
        moved = (w1 - old[a]) ** 2
        if b - a == 2:
            u[a + 1] = w2
            moved += (w2 - old[a + 1]) ** 2
        along = z1 * w1 + z2 * w2
        smooth += along + moved / (2.0 * sigma)
        kink += max(0.0, np.sqrt(z1 * z1 + z2 * z2) + along)
        for i in range(r):
            g[i] += w1 * Gt[a, i]
        if b - a == 2:
            for i in range(r):
                g[i] += w2 * Gt[a + 1, i]
        if inside:
            for j in range(a, b):
                for i in range(r):
                    weight = sigma * Gt[j, i]
                    for l in range(i + 1):
                        S[i, l] += weight * Gt[j, l]
        elif b - a == 2:
            for i in range(r):
                across = sigma / size * (w1 * Gt[a + 1, i] - w2 * Gt[a, i])
                for l in range(i + 1):
                    S[i, l] += across * (w1 * Gt[a + 1, l] - w2 * Gt[a, l])
    residual, primal = 0.0, 0.0
    for i in range(springs):
        residual += g[i] * g[i]
        primal += (g[i] + y[i]) ** 2
    for i in range(springs, r):
        residual += g[i] * g[i]
        kink -= y[i] * g[i]
    return smooth, 0.5 * residual, kink, 0.5 * primal


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _solve(S: NDArray, g: NDArray, x: NDArray) -> bool:
    """S x = g by Cholesky, in the lower half of S."""
    r = len(g)
    for i in range(r):
        for l in range(i + 1):
            total = S[i, l]
            for j in range(l):
                total -= S[i, j] * S[l, j]
            if l < i:
                S[i, l] = total * S[l, l]
            elif total > 0.0:
                S[i, i] = 1.0 / np.sqrt(total)  # kept as its inverse
            else:
                return False
    for i in range(r):
        total = g[i]
        for j in range(i):
            total -= S[i, j] * x[j]
        x[i] = total * S[i, i]
    for i in range(r - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, r):
            total -= S[j, i] * x[j]
        x[i] = total * S[i, i]
    return True
