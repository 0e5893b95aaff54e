"""Help texts: options in groups."""

import re

import pytest
import typer

from forcefit.commands import app as command
from forcefit.commands.help import GROUPS


def leaves(group, words=()):
    """Yield the words and the object of each command."""
    for name, inner in getattr(group, "commands", {}).items():
        yield from leaves(inner, (*words, name))
    if not hasattr(group, "commands"):
        yield words, group


COMMANDS = dict(leaves(typer.main.get_command(command.app)))


def titles_of_options(out):
    """Return the titles of the groups that list each long option in a help text."""
    titles, title = {}, None
    for line in out.splitlines():
        if re.fullmatch(r"\S.*:", line):
            title = line[:-1]
        elif title and (option := re.match(r"  (?:-\w, )?(--[\w-]+)", line)):
            titles.setdefault(option[1], []).append(title)
    return titles


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_help_lists_every_option_in_one_group(run, words):
    _, out, _ = run(*words, "--help")
    found = titles_of_options(out)
    declared = {max(p.opts, key=len) for p in COMMANDS[words].params
                if p.param_type_name == "option"}  # fmt: skip
    assert set(found) == declared | {"--help"}
    assert all(len(titles) == 1 for titles in found.values())
    assert {one[0] for one in found.values()} <= {"What", *GROUPS}


def test_every_name_in_a_group_is_an_option():
    """An option that is removed must also be removed from the table of groups."""
    declared = {
        name for one in COMMANDS.values() for p in one.params for name in p.opts
    }
    grouped = {f"--{name}" for names in GROUPS.values() for name in names.split()}
    assert grouped <= declared | {"--help"}
