"""Robot files that ``forcefit new`` writes."""

import json
import sys
import tomllib

import pytest
from jsonschema import Draft202012Validator

from forcefit.assembly.files.new_robot import KINDS
from forcefit.assembly.files.robot_schema import ROBOT_FILE
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.robots import load_robot
from forcefit.results.schema import schema_of

# degrees of freedom of the robot and of the platform, and number of redundant
# constraints, from Merlet, Parallel Robots (2006)
MOBILITY = {
    "UPS": (6, 6, 0), "RUS": (6, 6, 0), "UPU": (3, 3, 0), "PRS": (3, 3, 0),
    "RRR": (3, 3, 6), "delta": (9, 3, 0),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_new_robot_has_mobility_of_the_literature(run, tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    status, out, err = run("new", "mine", "--kind", kind)
    assert (status, err) == (0, "")
    assert "written: mine.toml" in out
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]
    found = mobility(home_posture(load_robot("mine.toml")))
    assert (
        found.freedoms, found.platform_freedoms, found.overconstraint
    ) == MOBILITY[kind]  # fmt: skip
    assert found.platform_freedoms_drives_locked == 0
    status, out, _ = run("assembly", "solve", "mine.toml", "--load", "fz=-50",
                         "--json", "-")  # fmt: skip
    results = json.loads(out)
    assert (status, results["status"]) == (0, "ok")
    assert not results["mobility"]["singular"]
    assert results["platform_screw"][5] < 0  # the platform moves in load direction


@pytest.mark.parametrize("kind", KINDS)
def test_new_robot_file_is_valid_according_to_schema(run, tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    run("new", "mine", "--kind", kind)
    text = (tmp_path / "mine.toml").read_text()
    assert text.startswith("#:schema robot.schema.json\n")
    assert len(text.splitlines()) <= 110
    validator = Draft202012Validator(schema_of(ROBOT_FILE, "robot", file=True))
    assert not list(validator.iter_errors(tomllib.loads(text)))


@pytest.mark.parametrize(("kind", "legs", "expected"), [
    # drives of additional legs are redundant
    ("UPS", 8, (6, 2, 0)), ("RRR", 4, (3, 1, 9)),
    # each leg of a 3-UPU robot constrains one rotation, so that the fourth is redundant
    ("UPU", 4, (3, 1, 1)),
])  # fmt: skip
def test_additional_legs_of_new_robot_are_redundant(
    run, tmp_path, kind, legs, expected
):
    path = tmp_path / "mine.toml"
    assert run("new", path, "--kind", kind, "--legs", legs)[0] == 0
    found = mobility(home_posture(load_robot(path)))
    assert (
        found.freedoms, found.actuation_redundancy, found.overconstraint
    ) == expected  # fmt: skip


def test_new_robot_does_not_overwrite_an_existing_file(run, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("# Written by forcefit.\n")
    status, _, err = run("new", path, "--kind", "RRR")
    assert status == 2
    assert "not overwritten" in err
    assert path.read_text() == "# Written by forcefit.\n"


def test_new_robot_prompts_for_its_type_on_a_terminal(run, tmp_path, monkeypatch):
    answers = iter(["UPU", 4])
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("typer.prompt", lambda *_, **__: next(answers))
    status, out, _ = run("new", tmp_path / "mine")
    assert status == 0
    assert "UPS     Gough platform, UPS, 6 legs" in out
    assert "UPU after Tsai, 4 legs" in (tmp_path / "mine.toml").read_text()
