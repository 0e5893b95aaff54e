"""Deprecated names of commands and options still work and report the new name."""

import pytest
import typer

from forcefit.commands.app import app
from forcefit.commands.old_names import COMMANDS, OPTIONS, STAY, with_new_names

RENAMED = [
    (command, old, new)
    for command, options in OPTIONS.items()
    for old, new in options.items()
]


def options_of(command):
    """Return the options of a command, and whether each option requires a value."""
    found = typer.main.get_command(app)
    for word in command.split():
        found = found.commands[word]
    options = [one for one in found.params if one.param_type_name == "option"]
    return {name: not one.is_flag for one in options for name in one.opts}


@pytest.mark.parametrize(("old", "new"), COMMANDS.items())
def test_old_command_is_translated_to_an_existing_command(old, new, capsys):
    words = [
        "file",
        "--at",
        "radius=1",
        "--json",
        "-",
    ]  # the look-up requires parameters
    assert with_new_names([*old.split(), *words]) == [*new, *words]
    assert capsys.readouterr().err == f"forcefit: {old} is now {' '.join(new)}\n"
    with pytest.raises((KeyError, AttributeError)):
        options_of(old)
    command = " ".join(new).partition(" --")[0]
    assert {one for one in new if one.startswith("--")} <= set(options_of(command))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (["zone", "five_bar"], ["solve", "five_bar", "--quantities", "margin"]),
        (["exact", "five_bar"], ["solve", "five_bar", "--state", "exact"]),
    ],
)
def test_old_command_has_the_same_result_as_the_new_command(run, old, new):
    status, out, _ = run("assembly", *old, "--json", "-")
    assert (status, out) == run("assembly", *new, "--json", "-")[:2]
    assert '"margin"' in out or '"linearisation_error"' in out


@pytest.mark.parametrize(("command", "old", "new"), RENAMED)
def test_old_option_is_translated_to_an_existing_option(command, old, new, capsys):
    words, present = command.split(), list(COMMANDS.get(command, command.split()))
    joined = f"{old}=value" if old.startswith("--") else f"{old}value"
    found = with_new_names([*words, old, "value", joined, "--json", "-"])
    assert found == [
        *present,
        *new,
        "value",
        *new[:-1],
        f"{new[-1]}=value",
        "--json",
        "-",
    ]
    said = "" if (command, old) in STAY else f"forcefit: {old} is now {' '.join(new)}\n"
    assert capsys.readouterr().err.startswith(said)
    options = options_of(" ".join(present))
    assert old not in options
    assert new[0] in options
    # a new option without a fixed value must accept the value of the old option
    assert len(new) == 1 or options[new[0]]


@pytest.mark.parametrize(("old", "new"), [("free", "margin_free"), ("rigid", "margin")])
def test_old_value_of_compliant_is_translated_to_a_margin_quantity(old, new):
    words = ["assembly", "tolerances", "r.toml"]
    assert with_new_names([*words, "--compliant", old, "free"])[3:] == [
        "--quantities", new, "free"
    ]  # fmt: skip
    assert with_new_names([*words, f"--compliant={old}"])[3:] == [f"--quantities={new}"]


def test_arguments_of_other_commands_are_not_translated(capsys):
    for words in (
        ["assembly", "sweep", "--", "--tangent"],
        ["validation", "validity", "r", "--stiffness"],
    ):
        assert with_new_names(words) == words
    assert capsys.readouterr().err == ""


def test_old_flag_has_the_same_result_as_the_new_option(run):
    words = ["assembly", "stiffness", "four_bar", "--load", "fx=10", "--json", "-"]
    status, new, silent = run(*words, "--state", "exact")
    old_status, old, err = run(*words, "--exact")
    assert (status, silent) == (0, "")
    assert (old_status, old) == (status, new)
    assert err == "forcefit: --exact is now --state exact\n"


def test_library_look_up_requires_parameters(run):
    status, out, err = run("stiffness", "library", "look-up", "folder")
    assert (status, out) == (2, "")
    assert "--at: missing; expected parameters such as" in err


@pytest.mark.parametrize(
    ("old", "new"),
    [("stiffness import", "stiffness convert"), ("assembly zone", "assembly solve")],
)
def test_old_command_has_the_schema_of_the_new_command(run, old, new):
    status, expected, _ = run("schema", *new.split())
    assert status == 0
    assert run("schema", *old.split())[:2] == (0, expected)
