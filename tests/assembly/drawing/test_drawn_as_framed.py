"""Robots written as bodies and joints are those written as frames and closures."""

from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import BUILT_IN, load_robot
from tests.drawn_robots_for_tests import (
    drawn_bennett,
    drawn_delta,
    drawn_five_bar,
    drawn_hexapod,
    drawn_prs,
    drawn_three_rrr,
    drawn_three_upu,
)

SAME = 1e-12
LITERATURE = Path(__file__).parents[4] / "shared" / "cases" / "robots"
LOAD = np.array([0.3, -0.2, 0.5, 10.0, -20.0, 30.0])
GRAVITY = [1.0, -2.0, -9.81]
# the text of each, the robot of frames, and poses other than home
ROBOTS = {
    "five_bar": (drawn_five_bar, [{"tx": 0.02, "ty": 0.15}]),
    "3rrr": (drawn_three_rrr, [{"tx": 0.03, "ty": -0.02, "rz": 0.2}]),
    "hexapod": (drawn_hexapod, [{"tx": 0.02, "ty": 0.01, "tz": 0.55, "rx": 0.1,
                                 "ry": -0.05, "rz": 0.2}]),
    "delta": (drawn_delta, [{"tx": 0.1, "ty": -0.2, "tz": -0.95}]),
    "prs": (drawn_prs, [{"tz": -0.95, "rx": 0.05, "ry": -0.1}]),
    "tsai_err": (drawn_three_upu, [{"tx": 0.03, "ty": 0.02, "tz": 0.5}]),
    "bennett": (drawn_bennett, []),
}  # fmt: skip


def framed(name):
    """The robot of frames, without errors."""
    path = LITERATURE / f"{name}.toml"
    if name in BUILT_IN:
        return load_robot(name)
    if not path.exists():
        pytest.skip(f"{path} is not here")
    robot = read_robot(path)
    return robot.with_errors(np.zeros_like(robot.errors))


@pytest.fixture(params=ROBOTS)
def pair(request, tmp_path):
    """The two robots, and poses of them."""
    text, poses = ROBOTS[request.param]
    path = tmp_path / "drawn.toml"
    path.write_text(text())
    return read_robot(path), framed(request.param), poses


def postures(pair):
    """Both at home and at every pose."""
    drawn, expected, poses = pair
    yield home_posture(drawn), home_posture(expected)
    for pose in poses:
        yield place_robot(drawn, pose), place_robot(expected, pose)


def test_robots_of_both_formats_have_the_same_poses(pair):
    """The platform's origin, and its rotation from home: axes there are the base's."""
    home = home_posture(pair[1]).platform[:3, :3]
    for drawn, expected in postures(pair):
        reference = expected.platform.copy()
        reference[:3, :3] = reference[:3, :3] @ home.T
        assert np.abs(drawn.platform - reference).max() < SAME


def test_drawn_robots_have_the_same_stiffness_as_robots_defined_by_frames(pair):
    """Entries divided by the root of the diagonal's, so that rad and m weigh alike."""
    for drawn, expected in postures(pair):
        C = platform_stiffness(drawn).compliance
        reference = platform_stiffness(expected).compliance
        size = np.sqrt(np.abs(np.diag(reference)).clip(1e-30))
        assert np.abs((C - reference) / np.outer(size, size)).max() < SAME


def test_drawn_robots_have_the_same_energy_as_robots_defined_by_frames(pair):
    """Under a load and weight, clearances at their bounds."""
    drawn, expected = (home_posture(robot) for robot in pair[:2])
    found = solve_assembly(drawn, LOAD, gravity=GRAVITY)
    reference = solve_assembly(expected, LOAD, gravity=GRAVITY)
    assert found.energy == pytest.approx(reference.energy, rel=SAME)


def test_drawn_robots_have_the_same_motions_as_robots_defined_by_frames(pair):
    drawn, expected = (mobility(home_posture(robot)) for robot in pair[:2])
    assert drawn.freedoms == expected.freedoms
    assert drawn.platform_freedoms == expected.platform_freedoms
    assert drawn.overconstraint == expected.overconstraint


@pytest.mark.parametrize("place", ["left.drive", "left.elbow", "right.elbow", "pin"])
def test_error_of_a_drawn_joint_equals_the_error_of_its_frame(place, tmp_path):
    """In the joint's axes, before its motion; five_bar's pin is of its left arm."""
    error = [1e-4, -2e-4, 3e-4, 1e-5, 2e-5, -3e-5]
    path = tmp_path / "drawn.toml"
    leg, _, joint = place.rpartition(".")
    before, mark, after = drawn_five_bar().rpartition(f'name = "{leg}"')
    begin, name, rest = after.partition(f'name = "{joint}"\n')
    path.write_text(before + mark + begin + f"{name}geometric_error = {error}\n" + rest)
    robot = load_robot("five_bar")
    errors = np.zeros((len(robot.frames), 6))
    errors[robot.index("left.pin" if place == "pin" else place)] = error
    found = solve_assembly(home_posture(read_robot(path)), LOAD)
    expected = solve_assembly(home_posture(robot.with_errors(errors)), LOAD)
    assert found.energy == pytest.approx(expected.energy, rel=SAME)
    np.testing.assert_allclose(
        found.platform_screw, expected.platform_screw, rtol=0, atol=1e-15
    )
