"""Fixtures and settings of all tests."""

import os

# This must be set before numpy is imported.  For small matrices, additional threads
# would double the processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import typer
from hypothesis import settings

from forcefit.commands import app as command
from tests.schemas_for_tests import check_schema

# The option parser is created only once, which saves time in a thousand tests.
typer.main.get_command = cache(typer.main.get_command)

# Every run uses the same random examples, so that a failure is due to a change.
# For new examples, run: pytest --hypothesis-profile search --hypothesis-seed N
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("search", derandomize=False)
settings.load_profile("repeatable")


@pytest.fixture
def rng() -> np.random.Generator:
    """Return a random generator with a fixed seed."""
    return np.random.default_rng(20)


@pytest.fixture
def write_file(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """Return a function that writes a robot file and returns its path."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "robot.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture
def rejected(run):
    """Run a command that must be rejected without output: its error message."""

    def call(*words):
        status, out, err = run(*words)
        assert (status, out) == (2, "")
        assert "Traceback" not in err
        return err.strip()

    return call


@pytest.fixture
def run(capsys, monkeypatch):
    """Return a function that runs ``forcefit`` in this process.

    The function returns the exit status, standard output and standard error.
    """

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["forcefit", *map(str, words)])
        # keeps the warning filters of pytest
        monkeypatch.setattr(sys, "warnoptions", ["default"])
        with pytest.raises(SystemExit) as done:
            command.main()
        out, err = capsys.readouterr()
        if done.value.code in {0, 1}:
            check_schema(tuple(sys.argv[1:]), out)  # argv contains the new names
        return done.value.code, out, err

    return call
