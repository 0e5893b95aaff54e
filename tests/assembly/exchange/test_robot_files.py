"""Robots of other programs where a robot file is expected, in commands and Python."""

import json

import numpy as np
import pytest

import forcefit as ff
from assembly.robots import BUILT_IN
from forcefit.inputs.errors import BadInput
from tests.assembly.exchange.test_sdf import four_bar, pin
from tests.examples_for_tests import example


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_a_robot_is_written_and_read_by_the_ending(ending, tmp_path):
    """Drives, platform and pose of an arm of six joints, through another format."""
    robot, path = BUILT_IN["arm6"](), tmp_path / f"arm.{ending}"
    ff.write_robot(robot, path)
    assert path.read_text().startswith("<!-- Written by forcefit. -->")
    again = ff.load_robot(path)
    drives = {frame.name: 0.3 for frame in robot.frames if frame.actuated}
    assert {frame.name for frame in again.frames if frame.actuated} == set(drives)
    here, there = (ff.place_robot(one, joints=drives) for one in (robot, again))
    assert there.platform == pytest.approx(here.platform, abs=1e-12)


def test_no_file_of_another_kind_is_written(tmp_path):
    for name in ("arm.sdf", "arm.txt", "arm"):
        with pytest.raises(BadInput, match=r"expected \.toml or \.urdf or \.xml"):
            ff.write_robot(BUILT_IN["arm6"](), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "text"), [("arm.urdf", "<robot/>"), ("arm.toml", "# mine\nname = 'arm'\n")]
)
def test_a_file_of_the_users_own_is_not_overwritten(tmp_path, name, text):
    """It may hold comments, which a robot does not."""
    (tmp_path / name).write_text(text)
    with pytest.raises(BadInput, match="not overwritten"):
        ff.write_robot(BUILT_IN["arm6"](), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == text


def test_conversion_is_public(tmp_path):
    answer = ff.convert("four_bar", tmp_path / "bar.urdf")
    assert answer.difference < 1e-12
    assert [path.name for path in answer.files] == ["bar.urdf", "bar.yaml"]


def test_a_command_takes_a_urdf_with_its_loops(run, tmp_path):
    """The same answer as of the robot file that it is converted to."""
    source = example("5bar_linkage")
    ff.convert(source, tmp_path / "robot.toml")
    answers = []
    for robot in (source, tmp_path / "robot.toml"):
        status, out, _ = run("assembly", "solve", robot, "--json", tmp_path / "o.json")
        assert status == 0
        answers.append(json.loads((tmp_path / "o.json").read_text()))
    assert answers[0]["mobility"] == answers[1]["mobility"]
    assert answers[0]["zone"] == answers[1]["zone"]


def test_a_command_says_what_was_taken_of_an_sdf(run, tmp_path):
    path = tmp_path / "bar.sdf"
    path.write_text(four_bar())
    status, out, _ = run("assembly", "solve", path)
    assert status == 0
    assert "bar.sdf: taken: mass of links, no inertial: 1 kg" in out
    robot = ff.load_robot(path)
    assert np.linalg.norm(pin(0.0)) > 0.3
    assert len(robot.closures) == 1


def test_a_sweep_takes_an_mjcf(run, tmp_path):
    path = tmp_path / "bar.xml"
    ff.write_robot(BUILT_IN["four_bar"](), path)
    status, _, _ = run("assembly", "sweep", path, "--grid", "rz=0:0.1:0.1",
                       "-o", tmp_path / "out.nc")  # fmt: skip
    assert status == 0


def test_a_wrong_file_is_one_line(run, tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text("<robot><link/></robot>")
    status, out, err = run("assembly", "solve", path)
    assert (status, out) == (2, "")
    assert "robot.urdf: link.name: missing" in err


def test_xml_by_another_ending_is_told_the_endings(run, tmp_path):
    path = tmp_path / "bar.mjcf"
    path.write_text("\ufeff\n<mujoco><worldbody/></mujoco>", encoding="utf-8")
    status, out, err = run("assembly", "solve", path)
    assert (status, out) == (2, "")
    assert (
        "bar.mjcf: found XML, expected a robot file, or the ending .urdf, .xml" in err
    )
