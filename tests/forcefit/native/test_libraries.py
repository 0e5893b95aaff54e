"""Libraries of C++: compiled once, by whoever asks, and never out of date."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from assembly.linear.lanes import FEW_LANES, SOURCE
from forcefit.native import libraries
from forcefit.native.libraries import by_numba, load_library

needs_compiler = pytest.mark.skipif(
    load_library(SOURCE) is None, reason="no C++ compiler"
)


def test_a_compiler_that_fails_is_asked_once(tmp_path, monkeypatch):
    asked = []

    def fail(command, **options):
        asked.append(next(word for word in command if word.endswith(".cpp")))
        raise subprocess.CalledProcessError(1, command)

    monkeypatch.setattr(shutil, "which", lambda name: sys.executable)
    monkeypatch.setattr(libraries, "folder_of_compiled", lambda: tmp_path)
    monkeypatch.setattr(libraries.subprocess, "run", fail)
    for _ in range(2):
        libraries._library.cache_clear()
        assert load_library(SOURCE) is None
    libraries._library.cache_clear()
    assert str(libraries._ROOT / SOURCE) in asked
    assert len(set(asked)) == len(asked)
    assert {note.suffix for note in tmp_path.iterdir()} == {".failed"}


def test_a_compiler_that_is_stopped_is_asked_again(tmp_path, monkeypatch):
    """Ctrl-C while it works says nothing of the compiler."""

    def stop(command, **options):
        raise subprocess.CalledProcessError(-2, command)

    monkeypatch.setattr(shutil, "which", lambda name: sys.executable)
    monkeypatch.setattr(libraries, "folder_of_compiled", lambda: tmp_path)
    monkeypatch.setattr(libraries.subprocess, "run", stop)
    libraries._library.cache_clear()
    try:
        assert load_library(SOURCE) is None
    finally:
        libraries._library.cache_clear()
    assert list(tmp_path.iterdir()) == []


@needs_compiler
def test_a_library_of_another_source_is_not_used(tmp_path, monkeypatch):
    """A file of the right name that says it was made from something else."""
    made = Path(load_library(SOURCE)._name)
    monkeypatch.setattr(libraries, "folder_of_compiled", lambda: tmp_path)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(libraries, "digest_of", lambda source: "0" * 16)
    shutil.copy(made, tmp_path / f"lanes.{'0' * 16}.so")
    libraries._library.cache_clear()
    try:
        assert load_library(SOURCE) is None
    finally:
        libraries._library.cache_clear()


def test_no_command_waits_for_what_is_not_needed(monkeypatch):
    """Two lanes are compiled by whoever asks for it, and never on the way."""
    monkeypatch.setattr(libraries, "_compile", None)
    libraries._at_hand.cache_clear()
    monkeypatch.setattr(libraries, "_kept_at", lambda source: ("0", Path("nowhere")))
    assert libraries.library_at_hand(FEW_LANES) is None
    libraries._at_hand.cache_clear()
    with by_numba():
        assert libraries.library_at_hand(FEW_LANES) is None
