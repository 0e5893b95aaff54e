"""Stub file of public names for editors and type checkers."""

import os
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
import typer

import forcefit as ff
from forcefit.commands.app import app
from tests.test_readme import python_example

ROOT = Path(__file__).parents[2]
STUB = ROOT / "forcefit/__init__.pyi"


def import_of(owner, names):
    """Return an import statement in the format of ruff."""
    line = f"from {owner} import {', '.join(names)}\n"
    if len(line) < 90:
        return line
    return f"from {owner} import (\n" + "".join(f"    {n},\n" for n in names) + ")\n"


def stub_of(owners):
    """Return the stub file that corresponds to the table of public names."""
    imports = [import_of(owner, names) for owner, names in owners.items()]
    public = "".join(f'    "{name}",\n' for name in ff.__all__)
    return (
        '"""Public names for editors and type checkers, as in ``__init__.py``."""\n'
        "\n" + "".join(sorted(imports)) + f"\n__all__ = [\n{public}]\n\n"
        "__version__: str\n"
    )


def test_stub_file_agrees_with_public_names():
    """To update the stub file, run python -m tests.forcefit.test_public_names."""
    assert STUB.read_text(encoding="utf-8") == stub_of(ff._OWNERS)


def commands_of(group, before=()):
    """Yield the names of all commands."""
    for name, one in group.commands.items():
        if hasattr(one, "commands"):
            yield from commands_of(one, (*before, name))
        else:
            yield " ".join((*before, name))


def test_reference_lists_functions_of_every_command():
    """Public functions are listed without a module, other functions with one."""
    page = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    table = page.partition("## Commands and their functions")[2]
    rows = re.findall(r"^\| `([\w ]+)` \| (.*) \|$", table, flags=re.MULTILINE)
    others = re.findall(r"`([\w ]+)`", table.rpartition("|\n")[2])
    commands = sorted(commands_of(typer.main.get_command(app)))
    assert sorted([name for name, _ in rows] + others) == commands
    for _, cell in rows:
        functions = re.findall(r"`(\w+)`(?: in `([\w.]+)`)?", cell)
        assert functions
        for name, module in functions:
            assert name in ff.__all__ or callable(
                getattr(import_module(module), name)
            ), name


def checked(checker, folder, code):
    """Return the exit status and output of a type checker for some user code."""
    file = folder / "users_lines.py"
    file.write_text(code, encoding="utf-8")
    command = {
        "mypy": ["mypy", "--config-file=", "--python-executable", sys.executable],
        "pyright": ["pyright", "--pythonpath", sys.executable],
    }[checker]
    found = {"PYTHONPATH": str(ROOT), "MYPYPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", *command, str(file)], capture_output=True, text=True,
        env=os.environ | found, cwd=folder, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("checker", ["mypy", "pyright"])
def test_type_checkers_know_the_public_names(checker, tmp_path):
    if find_spec(checker) is None:
        pytest.skip(f"no {checker}")
    code = python_example()
    status, said = checked(checker, tmp_path, code)
    assert status == 0, said
    status, said = checked(checker, tmp_path, code.replace("zone_margin", "zone_marg"))
    assert status == 1
    assert "zone_marg" in said
    # the type of an attribute is known: an energy is a number
    status, said = checked(checker, tmp_path, code + "forced.energy.upper()\n")
    assert status == 1
    assert "upper" in said


if __name__ == "__main__":
    STUB.write_text(stub_of(ff._OWNERS), encoding="utf-8")
