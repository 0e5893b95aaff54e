"""A compiled interior-point method for the small cone programmes of this package.

    minimise  |G u + h|^2 / 2 - d.u    subject to  H u = k,  |u_k| <= 1 for each cone k

Nesterov-Todd scaling, Mehrotra's predictor and corrector.  The start, u = 0 with its
multipliers, satisfies everything but H u = k, and so do all iterates: the gap is the
sum of s.z over the cones.  Each step solves one symmetric system of the size of G's and
H's rows together, about 10 by 10, whatever the number of clearances.

The columns are sorted into layers, see :mod:`assembly.solvers.layers`; the scaling is
in :mod:`assembly.solvers.nesterov_todd`.

Sources:
    Nesterov, Todd (1997), Self-scaled barriers and interior-point methods for convex
    programming; Andersen, Roos, Terlaky (2003), On implementing a primal-dual
    interior-point method for conic quadratic optimization (steps and starting point).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import kernel, part
from assembly.solvers.layers import FAST, LANES, add, cone_sums, dot, layers_of
from assembly.solvers.layouts import Indices, Matrix, Vector
from assembly.solvers.nesterov_todd import (
    Point,
    Scaling,
    Sides,
    correct,
    scale,
    square_scaled,
)
from assembly.solvers.vectors import matrix, vector

_ITERATIONS = 60
_BACK_OFF = 0.99  # of the step to the nearest boundary of a cone
# 3 is usual; on these problems 2 takes a seventh, 1.5 a sixth less iterations
_CENTRING = 1.5
_FAR = 1e30


class Programme(NamedTuple):
    """What is minimised; all numbers of order 1 (scale before).

    Attributes:
        G: (r, nu).
        h: (r,).
        d: (nu,).
        H: (p, nu) of full row rank.
        k: (p,).
        starts: (cones + 1,) first column of each cone, and nu.
    """

    G: Matrix
    h: Vector
    d: Vector
    H: Matrix
    k: Vector
    starts: Indices


class System(NamedTuple):
    """The symmetric system of a step, S right = .., with G's and H's rows.

    Attributes:
        M: (m, width) G above H, columns in layers.
        B: (m, width) M D^-1/2.
        S: (m, m) M D^-1 M^T + diag(1 .. 1, 0 .. 0), then its factor.
        residual: (p,) k - H u.
        right: (m,) right side, then (G du, dn).
        e: (width,) for what lives within a function.
        f: (width,) the same.
    """

    M: Matrix
    B: Matrix
    S: Matrix
    residual: Vector
    right: Vector
    e: Vector
    f: Vector


@part(fastmath=FAST)
def interior_point(
    programme: Programme, tolerance: float, relative: float
) -> tuple[Vector, Vector, int]:
    """Minimise.

    Args:
        programme: the problem.
        tolerance: of the gap ..
        relative: .. plus this part of the springs' energy |G u + h|^2 / 2.

    Returns:
        u (nu,), multipliers of H (p,), and the iterations taken; -1 if it broke down.
    """
    G, h, d, H, k, starts = programme
    r, nu = G.shape
    p, cones = len(k), len(starts) - 1
    m = r + p
    order, layers = layers_of(starts)
    M, linear = _in_layers(programme, order)
    width = len(linear)
    # one number a column, and one a cone
    columns, heads = matrix(9, width), matrix(15, cones)
    point = Point(columns[0], heads[0], columns[1])
    step = Point(columns[2], heads[1], columns[3])
    sides = Sides(heads[2], columns[4], heads[3])
    scaling = Scaling(
        layers, heads[4], heads[5], columns[5], heads[6], columns[6], heads[7],
        heads[8], heads[9:],
    )  # fmt: skip
    system = System(
        M, matrix(m, width), matrix(m, m), vector(p), vector(m), columns[7], columns[8]
    )
    u, z0, z1 = point.u, point.z0, point.z1
    sums = scaling.sums
    # multipliers of all rows: springs' own, v = G u + h, and n
    y = vector(m)
    for i in range(r):
        y[i] = h[i]
    _dual(M, y, linear, z1)
    cone_sums(layers, z1, z1, sums[0])
    for c in range(cones):
        z0[c] = np.sqrt(sums[0, c]) + 1.0
    taken = -1
    for iteration in range(_ITERATIONS):
        worst, energy, gap = _violation(system, k, u), 0.0, dot(z1, u)
        for c in range(cones):
            gap += z0[c]
        for i in range(r):
            energy += 0.5 * y[i] * y[i]
        if gap <= tolerance + relative * energy and worst <= 1e-13:
            taken = iteration
            break
        mu = gap / cones
        if not scale(point, scaling):
            break
        _fill_system(system, scaling)
        if not _cholesky(system.S):
            break
        _predict(point, scaling, sides)
        _direction(system, scaling, sides, point, step)
        length = min(1.0, _longest(scaling, point, step))
        sigma = (1.0 - length) ** _CENTRING
        # corrector: centre, and what the predictor's product of steps leaves
        correct(scaling, step, sigma * mu, sides)
        _direction(system, scaling, sides, point, step)
        length = min(1.0, _BACK_OFF * _longest(scaling, point, step))
        if not length >= 1e-10:
            break
        for j in range(width):
            u[j] += length * step.u[j]
        for c in range(cones):
            z0[c] += length * step.z0[c]
        # the balance holds by construction; computed anew it cannot drift
        for i in range(r):
            y[i] = h[i] + dot(M[i], u)
        for i in range(r, m):
            y[i] += length * system.right[i]
        _dual(M, y, linear, z1)
    minimiser = vector(nu)
    for j in range(nu):
        minimiser[order[j]] = u[j]
    return minimiser, y[r:].copy(), taken


@part(fastmath=FAST)
def _in_layers(programme: Programme, order: Indices) -> tuple[Matrix, Vector]:
    """The programme's matrices with their columns in layers.

    Rows are padded with zeros to a multiple of the vector registers.

    Returns:
        G above H (m, width), and -d (width,).
    """
    G, H, d = programme.G, programme.H, programme.d
    (r, nu), p = G.shape, len(H)
    width = nu + -nu % LANES
    M, linear = matrix(r + p, width), vector(width)
    for j in range(nu):
        linear[j] = -d[order[j]]
        for i in range(r):
            M[i, j] = G[i, order[j]]
        for i in range(p):
            M[r + i, j] = H[i, order[j]]
    return M, linear


@part(fastmath=FAST)
def _violation(system: System, k: Vector, u: Vector) -> float:
    """Largest of |k - H u|, which is kept as the residual."""
    residual, worst = system.residual, 0.0
    r = len(system.M) - len(residual)
    for i in range(len(residual)):
        residual[i] = k[i] - dot(system.M[r + i], u)
        worst = max(worst, abs(residual[i]))
    return worst


@part(fastmath=FAST)
def _predict(point: Point, scaling: Scaling, sides: Sides) -> None:
    """Right sides of the predictor: no centring, no correction."""
    t0, t1, r0, sums = sides.t0, sides.t1, sides.r0, scaling.sums
    cone_sums(scaling.layers, point.u, point.z1, sums[0])
    for c in range(len(t0)):
        t0[c] = -scaling.l0[c]
        r0[c] = -point.z0[c] - sums[0, c]
    for j in range(len(t1)):
        t1[j] = -scaling.l1[j]


@kernel(fastmath=FAST)
def _dual(M: NDArray, y: NDArray, linear: NDArray, z1: NDArray) -> None:
    """z1 = M^T y + linear."""
    for j in range(len(z1)):
        z1[j] = linear[j]
    for i in range(len(y)):
        add(y[i], M[i], z1)


@part(fastmath=FAST)
def _fill_system(system: System, scaling: Scaling) -> None:
    """B = M D^-1/2, and S's lower half."""
    M, B, S = system.M, system.B, system.S
    layers, eta, w1 = scaling.layers, scaling.eta, scaling.w1
    along, sums = scaling.along, scaling.sums
    part, root, inverse = sums[0], sums[1], sums[5]
    for c in range(len(root)):
        root[c] = np.sqrt(along[c])
    for i in range(len(S)):
        row, scaled = M[i], B[i]
        cone_sums(layers, row, w1, part)
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
    for i in range(len(S) - len(system.residual)):
        S[i, i] += 1.0


@part(fastmath=FAST)
def _cholesky(S: Matrix) -> bool:
    """Factor the lower half in place; rows lost to rounding get a huge pivot.

    The diagonal is overwritten with its inverse.

    Returns:
        Whether every number is finite.
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
def _direction(
    system: System, scaling: Scaling, sides: Sides, point: Point, step: Point
) -> None:
    """Step for the scaled right sides t, with M's rows eliminated.

    dz1 comes from the balance and dz0 from s.dz + z.ds = r0, the first row of the
    scaled complementarity: the equal W^-1 t - W^-2 ds cancels near the solution.
    """
    M, S, right, e, f = system.M, system.S, system.right, system.e, system.f
    layers, eta, w0, w1 = scaling.layers, scaling.eta, scaling.w0, scaling.w1
    t0, t1, sums, residual = sides.t0, sides.t1, scaling.sums, system.residual
    du, dz0, dz1 = step.u, step.z0, step.z1
    m, p = len(S), len(residual)
    part, other = sums[0], sums[1]
    cone_sums(layers, w1, t1, part)  # f = (W^-1 t)_1
    for c in range(len(part)):
        other[c] = 1.0 / eta[c]
        part[c] = part[c] / (1.0 + w0[c]) - t0[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        w, t, out = w1[a:b], t1[a:b], f[a:b]
        for c in range(len(w)):
            out[c] = (t[c] + part[c] * w[c]) * other[c]
    square_scaled(scaling, f, e)
    for i in range(m):
        right[i] = dot(M[i], e)
    for i in range(p):
        right[m - p + i] -= residual[i]
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
    square_scaled(scaling, e, du)  # du = D^-1 (f - M^T right)
    cone_sums(layers, point.z1, du, part)
    cone_sums(layers, point.u, dz1, other)
    for c in range(len(part)):
        dz0[c] = sides.r0[c] - part[c] - other[c]


@part(fastmath=FAST)
def _longest(scaling: Scaling, point: Point, step: Point) -> float:
    """Longest step that keeps every s and z in its cone."""
    layers, sums = scaling.layers, scaling.sums
    u, z0, z1 = point.u, point.z0, point.z1
    du, dz0, dz1 = step.u, step.z0, step.z1
    aa, ab, bb = sums[0], sums[1], sums[2]
    cone_sums(layers, du, du, aa)
    cone_sums(layers, u, du, ab)
    cone_sums(layers, u, u, bb)
    for c in range(len(z0)):
        aa[c] = _root(aa[c], ab[c], bb[c] - 1.0)
    ya, yb, yc = ab, bb, sums[3]
    cone_sums(layers, dz1, dz1, ya)
    cone_sums(layers, z1, dz1, yb)
    cone_sums(layers, z1, z1, yc)
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
    smallest = -c / (below if crosses else 1.0)
    return smallest if crosses else _FAR
