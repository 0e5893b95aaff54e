"""Postures, one or many: their text, their screw maps, their cached arrays."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import (
    home_posture,
    joint_target,
    place_robot,
    together,
)
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from tests.linkages_for_tests import four_bar, four_bar_angles


def turned(*angles):
    return [place_robot(four_bar(), joints={"crank": angle}) for angle in angles]


def test_posture_text_states_the_drives_or_the_number_of_postures():
    one, other = turned(0.4, 0.9)
    assert "drives" in repr(one)
    assert "crank 0.4 [rad, m]" in repr(one)
    many = together([one, other, one])
    assert repr(many) == "Posture of bars\n  postures  (3,)"
    grid = replace(
        many, coordinates=many.coordinates[None], transforms=many.transforms[None]
    )
    assert "(1, 3)" in repr(grid)


def test_posture_text_of_a_robot_without_drives_states_none():
    assert "drives            none [rad, m]" in repr(
        home_posture(Robot("rod", "tip", (Frame("tip", translation=[1.0, 0, 0]),)))
    )


def test_paths_transform_screws_from_each_frame_to_the_platform():
    """[R 0; [p_j - p]x R, R], of one posture and of each of many."""
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


def test_drives_not_named_keep_their_home_position(rng):
    """Passive joints are free."""
    robot = load_robot("five_bar")
    drives = [f.name for f in robot.frames if f.actuated]
    asked = joint_target(robot, {drives[1]: 0.25}).coordinates
    assert asked.shape == (1, len(robot.frames))
    for i, frame in enumerate(robot.frames):
        if frame.name == drives[1]:
            assert asked[0, i] == 0.25
        elif frame.actuated:
            assert asked[0, i] == robot.positions[i]
        else:
            assert np.isnan(asked[0, i])


def test_coordinates_above_1e6_are_refused():
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


def test_joints_after_a_closure_or_the_platform_keep_their_position():
    """Their motion changes neither the closing frame nor the platform."""
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
def test_missing_distance_in_the_message_has_the_unit_of_the_requested_component(
    asked, missing
):
    """A slide along x neither rises nor tilts at any position."""
    robot = Robot("slide", "car", (
        Frame("rail", rotation=[0, np.pi / 2, 0], joint="prismatic", actuated=True),
        Frame("car", "rail", rotation=[0, -np.pi / 2, 0]),
    ))  # fmt: skip
    with pytest.raises(BadInput) as caught:
        place_robot(robot, pose=asked)
    names = ", ".join(f"{name}={value:g}" for name, value in asked.items())
    message = str(caught.value)
    assert message.startswith(
        f"slide: pose {names} cannot be reached: on the straight line from home the "
        f"platform stops at {next(iter(asked))}="
    )
    assert message.endswith(
        f", {missing} short; expected a configuration in which every closure holds"
    )


@pytest.mark.parametrize("function", [solve_assembly, zone_margin, platform_stiffness])
def test_a_robot_in_place_of_a_posture_is_refused_with_a_way_out(function):
    with pytest.raises(TypeError, match=r'robot "bars".*forcefit.place_robot\(robot\)'):
        function(four_bar())
