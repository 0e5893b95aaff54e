"""Tests of the platform compliance in the simulation, by two methods."""

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.robots import load_robot
from forcefit.validation.crosscheck.link_models import link_models
from forcefit.validation.multibody import tangent
from forcefit.validation.multibody.conservative_springs import far_couple, middle_wrench
from forcefit.validation.multibody.exudyn_model import Regularisation
from forcefit.validation.multibody.motion import exponential, logarithm, turned
from forcefit.validation.multibody.simulation import SimulationModel
from forcefit.validation.multibody.simulation import without_clearance as without_play
from forcefit.validation.multibody.tangent import simulated_tangent

pytestmark = pytest.mark.exudyn


def relative(C, other):
    size = np.sqrt(np.abs(np.diag(C)))
    return np.abs((C - other) / np.outer(size, size)).max()


@pytest.mark.parametrize("share", [-0.8, 0.5, 0.9])
def test_stiffness_of_a_loaded_bar_is_reduced_by_the_force(share):
    """For a rigid bar of 1 m under the axial force F, 1 / C_yy = k - F."""
    k = 50.0
    link = MatrixLink(np.diag([1e9, 1e9, k, 1e9, 1e9, 1e9]))
    frames = (Frame("foot", link=link), Frame("tip", "foot", [1.0, 0, 0]))
    posture = home_posture(Robot("bar", "tip", frames, ()))
    load = [0, 0, 0, -share * k, 0, 0]
    answer = simulated_tangent(posture, SimulationModel("spring"), load)
    expected = 1 / (k - share * k)
    for C in (answer.linearised, answer.stepped):
        # the other springs are stiff, with relative deformations of 1e-9
        assert C[4, 4] == pytest.approx(expected, rel=3e-7)


@pytest.mark.parametrize("size", [1e-3, 0.05, 0.3])
def test_wrench_of_a_bent_spring_is_the_gradient_of_its_energy(size):
    """The gradient is computed by differences along six twists of the far end."""
    rng = np.random.default_rng(3)
    B = rng.normal(size=(6, 6))
    K = B @ B.T + np.eye(6)
    screw = size * rng.normal(size=6)
    T, half = exponential(screw), turned(screw[:3] / 2)
    wrench = np.array(middle_wrench(K.tolist(), screw.tolist()))
    moment, force = np.split(wrench.reshape(2, 3) @ half.T, 2)
    # Exudyn applies the wrench at half of the translation from each end
    arm = half @ screw[3:] / 2
    near = np.concatenate([moment[0] + np.cross(arm, force[0]), force[0]])
    couple = T[:3, :3] @ far_couple(screw.tolist(), wrench[3:].tolist())
    at_far = moment[0] - np.cross(arm, force[0]) - couple
    far = np.concatenate([at_far + np.cross(T[:3, 3], force[0]), force[0]])
    slopes = []
    for twist in np.eye(6):
        ends = [logarithm(exponential(h * twist) @ T) for h in (1e-5, -1e-5)]
        slopes.append((ends[0] @ K @ ends[0] - ends[1] @ K @ ends[1]) / 4e-5)
    np.testing.assert_allclose(near, slopes, atol=1e-8 * np.abs(slopes).max())
    np.testing.assert_allclose(far, near, atol=1e-14 * np.abs(near).max())


def test_tangent_of_a_spring_with_large_rotation_equals_exact_tangent():
    """The reference is the tangent at the exact equilibrium."""
    K = np.diag([40.0, 50.0, 60.0, 300.0, 400.0, 500.0])
    frames = (
        Frame("foot", translation=[0.5, 0, 0], link=MatrixLink(K)),
        Frame("tip", "foot", [0.7, 0.1, 0]),
    )
    posture = home_posture(Robot("bent", "tip", frames, ()))
    load = np.array([0, 0, 0, 20.0, -25.0, 30.0])
    equilibrium = solve_exact(posture, load)
    assert np.linalg.norm(equilibrium.platform_screw[:3]) > 0.4
    simulated = simulated_tangent(posture, SimulationModel("spring"), load)
    expected = exact_tangent(equilibrium).compliance
    assert relative(expected, simulated.linearised) < 1e-8
    assert relative(expected, simulated.stepped) < 1e-6


def soft_four_bar():
    """Return a four-bar on soft springs with errors of 0.2 rad and 0.2 m."""
    K = np.diag([10.0, 10.0, 10.0, 300.0, 400.0, 500.0])
    frames = (
        Frame("crank", joint="revolute"),
        Frame("crank_end", "crank", [0.3, 0.1, 0], link=MatrixLink(K)),
        Frame("pin", "crank_end", joint="revolute"),
        Frame("coupler", "pin", [0.1, 0.6, 0]),
        Frame("ground", translation=[0.5, 0.5, 0]),
        Frame("rocker", "ground", joint="revolute"),
        Frame("rocker_end", "rocker", [-0.1, 0.2, 0], link=MatrixLink(K)),
    )
    errors = np.zeros((7, 6))
    errors[3] = [0, 0, 0.2, 0.15, -0.1, 0]
    robot = Robot("soft", "coupler", frames, (("coupler", "rocker_end"),))
    return home_posture(robot.with_errors(errors))


def test_weak_springs_of_free_joints_do_not_change_the_tangent(monkeypatch):
    """Joints rotate by radians against springs of 1e-4 N m/rad."""
    weak = (Regularisation(1e8, 1e-4),)
    monkeypatch.setattr(tangent, "_REGULARISATIONS", weak)
    posture = soft_four_bar()
    expected = exact_tangent(solve_exact(posture)).compliance
    simulated = simulated_tangent(posture, link_models(posture.robot, "spring"))
    # without the correction, the differences would be 2e-5 and 1e-4
    assert relative(expected, simulated.linearised) < 1e-8
    assert relative(expected, simulated.stepped) < 1e-7


def loaded_orthoglide(share):
    """Return the Orthoglide at equilibrium under a load, and the load.

    The platform tilts if the factor ``share`` exceeds two thirds.
    """
    robot = without_play(load_robot("orthoglide"))
    errors = np.random.default_rng(4).uniform(-1, 1, (len(robot.frames), 6))
    robot = robot.with_errors(errors * np.repeat([1e-3, 1e-4], 3))
    load = share * np.array([800.0, 4400.0, 300.0, 88e3, 58e3, 11e3])
    couples = np.zeros((len(robot.frames), 6))
    couples[robot.index(robot.platform), :3] = load[:3]
    posture = home_posture(robot)
    return solve_exact(posture, load * [0, 0, 0, 1, 1, 1], bodies=couples), load


def test_compliance_does_not_depend_on_closure_stiffness():
    """The connector of the closure deforms by a millimetre under 1e5 N."""
    equilibrium, load = loaded_orthoglide(0.5)
    posture = equilibrium.posture
    model = link_models(posture.robot, "spring")
    simulated = simulated_tangent(posture, model, load, steps=False)
    expected = exact_tangent(equilibrium).compliance
    assert relative(expected, simulated.linearised) < 5e-9


@pytest.mark.slow
def test_smaller_load_steps_find_the_stable_equilibrium(monkeypatch):
    """Large steps beyond a bifurcation lead to an unstable equilibrium."""
    equilibrium, load = loaded_orthoglide(1.0)
    assert equilibrium.least_curvature > 0
    posture = equilibrium.posture
    model = link_models(posture.robot, "spring")
    expected = exact_tangent(equilibrium).compliance
    simulated = simulated_tangent(posture, model, load, steps=False)
    assert simulated.stable
    assert relative(expected, simulated.linearised) < 5e-9
    monkeypatch.setattr(tangent, "_SMALLER_STEPS", ())
    straight = simulated_tangent(posture, model, load, steps=False)
    assert not straight.stable
    apart = straight.platform[:3, 3] - simulated.platform[:3, 3]
    assert np.abs(apart).max() > 1e-3
