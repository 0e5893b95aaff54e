"""A compiled Newton method for the dual of problem (22), smoothed at each solution.

    maximise  y.h - |y|^2 / 2 - sum_k |G_k^T y - d_k|   over the springs y

is smooth wherever every cone constraint is active: a few Newton steps suffice.  Where
one is inactive the dual has a kink, -|z|, which is replaced by

    min over |u| <= 1 of  u.z + |u - u_old|^2 / (2 sigma),

the kink smoothed about u_old.  The u of each solution is the next u_old, and sigma
grows; this converges to the maximum of the dual for any sigma.  With u the gap is known
exactly at every step: |G u + h - y|^2 / 2 + sum_k (|z_k| + z_k.u_k).  Rows
H u = k that no spring enters are further rows of G, h = -k, with no |y|^2 / 2.

Sources:
    Rockafellar (1976), Augmented Lagrangians and applications of the proximal point
    algorithm in convex programming; Li, Sun, Toh (2018), A highly efficient semismooth
    Newton augmented Lagrangian method for solving lasso problems.
"""

from typing import NamedTuple

import numpy as np

from assembly.solvers.compiled import part
from assembly.solvers.layers import LANES, add, dot, layers_of
from assembly.solvers.layouts import Indices, Matrix, Vector
from assembly.solvers.vectors import matrix, vector

FAST = {"contract", "reassoc"}
_HALVINGS = 12
_SIGMA_GROWTH = 10.0  # each time u_old moves
_INNER_SHARE = 0.1  # of the gap that may be the inner problem's
_RESIDUAL = 1e-13  # accepted of a row that no spring enters


class Dual(NamedTuple):
    """What is maximised, and how far.

    Attributes:
        Gt: (nu, r) columns of G, of order 1, and of H.
        h: (r,) and -k.
        d: (nu,) work of the load along the clearances.
        springs: r of G alone; H's rows come last.
        starts: (cones + 1,) first column of each cone (one or two each), and nu.
        relative: gap asked for, relative to the energy ..
        absolute: .. plus this.
    """

    Gt: Matrix
    h: Vector
    d: Vector
    springs: int
    starts: Indices
    relative: float
    absolute: float


class Layered(NamedTuple):
    """The same with its columns in layers, padded with zeros.

    Attributes:
        M: (r, width) rows of G and H.
        h: (r,).
        linear: (width,) -d.
        springs: r of G alone.
        layers: first place of each layer, and nu.
    """

    M: Matrix
    h: Vector
    linear: Vector
    springs: int
    layers: Indices


class Iterate(NamedTuple):
    """Where the method stands; all but ``y`` and ``old`` follow from these.

    Attributes:
        y: (r,) multipliers.
        old: (width,) the proximal clearances, in layers like all columns.
        u: (width,) clearances.
        z: (width,) M^T y - d.
        g: (r,) gradient of the smooth dual.
        B: (r, width) a root of minus its curvature but for the springs' own.
    """

    y: Vector
    old: Vector
    u: Vector
    z: Vector
    g: Vector
    B: Matrix


@part(fastmath=FAST)
def dual_newton(
    dual: Dual, steps: int, first_sigma: float, u: Vector, y: Vector
) -> int:
    """Maximise the dual; ``u`` and ``y`` are overwritten with the solution.

    Args:
        dual: the problem.
        steps: most Newton steps.
        first_sigma: times the mean |G_k^T h|; the larger, the better u must be.  0
            leaves the dual as it is, with its kinks, and stops at the first one.
        u: (nu,) first guess within the cones, such as 0; overwritten with the solution.
        y: (r,) overwritten with the multipliers; of H's rows also the first guess.

    Returns:
        Steps taken; -1 if it did not converge.
    """
    Gt, h, springs = dual.Gt, dual.h, dual.springs
    r, nu = len(h), len(u)
    order, layers = layers_of(dual.starts)
    # as in the interior-point method: rows of G, columns in layers, padded with zeros
    width = nu + -nu % LANES
    M, B, columns = matrix(r, width), matrix(r, width), matrix(4, width)
    old, own, linear, z = columns[0], columns[1], columns[2], columns[3]
    for j in range(nu):
        old[j], linear[j] = u[order[j]], -dual.d[order[j]]
        for i in range(r):
            M[i, j] = Gt[order[j], i]
    g, S, step, start = vector(r), matrix(r, r), vector(r), vector(r)
    for i in range(springs):
        y[i] = h[i] + dot(M[i], old)
    for j in range(width):
        z[j] = linear[j]
    for i in range(springs):
        add(h[i], M[i], z)
    mean = 0.0
    for j in range(nu):
        mean += abs(z[j]) / nu
    sigma = first_sigma / max(mean, 1e-12) if first_sigma > 0.0 else 1e30
    rows, at = Layered(M, h, linear, springs, layers), Iterate(y, old, own, z, g, B)
    before, halvings, taken = -np.inf, 0, 0
    while True:
        smooth, residual, kink, primal = _slopes(rows, at, sigma)
        closed = True
        for i in range(springs, r):
            closed = closed and abs(g[i]) <= _RESIDUAL
        if closed and residual + kink <= dual.relative * primal + dual.absolute:
            break
        if not smooth >= before - 1e-14:
            halvings += 1
            if halvings > _HALVINGS or first_sigma == 0.0:
                taken = -1
                break
            for i in range(r):
                step[i] *= 0.3
                y[i] = start[i] + step[i]
            continue
        if taken == steps:
            taken = -1
            break
        before, halvings, taken = smooth, 0, taken + 1
        if residual <= _INNER_SHARE * (residual + kink):
            for j in range(width):
                old[j] = own[j]
            sigma *= _SIGMA_GROWTH
            before = -np.inf
            _slopes(rows, at, sigma)
        _curvature(B, springs, S)
        if not _solve(S, g, step):
            taken = -1
            break
        for i in range(r):
            start[i] = y[i]
            y[i] += step[i]
    for j in range(nu):
        u[order[j]] = own[j]
    return taken


@part(fastmath=FAST)
def _slopes(
    rows: Layered, at: Iterate, sigma: float
) -> tuple[float, float, float, float]:
    """Value and derivatives of the smooth dual at y, with the parameter sigma.

    Returns:
        The smooth dual, the gap from the gradient and from the kinks, the springs'
        energy.
    """
    M, h, linear, springs, layers = rows
    y, old, u, z, g, B = at
    for j in range(len(z)):
        z[j] = linear[j]
    for i in range(len(y)):
        add(y[i], M[i], z)
    discs = layers[2] - layers[1] if len(layers) > 2 else 0
    cones = layers[1]
    # the weights of both columns in each row of B: first a, b, then e
    weights = matrix(3, cones)
    root = np.sqrt(sigma)
    smooth, kink = 0.0, 0.0
    for c in range(discs):
        z1, z2 = z[c], z[cones + c]
        o1, o2 = old[c], old[cones + c]
        w1, w2 = o1 - sigma * z1, o2 - sigma * z2
        size = np.sqrt(w1 * w1 + w2 * w2)
        inside = size <= 1.0
        shorter = 1.0 if inside else 1.0 / size
        w1, w2 = w1 * shorter, w2 * shorter
        u[c], u[cones + c] = w1, w2
        along = z1 * w1 + z2 * w2
        moved = (w1 - o1) * (w1 - o1) + (w2 - o2) * (w2 - o2)
        smooth += along + moved / (2.0 * sigma)
        kink += max(0.0, np.sqrt(z1 * z1 + z2 * z2) + along)
        across = root * np.sqrt(shorter)
        weights[0, c] = root if inside else -across * w2
        weights[1, c] = 0.0 if inside else across * w1
        weights[2, c] = root if inside else 0.0
    for c in range(discs, cones):
        w = old[c] - sigma * z[c]
        inside = abs(w) <= 1.0
        if not inside:
            w = 1.0 if w > 0.0 else -1.0
        u[c] = w
        along = z[c] * w
        smooth += along + (w - old[c]) * (w - old[c]) / (2.0 * sigma)
        kink += max(0.0, abs(z[c]) + along)
        weights[0, c] = root if inside else 0.0
    residual, primal = 0.0, 0.0
    for i in range(len(y)):
        row, out = M[i], B[i]
        stretch = y[i] if i < springs else 0.0
        smooth += y[i] * (h[i] - 0.5 * stretch)
        g[i] = h[i] - stretch + dot(row, u)
        residual += g[i] * g[i]
        if i < springs:
            primal += (g[i] + y[i]) * (g[i] + y[i])
        else:
            kink -= y[i] * g[i]
        first, second = row[:cones], row[cones : cones + discs]
        a, b, e = weights[0], weights[1], weights[2]
        into = out[:cones]
        for c in range(cones):
            into[c] = a[c] * first[c]
        into = out[cones : cones + discs]
        for c in range(discs):
            out[c] += b[c] * second[c]
            into[c] = e[c] * second[c]
    return smooth, 0.5 * residual, kink, 0.5 * primal


@part(fastmath=FAST)
def _curvature(B: Matrix, springs: int, S: Matrix) -> None:
    """Lower half of S = B B^T + diag(1 .. 1, 0 .. 0)."""
    for i in range(len(S)):
        row = B[i]
        for l in range(i + 1):
            S[i, l] = dot(row, B[l])
        if i < springs:
            S[i, i] += 1.0


@part(fastmath=FAST)
def _solve(S: Matrix, g: Vector, x: Vector) -> bool:
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
