"""The methods on cones against closed forms and Clarabel, in Python and compiled."""

import cvxpy as cp
import numpy as np
import pytest

from assembly.solvers.dual_newton import (
    Dual,
    Iterate,
    Layered,
    _curvature,
    _slopes,
    _solve,
    dual_newton,
)
from assembly.solvers.interior import Programme, interior_point
from assembly.solvers.layers import layers_of
from assembly.solvers.nesterov_todd import (
    Point,
    Scaling,
    Sides,
    correct,
    scale,
    square_scaled,
)
from assembly.solvers.support import (
    ConvexBody,
    screw_at,
    support,
)

# as Python, loops warn of what they then look at
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
STARTS = np.array([0, 2, 3, 5, 6])  # discs and intervals


def programme(seed, rigid=1, springs=4):
    rng = np.random.default_rng(seed)
    nu = STARTS[-1]
    inside = 0.4 * rng.uniform(-1, 1, nu)
    H = np.linalg.qr(rng.normal(size=(nu, rigid)))[0].T.copy()
    return Programme(
        G=rng.normal(size=(springs, nu)) / 3, h=rng.normal(size=springs) / 2,
        d=0.05 * rng.normal(size=nu), H=H, k=H @ inside, starts=STARTS,
    )  # fmt: skip


def least(p):
    """By Clarabel."""
    u = cp.Variable(len(p.d))
    cones = [cp.norm(u[a:b]) <= 1 for a, b in zip(STARTS, STARTS[1:], strict=False)]
    if len(p.k):
        cones.append(p.H @ u == p.k)
    problem = cp.Problem(
        cp.Minimize(cp.sum_squares(p.G @ u + p.h) / 2 - p.d @ u), cones
    )
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12)
    return problem.value


def value(p, u):
    return float(np.sum((p.G @ u + p.h) ** 2) / 2 - p.d @ u)


def lengths(u):
    return np.sqrt(np.add.reduceat(u * u, STARTS[:-1]))


def proved(p, y, n):
    """Of any y and n, a bound: min over unit cones of what is linear in u."""
    z = p.G.T @ y - p.d - p.H.T @ n
    return float(y @ p.h - y @ y / 2 + n @ p.k - lengths(z).sum())


@pytest.mark.parametrize("rigid", [0, 1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_the_interior_point_is_clarabels_least_value_and_proves_it(seed, rigid):
    p = programme(seed, rigid)
    u, n, taken = interior_point(p, 1e-9, 0.0)
    assert 0 < taken < 20 or rigid  # rounding of the rows may end it just before
    np.testing.assert_allclose(p.H @ u, p.k, atol=1e-12)
    assert (lengths(u) <= 1).all()
    assert value(p, u) == pytest.approx(least(p), abs=1e-8)
    # its multipliers prove it, whichever sign they have for the closures
    y = p.G @ u + p.h
    bounds = [proved(p, y, sign * n) for sign in (1.0, -1.0)]
    assert value(p, u) - max(bounds) <= 1.1e-9


def test_a_looser_gap_takes_fewer_steps_and_is_kept():
    p = programme(5)
    best = least(p)
    _, _, many = interior_point(p, 1e-9, 0.0)
    for tolerance, relative in ((1e-2, 0.0), (0.0, 1e-2)):
        u, _, few = interior_point(p, tolerance, relative)
        assert few < many
        energy = float(np.sum((p.G @ u + p.h) ** 2) / 2)
        assert value(p, u) - best <= 1.01 * (tolerance + relative * energy) + 1e-9


def test_the_farthest_point_of_a_disc_is_its_rim():
    nothing = np.zeros((0, 2))
    p = Programme(
        nothing, np.zeros(0), np.array([3.0, 4.0]), nothing, np.zeros(0),
        np.array([0, 2]),
    )  # fmt: skip
    u, _, _ = interior_point(p, 1e-12, 0.0)
    np.testing.assert_allclose(u, [0.6, 0.8], atol=1e-6)
    assert 5.0 - p.d @ u <= 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_newton_after_a_rough_start_proves_its_gap(seed):
    p = programme(seed, 0)
    u, _, _ = interior_point(p, 1e-4, 0.0)
    y = p.G @ u + p.h
    dual = Dual(p.G.T.copy(), p.h, p.d, len(p.h), STARTS, 1e-11, 1e-12)
    assert dual_newton(dual, 60, 1e4, u, y) >= 0
    assert (lengths(u) <= 1 + 1e-14).all()
    gap = value(p, u) - proved(p, y, np.zeros(0))
    energy = float(np.sum((p.G @ u + p.h) ** 2) / 2)
    assert -1e-13 <= gap <= 1e-11 * energy + 1e-12 + 1e-13
    assert value(p, u) == pytest.approx(least(p), abs=1e-8)


def test_without_smoothing_newton_is_done_where_all_cones_are_active():
    """|G_k^T h| large: the solution is on every rim, the dual smooth about it."""
    rng = np.random.default_rng(2)
    G, u = rng.normal(size=(6, 6)), np.zeros(6)
    h = 30 * G @ rng.normal(size=6)
    dual = Dual(G.T.copy(), h, np.zeros(6), 6, STARTS, 1e-12, 0.0)
    y = np.zeros(6)
    taken = dual_newton(dual, 20, 0.0, u, y)
    assert 0 < taken < 10
    np.testing.assert_allclose(lengths(u), 1.0, rtol=1e-12)
    z = G.T @ y
    # a clearance lies against its force
    for a, b in zip(STARTS, STARTS[1:], strict=False):
        np.testing.assert_allclose(u[a:b], -z[a:b] / np.linalg.norm(z[a:b]), atol=1e-6)
    # where a cone is inactive there is a kink, and this gives up
    inside = 0.1 * G @ np.ones(6)
    slack = Dual(G.T.copy(), inside, np.zeros(6), 6, STARTS, 1e-12, 0.0)
    assert dual_newton(slack, 20, 0.0, np.zeros(6), y) == -1


@pytest.mark.parametrize("sigma", [0.3, 5.0])
def test_the_smooth_dual_is_its_definition_and_its_slopes_are_its_slopes(sigma):
    """y.h - |y|^2/2 + sum min over |u| <= 1 of u.z + |u - old|^2 / (2 sigma).

    Of the four cones some are active at y and some are not; the third row of H has no
    spring.  The curvature is that of B B^T + 1 for springs, by differences.
    """
    rng = np.random.default_rng(6)
    springs, r = 3, 4
    M, h, d = rng.normal(size=(r, 6)), rng.normal(size=r), 0.1 * rng.normal(size=6)
    order, layers = layers_of(STARTS)
    old = 0.5 * rng.uniform(-1, 1, 6)
    rows = Layered(M[:, order].copy(), h, -d[order], springs, layers)

    def slopes(y):
        at = Iterate(
            y.copy(), old[order], *np.zeros((2, 6)), np.zeros(r), np.zeros((r, 6))
        )
        return _slopes(rows, at, sigma), at

    y = 0.3 * rng.normal(size=r)
    (smooth, residual, kink, primal), at = slopes(y)
    z = M.T @ y - d
    np.testing.assert_allclose(at.z, z[order], rtol=1e-12)
    value, u = y @ h - y[:springs] @ y[:springs] / 2, np.zeros(6)
    inside = []
    for a, b in zip(STARTS, STARTS[1:], strict=False):
        best = old[a:b] - sigma * z[a:b]  # the free minimum, then the nearest inside
        inside.append(np.linalg.norm(best) <= 1)
        u[a:b] = best / max(1.0, np.linalg.norm(best))
        away = u[a:b] - old[a:b]
        value += u[a:b] @ z[a:b] + away @ away / (2 * sigma)
    assert any(inside) or sigma > 1
    assert smooth == pytest.approx(value, rel=1e-12)
    np.testing.assert_allclose(at.u, u[order], rtol=1e-12)
    # the gradient, and the gap of the module's head with u in it
    step = 1e-6 * np.eye(r)
    ahead = [slopes(y + e)[1].g for e in step]
    back = [slopes(y - e)[1].g for e in step]
    rise = [slopes(y + e)[0][0] - slopes(y - e)[0][0] for e in step]
    np.testing.assert_allclose(at.g, np.array(rise) / 2e-6, atol=1e-8)
    curvature = np.array(ahead) - np.array(back)
    S = np.zeros((r, r))
    _curvature(at.B, springs, S)
    np.testing.assert_allclose(
        np.tril(S), np.tril(-curvature / 2e-6), rtol=1e-5, atol=1e-7
    )
    strain = M[:springs] @ u + h[:springs]
    assert primal == pytest.approx(strain @ strain / 2, rel=1e-12)
    assert residual == pytest.approx(at.g @ at.g / 2, rel=1e-12)
    total = np.add.reduceat(z * u, STARTS[:-1]) + lengths(z)
    without = y[springs:] @ at.g[springs:]
    assert kink == pytest.approx(total.sum() - without, rel=1e-9)


def test_a_small_system_is_numpys_and_one_that_is_not_positive_is_refused(rng):
    root = rng.normal(size=(5, 5))
    S, g = root @ root.T + np.eye(5), rng.normal(size=5)
    x = np.zeros(5)
    assert _solve(S.copy(), g, x)
    np.testing.assert_allclose(x, np.linalg.solve(S, g), rtol=1e-10)
    S[4, 4] = -1.0
    assert not _solve(S, g, x)


def scaled_point(rng):
    """A point inside three discs, and its scaling."""
    cones, size = 3, 2
    starts = size * np.arange(cones + 1)
    order, layers = layers_of(starts)
    u, z1 = rng.uniform(-0.5, 0.5, size=(2, cones * size))
    z0 = 2.0 + rng.uniform(size=cones)
    point = Point(u[order], z0, z1[order])
    width = cones * size
    scaling = Scaling(
        layers, *np.zeros((2, cones)), np.zeros(width), np.zeros(cones),
        np.zeros(width), *np.zeros((2, cones)), np.zeros((6, cones)),
    )  # fmt: skip
    assert scale(point, scaling)
    return starts, order, (u, z0, z1), scaling


def by_cone(values, order, starts, c):
    own = np.empty(len(values))
    own[order] = values
    return own[starts[c] : starts[c + 1]]


def test_the_scaling_takes_both_sides_to_one_point(rng):
    """W z = W^-1 s = l with W = eta (2 w w^T - J), J = diag(1, -1 ..), w.J w = 1."""
    starts, order, (u, z0, z1), scaling = scaled_point(rng)
    for c in range(len(z0)):
        own = slice(starts[c], starts[c + 1])
        w = np.r_[scaling.w0[c], by_cone(scaling.w1, order, starts, c)]
        assert w[0] ** 2 - w[1:] @ w[1:] == pytest.approx(1.0, rel=1e-12)
        # the square root of the quadratic representation of w
        W = np.block([
            [np.array([[w[0]]]), w[None, 1:]],
            [w[1:, None], np.eye(2) + np.outer(w[1:], w[1:]) / (1 + w[0])],
        ]) * scaling.eta[c]  # fmt: skip
        l = np.r_[scaling.l0[c], by_cone(scaling.l1, order, starts, c)]
        np.testing.assert_allclose(W @ np.r_[z0[c], z1[own]], l, rtol=1e-12)
        np.testing.assert_allclose(
            np.linalg.solve(W, np.r_[1.0, u[own]]), l, rtol=1e-12
        )
        # D^-1 is the part of (W^2)^-1 .. that stays once the head of ds is zero
        x = rng.normal(size=len(scaling.w1))
        out = np.zeros(len(x))
        square_scaled(scaling, x, out)
        D = np.linalg.inv(W @ W)[1:, 1:]
        np.testing.assert_allclose(
            D @ by_cone(out, order, starts, c), by_cone(x, order, starts, c), rtol=1e-10
        )


def test_the_corrector_solves_the_scaled_complementarity(rng):
    """l o t = target e - l o l - (W^-1 ds) o (W dz), by Jordan's product itself."""
    starts, order, (_, z0, _), scaling = scaled_point(rng)
    cones, width = len(z0), len(scaling.w1)
    step = Point(rng.normal(size=width), rng.normal(size=cones), rng.normal(size=width))
    sides = Sides(np.zeros(cones), np.zeros(width), np.zeros(cones))
    correct(scaling, step, 0.3, sides)
    for c in range(cones):
        w = np.r_[scaling.w0[c], by_cone(scaling.w1, order, starts, c)]
        W = np.block([
            [np.array([[w[0]]]), w[None, 1:]],
            [w[1:, None], np.eye(2) + np.outer(w[1:], w[1:]) / (1 + w[0])],
        ]) * scaling.eta[c]  # fmt: skip
        ds = np.linalg.solve(W, np.r_[0.0, by_cone(step.u, order, starts, c)])
        dz = W @ np.r_[step.z0[c], by_cone(step.z1, order, starts, c)]
        l = np.r_[scaling.l0[c], by_cone(scaling.l1, order, starts, c)]
        t = np.r_[sides.t0[c], by_cone(sides.t1, order, starts, c)]

        def product(x, y):
            return np.r_[x @ y, x[0] * y[1:] + y[0] * x[1:]]

        right = np.r_[0.3, 0.0, 0.0] - product(l, l) - product(ds, dz)
        np.testing.assert_allclose(product(l, t), right, atol=1e-12)
        assert sides.r0[c] == pytest.approx(right[0], rel=1e-12)


def test_a_point_outside_has_no_scaling(rng):
    _, _, (u, z0, z1), scaling = scaled_point(rng)
    assert not scale(Point(u / np.abs(u).max() * 1.1, z0, z1), scaling)
    assert not scale(Point(u, 0.1 * z0, z1 / np.abs(z1).max()), scaling)


def test_layers_have_the_largest_cones_first():
    order, layers = layers_of(np.array([0, 1, 3, 6, 8]))
    # sizes 1, 2, 3, 2: first columns of the cones of size 3, then 2 and 2, then 1
    assert order.tolist() == [3, 1, 6, 0, 4, 2, 7, 5]
    assert layers.tolist() == [0, 4, 7, 8]


@pytest.fixture
def body():
    rng = np.random.default_rng(4)
    H = np.linalg.qr(rng.normal(size=(6, 2)))[0].T.copy()
    start = 0.3 * rng.uniform(-1, 1, 6)
    return ConvexBody(rng.normal(size=6), rng.normal(size=(6, 6)), H, start, STARTS)


@pytest.mark.parametrize("part", [0, 3])
def test_a_support_is_clarabels_attained_and_proved(body, part):
    direction = np.array([0.48, -0.6, 0.64])
    height, v, gradient, n = support(body, part, direction, 1e-10)
    x = cp.Variable(6)
    screw = body.centre + body.map @ (x - body.start)
    constraints = [body.rows @ (x - body.start) == 0]
    constraints += [
        cp.norm(x[a:b]) <= 1 for a, b in zip(STARTS, STARTS[1:], strict=False)
    ]
    problem = cp.Problem(cp.Maximize(direction @ screw[part : part + 3]), constraints)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12)
    assert height == pytest.approx(problem.value, abs=1e-8)
    # attained: the point is of the body, and as high as the proof but for the tolerance
    assert (lengths(v) <= 1 + 1e-13).all()
    np.testing.assert_allclose(body.rows @ (v - body.start), 0, atol=1e-13)
    attained = screw_at(body, v)
    np.testing.assert_allclose(
        attained, body.centre + body.map @ (v - body.start), rtol=1e-12
    )
    assert 0 <= height - direction @ attained[part : part + 3] <= 1e-9
    slope = body.map[part : part + 3].T @ direction - body.rows.T @ n
    np.testing.assert_allclose(gradient, slope, atol=1e-12)
    above = direction @ body.centre[part : part + 3] - gradient @ body.start
    # X and H together: the terms of n vanish in (X^T d - H^T n).(v - start)
    assert height == pytest.approx(above + lengths(gradient).sum(), rel=1e-12)


def test_without_rows_each_clearance_lies_along_its_gradient(body):
    free = body._replace(rows=np.zeros((0, 6)))
    direction = np.array([1.0, 0.0, 0.0])
    height, v, gradient, _ = support(free, 3, direction, 1e-9)
    np.testing.assert_allclose(lengths(v), 1.0, rtol=1e-12)
    wanted = free.centre[3] + free.map[3] @ (v - free.start)
    assert height == pytest.approx(wanted, rel=1e-12)
    np.testing.assert_allclose(gradient, free.map[3], rtol=1e-12)
    # a body that does not move along a direction: its centre, whatever it is asked
    still = free._replace(map=np.zeros((6, 6)))
    height, v, _, _ = support(still, 3, direction, 1e-9)
    assert height == free.centre[3]
    np.testing.assert_array_equal(v, free.start)
