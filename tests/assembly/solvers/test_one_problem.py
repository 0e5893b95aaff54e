"""Cone programs and farthest screws, compared with closed forms and Clarabel."""

import cvxpy as cp
import numpy as np
import pytest
from scipy.optimize import linprog

from forcefit.assembly.linear.reference.pose_error import ReachableSet
from forcefit.assembly.solvers import conic
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts
from forcefit.assembly.solvers.conic import ConeProgramme
from forcefit.assembly.solvers.one_problem import farthest_points

GROUP = np.array([0, 0, 1, 2, 2, 3])  # discs and intervals
SPRINGS = 4


def random_cones(rng, widest):
    """Return the cone of each column, with one to ``widest`` columns per cone."""
    sizes = rng.integers(1, widest + 1, size=rng.integers(2, 9))
    return np.repeat(np.arange(len(sizes)), sizes)


def inside(rng, group):
    """Return a point within all unit cones."""
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
    """Return the solution of Clarabel."""
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


@pytest.mark.parametrize("widest", [1, 2, 3, 20])
@pytest.mark.parametrize("springs", [0, 5])
def test_minimum_energies_of_both_methods_agree_with_both_bounds(rng, widest, springs):
    """The bound of each method is at most the value of the other method."""
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
        # The multipliers do work on the residual of the equations.
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


def test_farthest_point_of_a_ball_or_interval_equals_its_closed_form():
    """The maximum of |c + r v| over |v| <= 1 is |c| + r."""
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


@pytest.mark.parametrize("widest", [2, 12])
def test_farthest_distance_bounds_all_support_functions(rng, widest):
    """The support functions in many directions are computed by Clarabel."""
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
    """Return the support function of a set, evaluated by Clarabel."""
    v = cp.Variable(len(body.start))
    step = body.map[part : part + 3].T @ direction
    size = np.linalg.norm(step)
    cones = [cp.norm(v[body.group == c]) <= 1 for c in range(body.group.max() + 1)]
    if len(body.rows):
        cones.append(body.rows @ (v - body.start) == 0)
    problem = cp.Problem(cp.Maximize((step / size) @ (v - body.start)), cones)
    problem.solve(solver="CLARABEL")
    return direction @ body.centre[part : part + 3] + size * problem.value


CONES = np.array([0, 0, 1, 2, 2, 2])  # cones of two, one and three columns


def rows_of(rng, count, nu=6):
    return np.linalg.qr(rng.normal(size=(nu, count)))[0].T.copy()


def directions_of(rng, count, nu=6):
    d = rng.normal(size=(count, nu))
    return d / np.linalg.norm(d, axis=1)[:, None]


def found(rows, group, d, right, tolerance=1e-9):
    return farthest_points(
        rows, cone_starts(group), d, right, np.full(len(d), tolerance)
    )


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_multipliers_give_a_tight_bound_on_the_distance(rng, rows):
    """For every u of the set and any n, d.u <= n.e + sum |(d - H^T n)_k|."""
    H, d = rows_of(rng, rows), directions_of(rng, 20)
    start = rng.uniform(-0.4, 0.4, size=(20, 6))
    points, multipliers, solved = found(H, CONES, d, start @ H.T)
    # With several equations, round-off can prevent full convergence.
    assert solved.all() if rows == 1 else solved.sum() > 12
    assert np.abs((points - start)[solved] @ H.T).max() < 1e-12
    for i in np.flatnonzero(solved).tolist():
        assert cone_sizes(points[i], CONES).max() <= 1
        gradient = d[i] - H.T @ multipliers[i]
        most = multipliers[i] @ H @ start[i] + cone_sizes(gradient, CONES).sum()
        assert -1e-12 <= most - d[i] @ points[i] <= 1.1e-9
        assert d[i] @ points[i] >= d[i] @ start[i] - 1e-9


def test_farthest_points_of_intervals_equal_a_linear_program(rng):
    H, d = rows_of(rng, 2), directions_of(rng, 8)
    start = rng.uniform(-0.5, 0.5, size=(8, 6))
    points, _, solved = found(H, np.arange(6), d, start @ H.T)
    assert solved.all()
    for i in range(8):
        least = linprog(-d[i], A_eq=H, b_eq=H @ start[i], bounds=[(-1, 1)] * 6)
        assert d[i] @ points[i] == pytest.approx(-least.fun, abs=1e-8)


def test_infeasible_equations_are_reported_as_unsolved(rng):
    H, d = rows_of(rng, 1), directions_of(rng, 3)
    _, _, solved = found(H, CONES, d, np.array([[0.1], [10.0], [-0.2]]))
    assert solved.tolist() == [True, False, True]
