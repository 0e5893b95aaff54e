"""What several test files need."""

import os

# before numpy: on matrices as small as these a second thread only waits, but busily,
# and the tests take twice the processor time
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

# a command is the same whenever it is called: its options are read from the signatures
# once, not in each of a thousand tests
typer.main.get_command = cache(typer.main.get_command)

# The same cases in every run: a commit is judged by what it changes, not by luck.
# Others, on purpose: pytest --hypothesis-profile search --hypothesis-seed N
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("search", derandomize=False)
settings.load_profile("repeatable")


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20)


@pytest.fixture
def write_file(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """A function that writes a robot file and returns its path."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "robot.toml"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture
def run(capsys, monkeypatch):
    """Run the command in this process: exit status, standard output, error output."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["forcefit", *map(str, words)])
        # pytest's own choice of warnings stays
        monkeypatch.setattr(sys, "warnoptions", ["default"])
        with pytest.raises(SystemExit) as done:
            command.main()
        out, err = capsys.readouterr()
        if done.value.code in {0, 1}:
            check_schema(tuple(sys.argv[1:]), out)  # under the present names
        return done.value.code, out, err

    return call
