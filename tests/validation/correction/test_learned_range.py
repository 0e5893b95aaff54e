"""Tests of the range in which a robot was identified."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.model.function import Function
from forcefit.validation.campaign.campaign_file import read_commands
from forcefit.validation.diagnosis.learned_range import beyond, learned_range
from tests.campaigns_for_tests import ARM, write_campaign

HEAD = "id,q.one,q.two,cov.tilt,cov.time,meas.tx"
ROWS = ["a,0.1,0.2,0.0,0,0", "b,0.5,0.2,0.4,9,0", "c,0.3,0.2,9.0,5,0"]
KNOWN = 'learned_range = { "cov.tilt" = [0.0, 0.4], "q.one" = [0.1, 0.5] }\n'


def robot_file(tmp_path, known=KNOWN):
    path = tmp_path / "learned.toml"
    path.write_text(known + ARM)
    return path


def test_learned_range_excludes_time_and_outliers(tmp_path):
    robot = read_robot(robot_file(tmp_path))
    campaign = read_commands(write_campaign(tmp_path / "c", HEAD, ROWS), robot)
    ranges = learned_range(campaign, np.array([True, True, False]))
    assert {k: v for k, v in ranges.items() if not k.startswith("load.")} == {
        "q.one": (0.1, 0.5), "q.two": (0.2, 0.2), "cov.tilt": (0.0, 0.4),
    }  # fmt: skip
    assert ranges["load.fz"] == (0.0, 0.0)


def test_learned_range_has_a_margin_of_five_per_cent(tmp_path):
    robot = read_robot(robot_file(tmp_path))
    for tilt, outside in ((0.4, 0), (0.42, 0), (0.43, 1), (-0.03, 1)):
        rows = [f"a,0.1,0.2,{tilt},0,0", "b,0.5,0.2,0.2,9,0"]
        folder = write_campaign(tmp_path / f"c{tilt}", HEAD, rows)
        left = beyond(robot, read_commands(folder, robot))
        assert [one.rows for one in left] == [1] * outside


@pytest.mark.parametrize(("variables", "form", "name", "outside"), [
    (None, "", "", 0),
    (("q.one",), "waves", "1.sine", 0),
    (("q.one",), "reversal", "0", 0),
    (("q.one", "cov.tilt"), "scaled_waves", "1.sine", 0),
    (("q.two", "q.one"), "scaled_waves", "1.sine", 1),
    (("q.one",), "powers", "1", 1),
])  # fmt: skip
def test_full_turn_of_a_joint_is_inside_the_learned_range(
    variables, form, name, outside, tmp_path
):
    """Functions of the angle that are not periodic are an exception."""
    robot = read_robot(robot_file(tmp_path))
    if variables:
        one = Function("base", ("tx",), variables, form, {name: 1e-6})
        robot = replace(robot, functions=(one,))
    rows = [f"a,{0.3 + 2 * np.pi},0.2,0.2,0,0", f"b,{0.5 - 4 * np.pi},0.2,0.2,9,0"]
    folder = write_campaign(tmp_path / "c", HEAD, [*rows, "c,0.1,0.2,0.2,10,0"])
    left = beyond(robot, read_commands(folder, robot))
    assert [(one.variable, one.rows) for one in left] == [("q.one", 2)] * outside
    half = write_campaign(tmp_path / "d", HEAD, [f"a,{0.3 + np.pi},0.2,0.2,0,0"])
    assert [one.rows for one in beyond(robot, read_commands(half, robot))] == [1]


def test_missing_covariate_is_not_outside_the_learned_range(tmp_path):
    robot = read_robot(robot_file(tmp_path, KNOWN.replace("0.0", "0.2")))
    folder = write_campaign(tmp_path / "c", "id,q.one,q.two,meas.tx", ["a,0.1,0.2,0"])
    assert beyond(robot, read_commands(folder, robot)) == ()


def test_learned_range_is_saved_in_the_robot_file(tmp_path):
    robot = read_robot(robot_file(tmp_path))
    write_robot(robot, tmp_path / "again.toml")
    again = read_robot(tmp_path / "again.toml")
    assert again.learned_range == {"cov.tilt": (0.0, 0.4), "q.one": (0.1, 0.5)}


@pytest.mark.parametrize("command", ["predict", "compensate"])
def test_commands_report_rows_outside_the_learned_range(tmp_path, run, command):
    table = tmp_path / "new.csv"
    table.write_text("id,q.one,q.two,cov.tilt\na,0.3,0.1,0.2\nb,0.3,0.5,0.9\n")
    out, answer = tmp_path / "out.csv", tmp_path / "answer.json"
    code, _, error = run("validation", command, str(robot_file(tmp_path)), str(table),
                         "-o", str(out), "--json", str(answer))  # fmt: skip
    assert (code, out.exists()) == (0, True)
    assert error == (
        "warning: cov.tilt is 0.2 to 0.9, outside the identified range 0 to 0.4, in 1 "
        "of 2 rows\n"
    )
    (one,) = json.loads(answer.read_text())["beyond_learned_range"]
    assert (one["variable"], one["learned"], one["rows"]) == ("cov.tilt", [0, 0.4], 1)


def test_reversed_learned_range_is_rejected(tmp_path, rejected):
    path = robot_file(tmp_path, KNOWN.replace("0.0", "1.0"))
    error = rejected("validation", "explain", path)
    assert "cov.tilt: found [1, 0.4], expected the smaller number first" in error
