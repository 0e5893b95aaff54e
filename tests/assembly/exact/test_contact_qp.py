"""Tests of the minimum of a quadratic energy with cone constraints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from forcefit.assembly.exact.contact_qp import ClearanceProblem, clearance_step

GROUP = np.array([0, 0, 1, 2, 2, 2])  # three cones of dimension 2, 1 and 3
seeds = st.integers(0, 10**6)


def sizes(u):
    return np.sqrt(np.bincount(GROUP, u**2))


def problem(rng, rows):
    """Return a random convex problem."""
    A = rng.normal(size=(6, 6))
    inside = rng.normal(size=6)
    inside *= rng.uniform(0.2, 0.7, 3)[GROUP] / sizes(inside)[GROUP]
    H = rng.normal(size=(rows, 6))
    return ClearanceProblem(
        S=A @ A.T + 0.1 * np.eye(6), s=3.0 * rng.normal(size=6),
        start=inside, group=GROUP, rows=H, right=H @ inside,
    )  # fmt: skip


def energy(p, u):
    v = u - p.start
    return p.s @ v + v @ p.S @ v / 2


def least_by_slsqp(p):
    """Return the minimum energy that SciPy's SLSQP method finds."""
    within = {"type": "ineq", "fun": lambda u: 1 - sizes(u) ** 2}
    closed = {"type": "eq", "fun": lambda u: p.rows @ u - p.right}
    scale = np.abs(p.S).max()
    found = minimize(
        lambda u: energy(p, u) / scale, p.start, method="SLSQP",
        constraints=[within] + [closed] * bool(len(p.rows)), options={"ftol": 1e-13},
    )  # fmt: skip
    return energy(p, found.x)


def unbalanced(p, step):
    """Return the largest violation of the optimality conditions after a step."""
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
def test_energy_after_clearance_step_agrees_with_slsqp(seed, rows):
    p = problem(np.random.default_rng(seed), rows)
    step = clearance_step(p, near=False)
    assert unbalanced(p, step) < 1e-5
    least = least_by_slsqp(p)
    assert energy(p, p.start + step[0]) == pytest.approx(least, rel=1e-5)


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e6])
def test_clearance_step_with_negative_curvature_ends_at_bound(units):
    """The energy is concave, with a small force to one side of an interval."""
    p = ClearanceProblem(-units * np.eye(1), np.array([-1e-3 * units]), np.zeros(1),
                         np.array([0]), np.zeros((0, 1)), np.zeros(0))  # fmt: skip
    step, _ = clearance_step(p, near=False)
    assert step == pytest.approx([1.0], abs=1e-6)
