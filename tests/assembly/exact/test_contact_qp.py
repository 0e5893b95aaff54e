"""Least quadratic energies within cones: what holds at a minimum, to rounding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from assembly.exact.contact_qp import ClearanceProblem, clearance_step

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
