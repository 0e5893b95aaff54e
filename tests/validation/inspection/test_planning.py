"""Test the planning of campaigns."""

import json

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.robots import load_robot
from forcefit.validation.campaign.campaign_file import read_commands
from forcefit.validation.inspection.planning import _Criterion
from tests.campaigns_for_tests import ARM, read_table
from tests.robots_for_tests import with_frames

ROWS = 30


def blocks(seed=0):
    """Return random columns of three effects with one, two and one unknown."""
    rng = np.random.default_rng(seed)
    return [rng.normal(size=(2 * ROWS, k)) for k in (1, 2, 1)]


def test_non_centrality_of_two_effects_equals_schur_complement():
    """For one unknown each, it is a'a - (a'b)^2 / (b'b + 1)."""
    a, _, b = blocks()
    apart = _Criterion(blocks(), ROWS).apart(np.arange(ROWS))
    expected = float((a.T @ a - (a.T @ b) ** 2 / (b.T @ b + 1)).item())
    assert apart[0, 2] == pytest.approx(expected)
    assert np.isnan(np.diag(apart)).all()


def test_plan_command_writes_a_campaign_without_readings(tmp_path, run):
    robot = tmp_path / "arm.toml"
    robot.write_text(ARM)
    folder, answer = tmp_path / "plan", tmp_path / "plan.json"
    code, text, _ = run("validation", "plan", str(robot), "--rows", "12",
                        "-o", str(folder), "--json", str(answer))  # fmt: skip
    assert code == 0
    assert "12 rows" in text
    rows = read_table(folder / "measurements.csv")
    assert len(rows) == 12
    assert {row["meas.tx"] for row in rows} == {""}
    time = [float(row["cov.time"]) for row in rows]
    assert time == sorted(time)
    again = read_commands(folder, read_robot(robot))
    assert (len(again), again.cells.any()) == (12, False)
    pairs = json.loads(answer.read_text())["pairs"]
    told = {k: sum(np.log1p(p[k]) for p in pairs) for k in ("planned", "random")}
    assert told["planned"] > told["random"]


@pytest.mark.parametrize(("option", "value", "says"), [
    ("--rows", "7", "--rows: found 7, expected at least 8"),
    ("--position", "0", "--position: found 0, expected a finite number > 0 [m]"),
    ("--temperature", "hot", 'temperature: found "hot", expected swing'),
])  # fmt: skip
def test_plan_command_rejects_invalid_options(tmp_path, rejected, option, value, says):
    robot = tmp_path / "arm.toml"
    robot.write_text(ARM)
    folder = tmp_path / "plan"
    assert says in rejected("validation", "plan", robot, option, value, "-o", folder)
    assert not folder.exists()


@pytest.mark.slow
def test_plan_command_rejects_a_loop_that_requires_clearance(tmp_path, rejected):
    """The robot is a rigid planar four-bar linkage with a twisted coupler."""
    twist = np.array([1e-5, 0, 0, 0, 0, 0])
    robot = with_frames(
        load_robot("four_bar"), bool, link=None, joint_stiffness=None,
        geometric_error=lambda f: twist * (f.name == "middle"),
    )  # fmt: skip
    file = tmp_path / "rigid.toml"
    write_robot(robot, file)
    folder = tmp_path / "plan"
    message = rejected("validation", "plan", file, "--rows", "12", "-o", folder)
    assert not folder.exists()
    assert "found no effect that changes the readings if all clearances" in message
