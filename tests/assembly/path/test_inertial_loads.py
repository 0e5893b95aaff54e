"""Tests of the loads on accelerated bodies and beams against closed forms."""

import numpy as np
import pytest

from forcefit import Frame, Robot, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.path.inertial_loads import inertial_loads
from forcefit.assembly.path.path_errors import path_errors
from tests.assembly.path.moving_robots_for_tests import (
    GRAVITY,
    hinge,
    instants,
    moving_drives,
    rod,
    spinning_beam,
)

MASS, LENGTH, G = 2.0, 0.5, 9.81


def pendulum():
    """Return a rod on a hinge at the origin, along x in its home pose."""
    body = Frame("rod", "hinge", [LENGTH, 0, 0], **rod(MASS, LENGTH))
    return Robot("pendulum", "rod", (hinge("hinge"), body))


@pytest.mark.parametrize(
    ("angle", "axial", "transverse"),
    [(90.0, 0.0, 4.905), (30.0, 42.4786, 2.4525), (0.0, 49.05, 0.0)],
)
def test_hinge_forces_of_falling_rod_equal_closed_form(angle, axial, transverse):
    """A rod released in the horizontal position exerts 5/2 m g cos a along its axis.

    The transverse force is m g sin a / 4, where a is the angle from the vertical.
    """
    angle = np.radians(angle)
    q = angle - np.pi / 2
    rate = -np.sqrt(3 * G * np.cos(angle) / LENGTH)
    second = -1.5 * G * np.sin(angle) / LENGTH
    path = instants(["q.hinge"], [q], [rate], [second])
    found = path_errors(pendulum(), path, gravity=GRAVITY)
    force = found.arrays["wrench"][0, 0, 3:]
    along = np.array([np.cos(q), np.sin(q), 0.0])
    assert abs(found.arrays["drive_force"][0, 0]) < 1e-12 * MASS * G * LENGTH
    assert force @ along == pytest.approx(axial, abs=1e-4)
    assert np.linalg.norm(np.cross(along, force)) == pytest.approx(transverse, abs=1e-4)


def test_drive_torques_of_two_links_equal_lagrange_equations():
    """The arm moves in a horizontal plane and in a vertical plane."""
    frames = (
        hinge("shoulder"),
        hinge("elbow", "shoulder", [0.4, 0, 0], **rod(3.0, 0.4)),
        Frame("tip", "elbow", [0.3, 0, 0], **rod(2.0, 0.3)),
    )
    path = instants(["q.shoulder", "q.elbow"], [0.5, 0.8], [3, -2], [20, 15])
    robot = Robot("arm", "tip", frames)
    level, upright = (
        path_errors(robot, path, gravity=gravity).arrays["drive_force"][0]
        for gravity in (None, GRAVITY)
    )
    assert level == pytest.approx([16.9869, 4.5468], abs=1e-4)
    np.testing.assert_allclose(level, lagrange(weight=False), rtol=1e-12)
    np.testing.assert_allclose(upright, lagrange(weight=True), rtol=1e-12)


def lagrange(weight):
    """Return the torques by the equations of motion of a planar arm with two links."""
    (m1, m2), (l1, l2), (q1, q2) = (3.0, 2.0), (0.4, 0.3), (0.5, 0.8)
    c1, c2, g = l1 / 2, l2 / 2, G * weight
    I1, I2 = m1 * l1**2 / 12, m2 * l2**2 / 12
    h = m2 * l1 * c2
    M11 = I1 + I2 + m1 * c1**2 + m2 * (l1**2 + c2**2) + 2 * h * np.cos(q2)
    M12 = I2 + m2 * c2**2 + h * np.cos(q2)
    M22 = I2 + m2 * c2**2
    a, b, s = 3.0, -2.0, h * np.sin(q2)
    return [
        M11 * 20 + M12 * 15 - s * (2 * a * b + b * b)
        + g * ((m1 * c1 + m2 * l1) * np.cos(q1) + m2 * c2 * np.cos(q1 + q2)),
        M12 * 20 + M22 * 15 + s * a * a + g * m2 * c2 * np.cos(q1 + q2),
    ]  # fmt: skip


def test_rotating_beam_elongation_equals_closed_form():
    """The elongation is rho omega^2 L^3 / 3 E, and the stress rho omega^2 L^2 / 2."""
    robot, path = spinning_beam(100.0, 0.0)
    found = path_errors(robot, path)
    longer = 2700 * 100**2 * 0.5**3 / (3 * 70e9)
    assert found.arrays["platform_screw"][0, 3] == pytest.approx(longer, rel=1e-9)
    assert found.arrays["inertial_screw"][0, 3] == pytest.approx(16.07e-6, rel=1e-3)
    assert found.arrays["stress"][0, 0] == pytest.approx(3.375e6, rel=1e-9)


def test_bending_of_beam_on_accelerated_hub_equals_closed_form():
    """The load per length increases linearly to q = rho A alpha L at the tip.

    The deflection is 11 q L^4 / 120 E I, and rotary inertia adds rho alpha L^3 / 3 E.
    """
    r, L, alpha, rho, E = 0.01, 0.5, 500.0, 2700.0, 70e9
    area, second = np.pi * r**2, np.pi * r**4 / 4
    q = rho * area * alpha * L
    bending = 11 * q * L**4 / (120 * E * second)
    turning = rho * second * alpha * L**3 / (3 * E * second)
    assert bending == pytest.approx(2.210e-3, rel=1e-3)
    robot, path = spinning_beam(0.0, alpha)
    found = path_errors(robot, path)
    deflection = -found.arrays["platform_screw"][0, 4]
    assert deflection == pytest.approx(bending + turning, rel=1e-9)
    stress = 4 * (q * L**2 / 3 + rho * second * alpha * L) / (np.pi * r**3)
    assert found.arrays["stress"][0, 0] == pytest.approx(stress, rel=2e-3)


@pytest.mark.parametrize("theory", ["euler", "timoshenko"])
def test_deflection_does_not_depend_on_number_of_beams(theory):
    """The equivalent loads at the ends are exact, also for short beams with shear."""
    screws = []
    for pieces in (1, 2, 7):
        robot, path = spinning_beam(80.0, 3000.0, pieces, theory, 0.06, (0.3, -0.5, 1))
        found = path_errors(robot, path, gravity=[3.0, -9.0, 2.0])
        screws.append(found.arrays["platform_screw"][0])
    size = np.abs(screws[0]).max()
    for screw in screws[1:]:
        np.testing.assert_allclose(screw, screws[0], atol=1e-9 * size)


def test_wrench_at_start_of_beam_equals_hub_wrench():
    """The beam is in equilibrium under its own load and the load of a tool."""
    robot, path = spinning_beam(80.0, 3000.0, radius=0.03, axis=(0.3, -0.5, 1))
    tool = Frame("tool", "piece0", [0.1, 0.05, -0.07], mass=1.2,
                 inertia=np.diag([1e-3, 2e-3, 2e-3]))  # fmt: skip
    robot = Robot("beam", "tool", (*robot.frames, tool))
    motion = moving_drives(robot, path.names, (path.values, path.first, path.second))
    load = inertial_loads(motion, GRAVITY).beams[1]
    hub, tip = path_errors(robot, path, gravity=GRAVITY).arrays["wrench"][0, :2]
    T, R = motion.postures.transforms[0], load.data.axes
    sections = load.on_sections(np.r_[tip[:3] @ R, tip[3:] @ R][None], count=3)[0]
    turn = (T[1, :3, :3] @ R).T @ T[0, :3, :3]
    at_start = np.r_[turn @ hub[:3], turn @ hub[3:]]
    np.testing.assert_allclose(sections[0], at_start, atol=1e-10 * np.abs(hub).max())
    np.testing.assert_allclose(sections[2, :3], tip[:3] @ R, atol=1e-12)


def test_errors_at_rest_equal_static_solution_with_gravity():
    """The drives are at rest, so only the weight acts."""
    robot, path = spinning_beam(0.0, 0.0, pieces=2, theory="timoshenko")
    found = path_errors(robot, path, gravity=[1.0, -9.0, 2.0])
    static = solve_assembly(home_posture(robot), gravity=[1.0, -9.0, 2.0])
    screw, wrench = (found.arrays[name][0] for name in ("platform_screw", "wrench"))
    np.testing.assert_allclose(screw, static.platform_screw, rtol=1e-10, atol=1e-16)
    np.testing.assert_allclose(wrench, static.tip_wrenches, rtol=1e-10, atol=1e-12)
    assert np.abs(found.arrays["inertial_screw"]).max() < 1e-18
