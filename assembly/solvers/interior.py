"""A compiled interior-point method for the small cone programmes of this package.

    minimise  |G u + h|^2 / 2 - d.u    subject to  H u = k,  |u_k| <= 1 for each cone k

Nesterov-Todd scaling, Mehrotra's predictor and corrector.  The start, u = 0 with the
multipliers that balance it, satisfies everything but H u = k, and stays so: the gap is
then the sum of s.z over the cones.  Each step solves one symmetric system of the size
of G's and H's rows together, about 10 by 10, whatever the number of clearances.

Arranged for speed: the columns are sorted into layers, the first of every cone, then
the second of every cone that has one, and so on, the largest cones first; what is done
to each cone is done along a layer, several cones at once in the processor's registers.

Sources:
    Nesterov, Todd (1997), Self-scaled barriers and interior-point methods for convex
    programming; Andersen, Roos, Terlaky (2003), On implementing a primal-dual
    interior-point method for conic quadratic optimization (steps and starting point).
"""

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import (
    GivenIndices,
    GivenMatrix,
    GivenVector,
    Indices,
    Matrix,
    Vector,
    kernel,
    part,
)

_ITERATIONS = 60
_BACK_OFF = 0.99  # of the way to the nearest cone's boundary
# 3 is usual; on these problems 2 takes a seventh, 1.5 a sixth less iterations
_CENTRING = 1.5
_FAR = 1e30
LANES = 16
FAST = {"contract", "reassoc", "nsz", "arcp"}


@part(fastmath=FAST)
def interior_point(
    G: GivenMatrix, h: GivenVector, d: GivenVector, H: GivenMatrix, k: GivenVector,
    starts: GivenIndices, tolerance: float, relative: float,
) -> tuple[Vector, Vector, int]:  # fmt: skip
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
    p, cones = len(k), len(starts) - 1
    m = r + p
    order, layers = layers_of(starts)
    # rows end in zeros, so that none is left over when sixteen are taken at a time
    width = nu + -nu % LANES
    M, push = np.zeros((m, width)), np.zeros(width)
    for j in range(nu):
        push[j] = -d[order[j]]
        for i in range(r):
            M[i, j] = G[i, order[j]]
        for i in range(p):
            M[r + i, j] = H[i, order[j]]
    # one number a column: u, z and their steps, scalings, right sides
    columns = np.zeros((9, width))
    u, z1, w1, l1, t1, f, du, dz1, e = (
        columns[0], columns[1], columns[2], columns[3], columns[4], columns[5],
        columns[6], columns[7], columns[8],
    )  # fmt: skip
    # one number a cone; the last six are sums within it
    heads = np.empty((15, cones))
    z0, eta, w0, l0, t0, r0, dz0 = (
        heads[0], heads[1], heads[2], heads[3], heads[4], heads[5], heads[6]
    )  # fmt: skip
    across, along, sums = heads[7], heads[8], heads[9:]
    B, S = np.zeros((m, width)), np.empty((m, m))
    # multipliers of all rows: springs' own, v = G u + h, and n
    y, right, left = np.zeros(m), np.empty(m), np.empty(p)
    for i in range(r):
        y[i] = h[i]
    _pull(M, y, push, z1)
    _sum(layers, z1, z1, sums[0])
    for c in range(cones):
        z0[c] = np.sqrt(sums[0, c]) + 1.0
    taken = -1
    for iteration in range(_ITERATIONS):
        gap = 0.0
        gap += dot(z1, u)
        for c in range(cones):
            gap += z0[c]
        worst = 0.0
        for i in range(p):
            left[i] = k[i] - dot(M[r + i], u)
            worst = max(worst, abs(left[i]))
        energy = 0.0
        for i in range(r):
            energy += 0.5 * y[i] * y[i]
        if gap <= tolerance + relative * energy and worst <= 1e-13:
            taken = iteration
            break
        mu = gap / cones
        # scaling of each cone, and S = M D^-1 M^T + diag(1 .. 1, 0 .. 0)
        if not _scalings(layers, u, z0, z1, eta, w0, w1, l0, l1, across, along, sums):
            break
        _fill_system(layers, M, w1, eta, along, across, sums, B, S, r)
        if not _cholesky(S):
            break
        # predictor: no centring, no correction
        _sum(layers, u, z1, sums[0])
        for c in range(cones):
            t0[c] = -l0[c]
            r0[c] = -z0[c] - sums[0, c]
        for j in range(width):
            t1[j] = -l1[j]
        _direction(layers, M, S, eta, w0, w1, across, along, t0, t1, r0, u, z1, left, r,
                   sums, e, f, right, du, dz0, dz1)  # fmt: skip
        step = min(1.0, _longest(layers, u, du, z0, z1, dz0, dz1, sums))
        sigma = (1.0 - step) ** _CENTRING
        # corrector: centre, and what the predictor's product of steps leaves
        _corrected(layers, eta, w0, w1, l0, l1, du, dz0, dz1, sigma * mu, sums,
                   t0, t1, r0)  # fmt: skip
        _direction(layers, M, S, eta, w0, w1, across, along, t0, t1, r0, u, z1, left, r,
                   sums, e, f, right, du, dz0, dz1)  # fmt: skip
        step = min(1.0, _BACK_OFF * _longest(layers, u, du, z0, z1, dz0, dz1, sums))
        if not step >= 1e-10:
            break
        for j in range(width):
            u[j] += step * du[j]
        for c in range(cones):
            z0[c] += step * dz0[c]
        # the balance holds by construction; found anew it cannot drift
        for i in range(r):
            y[i] = h[i] + dot(M[i], u)
        for i in range(r, m):
            y[i] += step * right[i]
        _pull(M, y, push, z1)
    answer = np.empty(nu)
    for j in range(nu):
        answer[order[j]] = u[j]
    return answer, y[r:].copy(), taken


@part
def layers_of(starts: GivenIndices) -> tuple[Indices, Indices]:
    """Columns sorted into layers, the largest cones first.

    Args:
        starts: (cones + 1,) first column of each cone, and nu.

    Returns:
        (nu,) column at each place; (widest + 1,) first place of each layer, and nu.
    """
    cones, widest = len(starts) - 1, 0
    for c in range(cones):
        widest = max(widest, starts[c + 1] - starts[c])
    order, layers = np.empty(starts[-1], np.int64), np.empty(widest + 1, np.int64)
    place = 0
    for layer in range(widest):
        layers[layer] = place
        for size in range(widest, layer, -1):
            for c in range(cones):
                if starts[c + 1] - starts[c] == size:
                    order[place] = starts[c] + layer
                    place += 1
    layers[widest] = place
    return order, layers


@kernel(fastmath=FAST)
def dot(a: NDArray, b: NDArray) -> float:
    """Inner product of two rows, quick where they end in zeros to a length of LANES.

    Args:
        a: (width,).
        b: (width,).

    Returns:
        a.b.
    """
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@kernel(fastmath=FAST)
def add(weight: float, row: NDArray, total: NDArray) -> None:
    """Add a multiple of a row.

    Args:
        weight: which multiple.
        row: (width,).
        total: (width,) leaves larger by it.
    """
    for j in range(len(total)):
        total[j] += weight * row[j]


@kernel(fastmath=FAST)
def _pull(M: NDArray, y: NDArray, push: NDArray, z1: NDArray) -> None:
    """z1 = M^T y + push."""
    for j in range(len(z1)):
        z1[j] = push[j]
    for i in range(len(y)):
        add(y[i], M[i], z1)


@kernel(fastmath=FAST)
def _sum(layers: NDArray, a: NDArray, b: NDArray, total: NDArray) -> None:
    """Inner products of a's and b's parts in every cone."""
    for c in range(len(total)):
        total[c] = 0.0
    for layer in range(len(layers) - 1):
        x, y = (
            a[layers[layer] : layers[layer + 1]],
            b[layers[layer] : layers[layer + 1]],
        )
        for c in range(len(x)):
            total[c] += x[c] * y[c]


@part(fastmath=FAST)
def _scalings(
    layers: Indices, u: Vector, z0: Vector, z1: Vector, eta: Vector, w0: Vector,
    w1: Vector, l0: Vector, l1: Vector, across: Vector, along: Vector,
    sums: Matrix,
) -> bool:  # fmt: skip
    """Nesterov-Todd points of all cones, W = eta (w), and the scaled point l = W z.

    D^-1 = W^2 is ``across`` across w and ``along`` along it; w grows without bound, so
    the two are kept apart.  ``sums[5]`` leaves holding 1 / w.w.

    Returns:
        Whether all cones have such points.
    """
    ss, zz, sz, s_part, z_part, inverse = (
        sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    )  # fmt: skip
    _sum(layers, u, u, ss)
    _sum(layers, z1, z1, zz)
    _sum(layers, u, z1, sz)
    outside = 0
    for c in range(len(z0)):
        s_norm, z_norm = np.sqrt(ss[c]), np.sqrt(zz[c])
        s_size = (1.0 - s_norm) * (1.0 + s_norm)
        z_size = (z0[c] - z_norm) * (z0[c] + z_norm)
        outside += not (s_size > 0.0)
        outside += not (z_size > 0.0)
        s_size, z_size = np.sqrt(s_size), np.sqrt(z_size)
        inner = (z0[c] + sz[c]) / (s_size * z_size)
        double = np.sqrt(2.0 + 2.0 * inner)
        eta[c] = np.sqrt(s_size / z_size)
        w0[c] = (1.0 / s_size + z0[c] / z_size) / double
        s_part[c] = 1.0 / (s_size * double)
        z_part[c] = 1.0 / (z_size * double)
    if outside:
        return False
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        own, pull, w = u[a:b], z1[a:b], w1[a:b]
        for c in range(len(own)):
            w[c] = s_part[c] * own[c] - z_part[c] * pull[c]
    ww, wz = ss, zz
    _sum(layers, w1, w1, ww)
    _sum(layers, w1, z1, wz)
    for c in range(len(z0)):
        l0[c] = eta[c] * (w0[c] * z0[c] + wz[c])
        wz[c] = z0[c] + wz[c] / (1.0 + w0[c])
        across[c] = eta[c] * eta[c]
        along[c] = across[c] / (1.0 + 2.0 * ww[c])
        inverse[c] = 1.0 / (ww[c] if ww[c] > 0.0 else 1.0)
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        pull, w, scaled = z1[a:b], w1[a:b], l1[a:b]
        for c in range(len(w)):
            scaled[c] = eta[c] * (pull[c] + wz[c] * w[c])
    return True


@part(fastmath=FAST)
def _fill_system(
    layers: Indices, M: Matrix, w1: Vector, eta: Vector, along: Vector,
    across: Vector, sums: Matrix, B: Matrix, S: Matrix, r: int,
) -> None:  # fmt: skip
    """B = M D^-1/2, and S's lower half."""
    part, root, inverse = sums[0], sums[1], sums[5]
    for c in range(len(root)):
        root[c] = np.sqrt(along[c])
    for i in range(len(S)):
        row, scaled = M[i], B[i]
        _sum(layers, row, w1, part)
        for c in range(len(part)):
            part[c] *= inverse[c]
        for layer in range(len(layers) - 1):
            a, b = layers[layer], layers[layer + 1]
            own, w, out = row[a:b], w1[a:b], scaled[a:b]
            for c in range(len(w)):
                lengthwise = part[c] * w[c]
                out[c] = eta[c] * (own[c] - lengthwise) + root[c] * lengthwise
        for l in range(i + 1):
            S[i, l] = dot(scaled, B[l])
    for i in range(r):
        S[i, i] += 1.0


@part(fastmath=FAST)
def _cholesky(S: Matrix) -> bool:
    """Factor the lower half in place; rows lost to rounding get a huge pivot.

    The diagonal leaves holding its inverse.

    Returns:
        Whether every number is one.
    """
    for i in range(len(S)):
        own, diagonal = S[i], S[i, i]
        for l in range(i):
            other, total = S[l], own[l]
            for j in range(l):
                total -= own[j] * other[j]
            own[l] = total * other[l]
        total = diagonal
        for j in range(i):
            total -= own[j] * own[j]
        if total > 1e-15 * diagonal:
            own[i] = 1.0 / np.sqrt(total)
        elif total == total and diagonal >= 0.0:
            own[i] = 1e-64
        else:
            return False
    return True


@part(fastmath=FAST)
def _square_scaled(
    layers: Indices, w1: Vector, across: Vector, along: Vector, sums: Matrix,
    x: Vector, out: Vector,
) -> None:  # fmt: skip
    """D^-1 x."""
    part, inverse = sums[0], sums[5]
    _sum(layers, x, w1, part)
    for c in range(len(part)):
        part[c] *= inverse[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        own, w, found = x[a:b], w1[a:b], out[a:b]
        for c in range(len(w)):
            lengthwise = part[c] * w[c]
            found[c] = across[c] * (own[c] - lengthwise) + along[c] * lengthwise


@part(fastmath=FAST)
def _direction(
    layers: Indices, M: Matrix, S: Matrix, eta: Vector, w0: Vector, w1: Vector,
    across: Vector, along: Vector, t0: Vector, t1: Vector, r0: Vector, u: Vector,
    z1: Vector, left: Vector, r: int, sums: Matrix, e: Vector,
    f: Vector, right: Vector, du: Vector, dz0: Vector, dz1: Vector,
) -> None:  # fmt: skip
    """Step for the scaled right sides t, with M's rows eliminated.

    dz1 comes from the balance and dz0 from s.dz + z.ds = r0, the first row of the
    scaled complementarity: W^-1 t - W^-2 ds, the same thing, cancels near the end.
    ``right`` leaves holding (G du, dn).
    """
    m = len(S)
    part, other = sums[0], sums[1]
    _sum(layers, w1, t1, part)  # f = (W^-1 t)_1
    for c in range(len(part)):
        other[c] = 1.0 / eta[c]
        part[c] = part[c] / (1.0 + w0[c]) - t0[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        w, t, out = w1[a:b], t1[a:b], f[a:b]
        for c in range(len(w)):
            out[c] = (t[c] + part[c] * w[c]) * other[c]
    _square_scaled(layers, w1, across, along, sums, f, e)
    for i in range(m):
        right[i] = dot(M[i], e)
    for i in range(m - r):
        right[r + i] -= left[i]
    for i in range(m):
        total = right[i]
        for j in range(i):
            total -= S[i, j] * right[j]
        right[i] = total * S[i, i]
    for i in range(m - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, m):
            total -= S[j, i] * right[j]
        right[i] = total * S[i, i]
    for j in range(len(dz1)):
        dz1[j] = 0.0
    for i in range(m):
        add(right[i], M[i], dz1)
    for j in range(len(dz1)):
        e[j] = f[j] - dz1[j]
    _square_scaled(layers, w1, across, along, sums, e, du)  # du = D^-1 (f - M^T right)
    _sum(layers, z1, du, part)
    _sum(layers, u, dz1, other)
    for c in range(len(part)):
        dz0[c] = r0[c] - part[c] - other[c]


@part(fastmath=FAST)
def _corrected(
    layers: Indices, eta: Vector, w0: Vector, w1: Vector, l0: Vector, l1: Vector,
    du: Vector, dz0: Vector, dz1: Vector, target: float, sums: Matrix,
    t0: Vector, t1: Vector, r0: Vector,
) -> None:  # fmt: skip
    """Solve l o t = r = target e - l o l - (W^-1 ds) o (W dz) for t."""
    ds, dz, ll, lt = sums[0], sums[1], sums[2], sums[3]
    _sum(layers, w1, du, ds)
    _sum(layers, w1, dz1, dz)
    for c in range(len(eta)):
        ll[c], lt[c] = 0.0, 0.0
        s0 = -ds[c] / eta[c]
        y0 = eta[c] * (w0[c] * dz0[c] + dz[c])
        r0[c] = target - s0 * y0 - l0[c] * l0[c]
        ds[c] = ds[c] / (1.0 + w0[c])
        dz[c] = dz0[c] + dz[c] / (1.0 + w0[c])
        # kept for the columns
        sums[4, c], t0[c] = s0, y0
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        w, scaled, t = w1[a:b], l1[a:b], t1[a:b]
        s_step, z_step = du[a:b], dz1[a:b]
        for c in range(len(w)):
            s1 = (s_step[c] + ds[c] * w[c]) / eta[c]
            y1 = eta[c] * (z_step[c] + dz[c] * w[c])
            r0[c] -= s1 * y1 + scaled[c] * scaled[c]
            t[c] = -(sums[4, c] * y1 + t0[c] * s1) - 2.0 * l0[c] * scaled[c]
            ll[c] += scaled[c] * scaled[c]
            lt[c] += scaled[c] * t[c]
    for c in range(len(eta)):
        size = np.sqrt(ll[c])
        t0[c] = (l0[c] * r0[c] - lt[c]) / ((l0[c] - size) * (l0[c] + size))
        ll[c] = 1.0 / l0[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        scaled, t = l1[a:b], t1[a:b]
        for c in range(len(t)):
            t[c] = (t[c] - t0[c] * scaled[c]) * ll[c]


@part(fastmath=FAST)
def _longest(
    layers: Indices, u: Vector, du: Vector, z0: Vector, z1: Vector, dz0: Vector,
    dz1: Vector, sums: Matrix,
) -> float:  # fmt: skip
    """Longest step that keeps every s and z in its cone."""
    aa, ab, bb = sums[0], sums[1], sums[2]
    _sum(layers, du, du, aa)
    _sum(layers, u, du, ab)
    _sum(layers, u, u, bb)
    for c in range(len(z0)):
        aa[c] = _root(aa[c], ab[c], bb[c] - 1.0)
    ya, yb, yc = ab, bb, sums[3]
    _sum(layers, dz1, dz1, ya)
    _sum(layers, z1, dz1, yb)
    _sum(layers, z1, z1, yc)
    for c in range(len(z0)):
        ya[c] = _root(
            ya[c] - dz0[c] * dz0[c], yb[c] - z0[c] * dz0[c], yc[c] - z0[c] * z0[c]
        )
        yb[c] = -z0[c] / (dz0[c] if dz0[c] < 0.0 else -z0[c] / _FAR)
    longest = _FAR
    for c in range(len(z0)):
        longest = min(longest, aa[c], ya[c], yb[c])
    return longest


@kernel(fastmath=FAST)
def _root(a: float, b: float, c: float) -> float:
    """Smallest t > 0 with a t^2 + 2 b t + c = 0 (c < 0), without cancellation."""
    inside = b * b - a * c
    below = b + np.sqrt(inside if inside > 0.0 else 0.0)
    crosses = inside >= 0.0 and below > 0.0
    found = -c / (below if crosses else 1.0)
    return found if crosses else _FAR
