"""Random invalid input: every command works or prints a one-line message.

For thousands of inputs to all commands, run ``python benchmarks/fuzz.py``.
"""

import os
import signal
import tempfile

import pytest

from benchmarks.fuzz import Asked, one, options_of
from benchmarks.fuzz_foreign import FOREIGN, write_foreign
from benchmarks.fuzz_machines import MACHINES, write_machines
from benchmarks.fuzz_seeds import COMMANDS, write_seeds

# fast commands that do not depend on the output of another command
QUICK = (
    "assembly solve bar.toml --quantities", "assembly solve rounded", "convert bar.sdf",
    "convert tied", "stiffness beam", "stiffness convert long",
    "validation import", "validation inspect campaign",
)  # fmt: skip


@pytest.fixture
def sound_files(tmp_path, monkeypatch):
    """Return a folder of valid input files, and restore the signal handlers."""
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


def test_damaged_input_has_a_one_line_message_and_no_output(sound_files):
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
