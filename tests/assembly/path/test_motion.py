"""Tests of velocities and accelerations of bodies along a path."""

import numpy as np
import pytest

from forcefit import Frame, Robot, load_robot
from forcefit.assembly.kinematics.posture import (
    POSE,
    home_posture,
    place_many,
    place_many_joints,
    together,
)
from forcefit.assembly.path.motion import NotFollowed, follow_path
from forcefit.assembly.sweeps.targets import goals_of, of_joints
from forcefit.stiffness.screws import rotation_vector
from tests.assembly.path.moving_robots_for_tests import hinge

CASES = {"irsbot2": ("tx", "tz"), "hexapod": POSE, "delta": ("tx", "ty", "tz"),
         "five_bar": ("tx", "ty"), "arm6": POSE}  # fmt: skip


def path_of(names, home, t):
    """Return a smooth path and its first and second derivatives."""
    k = np.arange(len(names))
    size = np.array([0.02 if name[0] == "t" else 0.15 for name in names])
    w, phase = 1.0 + 0.3 * k, 0.5 * k
    turn = w * t[:, None] + phase
    return (
        home + size * (np.sin(turn) - np.sin(phase)),
        size * w * np.cos(turn), -size * w**2 * np.sin(turn),
    )  # fmt: skip


def placed(robot, names, values):
    place = place_many_joints if of_joints(names) else place_many
    postures, reasons = place(robot, goals_of(names, robot, values))
    assert not any(reasons)
    return together(postures)


def differences(robot, names, home, t, h):
    """Return velocities, accelerations and angular velocities by finite differences.

    The differences are of fourth order in the step h.
    """
    steps = (-2, -1, 0, 1, 2)
    values = path_of(names, home, t + h * np.array(steps))[0]
    poses = dict(zip(steps, placed(robot, names, values).transforms, strict=True))
    p = {k: T[:, :3, 3] for k, T in poses.items()}
    velocity = (8 * (p[1] - p[-1]) - (p[2] - p[-2])) / (12 * h)
    acceleration = (16 * (p[1] + p[-1]) - (p[2] + p[-2]) - 30 * p[0]) / (12 * h**2)
    R = {k: T[:, :3, :3] for k, T in poses.items()}

    def turn(k):
        return rotation_vector(R[k] @ np.swapaxes(R[-k], 1, 2))

    return velocity, acceleration, (8 * turn(1) - turn(2)) / (12 * h)


@pytest.mark.parametrize("name", CASES)
def test_velocities_and_accelerations_equal_finite_differences(name):
    robot, names = load_robot(name), CASES[name]
    pose = home_posture(robot).pose()
    home = np.array([pose[one] for one in names])
    t = np.array([0.4])
    path = path_of(names, home, t)
    motion = follow_path(placed(robot, names, path[0]), names, path)
    velocity, acceleration, omega = differences(robot, names, home, 0.4, 4e-3)
    p = motion.postures.transforms[0, :, :3, 3]
    V = motion.twists[0]
    found = np.array([motion.acceleration_of(i, p[None, i])[0] for i in range(len(p))])
    np.testing.assert_allclose(V[:, :3], omega, atol=1e-7)
    np.testing.assert_allclose(V[:, 3:] + np.cross(V[:, :3], p), velocity, atol=1e-8)
    np.testing.assert_allclose(found, acceleration, atol=2e-6)


def two_links(a, b):
    """Return a planar arm with two drives, which is straight in its home pose."""
    frames = hinge("one"), hinge("two", "one", [a, 0, 0])
    return Robot("arm", "tip", (*frames, Frame("tip", "two", [b, 0, 0])))


def test_tip_acceleration_of_planar_arm_equals_closed_form():
    a, b = 0.4, 0.3
    robot, names = two_links(a, b), ("q.one", "q.two")
    q, rate, second = ([[0.5, 0.8]], [[3.0, -2.0]], [[20.0, 15.0]])
    path = tuple(np.array(x) for x in (q, rate, second))
    motion = follow_path(placed(robot, names, path[0]), names, path)
    u, v = np.exp(0.5j), np.exp(1.3j)
    acceleration = a * u * (20j - 9) + b * v * (35j - 1)
    tip = motion.postures.transforms[:, 2, :3, 3]
    expected = [acceleration.real, acceleration.imag, 0]
    np.testing.assert_allclose(motion.acceleration_of(2, tip)[0], expected, rtol=1e-13)


def test_drives_without_path_coordinates_do_not_move():
    robot = load_robot("arm6")
    path = tuple(np.array([[x, y]]) for x, y in ((0.2, 0.3), (1.0, -2), (3.0, 4)))
    names = ("q.joint2", "q.joint4")
    motion = follow_path(placed(robot, names, path[0]), names, path)
    expected = np.zeros((2, len(robot.frames)))
    for name, rate, second in (("joint2", 1.0, 3.0), ("joint4", -2.0, 4.0)):
        expected[:, robot.index(name)] = rate, second
    found = [motion.rates[0], motion.second_rates[0]]
    np.testing.assert_allclose(found, expected, atol=1e-13)
    assert motion.free == 0


def test_joint_rate_is_correct_for_large_rotations():
    """The rotation angle is 3 rad, and its rate is 2 rad/s."""
    robot = Robot("table", "top", (hinge("drive"), Frame("top", "drive", [0.1, 0, 0])))
    path = tuple(np.array([[x]]) for x in (3.0, 2.0, 5.0))
    motion = follow_path(placed(robot, ("rz",), path[0]), ("rz",), path)
    np.testing.assert_allclose(motion.rates[0, 0], 2.0, rtol=1e-12)
    np.testing.assert_allclose(motion.second_rates[0, 0], 5.0, rtol=1e-12)


def test_radial_velocity_of_straight_arm_is_rejected():
    """The tip of a straight arm cannot move along the arm."""
    robot, names = two_links(0.4, 0.3), ("tx", "ty")
    there = together([home_posture(robot)])
    path = tuple(np.array(x) for x in ([[0.7, 0.0]], [[1.0, 0.0]], [[0.0, 0.0]]))
    with pytest.raises(NotFollowed, match="point 0"):
        follow_path(there, names, path)
