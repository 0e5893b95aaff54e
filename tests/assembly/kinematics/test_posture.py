"""One or many postures, screw maps and cached arrays."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BadInput, platform_stiffness, solve_assembly, zone_margin
from forcefit.assembly.kinematics.pieces import cut_beams
from forcefit.assembly.kinematics.posture import home_posture, place_robot, together
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from tests.linkages_for_tests import four_bar, four_bar_angles


def turned(*angles):
    return [place_robot(four_bar(), joints={"crank": angle}) for angle in angles]


def test_paths_transform_screws_from_each_frame_to_the_platform():
    """The map is [R 0; [p_j - p]x R, R]."""
    postures = turned(0.4, 0.9)
    many = together(postures)
    last = postures[0].robot.index(postures[0].robot.platform)
    for row, one in enumerate(postures):
        for j, T in enumerate(one.transforms):
            R, (x, y, z) = T[:3, :3], T[:3, 3] - one.transforms[last, :3, 3]
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            expected = np.block([[R, np.zeros((3, 3))], [cross @ R, R]])
            assert one.paths[j] == pytest.approx(expected, abs=1e-15)
            assert many.paths[row, j] == pytest.approx(expected, abs=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        many.paths[0, 0, 0, 0] = 1.0


def test_coordinates_above_1e6_are_rejected():
    with pytest.raises(BadInput, match=r"pose.tx: found 2e\+06, expected a number of"):
        place_robot(four_bar(), pose={"tx": 2e6})
    with pytest.raises(
        BadInput, match=r"joint crank: found -2e\+06, .* at most 1e\+06"
    ):
        place_robot(four_bar(), joints={"crank": -2e6})


def test_posture_reports_its_largest_closure_gap():
    robot = Robot(
        "gaps", "a",
        (Frame("a"), Frame("b", translation=[3e-7, 0, 0]),
         Frame("c", translation=[0, 5e-7, 0]), Frame("arm", translation=[1.0, 0, 0])),
        (("a", "b"), ("a", "c")),
    )  # fmt: skip
    assert home_posture(robot).mismatch == pytest.approx(5e-7, rel=1e-6)


def test_joints_outside_loops_remain_at_their_home_position():
    """Motions of these joints affect neither the closures nor the platform."""
    robot = four_bar()
    closed = {"end", "seat"}
    frames = tuple(
        replace(f, joint="revolute", position=0.3) if f.name in closed else f
        for f in robot.frames
    )
    robot = replace(robot, frames=(*frames, Frame("far", "end", [0.1, 0, 0])))
    posture = place_robot(robot, joints={"crank": 1.5})
    assert posture.platform[:2, 3] == pytest.approx(four_bar_angles(1.5)[2], abs=1e-9)
    for name in closed:
        assert posture.coordinates[robot.index(name)] == 0.3
    there = place_robot(robot, pose={"tx": posture.platform[0, 3]})
    for name in closed:
        assert there.coordinates[robot.index(name)] == 0.3


@pytest.mark.parametrize(
    ("asked", "missing"),
    [
        ({"rx": 0.5}, "0.5 rad"), ({"ry": -0.25}, "0.25 rad"), ({"tz": 2.0}, "2 m"),
        ({"tz": 2.0, "rx": 0.5}, "2 m and 0.5 rad"),
        ({"ty": 0.0, "tz": 2.0}, "2 m"), ({"rx": 0.3, "ry": 0.4}, "0.5 rad"),
        ({"ry": 0.3, "rz": 0.4}, "0.5 rad"),
    ],
)  # fmt: skip
def test_message_about_an_unreachable_pose_contains_units(asked, missing):
    """A slide along x cannot move along z or rotate."""
    robot = Robot("slide", "car", (
        Frame("rail", rotation=[0, np.pi / 2, 0], joint="prismatic", actuated=True),
        Frame("car", "rail", rotation=[0, -np.pi / 2, 0]),
    ))  # fmt: skip
    names = ", ".join(f"{name}={value:g}" for name, value in asked.items())
    message = (
        f"^slide: pose {names} cannot be reached: on the straight line from home the "
        f"platform stops at .*, {missing} short; expected a configuration in which "
    )
    with pytest.raises(BadInput, match=message):
        place_robot(robot, pose=asked)


@pytest.mark.parametrize("function", [solve_assembly, zone_margin, platform_stiffness])
def test_robot_in_place_of_a_posture_is_rejected(function):
    with pytest.raises(TypeError, match=r'robot "bars".*forcefit.place_robot\(robot\)'):
        function(four_bar())


BEAM = BeamLink({"radius": 0.01}, 7e10, 0.3)


def arm(pieces):
    """Return a serial arm of two beams with hinges at their bases."""
    beam = replace(BEAM, pieces=pieces)
    return Robot("arm", "tip", (
        Frame("hinge", joint="revolute", actuated=True, position=0.4),
        Frame("elbow", "hinge", [0.3, -0.2, 0.6], [0.5, -0.3, 0.2], joint="revolute",
              actuated=True, position=-0.7, link=beam, mass=2.0,
              geometric_error=[1e-3, 0, 0, 0, 0, 2e-4]),
        Frame("wrist", "elbow", [0.0, 0.4, 0.0], link=BEAM),
        Frame("tip", "wrist", [0.1, 0, 0], link=MatrixLink(np.eye(6))),
    ))  # fmt: skip


def test_posture_of_divided_beams_equals_posture_of_divided_robot():
    """The postures agree for any drive coordinates."""
    robot = arm(3)
    cut = cut_beams(robot)
    joints = {"hinge": 1.1, "elbow": 0.3}
    found = cut.cut(place_robot(robot, joints=joints))
    expected = place_robot(cut.robot, joints=joints)
    assert found.robot is cut.robot
    assert found.transforms == pytest.approx(expected.transforms, abs=1e-14)
    assert found.coordinates == pytest.approx(expected.coordinates, abs=1e-14)
    home = home_posture(robot)
    both = cut.cut(together([home] * 2))
    assert both.transforms.shape == (2, 6, 4, 4)
    for row in both.transforms:
        assert row == pytest.approx(cut.cut(home).transforms, abs=1e-15)
