"""Comparison of robots that are described by bodies and joints and by frames."""

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from tests.drawn_robots_for_tests import drawn_delta, drawn_five_bar, drawn_hexapod

SAME = 1e-12
LOAD = np.array([0.3, -0.2, 0.5, 10.0, -20.0, 30.0])
GRAVITY = [1.0, -2.0, -9.81]
# function that returns the text of the robot file, and a pose, by robot
ROBOTS = {
    "five_bar": (drawn_five_bar, {"tx": 0.02, "ty": 0.15}),
    "hexapod": (drawn_hexapod, {"tx": 0.02, "ty": 0.01, "tz": 0.55, "rx": 0.1,
                                "ry": -0.05, "rz": 0.2}),
    "delta": (drawn_delta, {"tx": 0.1, "ty": -0.2, "tz": -0.95}),
}  # fmt: skip


@pytest.mark.parametrize("name", ROBOTS)
def test_results_are_equal_for_both_file_formats(name, tmp_path):
    """Compliance matrices are scaled to a unit diagonal for the comparison."""
    text, pose = ROBOTS[name]
    (tmp_path / "drawn.toml").write_text(text())
    robots = read_robot(tmp_path / "drawn.toml"), load_robot(name)
    home = [home_posture(robot) for robot in robots]
    turn = home[1].platform[:3, :3].T
    for drawn, framed in (home, [place_robot(robot, pose) for robot in robots]):
        reference = framed.platform.copy()
        reference[:3, :3] = reference[:3, :3] @ turn
        assert np.abs(drawn.platform - reference).max() < SAME
        C, expected = (platform_stiffness(p).compliance for p in (drawn, framed))
        size = np.sqrt(np.abs(np.diag(expected)).clip(1e-30))
        assert np.abs((C - expected) / np.outer(size, size)).max() < SAME
    found, expected = (solve_assembly(p, LOAD, gravity=GRAVITY).energy for p in home)
    assert found == pytest.approx(expected, rel=SAME)
    drawn, framed = (mobility(posture) for posture in home)
    for count in ("freedoms", "platform_freedoms", "overconstraint"):
        assert getattr(drawn, count) == getattr(framed, count)
