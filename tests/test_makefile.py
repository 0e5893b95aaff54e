"""``make`` creates a virtual environment with the requested Python version."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
OWN = "{}.{}".format(*sys.version_info[:2])
pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make")


def commands(folder, *stamps):
    """Return the commands of ``make test`` if ``.venv`` contains given stamp files."""
    for name in ("Makefile", "pyproject.toml", "CMakeLists.txt"):
        shutil.copyfile(ROOT / name, folder / name)
    (folder / ".venv").mkdir()
    for stamp in stamps:
        (folder / ".venv" / stamp).touch()
    # variables of an outer make that runs this test are removed
    outer = ("MAKEFLAGS", "MAKEOVERRIDES", "MFLAGS", "PYTHON", "VENV")
    own = {name: value for name, value in os.environ.items() if name not in outer}
    return subprocess.run(
        ["make", "-n", "test", f"PYTHON={sys.executable}"],
        capture_output=True, text=True, cwd=folder, check=True, env=own,
    ).stdout  # fmt: skip


@pytest.mark.parametrize("stamp", ["ready", "ready-3.9", "unfinished"])
def test_environment_of_a_different_python_is_recreated(tmp_path, stamp):
    assert f"{sys.executable} -m venv --clear .venv" in commands(tmp_path, stamp)


def test_environment_is_reused_if_the_python_version_is_unchanged(tmp_path):
    found = commands(tmp_path, f"empty-{OWN}", f"ready-{OWN}")
    assert "venv --clear" not in found
    assert "pip install" not in found
    assert "pytest" in found


def test_package_is_rebuilt_if_its_sources_are_newer(tmp_path):
    found = commands(tmp_path, f"empty-{OWN}")
    assert "venv --clear" not in found
    assert "pip install" in found


@pytest.mark.skipif(shutil.which("sh") is None, reason="no shell")
def test_newest_python_runs_and_is_listed_in_pyproject():
    found = subprocess.run(
        ["sh", ".ci/newest_python"], capture_output=True, text=True, cwd=ROOT,
        check=True,
    ).stdout.strip()  # fmt: skip
    said = subprocess.run([found, "--version"], capture_output=True, text=True,
                          check=True).stdout  # fmt: skip
    version = said.split()[1].rpartition(".")[0]
    named = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert found == "python3" or f"Python :: {version}" in named
