"""The command ``validation crosscheck``: keys, exit statuses, refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Clearance
from forcefit.commands.validation import app
from forcefit.inputs.table import BadInput
from tests.mutations_for_tests import MUTATIONS
from tests.robots_for_tests import coaxial_beams

pytestmark = pytest.mark.exudyn


def test_readme_example_compares_a_draw_of_errors(tmp_path):
    """The errors of the file replace the robot's; the seed selects the draw."""
    target, root = tmp_path / "check.json", Path(__file__).parents[3]
    example = root / "examples" / "irsbot2_errors.toml"
    outcome = "validation crosscheck irsbot2 --errors examples/irsbot2_errors.toml"
    assert outcome in (root / "README.md").read_text(encoding="utf-8")
    words = ["irsbot2", "--errors", str(example), "--pose", "tx=0,tz=-0.5"]
    outcome = run(*words, "--scale", "1,0.5,0.25", "--json", str(target))
    assert outcome.exit_code == 0, outcome.output
    table = json.loads(target.read_text())
    assert {check["verdict"] for check in table["checks"].values()} == {"ok"}
    assert table["scales"][0]["vjm"]["energy"] > 0.1
    again = run(*words, "--scale", "1,0.5,0.25", "--seed", "2", "--json", "-")
    other = json.loads(again.output)["scales"][0]["vjm"]["energy"]
    assert other != table["scales"][0]["vjm"]["energy"]


def run(*arguments):
    return CliRunner().invoke(app, ["crosscheck", *arguments])


def test_crosscheck_writes_the_public_keys(tmp_path):
    target = tmp_path / "check.json"
    picture = tmp_path / "slope.png"
    outcome = run("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100",
               "--scale", "1,0.5", "--json", str(target),
               "--figure", str(picture))  # fmt: skip
    assert outcome.exit_code == 0, outcome.output
    assert "passed" in outcome.output
    table = json.loads(target.read_text())
    assert table["passed"] is True
    assert table["slope"] == pytest.approx(2.0, abs=0.1)
    assert [entry["scale"] for entry in table["scales"]] == [1.0, 0.5]
    entry = table["scales"][0]
    for side in ("vjm", "multibody", "difference"):
        assert len(entry[side]["platform_screw"]) == 6
        assert isinstance(entry[side]["energy"], float)
        assert len(entry[side]["links"]["leg1.link_a"]) == 6
    a, b, d = (entry[s]["energy"] for s in ("vjm", "multibody", "difference"))
    assert d == pytest.approx(b - a)
    assert picture.stat().st_size > 1000


def test_crosscheck_keeps_clearances_on_request(tmp_path):
    """Springs in series whose misfit is larger than the clearance between them."""
    target, file = tmp_path / "check.json", tmp_path / "robot.toml"
    gap = np.array([0, 0, 0, 2e-4, 1e-4, 5e-5])
    loose = Clearance(radial=2e-5, axial=1e-5)
    write_robot(coaxial_beams(gap, clearance=loose), file)
    outcome = run(str(file), "--with-clearance", "--scale", "0.5,0.25", "--json",
                  str(target))  # fmt: skip
    assert outcome.exit_code == 0, outcome.output
    table = json.loads(target.read_text())
    assert table["passed"] is True
    assert table["slope"] is None
    assert [entry["scale"] for entry in table["scales"]] == [0.5, 0.25]
    assert len(table["optimality_gaps"]) == 2 + len(table["added_scales"])
    refused = run(str(file), "--with-clearance", "--figure", "slope.png")
    assert isinstance(refused.exception, BadInput)


def test_failed_crosscheck_has_exit_status_1(monkeypatch):
    MUTATIONS["lever arm missing"](monkeypatch)
    outcome = run("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100")
    assert outcome.exit_code == 1
    assert "FAIL" in outcome.output or "cannot" in outcome.output


@pytest.mark.parametrize(("name", "message"), [
    ("slope.txt", "expected a picture: .png or .svg or .pdf"),
    ("no/such/folder/slope.png", "no/such/folder; expected an existing"),
])  # fmt: skip
def test_crosscheck_refuses_a_figure_that_cannot_be_written(name, message, tmp_path):
    outcome = run("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100",
               "--scale", "1,0.5", "--figure", str(tmp_path / name))  # fmt: skip
    assert isinstance(outcome.exception, BadInput)
    assert message in str(outcome.exception)


@pytest.mark.parametrize("text", ["1", "1,1", "1,0", "1;0.5", "1,nan"])
def test_crosscheck_refuses_wrong_scales(text):
    outcome = run("irsbot2", "--scale", text)
    assert isinstance(outcome.exception, BadInput)
    assert f'--scale: found "{text}", expected at least two' in str(outcome.exception)
