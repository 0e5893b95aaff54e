"""Hexapod, Delta and Orthoglide, compared with published or closed-form results."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import POSE, home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.robots.delta import DeltaParameters, drive_angle
from forcefit.assembly.robots.hexapod import HexapodParameters
from forcefit.inputs.table import BadInput
from tests.built_in_robots_for_tests import (
    farthest_corner,
    joints_of,
    platform_compliance,
    random_pose,
)

MERLET = np.array([  # joint centres on the base and on the platform [cm]
    [-9.7, 9.1], [9.7, 9.1], [12.76, 3.9], [3, -13], [-3, -13], [-12.76, 3.9],
    [-3, 7.3], [3, 7.3], [7.822, -1.052], [4.822, -6.248], [-4.822, -6.248],
    [-7.822, -1.052],
]).reshape(2, 6, 2)  # fmt: skip


def strut_lines(posture):
    """Return the unit wrenches of the struts at the platform's origin, and lengths."""
    a, b = np.pad(MERLET / 100, ((0, 0), (0, 0), (0, 1)))
    arms = b @ posture.platform[:3, :3].T
    along = posture.platform[:3, 3] + arms - a
    lengths = np.linalg.norm(along, axis=1)
    n = along / lengths[:, None]
    return np.hstack([np.cross(arms, n), n]), lengths


def test_hexapod_strut_lengths_equal_the_inverse_kinematics(rng):
    robot = BUILT_IN["hexapod"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("hexapod", rng))
        _, lengths = strut_lines(posture)
        found = np.array(list(joints_of(posture).values()))
        assert np.abs(found - lengths).max() < 1e-12


def test_hexapod_stiffness_equals_the_sum_over_struts(rng):
    """The stiffness is the sum of k w w^T (Gosselin 1990)."""
    P = HexapodParameters()
    robot = BUILT_IN["hexapod"]()
    tight = (replace(f, clearance=None) for f in robot.frames)
    robot = replace(robot, frames=tuple(tight))
    _, home = strut_lines(home_posture(robot))
    area = math.pi * (P.radius**2 - P.inner_radius**2)
    k = 1 / (1 / P.drive + home / (P.young * area))
    for _ in range(3):
        posture = place_robot(robot, pose=random_pose("hexapod", rng))
        w, _ = strut_lines(posture)
        expected = np.linalg.inv(np.einsum("k,ki,kj->ij", k, w, w))
        found = platform_compliance(posture)
        size = np.sqrt(np.diag(expected))
        assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-9


def assert_pose_error_is_of_64_corners(posture, lines, joints):
    """Assert that the bound of (27) equals the largest error at 64 corners.

    The strut lengths vary by the joint clearances within a box, and the largest
    platform error is at one of its corners.
    """
    robot, T = posture.robot, posture.transforms
    plays = np.zeros(6)
    for k, (line, ends) in enumerate(zip(lines, joints, strict=True)):
        for name in ends:
            u = T[robot.index(name), :3, :3].T @ line[3:]
            play = robot.frame(name).clearance
            plays[k] += play.radial * np.hypot(u[0], u[1]) + play.axial * abs(u[2])
    turn, shift = farthest_corner(lines, plays)
    found = bound_pose_error(solve_assembly(posture))
    for (low, high), expected in (
        (found.rotation_error, turn),
        (found.translation_error, shift),
    ):
        assert low <= expected * (1 + 1e-8)
        assert high >= expected * (1 - 1e-8)
        assert high - low <= 1e-6


def test_pose_error_of_the_hexapod_equals_the_closed_form(rng):
    posture = place_robot(BUILT_IN["hexapod"](), pose=random_pose("hexapod", rng))
    lines, _ = strut_lines(posture)
    joints = [(f"leg{k}.cardan_2", f"leg{k}.ball_3") for k in range(1, 7)]
    assert_pose_error_is_of_64_corners(posture, lines, joints)


@pytest.mark.parametrize(("position", "degrees"), [
    ((0.0, 0.0, -0.9), (-20.5, -20.5, -20.5)),
    ((0.3, 0.5, -1.1), (47.5, -11.6, 21.4)),
])  # fmt: skip
def test_drive_angles_of_the_delta_robot_equal_published_examples(position, degrees):
    """The published angles have an accuracy of 0.1 degrees."""
    pose = dict(zip(POSE, position, strict=False))
    posture = place_robot(BUILT_IN["delta"](), pose=pose)
    found = np.degrees(list(joints_of(posture).values()))
    assert np.abs(found - degrees).max() < 0.05


def test_delta_platform_is_the_intersection_of_three_spheres(rng):
    base, platform = 0.567 * math.sqrt(3) / 6, 0.076 * math.sqrt(3) / 3
    robot = BUILT_IN["delta"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("delta", rng))
        centres = []
        angles = joints_of(posture).values()
        for azimuth, q in zip(np.radians([-90, 30, 150]), angles, strict=True):
            out = base - platform + 0.524 * math.cos(q)
            centres.append([
                out * math.cos(azimuth),
                out * math.sin(azimuth),
                -0.524 * math.sin(q),
            ])
        found = lower_meeting_point(np.array(centres), 1.244)
        assert np.abs(posture.platform[:3, 3] - found).max() < 1e-10


def lower_meeting_point(centres, radius):
    """Return the lower intersection of three spheres of equal radius."""
    a, b = centres[1] - centres[0], centres[2] - centres[0]
    normal = np.cross(a, b)
    middle = np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * normal @ normal)
    down = normal / np.linalg.norm(normal) * -np.sign(normal[2])
    return centres[0] + middle + math.sqrt(radius**2 - middle @ middle) * down


def test_delta_platform_has_constant_orientation(rng):
    robot = BUILT_IN["delta"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("delta", rng))
        assert np.abs(posture.platform[:3, :3] - np.eye(3)).max() < 1e-11
        at = {f.name: T[:3, 3] for f, T in
              zip(robot.frames, posture.transforms, strict=True)}  # fmt: skip
        for leg in ("leg1", "leg2", "leg3"):
            one, two = (at[f"{leg}.{r}_low_1"] - at[f"{leg}.{r}_high_1"] for r in "ab")
            assert np.abs(one - two).max() < 1e-11
            assert np.linalg.norm(one) == pytest.approx(1.244, abs=1e-11)
            apart = at[f"{leg}.a_low_1"] - at[f"{leg}.b_low_1"]
            assert np.linalg.norm(apart) == pytest.approx(0.131, abs=1e-11)


def test_delta_without_rod_rotations_has_three_degrees_of_freedom():
    """The rods cannot rotate about their axes in the upper ball joints."""
    robot = BUILT_IN["delta"]()
    frames = (
        replace(f, joint="fixed") if f.name.endswith("high_3") else f
        for f in robot.frames
    )
    found = mobility(home_posture(replace(robot, frames=tuple(frames))))
    assert (found.freedoms, found.locked_freedoms) == (3, 0)


def test_delta_pose_out_of_reach_is_rejected():
    with pytest.raises(BadInput, match=r"delta: a leg requires a reach of 2\.0\d* m"):
        drive_angle(DeltaParameters(), 0.0, np.array([0.0, 0.0, -2.0]))


def test_pose_error_of_the_delta_robot_equals_the_closed_form(rng):
    """The six rods act like six struts."""
    posture = place_robot(BUILT_IN["delta"](), pose=random_pose("delta", rng))
    T, index = posture.transforms, posture.robot.index
    rods = [f"leg{k}.{r}" for k in (1, 2, 3) for r in "ab"]
    lines = []
    for rod in rods:
        high, low = (T[index(f"{rod}_{end}_3"), :3, 3] for end in ("high", "low"))
        n = (low - high) / np.linalg.norm(low - high)
        lines.append([*np.cross(low - posture.platform[:3, 3], n), *n])
    joints = [(f"{rod}_high_3", f"{rod}_low_3") for rod in rods]
    assert_pose_error_is_of_64_corners(posture, np.array(lines), joints)


def test_lengths_of_orthoglide_legs_are_constant(rng):
    robot = BUILT_IN["orthoglide"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("orthoglide", rng))
        p = posture.platform[:3, 3]
        slides = np.array(list(joints_of(posture).values()))
        # The leg along x satisfies (p_x - r_x)^2 + p_y^2 + p_z^2 = L^2.
        left = (p - slides) ** 2 + p @ p - p**2 - 0.310**2
        assert np.abs(left).max() < 1e-12
        assert np.abs(posture.platform[:3, :3] - np.eye(3)).max() < 1e-11
