"""Tests of the command ``validation crosscheck``."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Clearance
from tests.mutations_for_tests import MUTATIONS
from tests.robots_for_tests import coaxial_beams

pytestmark = pytest.mark.exudyn


@pytest.fixture
def check(run):
    """Run a cross-check and return exit status, output and error output."""
    return partial(run, "validation", "crosscheck")


def test_readme_example_reads_errors_from_a_file(check):
    """The errors in the file replace those of the robot."""
    root = Path(__file__).parents[3]
    example = root / "examples" / "irsbot2_errors.toml"
    words = "validation crosscheck irsbot2 --errors examples/irsbot2_errors.toml"
    assert words in (root / "README.md").read_text(encoding="utf-8")
    words = ["irsbot2", "--errors", example, "--pose", "tx=0,tz=-0.5"]
    words += ["--scale", "1,0.5,0.25", "--json", "-"]
    (status, out, _), (_, again, _) = check(*words), check(*words, "--seed", 2)
    assert status == 0
    table = json.loads(out)
    assert {check["verdict"] for check in table["checks"].values()} == {"ok"}
    energy = table["scales"][0]["vjm"]["energy"]
    assert energy > 0.1
    assert json.loads(again)["scales"][0]["vjm"]["energy"] != energy


def test_crosscheck_writes_the_public_keys(check, tmp_path):
    target, picture = tmp_path / "check.json", tmp_path / "slope.png"
    status, out, _ = check("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100",
               "--scale", "1,0.5", "--json", target, "--figure", picture)  # fmt: skip
    assert status == 0
    assert "passed" in out
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


def test_crosscheck_includes_clearances_on_request(check, tmp_path):
    """The misfit of two springs in series exceeds their clearance."""
    file = tmp_path / "robot.toml"
    gap = np.array([0, 0, 0, 2e-4, 1e-4, 5e-5])
    loose = Clearance(radial=2e-5, axial=1e-5)
    write_robot(coaxial_beams(gap, clearance=loose), file)
    words = [file, "--with-clearance"]
    status, out, _ = check(*words, "--scale", "0.5,0.25", "--json", "-")
    assert status == 0
    table = json.loads(out)
    assert table["passed"] is True
    assert table["slope"] is None
    assert [entry["scale"] for entry in table["scales"]] == [0.5, 0.25]
    assert len(table["optimality_gaps"]) == 2 + len(table["added_scales"])
    assert check(*words, "--figure", "slope.png")[0] == 2


def test_failed_crosscheck_has_exit_status_1(check, monkeypatch):
    MUTATIONS["lever arm missing"](monkeypatch)
    status, out, _ = check("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--load", "fz=-100")
    assert status == 1
    assert "FAIL" in out or "cannot" in out


@pytest.mark.parametrize("text", ["1", "1,1", "1,0", "1;0.5", "1,nan"])
def test_crosscheck_rejects_invalid_scales(rejected, text):
    err = rejected("validation", "crosscheck", "irsbot2", "--scale", text)
    assert f'--scale: found "{text}", expected at least two' in err
