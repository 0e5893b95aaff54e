"""Least quadratic energies within cones: what holds at a minimum, to rounding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from assembly.exact.contact_qp import (
    ClearanceProblem,
    _active_step,
    _newton,
    boundary_normals,
    clearance_step,
    cone_multipliers,
)

GROUP = np.array([0, 0, 1, 2, 2, 2])  # cones of two, one and three clearances
seeds = st.integers(0, 10**6)


def sizes(u):
    return np.sqrt(np.bincount(GROUP, u**2))


def problem(rng, rows, push=3.0, units=1.0):
    """Convex, some cones at their bound at the minimum, others not."""
    A = rng.normal(size=(6, 6))
    inside = rng.normal(size=6)
    inside *= rng.uniform(0.2, 0.7, 3)[GROUP] / sizes(inside)[GROUP]
    H = rng.normal(size=(rows, 6))
    return ClearanceProblem(
        S=units * (A @ A.T + 0.1 * np.eye(6)), s=units * push * rng.normal(size=6),
        start=inside, group=GROUP, rows=H, right=H @ inside,
    )  # fmt: skip


def energy(p, u):
    v = u - p.start
    return p.s @ v + v @ p.S @ v / 2


def least_by_slsqp(p):
    """From the start, where all is within the cones."""
    within = {"type": "ineq", "fun": lambda u: 1 - sizes(u) ** 2}
    closed = {"type": "eq", "fun": lambda u: p.rows @ u - p.right}
    scale = np.abs(p.S).max()
    found = minimize(
        lambda u: energy(p, u) / scale, p.start, method="SLSQP",
        constraints=[within] + [closed] * bool(len(p.rows)), options={"ftol": 1e-13},
    )  # fmt: skip
    return energy(p, found.x)


def unbalanced(p, step):
    """What balance, bounds and closures lack at the end of a step, relative."""
    v, rigid = step
    u = p.start + v
    gradient = p.s + p.S @ v - p.rows.T @ rigid
    force = -np.bincount(GROUP, gradient * u)
    inside = 1.0 - sizes(u)
    scale = np.abs(p.S).max()
    return max(
        np.abs(gradient + np.where(inside < 1e-6, force, 0)[GROUP] * u).max() / scale,
        -force[inside < 1e-6].min(initial=0.0) / scale, -inside.min(),
        np.abs(p.rows @ u - p.right).max(initial=0.0),
    )  # fmt: skip


@given(seeds, st.integers(0, 2))
@settings(max_examples=15, deadline=None)
def test_a_convex_step_is_that_of_a_general_solver(seed, rows):
    p = problem(np.random.default_rng(seed), rows)
    step = clearance_step(p, near=False)
    assert unbalanced(p, step) < 1e-5
    least = least_by_slsqp(p)
    assert energy(p, p.start + step[0]) == pytest.approx(least, rel=1e-5)


@given(seeds, st.integers(0, 2), st.sampled_from([1e-4, 1.0, 1e4]))
@settings(max_examples=25, deadline=None)
def test_near_its_end_a_step_is_exact_to_rounding(seed, rows, units):
    """From a start that is 1e-6 off, in whatever units, also where closures hold."""
    rng = np.random.default_rng(seed)
    p = problem(rng, rows, units=units)
    v, _ = clearance_step(p, near=False)
    u = p.start + v
    u = u / np.maximum(sizes(u), 1.0)[GROUP]
    s, right = p.s + p.S @ (u - p.start), p.rows @ u
    moved = ClearanceProblem(p.S, s, u, GROUP, p.rows, right)
    assert unbalanced(moved, clearance_step(moved, near=True)) < 1e-12


@given(seeds, st.integers(0, 1))
@settings(max_examples=15, deadline=None)
def test_whether_the_end_is_near_makes_no_difference_to_where_it_is(seed, rows):
    """From anywhere, Newton's method leads to the same minimum, or gives up."""
    p = problem(np.random.default_rng(seed), rows)
    near, far = clearance_step(p, near=True), clearance_step(p, near=False)
    assert near[0] == pytest.approx(far[0], abs=1e-4)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_negative_curvature_normal_to_a_bound_is_no_saddle(seed):
    """-c n n' beside multipliers more than c: the minimum that holds without it."""
    rng = np.random.default_rng(seed)
    p = problem(rng, 0, push=30.0)
    u = p.start + clearance_step(p, near=False)[0]
    u = u / np.maximum(sizes(u), 1.0)[GROUP]
    s = p.s + p.S @ (u - p.start)
    force = np.maximum(-np.bincount(GROUP, s * u), 0.0)
    k = int(np.argmax(force))
    n = np.where(k == GROUP, u, 0.0)
    bent = p.S - (n @ p.S @ n + 0.5 * force[k]) * np.outer(n, n)
    assert np.linalg.eigvalsh(bent)[0] < 0
    at = ClearanceProblem(bent, s, u, GROUP, p.rows, p.right)
    near, far = clearance_step(at, True), clearance_step(at, False)
    assert np.abs(near[0]).max() < 1e-5
    assert np.abs(far[0]).max() < 1e-4
    assert unbalanced(at, near) < 1e-12


def active_problem(rng, rows, units=1.0):
    """The first and last cone at their bound, convex along it, and a point there."""
    p = problem(rng, rows, units=units)
    u = p.start / sizes(p.start)[GROUP] * np.array([1.0, 0.4, 1.0])[GROUP]
    right = p.rows @ u + 0.01
    p = ClearanceProblem(p.S, p.s, p.start, GROUP, p.rows, right)
    return p, u, np.array([True, False, True])


@pytest.mark.parametrize("rows", [0, 1, 2])
@pytest.mark.parametrize("units", [1e-12, 1.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_a_step_along_boundaries_balances_and_stays_on_them(seed, rows, units):
    """S v + g + C f - H' n = 0 with C' v and H v as far as boundaries and rows are."""
    rng = np.random.default_rng(seed)
    p, u, active = active_problem(rng, rows, units)
    u = u * np.array([1.02, 1.0, 0.98])[GROUP]
    gradient = 0.05 * p.S @ rng.normal(size=6)
    change, forces, rigid = _active_step(p, p.S, gradient, u, active)
    C = boundary_normals(u, active, GROUP)
    assert C.T @ change == pytest.approx((1 - sizes(u)[[0, 2]] ** 2) / 2, abs=1e-12)
    assert p.rows @ (u + change) == pytest.approx(p.right, abs=1e-12)
    left = gradient + p.S @ change + C @ forces - p.rows.T @ rigid
    assert np.abs(left).max() < 1e-10 * np.abs(p.S).max()


def test_a_step_along_a_soft_boundary_is_shortened():
    """No more than 0.3 of the boundary's size, by curvature that is added."""
    rng = np.random.default_rng(0)
    p, u, active = active_problem(rng, 0)
    across = np.zeros(6)
    across[:2] = -u[1], u[0]
    for softness in (1e-2, 1e-7):
        soft = p.S - (1 - softness) * np.outer(p.S @ across, p.S @ across) / (
            across @ p.S @ across
        )
        push = 1e-6 * across
        change, *_ = _active_step(p, soft, push, u, active)
        assert sizes(change)[[0, 2]].max() <= 0.3
        assert change @ across < 0
    # softer still nothing that is added suffices
    assert _active_step(p, soft, 1e3 * across, u, active) is None


@pytest.mark.parametrize("units", [1e-12, 1.0, 1e6])
@pytest.mark.parametrize(("least", "minimum"), [(-1e-8, False), (-1e-10, True)])
def test_a_saddle_has_no_step_even_where_nothing_pulls(least, minimum, units):
    """Less than a billionth of the largest curvature is rounding."""
    Q = np.linalg.qr(np.random.default_rng(4).normal(size=(6, 6)))[0]
    S = units * Q @ np.diag([3.0, 2.0, 1.0, 1.0, 0.5, 3.0 * least]) @ Q.T
    nothing, inside = np.zeros((0, 6)), np.full(6, 0.1)
    p = ClearanceProblem(S, np.zeros(6), inside, GROUP, nothing, np.zeros(0))
    step = _active_step(p, S, np.zeros(6), inside, np.zeros(3, dtype=bool))
    assert (step is not None) == minimum


def test_where_boundaries_or_curvature_leave_no_minimum_there_is_no_step():
    rng = np.random.default_rng(1)
    p, u, active = active_problem(rng, 2)
    g = 0.05 * p.S @ rng.normal(size=6)
    assert _active_step(p, p.S, g, u, active) is not None
    assert _active_step(p, -p.S, g, u, active) is None
    # rows that boundaries hold already, and more of both than unknowns
    same = ClearanceProblem(
        p.S, p.s, p.start, GROUP, boundary_normals(u, active, GROUP).T[:1], p.right[:1]
    )
    assert _active_step(same, p.S, g, u, active) is None
    many = ClearanceProblem(
        p.S, p.s, p.start, GROUP, rng.normal(size=(5, 6)), np.zeros(5)
    )
    assert _active_step(many, p.S, g, u, active) is None
    # as many of both as unknowns: one point, whatever the curvature
    rows = rng.normal(size=(4, 6))
    full = ClearanceProblem(p.S, p.s, u, GROUP, rows, rows @ u)
    change, forces, rigid = _active_step(full, -p.S, g, u, active)
    assert np.abs(change).max() < 1e-12
    C = boundary_normals(u, active, GROUP)
    assert g + C @ forces == pytest.approx(rows.T @ rigid, rel=1e-9)


@pytest.mark.parametrize("rows", [0, 2])
@pytest.mark.parametrize("seed", range(3))
def test_multipliers_at_a_start_are_those_that_balance_it(seed, rows):
    """s + C f - H' n = 0 where it can; cones within, or pulled inwards, carry none."""
    rng = np.random.default_rng(seed)
    p, u, active = active_problem(rng, rows)
    C, n = boundary_normals(u, active, GROUP), rng.normal(size=rows)
    f = np.array([0.7, 0.0, 2.0])
    s = -C @ f[active] + p.rows.T @ n
    force, rigid = ClearanceProblem(p.S, s, u, GROUP, p.rows, p.right).multipliers
    assert force == pytest.approx(f, abs=1e-10)
    assert rigid == pytest.approx(n, abs=1e-10)
    # pulled inwards, and by a billionth of the other
    for weak in (-0.5, 1e-10):
        f[0] = weak
        s = -C @ f[active] + p.rows.T @ n
        force, _ = ClearanceProblem(p.S, s, u, GROUP, p.rows, p.right).multipliers
        assert force[0] == 0.0
        assert force[2] == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize(("off", "active"), [(0.9e-5, True), (1.1e-5, False)])
def test_a_cone_carries_a_force_within_a_hundred_thousandth_of_its_bound(off, active):
    u = np.array([0.6, 0.8, -1.0, 0.0, 0.6, 0.8])
    u *= np.array([1 - off, 1.0, 0.5])[GROUP]
    gradient = -u * np.array([3.0, -2.0, 5.0])[GROUP]
    force = cone_multipliers(u, gradient, GROUP)
    assert force == pytest.approx([3.0 * (1 - off) ** 2 * active, 0.0, 0.0], rel=1e-9)
    p = ClearanceProblem(np.eye(6), gradient, u, GROUP, np.zeros((0, 6)), np.zeros(0))
    assert (p.multipliers[0] > 0).tolist() == [active, False, False]


@pytest.mark.parametrize("near", [True, False])
def test_rows_that_no_clearance_within_the_cones_closes_have_no_step(near):
    rng = np.random.default_rng(2)
    p = problem(rng, 1)
    far = ClearanceProblem(p.S, p.s, p.start, GROUP, p.rows, p.right + 50.0)
    assert clearance_step(far, near) is None


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e6])
def test_curvature_that_is_negative_inside_leads_to_a_bound(units):
    """-v^2 about the middle of an interval, pushed: to the end it is pushed to."""
    group = np.array([0])
    p = ClearanceProblem(
        -units * np.eye(1), np.array([-1e-3 * units]), np.zeros(1), group,
        np.zeros((0, 1)), np.zeros(0),
    )  # fmt: skip
    step, _ = clearance_step(p, near=False)
    assert step == pytest.approx([1.0], abs=1e-6)


@pytest.mark.parametrize("push", [0.4, 3.0])
def test_of_one_interval_the_step_is_the_least_of_a_parabola(push):
    """-push / curvature, or the end before it; near or not."""
    p = ClearanceProblem(
        np.array([[2.0]]), np.array([-2.0 * push]), np.array([0.2]), np.array([0]),
        np.zeros((0, 1)), np.zeros(0),
    )  # fmt: skip
    for near in (True, False):
        step, rigid = clearance_step(p, near)
        assert step == pytest.approx([min(push, 0.8)], abs=1e-7)
        assert len(rigid) == 0


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("share", "refused"), [(0.6, False), (0.45, True)])
def test_newtons_end_is_taken_where_the_energy_does_not_rise(share, refused, units):
    """Rows that leave one end v: s.v + v.S v / 2 with s = -share S v."""
    rng = np.random.default_rng(3)
    p, v = problem(rng, 0, units=units), 0.05 * rng.normal(size=6)
    forced = ClearanceProblem(
        p.S, -share * p.S @ v, p.start, GROUP, np.eye(6), p.start + v
    )
    found = _newton(forced)
    assert (found is None) == refused
    if found is not None:
        assert found[0] == pytest.approx(v, abs=1e-12)
    assert clearance_step(forced, True)[0] == pytest.approx(v, abs=1e-6)


def test_newtons_end_is_on_the_boundaries_to_rounding():
    """However long its last step was, which leaves a circle by half of its square."""
    ends = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        p = problem(rng, 0, push=10.0)
        u = p.start + clearance_step(p, near=False)[0]
        # on the boundaries met, and off along them
        turned = u + 1e-3 * rng.normal(size=6)
        on = sizes(u) > 0.999
        turned = turned / np.where(on, sizes(turned), 1.0)[GROUP]
        moved = ClearanceProblem(
            p.S, p.s + p.S @ (turned - p.start), turned, GROUP, p.rows, p.right
        )
        found = _newton(moved)
        if found is not None:
            ends += 1
            at_end = sizes(turned + found[0])
            assert np.abs(at_end[at_end > 0.999] - 1).max(initial=0.0) < 4e-15
    assert ends
