"""Tests of corrected commands against hand calculations and simulated machines."""

import json
from dataclasses import replace
from math import acos, atan2, cos, sin
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.campaign.campaign_file import read_commands
from forcefit.validation.correction.compensation import compensate
from forcefit.validation.multibody.simulation import without_clearance
from forcefit.validation.synthetic.again import distances
from forcefit.validation.synthetic.machine import Hidden
from tests.campaigns_for_tests import ARM, read_table, table_rows

LONGER = ARM.replace("translation = [0.8, 0, 0]", """translation = [0.8, 0, 0]
geometric_error = [0, 0, 0, 0.01, 0, 0]""")  # fmt: skip
ZERO = """
[[effect]]
name = "encoder_offset"
parameters = { one = 2e-3 }
"""


def written(tmp_path, robot, rows, head="id,q.one,q.two"):
    path, table = tmp_path / "robot.toml", tmp_path / "targets.csv"
    path.write_text(robot)
    table.write_text("\n".join([head, *rows]) + "\n")
    return str(path), str(table)


def test_compensation_tables_equal_the_arrays(tmp_path):
    """A zero error of 2 mrad requires the opposite offset of the command."""
    pytest.importorskip("xarray")
    robot, targets = written(tmp_path, ARM + ZERO, ["a,0.3,0.9", "b,-0.2,1.2"])
    found = compensate(read_commands(Path(targets), load_robot(robot)))
    table = found.to_pandas()
    assert list(table.index) == ["a", "b"]
    np.testing.assert_allclose(table["offset", "one"], -2e-3, rtol=1e-6)
    np.testing.assert_allclose(table["offset", "two"], 0.0, atol=1e-9)
    np.testing.assert_array_equal(table["command"], found.commands)
    np.testing.assert_array_equal(table["before"], found.before)
    assert table.attrs["units"]["offset"] == "rad or m"


def two_links(x, y, length):
    """Return the joint angles of a planar arm with links of 1 m and ``length``."""
    second = acos((x**2 + y**2 - 1 - length**2) / (2 * length))
    first = atan2(y, x) - atan2(length * sin(second), 1 + length * cos(second))
    return first, second


def test_compensated_commands_equal_hand_calculation(tmp_path, run):
    robot, table = written(tmp_path, LONGER + ZERO, ["a,0.3,0.9", "b,-0.2,1.2"])
    out, offsets = tmp_path / "out.csv", tmp_path / "offsets.csv"
    left = tmp_path / "diagnosis.json"
    after = {"position": 4e-5, "rotation": None}
    left.write_text(json.dumps({"error": {"after": after}}))
    options = ["--offsets", str(offsets), "--json", str(tmp_path / "j.json"),
               "--diagnosed", str(left)]  # fmt: skip
    words = ["compensate", robot, table, "-o", str(out), *options]
    code, text, error = run("validation", *words)
    assert (code, error) == (0, "")
    assert "expected error: " in text
    for row, (q1, q2) in zip(read_table(out), [(0.3, 0.9), (-0.2, 1.2)], strict=True):
        x = cos(q1) + 0.8 * cos(q1 + q2)
        y = sin(q1) + 0.8 * sin(q1 + q2)
        first, second = two_links(x, y, 0.81)
        assert float(row["q.one"]) == pytest.approx(first - 2e-3, abs=1e-8)
        assert float(row["q.two"]) == pytest.approx(second, abs=1e-8)
    assert float(read_table(offsets)[0]["after.position"]) < 1e-9
    # The written file is a valid table of commands.
    again = read_commands(out, load_robot(robot))
    assert again.ids == ("a", "b")
    found = json.loads((tmp_path / "j.json").read_text())["error"]
    assert found["expected"]["position"] == pytest.approx(3**0.5 * 4e-5)
    assert found["before"]["position"] > 8e-3 > 1e-8 > found["after"]["position"]


def test_compensated_joints_are_within_their_limits(tmp_path, run):
    """The second joint is at its limit, so the first joint minimises the error."""
    text = LONGER.replace("position = 0.5", "position = 0.5\nlimits = [0.0, 0.9]")
    robot, table = written(tmp_path, text, ["a,0.3,0.9"])
    found = compensate(read_commands(table, load_robot(robot)))
    assert found.commands[0, 1] == 0.9
    assert found.limited[0]
    # smallest distance from the target for all angles of the first joint
    x, y = cos(0.3) + 0.8 * cos(1.2), sin(0.3) + 0.8 * sin(1.2)
    reach = np.hypot(1 + 0.81 * cos(0.9), 0.81 * sin(0.9))
    assert np.linalg.norm(found.after[0, 3:]) == pytest.approx(
        abs(reach - np.hypot(x, y)), rel=1e-3
    )


def test_registration_is_compensated_only_on_request(tmp_path):
    shift = '[[effect]]\nname = "registration"\nparameters = { "base.tx" = 1e-3 }\n'
    robot, table = written(tmp_path, ARM + shift, ["a,0.3,0.9"])
    targets = read_commands(table, load_robot(robot))
    assert np.abs(compensate(targets).offsets).max() < 1e-12
    found = compensate(targets, as_read=True)
    assert found.before[0, 3] == pytest.approx(-1e-3)
    assert np.abs(found.after[0, 3:]).max() < 1e-9


def test_spread_includes_tolerances_and_fitted_parameters(tmp_path):
    """The standard deviation of a zero error is 1e-4 rad."""
    text = ARM.replace(
        'name = "one"', 'name = "one"\ntolerance = [0, 0, 1e-4, 0, 0, 0]'
    )
    wave = """[[effect]]
name = "function"
where = "one"
components = ["rz"]
variables = ["q.one"]
form = "waves"
parameters = { "1.sine" = 1e-4 }
std = { "1.sine" = 2e-4 }
"""
    robot, table = written(tmp_path, text + wave, ["a,0.3,0.9"])
    found = compensate(read_commands(table, load_robot(robot)))
    reach = np.hypot(1 + 0.8 * cos(0.9), 0.8 * sin(0.9))
    expected = reach * np.hypot(1e-4, 2e-4 * sin(0.3))
    assert np.linalg.norm(found.spread[0, 3:]) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", ["arm6", "delta", "hexapod"])
def test_compensated_machine_reaches_its_target(name, tmp_path):
    """The machine is simulated independently.  The residual is of second order."""
    robot = without_clearance(load_robot(name))
    drives = [f for f in robot.frames if f.actuated]
    size = {"revolute": 2e-4, "prismatic": 1e-4}
    hidden = {f.name: size[f.joint] * (-1) ** i for i, f in enumerate(drives)}
    rng = np.random.default_rng(3)
    reach = {"revolute": 0.1, "prismatic": 0.01}
    head = ",".join(["id", *(f"q.{f.name}" for f in drives)])
    q = [[f.position + reach[f.joint] * rng.uniform(-1, 1) for f in drives]
         for _ in range(4)]  # fmt: skip
    (tmp_path / "targets.csv").write_text("\n".join([head, *table_rows(q)]) + "\n")
    corrected = replace(robot, effects={"encoder_offset": hidden})
    write_robot(corrected, tmp_path / "corrected.toml")
    targets = read_commands(
        tmp_path / "targets.csv", load_robot(tmp_path / "corrected.toml")
    )
    found = compensate(targets)
    effects = [Hidden("encoder_offset", hidden)]
    wanted = targets.coordinates
    before = distances(robot, effects, targets, wanted, program="springs")
    after = distances(robot, effects, targets, found.coordinates, program="springs")
    assert before.max() > 1e-4
    assert after.max() < 1e-6


SLIDE = """
name = "slide"
platform = "head"
[[frame]]
name = "carriage"
parent = "base"
translation = [0, 0, 1.0]
joint = "prismatic"
actuated = true
[[frame]]
name = "head"
parent = "carriage"
translation = [0.2, 0, 0]
[[effect]]
name = "function"
where = "carriage"
components = ["tz"]
variables = ["q.carriage"]
form = "powers"
parameters = { "0" = OFF }
"""


@pytest.mark.parametrize("off", [2e11, -5.0, 1e-3])
def test_correction_larger_than_the_robot_is_not_applied(off, tmp_path, run):
    """The function displaces a prismatic joint by metres."""
    robot, table = written(
        tmp_path, SLIDE.replace("OFF", repr(off)), ["a,0.3"], "id,q.carriage"
    )
    out, answer = tmp_path / "out.csv", tmp_path / "out.json"
    code, text, error = run("validation", "compensate", robot, table, "-o", out,
                            "--json", answer)  # fmt: skip
    assert error == ""
    (row,) = read_table(out)
    told = json.loads(answer.read_text())["without_answer"]
    if abs(off) < 1:
        assert (code, told) == (0, [])
        assert float(row["q.carriage"]) == pytest.approx(0.3 - off, abs=1e-9)
        return
    assert code == 1
    assert float(row["q.carriage"]) == 0.3
    ((label, reason),) = [one.values() for one in told]
    assert label == "a"
    assert "the robot's size" in reason
    assert reason in text
