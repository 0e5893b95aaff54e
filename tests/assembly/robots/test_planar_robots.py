"""Planar robots, compared with published or closed-form results."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.model.robot import Clearance
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.robots.five_bar import FiveBarParameters
from forcefit.assembly.robots.planar import arm_angle
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix
from tests.built_in_robots_for_tests import (
    farthest_corner,
    joints_of,
    only_play,
    random_pose,
)


def test_point_of_hoekens_linkage_equals_the_closed_form():
    """The crank rotates fully by Grashof's criterion, 1 + 2.5 < 2 + 2.5."""
    robot = BUILT_IN["four_bar"]()
    foot = np.array([0.2, 0.0])
    for angle in np.linspace(0.0, 2 * math.pi, 13):
        posture = place_robot(robot, joints={"crank": angle})
        pin = 0.1 * np.array([math.cos(angle), math.sin(angle)])
        ground = foot - pin
        # angle between the coupler and the line to the foot, by the law of cosines
        reach = np.hypot(*ground)
        beside = math.acos((reach**2 + 0.25**2 - 0.25**2) / (2 * reach * 0.25))
        coupler = math.atan2(ground[1], ground[0]) + beside
        point = pin + 0.5 * np.array([math.cos(coupler), math.sin(coupler)])
        assert np.abs(posture.platform[:2, 3] - point).max() < 1e-12
    ends = [place_robot(robot, joints={"crank": a}) for a in (0.0, 2 * math.pi)]
    assert np.abs(ends[0].transforms - ends[1].transforms).max() < 1e-12


@pytest.mark.parametrize(("degrees", "x"), [(90, 0.4), (180, 0.2), (270, 0.0)])
def test_point_of_hoekens_linkage_is_on_the_line_at_known_angles(degrees, x):
    """The distance from the ground link is four crank lengths."""
    robot = BUILT_IN["four_bar"]()
    posture = place_robot(robot, joints={"crank": math.radians(degrees)})
    assert posture.platform[:2, 3] == pytest.approx([x, 0.4], abs=1e-12)


def test_five_bar_tip_is_the_intersection_of_two_circles(rng):
    P = FiveBarParameters()
    robot = BUILT_IN["five_bar"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("five_bar", rng))
        elbows = [
            np.array([x, 0.0]) + 0.09 * np.array([math.cos(q), math.sin(q)])
            for x, q in zip((-P.base / 2, P.base / 2), joints_of(posture).values(),
                            strict=True)
        ]  # fmt: skip
        apart = elbows[1] - elbows[0]
        along = apart / np.hypot(*apart)
        height = math.sqrt(0.09**2 - (apart @ apart) / 4)
        tip = (elbows[0] + elbows[1]) / 2 + height * np.array([-along[1], along[0]])
        assert np.abs(posture.platform[:2, 3] - tip).max() < 1e-11


def half_angle_solutions(foot, tip, near, far):
    """Return drive angles by the half-angle tangent (Gosselin, Angeles 1988)."""
    x, y = tip - foot
    # The equation is x^2 + y^2 + near^2 - far^2 = 2 near (x cos q + y sin q).
    e = (x * x + y * y + near**2 - far**2) / (2 * near)
    root = math.sqrt(x * x + y * y - e * e)
    return [2 * math.atan2(y + s * root, x + e) for s in (1, -1)]


def test_drive_angles_of_3rrr_equal_published_formula(rng):
    robot = BUILT_IN["3rrr"]()
    angles = np.radians([90, 210, 330])
    corners = np.column_stack([np.cos(angles), np.sin(angles)])
    for _ in range(5):
        pose = random_pose("3rrr", rng)
        posture = place_robot(robot, pose=pose)
        R = rotation_matrix([0, 0, pose["rz"]])[:2, :2]
        tips = [pose["tx"], pose["ty"]] + 0.08 * corners @ R.T
        found = joints_of(posture).values()
        for q, foot, tip in zip(found, 0.3 * corners, tips, strict=True):
            both = half_angle_solutions(foot, tip, 0.16, 0.16)
            away = [abs(math.remainder(q - angle, 2 * math.pi)) for angle in both]
            assert min(away) < 1e-10


def only_radial(robot):
    """Return the robot with radial clearance only."""
    bare = (
        replace(f, clearance=f.clearance and Clearance(radial=f.clearance.radial))
        for f in robot.frames
    )
    return replace(robot, frames=tuple(bare))


def test_pose_error_of_3rrr_equals_the_farthest_prism_corner(rng):
    """The reachable set of (27) is a prism, because each leg has a clearance of 2c."""
    robot = only_radial(BUILT_IN["3rrr"]())
    posture = place_robot(robot, pose=random_pose("3rrr", rng))
    play = robot.frame("leg1.pin").clearance.radial
    lines = arm_lines(posture)
    found = bound_pose_error(
        solve_assembly(posture), tolerance_rotation=1e-9, tolerance_translation=1e-9
    )
    turn, shift = farthest_corner(lines, np.full(3, 2 * play))
    for (low, high), expected in (
        (found.rotation_error, turn),
        (found.translation_error, shift),
    ):
        assert low <= expected * (1 + 1e-8)
        assert high >= expected * (1 - 1e-8)
        assert high - low < 1e-8


def arm_lines(posture):
    """Return the unit wrenches [MZ FX FY] of the second arms, (3, 3)."""
    T, index = posture.transforms, posture.robot.index
    lines = []
    for leg in ("leg1", "leg2", "leg3"):
        elbow, end = (T[index(f"{leg}.{n}"), :2, 3] for n in ("elbow", "pin"))
        u = (end - elbow) / np.hypot(*(end - elbow))
        b = end - posture.platform[:2, 3]
        lines.append([b[0] * u[1] - b[1] * u[0], *u])
    return np.array(lines)


def test_displacement_of_loaded_3rrr_equals_pin_clearances(rng):
    """The largest work w.x of the load is the sum of |f| 2c over the legs.

    The second arm of a leg transmits an axial force f, and its two pins move by c each.
    """
    posture = place_robot(only_play(BUILT_IN["3rrr"]()), pose=random_pose("3rrr", rng))
    play = posture.robot.frame("leg1.pin").clearance.radial
    lines = arm_lines(posture)
    for w in rng.normal(size=(4, 3)) * [0.1, 1.0, 1.0]:
        forces = np.linalg.solve(lines.T, w)
        answer = solve_assembly(posture, [0, 0, w[0], w[1], w[2], 0])
        found = w @ answer.platform_screw[2:5]
        assert found == pytest.approx(np.abs(forces).sum() * 2 * play, rel=1e-8)
        assert answer.energy == 0.0


def test_planar_legs_out_of_reach_are_rejected():
    with pytest.raises(BadInput, match=r"5r: the home pose requires a reach of 3 m"):
        arm_angle("5r", [0, 0], [3, 0], 1.0, 1.0, 1)
