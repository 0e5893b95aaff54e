"""Poses and compliance of a serial arm, compared with Denavit-Hartenberg formulas."""

import math

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import Clearance
from forcefit.assembly.robots import BUILT_IN
from forcefit.stiffness.screws import skew
from tests.built_in_robots_for_tests import (
    LOAD,
    only_drives_give,
    only_play,
    platform_compliance,
    random_pose,
)


def denavit_hartenberg(theta, d, a, alpha):
    """Return the Denavit-Hartenberg transform, (4, 4)."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array([
        [c, -s * ca, s * sa, a * c],
        [s, c * ca, -c * sa, a * s],
        [0, sa, ca, d],
        [0, 0, 0, 1],
    ])


PUMA = [  # d, a [m], alpha [rad]
    (0, 0, math.pi / 2), (0, 0.4318, 0), (0.15005, 0.0203, -math.pi / 2),
    (0.4318, 0, math.pi / 2), (0, 0, -math.pi / 2), (0, 0, 0),
]  # fmt: skip


def test_arm_pose_equals_the_denavit_hartenberg_product(rng):
    robot = BUILT_IN["arm6"]()
    for _ in range(5):
        q = np.array(robot.positions[:6]) + rng.uniform(-1.0, 1.0, 6)
        expected = np.eye(4)
        for theta, row in zip(q, PUMA, strict=True):
            expected = expected @ denavit_hartenberg(theta, *row)
        joints = {f"joint{k + 1}": value for k, value in enumerate(q)}
        found = place_robot(robot, joints=joints).platform
        assert np.abs(found - expected).max() < 1e-12


@pytest.mark.parametrize(
    ("joints", "position", "approach"),
    [
        ((0, math.pi / 4, math.pi, 0, math.pi / 4, 0), (0.5963, -0.1501, -0.01435),
         (1, 0, 0)),
        ((0, 0, 0, 0, 0, 0), (0.4521, -0.15005, 0.4318), (0, 0, 1)),
    ],
    ids=["nominal", "zero"],
)  # fmt: skip
def test_arm_poses_equal_corkes_printed_values(joints, position, approach):
    """The tolerance is that of values with four or five digits."""
    named = {f"joint{k + 1}": value for k, value in enumerate(joints)}
    T = place_robot(BUILT_IN["arm6"](), joints=named).platform
    assert np.abs(T[:3, 3] - position).max() < 6e-5
    assert np.abs(T[:3, 2] - approach).max() < 1e-12


def arm_jacobian(posture):
    """Return the Jacobian at the flange in base axes, (6, 6)."""
    z, p = posture.transforms[:6, :3, 2], posture.transforms[:6, :3, 3]
    return np.hstack([z, np.cross(z, posture.platform[:3, 3] - p)]).T


def test_arm_compliance_equals_the_drive_compliances(rng):
    """The compliance is J K^-1 J^T."""
    robot = only_drives_give(BUILT_IN["arm6"]())
    posture = place_robot(robot, pose=random_pose("arm6", rng))
    J = arm_jacobian(posture)
    expected = J @ np.diag(1 / np.array([6e4, 6e4, 3e4, 3e3, 3e3, 2e3])) @ J.T
    size = np.sqrt(np.diag(expected))
    found = platform_compliance(posture)
    assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-12


def test_displacement_of_loaded_arm_equals_joint_clearances(rng):
    """A load moves every joint to the bound of its clearance."""
    posture = place_robot(only_play(BUILT_IN["arm6"]()), pose=random_pose("arm6", rng))
    play = Clearance(radial=5e-6, axial=5e-6, tilt=5e-5, spin=1e-4)
    answer = solve_assembly(posture, LOAD)
    expected = 0.0
    for T in posture.transforms[:6]:
        F = np.array(LOAD[3:])
        M = np.array(LOAD[:3]) + skew(posture.platform[:3, 3] - T[:3, 3]) @ F
        m, f = T[:3, :3].T @ M, T[:3, :3].T @ F
        expected += play.tilt * np.hypot(m[0], m[1]) + play.spin * abs(m[2])
        expected += play.radial * np.hypot(f[0], f[1]) + play.axial * abs(f[2])
    assert LOAD @ answer.platform_screw == pytest.approx(expected, rel=1e-8)
