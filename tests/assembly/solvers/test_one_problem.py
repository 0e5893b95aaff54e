"""One cone programme, and one farthest screw: closed forms, Clarabel, proofs."""

from itertools import product

import cvxpy as cp
import numpy as np
import pytest

from assembly.linear.reference.pose_error import ReachableSet
from assembly.solvers import conic, one_problem
from assembly.solvers.cones import cone_sizes, cone_starts
from assembly.solvers.conic import ConeProgramme

GROUP = np.array([0, 0, 1, 2, 2, 3])  # discs and intervals
SPRINGS = 4


def random_cones(rng, widest):
    """(nu,) cone of each column, of one to so many columns each."""
    sizes = rng.integers(1, widest + 1, size=rng.integers(2, 9))
    return np.repeat(np.arange(len(sizes)), sizes)


def inside(rng, group):
    """A point within all unit cones."""
    u = rng.normal(size=len(group))
    return u / cone_sizes(u, group)[group] * rng.uniform(0, 0.9, group.max() + 1)[group]


def programme(seed, rows=1, springs=SPRINGS, group=GROUP):
    rng = np.random.default_rng(seed)
    nu = len(group)
    H = np.linalg.qr(rng.normal(size=(nu, rows)))[0].T.copy()
    return ConeProgramme(
        G=rng.normal(size=(springs, nu)) / 3, h=rng.normal(size=springs) / 2,
        d=0.05 * rng.normal(size=nu), H=H, k=H @ (0.4 * inside(rng, group)),
        group=group,
    )  # fmt: skip


def least(p):
    """By Clarabel."""
    u = cp.Variable(len(p.d))
    cones = [cp.norm(u[p.group == c]) <= 1 for c in range(p.group.max() + 1)]
    if len(p.k):
        cones.append(p.H @ u == p.k)
    strain = cp.sum_squares(p.G @ u + p.h) / 2 if len(p.h) else 0.0
    problem = cp.Problem(cp.Minimize(strain - p.d @ u), cones)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12)
    return problem.value


def value(p, u):
    return float(np.sum((p.G @ u + p.h) ** 2) / 2 - p.d @ u)


def proved(p, y, n):
    """Of any y and n, a bound: min over unit cones of what is linear in u."""
    z = p.G.T @ y + p.H.T @ n - p.d
    return float(y @ p.h - y @ y / 2 - n @ p.k - cone_sizes(z, p.group).sum())


def interior_point(p, tolerance):
    return one_problem.interior_point(p[:5], cone_starts(p.group), tolerance)


def newton(p, u, y, relative=1e-11, absolute=1e-12, first_sigma=1e4, steps=60):
    limits = one_problem.SolverLimits(relative, absolute, first_sigma, steps)
    one_problem.newton(p[:5], cone_starts(p.group), limits, u, y)


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("widest", [2, 7])
@pytest.mark.parametrize("seed", range(3))
def test_the_interior_point_is_clarabels_least_value_and_proves_it(seed, widest, rows):
    group = GROUP if widest == 2 else random_cones(np.random.default_rng(seed), widest)
    p = programme(seed, min(rows, len(group) - 1), group=group)
    u, n = interior_point(p, 1e-9)
    np.testing.assert_allclose(p.H @ u, p.k, atol=1e-12)
    assert (cone_sizes(u, group) <= 1).all()
    assert value(p, u) == pytest.approx(least(p), abs=1e-8)
    # rounding of the rows may end it just before
    most = 1e-8 if rows else 1.1e-9
    assert value(p, u) - proved(p, p.G @ u + p.h, n) <= most


@pytest.mark.parametrize("seed", range(3))
def test_however_large_a_gap_may_be_it_is_kept_and_rows_are_closed(seed):
    p = programme(seed, 2)
    for tolerance in (100.0, 1e-2):
        u, _ = interior_point(p, tolerance)
        assert value(p, u) - least(p) <= 1.01 * tolerance
        assert np.abs(p.H @ u - p.k).max() < 1e-12


def test_the_farthest_point_of_a_disc_is_its_rim():
    none = np.zeros((0, 2))
    disc = none, np.zeros(0), np.array([3.0, 4.0]), none, np.zeros(0)
    u, _ = one_problem.interior_point(disc, np.array([0, 2]), 1e-12)
    np.testing.assert_allclose(u, [0.6, 0.8], atol=1e-6)
    assert 5.0 - disc[2] @ u <= 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_newton_after_a_rough_start_proves_its_gap(seed):
    p = programme(seed, 0)
    u, _ = interior_point(p, 1e-4)
    y = p.G @ u + p.h
    newton(p, u, y)
    assert (cone_sizes(u, GROUP) <= 1 + 1e-14).all()
    gap = value(p, u) - proved(p, y, np.zeros(0))
    energy = float(np.sum((p.G @ u + p.h) ** 2) / 2)
    assert -1e-13 <= gap <= 1e-11 * energy + 1e-12 + 1e-13
    assert value(p, u) == pytest.approx(least(p), abs=1e-8)


def test_without_smoothing_newton_is_done_where_all_cones_are_active():
    """|G_k^T h| large: the solution is on every rim, the dual smooth about it."""
    rng = np.random.default_rng(2)
    G, u, y = rng.normal(size=(6, 6)), *np.zeros((2, 6))
    h, none = 30 * G @ rng.normal(size=6), (np.zeros((0, 6)), np.zeros(0))
    p = ConeProgramme(G, h, np.zeros(6), *none, GROUP)
    newton(p, u, y, 1e-12, 0.0, first_sigma=0.0, steps=20)
    np.testing.assert_allclose(cone_sizes(u, GROUP), 1.0, rtol=1e-12)
    # a clearance lies against its force
    z = G.T @ y
    np.testing.assert_allclose(u, -z / cone_sizes(z, GROUP)[GROUP], atol=1e-6)


def solved(seed, rows):
    """A problem made from its solution: every cone presses, with a force z of 1 to 2.

    u = -z / |z| there, and z = G^T y + H^T n - d, h = y - G u, k = H u.
    """
    rng = np.random.default_rng(seed)
    G, y = rng.normal(size=(SPRINGS, 6)) / 3, rng.normal(size=SPRINGS)
    H = np.linalg.qr(rng.normal(size=(6, rows)))[0].T.copy()
    n = rng.normal(size=rows)
    z = rng.normal(size=6)
    sizes = cone_sizes(z, GROUP)[GROUP]
    u = -z / sizes
    z *= rng.uniform(1, 2, GROUP[-1] + 1)[GROUP] / sizes
    d = G.T @ y + H.T @ n - z
    return ConeProgramme(G, y - G @ u, d, H, H @ u, GROUP), u, np.r_[y, n]


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("seed", range(8))
def test_newton_converges_from_near_where_every_cone_presses(seed, rows):
    """There the dual is smooth; rows are closed to the 1e-13 that it accepts."""
    p, expected, multipliers = solved(seed, rows)
    away = np.random.default_rng(seed).uniform(-1e-3, 1e-3, (2, 6))
    u, y = (1 - 1e-3) * expected + away[0] / 10, multipliers.copy()
    y[SPRINGS:] += away[1, :rows]
    newton(p, u, y, 1e-10, 1e-13)
    assert np.abs(p.H @ u - p.k).max(initial=0.0) < 3e-13
    energy = float(np.sum((p.G @ u + p.h) ** 2) / 2)
    gap = value(p, u) - proved(p, y[:SPRINGS], y[SPRINGS:])
    assert gap <= 1.01e-10 * energy + 1e-12
    # the dual curves by 1 along the springs: |y - y*|^2 / 2 is no more than the gap
    assert y[:SPRINGS] == pytest.approx(multipliers[:SPRINGS], abs=1e-4)
    assert value(p, u) == pytest.approx(value(p, expected), abs=1e-9)


@pytest.mark.parametrize("widest", [1, 2, 3, 20])
@pytest.mark.parametrize("springs", [0, 5])
def test_least_energies_of_both_methods_prove_each_other(rng, widest, springs):
    """Neither's certified bound is above the other's value."""
    for _ in range(6):
        group = random_cones(rng, widest)
        p = rng.integers(0, max(1, min(4, len(group) - 2)))
        H = rng.normal(size=(p, len(group)))
        given = (
            rng.normal(size=(springs, len(group))), 3 * rng.normal(size=springs),
            rng.normal(size=len(group)), H, H @ inside(rng, group), group,
        )  # fmt: skip
        one = conic.minimise_energy(*given)
        other = conic.minimise_energy(*given, method="reference")
        answers = one, other
        # what is left open of the rows works at their multipliers
        open_ = max(
            np.abs(H @ a.clearances - given[4]).max(initial=0.0) for a in answers
        )
        rows = open_ * (1 + max(np.abs(a.rigid_multipliers).sum() for a in answers))
        assert open_ < 1e-8
        for answer in answers:
            assert cone_sizes(answer.clearances, group).max() <= 1 + 1e-12
        assert one.gap <= 1e-8 * abs(one.value) + rows + 1e-12
        assert one.bound <= other.value + rows + 1e-12
        assert other.bound <= one.value + rows + 1e-12


def body_of(rng, group, rows=0, size=1.0):
    nv = len(group)
    H = np.linalg.qr(rng.normal(size=(nv, rows)))[0].T.copy()
    return ReachableSet(
        size * rng.normal(size=6), size * rng.normal(size=(6, nv)), H,
        inside(rng, group), group,
    )  # fmt: skip


@pytest.mark.parametrize("part", [0, 3])
def test_a_body_of_one_point_is_its_centre(part):
    centre = np.array([1.0, 2.0, 2.0, 2.0, 3.0, 6.0])
    one = ReachableSet(
        centre, np.zeros((6, 0)), np.zeros((0, 0)), np.zeros(0), np.zeros(0, np.int64)
    )
    bounds, screw, _ = one.farthest(part, 1e-3)
    assert bounds == ((3.0, 3.0) if part == 0 else (7.0, 7.0))
    assert np.array_equal(screw, centre)


def test_the_farthest_point_of_a_ball_and_of_an_interval():
    """|c + r v| with |v| <= 1 is |c| + r; of a ball of three and one more column."""
    centre = np.array([0.0, 0.0, 0.0, 3e-3, 0.0, 4e-3])
    X = np.zeros((6, 4))
    X[3:, :3], X[0, 3] = 2e-3 * np.eye(3), 5e-3
    body = ReachableSet(
        centre, X, np.zeros((0, 4)), np.zeros(4), np.array([0, 0, 0, 1])
    )
    (low, high), screw, _ = body.farthest(3, 1e-9)
    assert low <= 7e-3 + 1e-15
    assert high >= 7e-3 - 1e-15
    assert high - low <= 1e-9
    assert screw[3:] == pytest.approx(1.4 * centre[3:], abs=1e-6)
    (low, high), screw, _ = body.farthest(0, 1e-9)
    assert (low, high) == pytest.approx((5e-3, 5e-3), abs=1e-9)


def test_of_an_ellipse_two_supports_tell_all():
    """|x|, |y|, |z| <= 1, 3, 2 in a ball, with v_y = v_z: sqrt((9 + 4) / 2)."""
    X = np.zeros((6, 3))
    X[3:] = np.diag([1.0, 3.0, 2.0])
    H = np.array([[0.0, 1.0, -1.0]]) / np.sqrt(2)
    body = ReachableSet(np.zeros(6), X, H, np.zeros(3), np.zeros(3, np.int64))
    (low, high), _, supports = body.farthest(3, 1e-6)
    assert low == pytest.approx(np.sqrt(6.5), abs=1e-6)
    assert high - low <= 1e-6
    assert supports <= 2


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("part", [0, 3])
def test_of_intervals_the_farthest_is_one_of_all_corners(seed, part):
    body = body_of(np.random.default_rng(seed), np.arange(6))
    corners = np.array(list(product([-1.0, 1.0], repeat=6)))
    points = body.centre + (corners - body.start) @ body.map.T
    farthest = np.linalg.norm(points[:, part : part + 3], axis=1).max()
    (low, high), screw, supports = body.farthest(part, 0.01 * farthest)
    assert low == pytest.approx(farthest, rel=1e-12)  # it is a corner
    assert farthest * (1 - 1e-13) <= high <= low + 0.01 * farthest
    assert np.linalg.norm(screw[part : part + 3]) == pytest.approx(low, rel=1e-13)
    assert supports < 40


@pytest.mark.parametrize("rows", [0, 1, 3])
@pytest.mark.parametrize("seed", range(3))
def test_of_a_zonotope_with_rows_the_farthest_is_one_of_its_corners(seed, rows):
    """Of intervals with equations every corner has all but so many at their ends."""
    rng = np.random.default_rng(seed)
    body = body_of(rng, np.arange(6), rows)
    right, farthest = body.rows @ body.start, 0.0
    for free in product([False, True], repeat=6):
        own = np.array(free)
        if own.sum() != rows:
            continue
        for ends in product([-1.0, 1.0], repeat=6 - rows):
            v = np.zeros(6)
            v[~own] = ends
            v[own] = np.linalg.solve(body.rows[:, own], right - body.rows @ v)
            if np.abs(v).max() <= 1 + 1e-12:
                point = body.centre + body.map @ (v - body.start)
                farthest = max(farthest, float(np.linalg.norm(point[3:])))
    (low, high), _, _ = body.farthest(3, 1e-3 * farthest)
    assert low <= farthest * (1 + 1e-12)
    assert high >= farthest * (1 - 1e-12)
    assert high - low <= 1e-3 * farthest


@pytest.mark.parametrize("widest", [2, 12])
def test_no_support_is_higher_than_the_farthest_and_its_own_is_no_lower(rng, widest):
    """By Clarabel, along many directions; with rows, and cones of many columns."""
    for _ in range(4):
        group = random_cones(rng, widest)
        rows = int(rng.integers(0, max(1, min(4, len(group) - 2))))
        body = body_of(rng, group, rows, size=1e-3)
        for part in (0, 3):
            (low, high), screw, _ = body.farthest(part, 1e-7)
            assert high - low <= 1e-7
            own = screw[part : part + 3]
            assert np.linalg.norm(own) == pytest.approx(low, rel=1e-12)
            directions = [own, *rng.normal(size=(3, 3))]
            heights = [height(body, part, d / np.linalg.norm(d)) for d in directions]
            assert max(heights) <= high + 1e-10
            assert heights[0] >= low - 1e-10


def height(body, part, direction):
    """The support function of a body, by Clarabel."""
    v = cp.Variable(len(body.start))
    step = body.map[part : part + 3].T @ direction
    size = np.linalg.norm(step)
    cones = [cp.norm(v[body.group == c]) <= 1 for c in range(body.group.max() + 1)]
    if len(body.rows):
        cones.append(body.rows @ (v - body.start) == 0)
    problem = cp.Problem(cp.Maximize((step / size) @ (v - body.start)), cones)
    problem.solve(solver="CLARABEL")
    return direction @ body.centre[part : part + 3] + size * problem.value
