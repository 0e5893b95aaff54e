"""A compiled interior-point method for the small cone programmes of this package.

    minimise  |G u + h|^2 / 2 - d.u    subject to  H u = k,  |u_k| <= 1 for each cone k

Nesterov-Todd scaling, Mehrotra's predictor and corrector.  The start, u = 0 with the
multipliers that balance it, satisfies everything but H u = k, and stays so: the gap is
then the sum of s.z over the cones.  Each step solves one symmetric system of the size
of G's and H's rows together, about 10 by 10, whatever the number of clearances.

Sources:
    Nesterov, Todd (1997), Self-scaled barriers and interior-point methods for convex
    programming; Andersen, Roos, Terlaky (2003), On implementing a primal-dual
    interior-point method for conic quadratic optimization (steps and starting point).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ITERATIONS = 60
_BACK_OFF = 0.99  # of the way to the nearest cone's boundary


@njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")
def interior_point(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, starts: NDArray,
    tolerance: float, relative: float = 0.0,
) -> tuple[NDArray, NDArray, int]:  # fmt: skip
    """Minimise; all arguments of order 1 (scale before).

    Args:
        G: (r, nu).
        h: (r,).
        d: (nu,).
        H: (p, nu) of full row rank.
        k: (p,).
        starts: (cones + 1,) first column of each cone, and nu.
        tolerance: of the gap ..
        relative: .. plus this part of the springs' energy |G u + h|^2 / 2.

    Returns:
        u (nu,), multipliers of H (p,), and the iterations taken; -1 if it broke down.
    """
    r, nu = G.shape
    p = len(k)
    m = r + p
    cones = len(starts) - 1
    M = np.empty((m, nu))
    M[:r] = G
    M[r:] = H
    u, n = np.zeros(nu), np.zeros(p)
    v = h.copy()  # G u + h
    z1 = -d
    for i in range(r):
        for j in range(nu):
            z1[j] += G[i, j] * v[i]
    z0 = np.empty(cones)
    for c in range(cones):
        size = 0.0
        for j in range(starts[c], starts[c + 1]):
            size += z1[j] * z1[j]
        z0[c] = np.sqrt(size) + 1.0
    eta, w0, w1 = np.empty(cones), np.empty(cones), np.empty(nu)
    l0, l1 = np.empty(cones), np.empty(nu)
    t0, t1, r0 = np.empty(cones), np.empty(nu), np.empty(cones)
    du, dz0, dz1 = np.empty(nu), np.empty(cones), np.empty(nu)
    f, MD = np.empty(nu), np.empty((m, nu))
    S, right = np.empty((m, m)), np.empty(m)
    left = np.empty(p)  # k - H u
    for iteration in range(_ITERATIONS):
        gap = 0.0
        for c in range(cones):
            gap += z0[c]
            for j in range(starts[c], starts[c + 1]):
                gap += z1[j] * u[j]
        worst = 0.0
        for i in range(p):
            left[i] = k[i]
            for j in range(nu):
                left[i] -= H[i, j] * u[j]
            worst = max(worst, abs(left[i]))
        energy = 0.0
        for i in range(r):
            energy += 0.5 * v[i] * v[i]
        if gap <= tolerance + relative * energy and worst <= 1e-13:
            return u, n, iteration
        mu = gap / cones
        # scaling of each cone, and S = M D^-1 M^T + diag(1 .. 1, 0 .. 0)
        if not _scalings(u, z0, z1, starts, eta, w0, w1, l0, l1):
            return u, n, -1
        _fill_system(M, starts, eta, w1, MD, S, r)
        if not _cholesky(S):
            return u, n, -1
        # predictor: no centring, no correction
        for c in range(cones):
            a, b = starts[c], starts[c + 1]
            t0[c] = -l0[c]
            r0[c] = -z0[c]
            for j in range(a, b):
                t1[j] = -l1[j]
                r0[c] -= u[j] * z1[j]
        _direction(M, MD, S, starts, eta, w0, w1, t0, t1, r0, u, z1, left, r,
                   f, right, du, dz0, dz1)  # fmt: skip
        step = min(1.0, _longest(u, du, z0, z1, dz0, dz1, starts))
        sigma = (1.0 - step) ** 3
        # corrector: centre, and what the predictor's product of steps leaves
        for c in range(cones):
            _corrected(c, starts, eta, w0, w1, l0, l1, du, dz0, dz1, sigma * mu,
                       t0, t1, r0)  # fmt: skip
        _direction(M, MD, S, starts, eta, w0, w1, t0, t1, r0, u, z1, left, r,
                   f, right, du, dz0, dz1)  # fmt: skip
        step = min(1.0, _BACK_OFF * _longest(u, du, z0, z1, dz0, dz1, starts))
        if step < 1e-10:
            return u, n, -1
        for j in range(nu):
            u[j] += step * du[j]
        for i in range(p):
            n[i] += step * right[r + i]
        for c in range(cones):
            z0[c] += step * dz0[c]
        # the balance holds by construction; found anew it cannot drift
        for i in range(r):
            v[i] = h[i]
            for j in range(nu):
                v[i] += G[i, j] * u[j]
        for j in range(nu):
            total = -d[j]
            for i in range(r):
                total += G[i, j] * v[i]
            for i in range(p):
                total += H[i, j] * n[i]
            z1[j] = total
    return u, n, -1


@njit(cache=True, inline="always", error_model="numpy")
def _scalings(
    u: NDArray, z0: NDArray, z1: NDArray, starts: NDArray, eta: NDArray, w0: NDArray,
    w1: NDArray, l0: NDArray, l1: NDArray,
) -> bool:  # fmt: skip
    """Nesterov-Todd points of all cones, W = eta (w), and the scaled point l = W z."""
    for c in range(len(z0)):
        a, b = starts[c], starts[c + 1]
        ss, zz, sz = 0.0, 0.0, 0.0
        for j in range(a, b):
            ss += u[j] * u[j]
            zz += z1[j] * z1[j]
            sz += u[j] * z1[j]
        s_norm = np.sqrt(ss)
        z_norm = np.sqrt(zz)
        s_size = (1.0 - s_norm) * (1.0 + s_norm)
        z_size = (z0[c] - z_norm) * (z0[c] + z_norm)
        if not (s_size > 0.0 and z_size > 0.0):
            return False
        s_size, z_size = np.sqrt(s_size), np.sqrt(z_size)
        inner = (z0[c] + sz) / (s_size * z_size)
        gamma = np.sqrt((1.0 + inner) / 2.0)
        eta[c] = np.sqrt(s_size / z_size)
        w0[c] = (1.0 / s_size + z0[c] / z_size) / (2.0 * gamma)
        for j in range(a, b):
            w1[j] = (u[j] / s_size - z1[j] / z_size) / (2.0 * gamma)
        dot = 0.0
        for j in range(a, b):
            dot += w1[j] * z1[j]
        l0[c] = eta[c] * (w0[c] * z0[c] + dot)
        factor = z0[c] + dot / (1.0 + w0[c])
        for j in range(a, b):
            l1[j] = eta[c] * (z1[j] + factor * w1[j])
    return True


@njit(cache=True, inline="always", error_model="numpy")
def _fill_system(
    M: NDArray, starts: NDArray, eta: NDArray, w1: NDArray, MD: NDArray, S: NDArray,
    r: int,
) -> None:  # fmt: skip
    """MD = M D^-1, and S's lower half.

    D^-1 is eta^2 across w and eta^2 / (1 + 2 w.w) along it; w grows without bound, so
    the two are kept apart.
    """
    m = len(S)
    for c in range(len(eta)):
        a, b = starts[c], starts[c + 1]
        size = 0.0
        for j in range(a, b):
            size += w1[j] * w1[j]
        scale = eta[c] * eta[c]
        along = scale / (1.0 + 2.0 * size)
        for i in range(m):
            dot = 0.0
            for j in range(a, b):
                dot += M[i, j] * w1[j]
            dot /= size if size > 0.0 else 1.0
            for j in range(a, b):
                MD[i, j] = scale * (M[i, j] - dot * w1[j]) + along * dot * w1[j]
    for i in range(m):
        for l in range(i + 1):
            total = 0.0
            for j in range(M.shape[1]):
                total += MD[i, j] * M[l, j]
            S[i, l] = total
    for i in range(r):
        S[i, i] += 1.0


@njit(cache=True, inline="always", error_model="numpy")
def _cholesky(S: NDArray) -> bool:
    """Factor the lower half in place; rows lost to rounding get a huge pivot."""
    for i in range(len(S)):
        diagonal = S[i, i]
        for l in range(i + 1):
            total = S[i, l]
            for j in range(l):
                total -= S[i, j] * S[l, j]
            if l < i:
                S[i, l] = total / S[l, l]
            elif total > 1e-15 * diagonal:
                S[i, i] = np.sqrt(total)
            elif total == total and diagonal >= 0.0:
                S[i, i] = 1e64
            else:
                return False
    return True


@njit(cache=True, inline="always", error_model="numpy")
def _direction(
    M: NDArray, MD: NDArray, S: NDArray, starts: NDArray, eta: NDArray, w0: NDArray,
    w1: NDArray, t0: NDArray, t1: NDArray, r0: NDArray, u: NDArray, z1: NDArray,
    left: NDArray, r: int,
    f: NDArray, right: NDArray, du: NDArray, dz0: NDArray, dz1: NDArray,
) -> None:  # fmt: skip
    """Step for the scaled right sides t, with M's rows eliminated.

    dz1 comes from the balance and dz0 from s.dz + z.ds = r0, the first row of the
    scaled complementarity: W^-1 t - W^-2 ds, the same thing, cancels near the end.
    ``right`` leaves holding (G du, dn).
    """
    m, nu = M.shape
    cones = len(eta)
    for c in range(cones):  # f = (W^-1 t)_1
        a, b = starts[c], starts[c + 1]
        dot = 0.0
        for j in range(a, b):
            dot += w1[j] * t1[j]
        factor = dot / (1.0 + w0[c]) - t0[c]
        for j in range(a, b):
            f[j] = (t1[j] + factor * w1[j]) / eta[c]
    for i in range(m):
        total = 0.0
        for j in range(nu):
            total += MD[i, j] * f[j]
        right[i] = total
    for i in range(m - r):
        right[r + i] -= left[i]
    for i in range(m):
        for j in range(i):
            right[i] -= S[i, j] * right[j]
        right[i] /= S[i, i]
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            right[i] -= S[j, i] * right[j]
        right[i] /= S[i, i]
    for j in range(nu):
        dz1[j] = 0.0
    for i in range(m):
        for j in range(nu):
            dz1[j] += M[i, j] * right[i]
    for c in range(cones):  # du = D^-1 (f - M^T right)
        a, b = starts[c], starts[c + 1]
        size, dot = 0.0, 0.0
        for j in range(a, b):
            size += w1[j] * w1[j]
            dot += w1[j] * (f[j] - dz1[j])
        scale = eta[c] * eta[c]
        along = scale / (1.0 + 2.0 * size)
        dot /= size if size > 0.0 else 1.0
        dz0[c] = r0[c]
        for j in range(a, b):
            du[j] = scale * (f[j] - dz1[j] - dot * w1[j]) + along * dot * w1[j]
            dz0[c] -= z1[j] * du[j] + u[j] * dz1[j]


@njit(cache=True, inline="always", error_model="numpy")
def _corrected(
    c: int, starts: NDArray, eta: NDArray, w0: NDArray, w1: NDArray, l0: NDArray,
    l1: NDArray, du: NDArray, dz0: NDArray, dz1: NDArray, target: float,
    t0: NDArray, t1: NDArray, r0: NDArray,
) -> None:  # fmt: skip
    """Solve l o t = r = target e - l o l - (W^-1 ds) o (W dz) for t, one cone."""
    a, b = starts[c], starts[c + 1]
    ds_dot, dz_dot = 0.0, 0.0
    for j in range(a, b):
        ds_dot += w1[j] * du[j]
        dz_dot += w1[j] * dz1[j]
    s0 = -ds_dot / eta[c]
    y0 = eta[c] * (w0[c] * dz0[c] + dz_dot)
    s_factor = ds_dot / (1.0 + w0[c])
    y_factor = dz0[c] + dz_dot / (1.0 + w0[c])
    first, ll, l_dot = target - s0 * y0 - l0[c] * l0[c], 0.0, 0.0
    for j in range(a, b):
        s1 = (du[j] + s_factor * w1[j]) / eta[c]
        y1 = eta[c] * (dz1[j] + y_factor * w1[j])
        first -= s1 * y1 + l1[j] * l1[j]
        t1[j] = -(s0 * y1 + y0 * s1) - 2.0 * l0[c] * l1[j]
        ll += l1[j] * l1[j]
        l_dot += l1[j] * t1[j]
    size = (l0[c] - np.sqrt(ll)) * (l0[c] + np.sqrt(ll))
    t0[c] = (l0[c] * first - l_dot) / size
    r0[c] = first
    for j in range(a, b):
        t1[j] = (t1[j] - t0[c] * l1[j]) / l0[c]


@njit(cache=True, inline="always", error_model="numpy")
def _longest(
    u: NDArray, du: NDArray, z0: NDArray, z1: NDArray, dz0: NDArray, dz1: NDArray,
    starts: NDArray,
) -> float:  # fmt: skip
    """Longest step that keeps every s and z in its cone."""
    longest = 1e30
    for c in range(len(z0)):
        aa, ab, bb = 0.0, 0.0, 0.0
        ya, yb, yc = 0.0, 0.0, 0.0
        for j in range(starts[c], starts[c + 1]):
            aa += du[j] * du[j]
            ab += u[j] * du[j]
            bb += u[j] * u[j]
            ya += dz1[j] * dz1[j]
            yb += z1[j] * dz1[j]
            yc += z1[j] * z1[j]
        longest = min(longest, _root(aa, ab, bb - 1.0, 0.0, 1.0))
        longest = min(longest, _root(
            ya - dz0[c] * dz0[c], yb - z0[c] * dz0[c], yc - z0[c] * z0[c],
            dz0[c], z0[c],
        ))  # fmt: skip
    return longest


@njit(cache=True, inline="always", error_model="numpy")
def _root(a: float, b: float, c: float, slope: float, value: float) -> float:
    """Smallest t > 0 with a t^2 + 2 b t + c = 0 (c < 0), or value + slope t = 0."""
    answer = 1e30
    if slope < 0.0:
        answer = -value / slope
    inside = b * b - a * c
    if inside >= 0.0:
        root = np.sqrt(inside)
        # the smaller positive root, without cancellation
        if b + root > 0.0:
            answer = min(answer, -c / (b + root))
    return answer
