"""JSON Schemas of files and results.

In addition, ``conftest.py`` checks the JSON results in all tests against their schemas.
"""

import copy
import json
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from forcefit.assembly.files.robot_file import robot_of, write_robot
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.table import BadInput, Table
from forcefit.results.outputs import OUTPUTS
from forcefit.results.schema import schema_of

ROOT = Path(__file__).parents[3]
ARM = {
    "platform": "tip",
    "frame": [
        {"name": "drive", "parent": "base", "joint": "revolute", "actuated": True,
         "clearance": {"radial": 1e-5}, "joint_stiffness": [1e6] * 6},
        {"name": "tip", "parent": "drive", "translation": [0.1, 0, 0],
         "link": {"beam": {"radius": 0.01}, "young": 2e11, "poisson": 0.3}},
    ],
}  # fmt: skip
# for each mistake: path of a key, and an invalid value
FAULTS = {
    "key of the file": (("plattform",), "tip"),
    "key of a frame": (("frame", 0, "axis"), [0, 0, 1]),
    "kind of joint": (("frame", 0, "joint"), "universal"),
    "kind of clearance": (("frame", 0, "clearance", "axail"), 1e-5),
    "text for a number": (("frame", 0, "clearance", "radial"), "10 um"),
    "length of a vector": (("frame", 1, "translation"), [0.1, 0]),
    "number for a truth value": (("frame", 0, "actuated"), 1),
    "key of a section": (("frame", 1, "link", "beam", "diameter"), 0.02),
    "kind of effect": (("effect",), [{"name": "self_wieght"}]),
    "frames of a closure": (("closure",), [{"frames": "tip"}]),
}


@pytest.fixture(scope="module")
def validator():
    """Return a function that creates a validator from ``forcefit schema``."""
    from io import StringIO
    from unittest.mock import patch

    from forcefit.commands.schema import schema

    def of(name):
        with patch("sys.stdout", new=StringIO()) as printed:
            schema([name])
        return Draft202012Validator(json.loads(printed.getvalue()))

    return of


def test_schemas_are_valid():
    for content in OUTPUTS.values():
        Draft202012Validator.check_schema(schema_of(content))


def test_robot_files_agree_with_schema(validator):
    robot, checked = validator("robot"), 0
    for path in ROOT.glob("[!.]*/**/*.toml"):
        table = tomllib.loads(path.read_text())
        if "platform" in table and {"frame", "leg", "joint"} & {*table}:
            assert not [*robot.iter_errors(table)], path
            checked += 1
    assert checked > 10


def test_campaign_files_agree_with_schema(validator):
    campaign, checked = validator("campaign"), 0
    for path in ROOT.glob("[!.]*/**/campaign.toml"):
        assert not [*campaign.iter_errors(tomllib.loads(path.read_text()))], path
        checked += 1
    assert checked > 5


@pytest.mark.parametrize("name", BUILT_IN)
def test_written_robot_files_agree_with_schema(name, tmp_path, validator):
    write_robot(BUILT_IN[name](), tmp_path / "robot.toml")
    table = tomllib.loads((tmp_path / "robot.toml").read_text())
    assert not [*validator("robot").iter_errors(table)]


@pytest.mark.parametrize("fault", FAULTS)
def test_schema_and_reader_reject_the_same_mistakes(fault, validator):
    table = copy.deepcopy(ARM)
    robot_of(Table(copy.deepcopy(table), "robot.toml", ""), "arm")
    assert not [*validator("robot").iter_errors(table)]
    (*places, key), value = FAULTS[fault]
    inner = table
    for place in places:
        inner = inner[place]
    inner[key] = value
    assert [*validator("robot").iter_errors(table)]
    with pytest.raises(BadInput):
        robot_of(Table(table, "robot.toml", ""), "arm")


def test_schema_command_lists_and_suggests_names(run):
    assert run("schema")[1].split("\n")[:3] == ["robot", "campaign", "assembly solve"]
    assert run("schema", "assembly", "sovle")[::2] == (
        2, 'forcefit: schema: found "assembly sovle"; did you mean "assembly solve"?\n'
    )  # fmt: skip
    described = json.loads(run("schema", "assembly", "error")[1])["properties"]
    assert described["energy"]["description"].endswith("[J]")


def test_every_command_with_json_has_a_schema():
    import typer.main

    from forcefit.commands.app import app

    def commands(group, above=()):
        for name, command in group.commands.items():
            if hasattr(command, "commands"):
                yield from commands(command, (*above, name))
            elif not command.hidden and any(p.name == "json" for p in command.params):
                yield " ".join((*above, name))

    assert {*commands(typer.main.get_command(app))} == {*OUTPUTS}


@pytest.mark.parametrize("words", [
    ("crosscheck", "four_bar", "--grid", "tx=3:4:1"),
    ("crosscheck", "four_bar", "--pose", "tx=0.2", "--load", "fx=1e9"),
    ("validity", "four_bar", "--grid", "q.crank=0:0.1:0.1", "--load", "fx=10"),
])  # fmt: skip
def test_results_of_failed_points_agree_with_schema(run, words):
    """The fixture ``run`` checks the results against their schema."""
    assert run("validation", *words, "--json", "-")[0] in {0, 1}
