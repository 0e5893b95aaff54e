"""Helical joints in robot files and in files of other programs."""

import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.inputs.table import BadInput
from tests.screws_for_tests import LIFT


@pytest.fixture
def read(tmp_path):
    def robot(text=LIFT):
        (tmp_path / "lift.toml").write_text(text)
        return read_robot(tmp_path / "lift.toml")

    return robot


def test_beam_length_includes_travel_of_a_screw(write_file):
    """The length is sqrt(0.24^2 + 0.1^2) m = 0.26 m after a travel of 0.1 m."""
    path = write_file("""
        platform = "tip"
        [[frame]]
        name = "thread"
        parent = "base"
        joint = "helical"
        pitch = 0.2
        actuated = true
        position = 3.141592653589793
        [[frame]]
        name = "tip"
        parent = "thread"
        translation = [0.24, 0, 0]
        link = { beam = { radius = 0.01 }, young = 2e11, poisson = 0.3 }
    """)
    assert read_robot(path).frame("tip").link.length == pytest.approx(0.26, rel=1e-14)


def test_helical_joint_is_equal_after_writing_and_reading(read, tmp_path):
    robot = read()
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert again.frame("nut").pitch == robot.frame("nut").pitch == 0.005
    assert convert(tmp_path / "lift.toml", tmp_path / "c.toml").difference < 1e-12


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_export_of_a_helical_joint_is_rejected(ending, read, tmp_path):
    read()
    with pytest.raises(BadInput, match=r'helical joints \("nut"\), which only robot'):
        convert(tmp_path / "lift.toml", tmp_path / f"lift.{ending}")
    assert not (tmp_path / f"lift.{ending}").exists()


def test_spin_bound_of_a_helical_joint_is_rejected(read):
    text = LIFT.replace("pitch =", "clearance = { spin = 1e-3 }\npitch =")
    with pytest.raises(BadInput, match="spin: found a bound on a helical joint"):
        read(text)


@pytest.mark.exudyn
def test_crosscheck_of_a_helical_joint_is_rejected(read, run, tmp_path):
    read()
    code, out, err = run("validation", "crosscheck", tmp_path / "lift.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert 'frame "nut": found a helical joint, expected revolute, prismatic' in err


def test_study_with_crosscheck_of_a_helical_joint_is_rejected(read, run, tmp_path):
    read()
    (tmp_path / "study.toml").write_text('robot = "lift.toml"')
    code, _, err = run("study", tmp_path / "study.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert 'found helical joints ("nut"), which are not simulated; set crossch' in err
