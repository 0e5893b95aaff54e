"""Reading and writing of the key ``pieces`` of a beam."""

import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.sweeps.parameters import load_design

BEAM = """
name = "beam"
platform = "tip"
[[frame]]
name = "tip"
parent = "base"
translation = [0.5, 0.0, 0.0]
link = { beam = { radius = 0.005 }, young = 7e10, poisson = 0.3, pieces = 4 }
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "beam.toml"
    path.write_text(BEAM)
    return path


def test_number_of_beam_springs_is_read_written_and_varied(file, tmp_path):
    robot = read_robot(file)
    assert robot.frame("tip").link.pieces == 4
    write_robot(robot, tmp_path / "again.toml")
    assert read_robot(tmp_path / "again.toml").frame("tip").link.pieces == 4
    other = load_design(file).robot({"tip.link.pieces": 8.0})
    assert other.frame("tip").link.pieces == 8
    posture = home_posture(robot)
    assert len(solve_exact(posture, [0, 0, 0, 0, 1.0, 0]).cut.robot.frames) == 4
