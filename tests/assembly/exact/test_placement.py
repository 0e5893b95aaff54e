"""Tests of finite motions and their derivatives."""

import numpy as np
import pytest
from scipy.linalg import expm

from forcefit.assembly.exact.dead_load import dead_loads, work_gradient
from forcefit.assembly.exact.descent import expand, potential
from forcefit.assembly.exact.finite_robot import FiniteRobot
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.kinematics.se3 import (
    bracket,
    exponential,
    inverse,
    left_jacobian,
    logarithm,
    second_form,
)
from forcefit.assembly.linear.closure import virtual_joints
from tests.assembly.exact.test_dead_load import heavy
from tests.robots_for_tests import random_robot


@pytest.mark.parametrize("size", [1e-7, 1e-2, 0.5, 1.5])
def test_exponential_of_screw_equals_matrix_exponential(rng, size):
    s = size * rng.normal(size=6)
    generator = np.zeros((4, 4))
    x, y, z = s[:3]
    generator[:3] = [[0, -z, y, s[3]], [z, 0, -x, s[4]], [-y, x, 0, s[5]]]
    assert np.abs(exponential(s) - expm(generator)).max() < 1e-14
    if np.linalg.norm(s[:3]) < np.pi:
        assert np.abs(logarithm(exponential(s)) - s).max() < 1e-14 * max(1, 1 / size)
    assert np.abs(exponential(s) @ inverse(exponential(s)) - np.eye(4)).max() < 1e-14


@pytest.mark.parametrize("size", [1e-4, 0.1, 1.0])
def test_left_jacobian_equals_power_series(rng, size):
    """J is the sum of ad^n / (n + 1)!."""
    s = size * rng.normal(size=6)
    J, term = np.eye(6), np.eye(6)
    for n in range(1, 40):
        term = term @ bracket(s) / (n + 1)
        J = J + term
    assert np.abs(left_jacobian(s) - J).max() < 1e-14


@pytest.mark.parametrize("size", [0.02, 0.3, 1.5, 3.0])
def test_second_form_equals_finite_differences(rng, size):
    """The second form D satisfies log(exp(s + h) exp(-s)) = J h + D(h, h) / 2."""
    s = size * np.ones(6) / np.sqrt(3)
    w, h = rng.normal(size=(2, 6))
    step = 2e-4

    def work(sign):
        return w @ logarithm(exponential(s + sign * step * h) @ inverse(exponential(s)))

    expected = (work(1) + work(-1)) / step**2
    rounding = 1e-16 / step**2
    form = second_form(s, w)
    assert np.abs(form - form.T).max() == 0.0
    scale = np.linalg.norm(w) * np.linalg.norm(h) ** 2
    assert abs(h @ form @ h - expected) < (10 * rounding + 1e-7) * scale


# Derivatives of the loop-closure residual


def moved_unknowns(posture, rng, size):
    """Return a robot, random unknowns of a given size, and a random direction."""
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    x, h = rng.normal(size=(2, len(model.frame))) / np.sqrt(np.diag(model.metric))
    return model, size * x, h


@pytest.mark.parametrize("seed", range(4))
def test_closure_and_platform_derivatives_equal_finite_differences(seed):
    rng = np.random.default_rng(seed)
    model, x, h = moved_unknowns(home_posture(random_robot(rng, legs=3)), rng, 0.05)
    here, step = place(model, x), 1e-5
    ahead, behind = place(model, x + step * h), place(model, x - step * h)
    difference = (ahead.residual - behind.residual) / (2 * step)
    assert np.abs(here.rows @ h - difference).max() < 1e-7
    difference = (ahead.platform_screw - behind.platform_screw) / (2 * step)
    assert np.abs(here.platform_rows @ h - difference).max() < 1e-7


def expansion(seed):
    """Return an expansion at a random placement under random loads, and a direction."""
    rng = np.random.default_rng(seed)
    posture = home_posture(heavy(random_robot(rng, 3, 3), rng))
    model, x, h = moved_unknowns(posture, rng, 0.1)
    x[model.bounded] *= 0.5 / np.abs(x[model.bounded]).max(initial=1.0)
    T, (first, second) = place(model, x).transforms, model.closed_frames.T
    vars(model)["nominal_closures"] = inverse(T[first]) @ T[second]
    bodies = rng.normal(size=(len(posture.robot.frames), 6))
    loads = dead_loads(posture, rng.normal(size=6), bodies, 9.81 * rng.normal(size=3))
    there = place(model, x)
    return expand(there, loads, rng.normal(size=len(there.residual))), h


@pytest.mark.parametrize("seed", range(3))
def test_gradient_and_hessian_equal_finite_differences(seed):
    """The multipliers are constant in the central differences."""
    local, h = expansion(seed)
    model, x, step = local.placement.model, local.placement.x, 1e-5
    ahead, behind = place(model, x + step * h), place(model, x - step * h)
    slope = (potential(ahead, local.loads) - potential(behind, local.loads)) / step / 2
    assert local.gradient @ h == pytest.approx(slope, rel=1e-6)

    def unbalanced(at):
        forces = -work_gradient(at, local.loads) - at.rows.T @ local.multipliers
        forces[model.springs] += at.x[model.springs]
        return forces

    bend = (unbalanced(ahead) - unbalanced(behind)) / (2 * step)
    assert np.abs(local.hessian @ h - bend).max() < 1e-6 * np.abs(bend).max()
