"""Helical joints in files, and the programs that refuse them."""

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


def test_beam_beyond_a_turned_thread_is_longer_by_the_travel(write_file):
    """From the thread's origin, 0.1 m before it, to its tip 0.24 m aside: 0.26 m."""
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


def test_screw_is_written_and_read_unchanged(read, tmp_path):
    robot = read()
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert again.frame("nut").pitch == robot.frame("nut").pitch == 0.005
    assert convert(tmp_path / "lift.toml", tmp_path / "c.toml").difference < 1e-12


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_files_of_other_programs_refuse_a_screw(ending, read, tmp_path):
    read()
    with pytest.raises(BadInput, match=r'helical joints \("nut"\), which only robot'):
        convert(tmp_path / "lift.toml", tmp_path / f"lift.{ending}")
    assert not (tmp_path / f"lift.{ending}").exists()


def test_rotation_bound_of_a_nut_is_refused(read):
    text = LIFT.replace("pitch =", "clearance = { spin = 1e-3 }\npitch =")
    with pytest.raises(BadInput, match="spin: found a bound on a helical joint"):
        read(text)


@pytest.mark.exudyn
def test_simulation_of_a_screw_is_refused_in_one_line(read, run, tmp_path):
    read()
    code, out, err = run("validation", "crosscheck", tmp_path / "lift.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert 'frame "nut": found a helical joint, expected revolute, prismatic' in err


def test_study_with_a_cross_check_of_a_screw_is_refused_at_once(read, run, tmp_path):
    read()
    (tmp_path / "study.toml").write_text('robot = "lift.toml"')
    code, _, err = run("study", tmp_path / "study.toml")
    assert (code, err.count("\n")) == (2, 1)
    assert 'found helical joints ("nut"), which are not simulated; set crossch' in err
