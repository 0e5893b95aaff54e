"""Use of files from other programs instead of robot files."""

import json

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.errors import BadInput
from tests.assembly.exchange.test_sdf import four_bar, pin
from tests.examples_for_tests import example


def test_write_robot_rejects_an_unsupported_suffix(tmp_path):
    for name in ("arm.sdf", "arm.txt", "arm"):
        with pytest.raises(BadInput, match=r"expected \.toml or \.urdf or \.xml"):
            ff.write_robot(BUILT_IN["arm6"](), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "text"), [("arm.urdf", "<robot/>"), ("arm.toml", "# mine\nname = 'arm'\n")]
)
def test_write_robot_does_not_overwrite_a_user_file(tmp_path, name, text):
    """A file that the user wrote may contain comments."""
    (tmp_path / name).write_text(text)
    with pytest.raises(BadInput, match="not overwritten"):
        ff.write_robot(BUILT_IN["arm6"](), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == text


def test_results_of_urdf_and_converted_robot_file_are_equal(run, tmp_path):
    """The mobility and the zone margin are equal."""
    source = example("5bar_linkage")
    ff.convert(source, tmp_path / "robot.toml")
    answers = []
    for robot in (source, tmp_path / "robot.toml"):
        status, out, _ = run("assembly", "solve", robot, "--json", tmp_path / "o.json")
        assert status == 0
        answers.append(json.loads((tmp_path / "o.json").read_text()))
    assert answers[0]["mobility"] == answers[1]["mobility"]
    assert answers[0]["zone"] == answers[1]["zone"]


def test_command_reports_assumptions_about_an_sdf_file(run, tmp_path):
    path = tmp_path / "bar.sdf"
    path.write_text(four_bar())
    status, out, _ = run("assembly", "solve", path)
    assert status == 0
    assert "bar.sdf: taken: mass of links, no inertial: 1 kg" in out
    robot = ff.load_robot(path)
    assert np.linalg.norm(pin(0.0)) > 0.3
    assert len(robot.closures) == 1


def test_xml_file_with_unknown_suffix_is_rejected(run, tmp_path):
    path = tmp_path / "bar.mjcf"
    path.write_text("\ufeff\n<mujoco><worldbody/></mujoco>", encoding="utf-8")
    status, out, err = run("assembly", "solve", path)
    assert (status, out) == (2, "")
    assert (
        "bar.mjcf: found XML, expected a robot file, or the suffix .urdf, .xml" in err
    )
