"""Damaged files and words: every command works, or prints one line with the reason.

Thousands, of every command: ``python benchmarks/fuzz.py``.
"""

import os
import signal
import tempfile

import pytest

from benchmarks.fuzz import Asked, one, options_of
from benchmarks.fuzz_foreign import FOREIGN, write_foreign
from benchmarks.fuzz_machines import MACHINES, write_machines
from benchmarks.fuzz_seeds import COMMANDS, write_seeds

# quick ones, that read no file which another command makes
QUICK = (
    "assembly solve bar.toml --quantities", "assembly solve rounded", "convert bar.sdf",
    "convert tied", "stiffness beam", "stiffness convert long",
    "validation import", "validation inspect campaign",
)  # fmt: skip


@pytest.fixture
def sound_files(tmp_path, monkeypatch):
    """A folder of sound files; what an input changes of the process is restored."""
    folder = tmp_path / "sound"
    folder.mkdir()
    write_seeds(folder)
    write_foreign(folder)
    write_machines(folder)
    (tmp_path / "sound.inputs").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TMPDIR", os.environ.get("TMPDIR", tempfile.gettempdir()))
    monkeypatch.setattr(tempfile, "tempdir", None)
    handlers = {s: signal.getsignal(s) for s in (signal.SIGPROF, signal.SIGINT)}
    yield folder
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_damaged_inputs_are_refused_in_one_line_and_leave_no_file(sound_files):
    commands = [
        (weight, command) for weight, command in [*COMMANDS, *FOREIGN, *MACHINES]
        if command.startswith(QUICK)
    ]  # fmt: skip
    asked = Asked(34, options_of(), commands, [])
    wrong = {}
    for number in range(150):
        result = one(number, asked, sound_files)
        if result["wrong"]:
            wrong[number] = result["words"], result["done"], result["wrong"]
    assert not wrong
