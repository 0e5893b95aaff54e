"""File locks, and operating systems without POSIX modules."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from forcefit.inputs.locking import locked_file

ROOT = Path(__file__).parents[3]


def test_locked_file_raises_an_error_until_released(tmp_path):
    """The lock is effective within a single process."""
    path = tmp_path / "map.nc.journal"
    with locked_file(path):
        with pytest.raises(BlockingIOError), locked_file(path, wait=False):
            pass
        assert path.exists()
    with locked_file(path, wait=False):
        path.unlink()
    assert list(tmp_path.iterdir()) == []


WITHOUT_POSIX = """
import os, sys, warnings
for module in ("fcntl", "resource", "pwd", "grp", "termios", "readline"):
    sys.modules[module] = None
for name in ("fork", "forkpty", "getuid", "killpg", "mkfifo", "sysconf"):
    delattr(os, name)
warnings.simplefilter("ignore")  # filelock's: there is no lock of the system
"""
COMMAND = """
from forcefit.commands.app import main
main()
"""


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(
            "assembly sweep irsbot2 --grid tx=0:0.1:0.1,tz=-0.5 -o {}.nc --csv {}.csv",
            marks=pytest.mark.slow,
        ),
        "assembly solve irsbot2 --pose tx=0.1,tz=-0.5 --json {}.json",
    ],
)
def test_commands_run_without_posix_modules(tmp_path, words):
    """Results are equal without the modules and functions that Windows lacks.

    The modules are hidden in the main process only.
    """
    search = {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    answers = []
    for name, before in (("a", WITHOUT_POSIX), ("b", "")):
        ran = subprocess.run(
            [sys.executable, "-c", before + COMMAND, *words.format(name, name).split()],
            cwd=tmp_path, env=os.environ | search, capture_output=True, text=True,
        )  # fmt: skip
        answers.append((ran.returncode, ran.stdout.replace(f"{name}.", "*.")))
    assert answers[0] == answers[1]
    assert answers[0][0] == 0
    written = [p.suffix for p in tmp_path.iterdir() if p.stem in {"a", "b"}]
    assert all(written.count(suffix) == 2 for suffix in written)
