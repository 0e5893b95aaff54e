"""Tests of weights and loads on bodies under finite motions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit import BeamLink, Frame, MatrixLink, Robot, solve_exact
from forcefit.assembly.exact.dead_load import dead_loads, work_gradient
from forcefit.assembly.exact.finite_robot import FiniteRobot
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, screw_map
from forcefit.validation.multibody.simulation import (
    simulate_assembly,
    without_clearance,
)
from tests.assembly.exact.test_exact import as_springs, only
from tests.robots_for_tests import NUMBERS, irsbot2_with, random_robot, with_bodies

G = 9.81


def heavy(robot, rng):
    """Return a robot with random masses and with beams that have a density."""
    frames = []
    for frame in robot.frames:
        link = frame.link
        if isinstance(link, MatrixLink | BeamLink) and frame.translation.any():
            link = BeamLink({"radius": 0.02}, 7e8, 0.3, density=2000.0)
        frames.append(replace(frame, link=link, mass=rng.uniform(0.5, 2.0),
                              centre_of_mass=rng.normal(size=3) * 0.1))  # fmt: skip
    return replace(robot, frames=tuple(frames))


def on_a_hinge(stiffness, *frames):
    """Return a chain of rigid bodies on an elastic hinge about z."""
    hinge = Frame("hinge", joint="revolute", joint_stiffness=only(2, stiffness))
    return home_posture(Robot("arm", frames[-1].name, (hinge, *frames)))


@pytest.mark.parametrize("stiffness", [3.0, 30.0])
def test_equilibrium_of_arm_with_mass_equals_closed_form(stiffness):
    """In equilibrium, k a + m g (x cos a - y sin a) = 0.

    The mass m is at the point (x, y) relative to the hinge.
    """
    arm = Frame("arm", "hinge", [0.4, 0, 0], mass=2.0, centre_of_mass=[0.1, 0.2, 0])
    x, y, weight = 0.5, 0.2, 2.0 * G

    def balance(a):
        return stiffness * a + weight * (x * np.cos(a) - y * np.sin(a))

    angle = brentq(balance, -3.0, 0.0)
    answer = solve_exact(on_a_hinge(stiffness, arm), gravity=[0, -G, 0])
    assert abs(angle) > 0.2
    assert answer.joint_screws[0, 2] == pytest.approx(angle, abs=1e-9)
    fall = x * np.sin(angle) + y * np.cos(angle) - y
    expected = stiffness * angle**2 / 2 + weight * fall
    assert answer.potential == pytest.approx(expected, rel=1e-12)
    assert answer.joint_wrenches[0, 2] == pytest.approx(stiffness * angle, rel=1e-9)


def test_weight_of_displaced_beam_acts_at_its_centre():
    """The beam has a geometric error, which displaces its centre of mass."""
    beam = BeamLink({"radius": 0.02}, 1e16, 0.3, density=8000.0)
    turn, off = 0.3, np.array([0.01, 0.05])
    tip = Frame("tip", "hinge", [0.6, 0, 0], link=beam,
                geometric_error=[0, 0, turn, *off, 0])  # fmt: skip
    posture = on_a_hinge(5.0, tip)
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    here = place(model, np.zeros(len(model.frame)))
    weight = 8000.0 * np.pi * 0.02**2 * 0.6 * G
    x = 0.6 + off[0] - 0.3 * np.cos(turn)
    hinge = model.frame == 0
    found = work_gradient(here, dead_loads(posture, gravity=[0, -G, 0]))[hinge]
    assert found * np.sqrt(5.0) == pytest.approx([-weight * x], rel=1e-9)


def test_couple_on_body_acts_as_two_dead_forces():
    """In equilibrium, k a = m cos a, because the work of the couple m is m sin a."""
    posture = on_a_hinge(10.0, Frame("arm", "hinge", [0.5, 0, 0]))
    angle = brentq(lambda a: 10.0 * a - 9.0 * np.cos(a), 0.0, 1.5)
    answer = solve_exact(posture, bodies=[[0] * 6, [0, 0, 9.0, 0, 0, 0]])
    assert answer.joint_screws[0, 2] == pytest.approx(angle, abs=1e-9)


def test_force_on_platform_body_has_effect_of_platform_load():
    posture = on_a_hinge(10.0, Frame("arm", "hinge", [0.5, 0, 0]))
    force = [0, 0, 0, 3.0, -20.0, 0]
    one = solve_exact(posture, force)
    other = solve_exact(posture, bodies=[[0] * 6, force])
    assert abs(one.joint_screws[0, 2]) > 0.5
    for name in ("joint_screws", "wrenches", "joint_wrenches", "platform_screw"):
        assert np.allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-9)
    assert one.potential == pytest.approx(other.potential, rel=1e-12)


def test_base_reactions_equal_total_weight():
    """Forces and moments on the base are computed in the deformed state."""
    rng = np.random.default_rng(3)
    robot = with_bodies(random_robot(rng, legs=3), rng)
    g = np.array([1.0, -2.0, -G])
    answer = solve_exact(home_posture(robot), gravity=g)
    total, balance = np.zeros(6), np.zeros(6)
    for i, frame in enumerate(robot.frames):
        p = (answer.placement.body_ends[i] @ [*frame.centre_of_mass, 1.0])[:3]
        total += frame.mass * np.concatenate([np.cross(p, g), g])
        if robot.parents[i] < 0:
            # the wrench of the link, transformed to the base frame
            T = answer.transforms[i]
            in_base = np.kron(np.eye(2), T[:3, :3]) @ answer.wrenches[i]
            balance += screw_map(-T[:3, 3]).T @ in_base
    assert np.abs(answer.linear.platform_screw).max() > 1e-6
    assert balance == pytest.approx(total, rel=1e-8, abs=1e-8 * np.abs(total).max())


@pytest.mark.parametrize("seed", [1, 2, 3, 5])
def test_rotation_of_robot_and_gravity_rotates_the_solution(seed):
    rng = np.random.default_rng(seed)
    robot = heavy(random_robot(rng, legs=2), rng)
    R = rotation_matrix(rng.normal(size=3))
    turned = []
    for frame in robot.frames:
        if frame.parent == "base":
            turn = rotation_vector(R @ rotation_matrix(frame.rotation))
            frame = replace(frame, rotation=turn, translation=R @ frame.translation)
        turned.append(frame)
    here = solve_exact(home_posture(robot), gravity=[0, 0, -G])
    posture = home_posture(replace(robot, frames=tuple(turned)))
    there = solve_exact(posture, gravity=R @ [0, 0, -G])
    both = np.kron(np.eye(2), R)
    assert there.potential == pytest.approx(here.potential, rel=1e-9)
    assert there.platform_screw == pytest.approx(both @ here.platform_screw, abs=1e-9)


@pytest.mark.exudyn
@pytest.mark.parametrize("gravity", [[0, 0, -9.81], [300.0, -200.0, -500.0]])
def test_exact_solution_with_gravity_agrees_with_simulation(gravity):
    """The robot has bodies of up to 2 kg and links that are springs.

    The poses agree to 1e-8 m, and the energies to the work of the weight on 1e-8 m.
    """
    robot = without_clearance(irsbot2_with(NUMBERS["cases"][1]))
    robot = with_bodies(robot, np.random.default_rng(4), heaviest=2, off=0.05)
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    answer = solve_exact(posture, gravity=gravity)
    other = simulate_assembly(posture, model=as_springs(robot), gravity=gravity)
    light = solve_exact(posture)
    sag = np.abs(answer.platform_screw - light.platform_screw)[3:].max()
    difference = np.abs(other.platform_screw - answer.platform_screw)
    assert sag > 1e-6
    assert difference[:3].max() < 2e-7
    assert difference[3:].max() < 1e-8
    weight = sum(f.mass for f in robot.frames) * np.linalg.norm(gravity)
    assert other.energy == pytest.approx(answer.energy, abs=1e-8 * weight)
