"""Journals of sweeps: interruption, damage and resumption."""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from forcefit import BadInput, load_robot
from forcefit.assembly.sweeps import identity
from forcefit.assembly.sweeps.identity import question_hash
from forcefit.assembly.sweeps.journal import open_journal
from forcefit.assembly.sweeps.parameters import load_design
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question, record_type
from forcefit.assembly.sweeps.sweep import (
    journal_path,
    run_sweep,
    solve_here,
    sweep_in_memory,
)
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid

ROOT = Path(__file__).parents[3]


def small_sweep(grid="tx=-0.04:0.04:0.02,ty=0.10:0.14:0.02", **options):
    """Return a sweep of a five-bar robot over 15 postures, in blocks of 4."""
    robot = load_robot("five_bar")
    targets = grid_targets(parse_grid(grid, robot))
    question = Question(robot, None, (), targets.names, **options)
    return Sweep(question, targets, block_size=4)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return a sweep, its file and its complete journal."""
    sweep, path = small_sweep(), tmp_path_factory.mktemp("whole") / "map.nc"
    kept = {}

    def keep(done, _):
        kept[done] = journal_path(path).read_bytes()

    run_sweep(sweep, path, keep)
    assert not journal_path(path).exists()
    return sweep, path.read_bytes(), kept


def kept_blocks(sweep, path):
    """Return the indices of finished blocks in a journal."""
    kind = record_type(sweep.question)
    with open_journal(path, sweep.identity, kind) as journal:
        return sorted(journal.places)


def go_on(sweep, folder, journal):
    """Resume a sweep from a journal, and return its file and the number of solved
    points.
    """
    path, solved = folder / "map.nc", []
    journal_path(path).write_bytes(journal)

    def solve(sweep, blocks):
        solved.extend(blocks)
        return solve_here(sweep, solved)

    run_sweep(sweep, path, solve=solve)
    return path.read_bytes(), solved


def test_truncated_journal_contains_all_complete_blocks(whole, tmp_path):
    """The file is truncated at many different positions."""
    sweep, _, kept = whole
    sizes = [len(journal) for journal in kept.values()]
    journal, path = kept[15], tmp_path / "map.nc.journal"
    first_line = journal.index(b"\n") + 1
    for cut in [*range(0, first_line, 7), *range(first_line, len(journal) + 1, 3)]:
        path.write_bytes(journal[:cut])
        whole_blocks = sum(size <= cut for size in sizes[1:])
        assert kept_blocks(sweep, path) == list(range(whole_blocks))
        assert path.stat().st_size == max(s for s in sizes if s <= max(cut, sizes[0]))


@pytest.mark.parametrize("done", [0, 4, 12, 15])
def test_resumed_sweep_writes_the_same_file(whole, tmp_path, done):
    sweep, expected, kept = whole
    torn = kept[done] + (kept[15][len(kept[done]) :][:50] if done < 15 else b"")
    found, solved = go_on(sweep, tmp_path, torn)
    assert found == expected
    assert solved == list(range(-(-done // 4), 4))


def test_flipped_bit_in_a_journal_invalidates_only_its_record(whole, tmp_path):
    """The flipped bits are in the first line, in block indices, in lengths and in
    records.
    """
    sweep, expected, kept = whole
    journal, first_line = kept[15], kept[15].index(b"\n") + 1
    ends = [len(content) for content in kept.values()]
    path = tmp_path / "map.nc.journal"
    heads = [place for end in ends[:-1] for place in range(end, end + 40)]
    for place in [*range(0, first_line, 5), *heads, *range(first_line, ends[-1], 97)]:
        spoilt = bytearray(journal)
        spoilt[place] ^= 1 << (place % 8)
        path.write_bytes(spoilt)
        left = [b for b in range(4) if not ends[b] <= place < ends[b + 1]]
        assert kept_blocks(sweep, path) == left
        assert path.read_bytes()[:first_line] == journal[:first_line]
    assert go_on(sweep, tmp_path, bytes(spoilt)) == (expected, [3])


def test_block_changed_during_the_sweep_is_rejected_with_one_message(whole, tmp_path):
    sweep, expected, _ = whole
    path = tmp_path / "map.nc"

    def spoil(done, total):
        if done == total:
            content = bytearray(journal_path(path).read_bytes())
            content[-3] ^= 8
            journal_path(path).write_bytes(content)

    with pytest.raises(BadInput, match="block 3 was changed during the sweep"):
        run_sweep(sweep, path, spoil)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.nc.journal"]
    run_sweep(sweep, path)
    assert path.read_bytes() == expected


def test_simultaneous_run_with_the_same_file_is_rejected(whole, tmp_path):
    """The first run is not affected."""
    sweep, expected, _ = whole
    path, said = tmp_path / "map.nc", []

    def begin_again(done, _):
        if done == 8:
            with pytest.raises(BadInput) as error:
                run_sweep(sweep, path)
            said.append(str(error.value))

    run_sweep(sweep, path, begin_again)
    assert said[0].startswith(f"{path}.journal: another process uses this journal; ")
    assert path.read_bytes() == expected
    assert not journal_path(path).exists()


def test_journal_of_a_killed_run_is_unlocked(whole, tmp_path):
    sweep, expected, _ = whole
    path = tmp_path / "map.nc"
    child = os.fork()
    if not child:
        run_sweep(sweep, path, lambda done, _: done < 8 or os.kill(os.getpid(), 9))
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    assert kept_blocks(sweep, journal_path(path)) == [0, 1]
    run_sweep(sweep, path)
    assert path.read_bytes() == expected


def test_journal_of_another_program_version_is_rejected(whole, tmp_path, monkeypatch):
    """One line of the sources differs."""
    sweep, _, kept = whole
    copy = tmp_path / "sources" / "assembly"
    shutil.copytree(ROOT / "assembly", copy, ignore=shutil.ignore_patterns("__*__"))
    monkeypatch.setattr(
        identity.forcefit.assembly, "__file__", str(copy / "__init__.py")
    )
    identity.program_hash.cache_clear()
    assert small_sweep().identity == sweep.identity  # other folder
    with (copy / "zone.py").open("a") as file:
        file.write("# one line more\n")
    identity.program_hash.cache_clear()
    path = journal_path(tmp_path / "map.nc")
    path.write_bytes(kept[8])
    with pytest.raises(BadInput, match="found program_sha256 '.*expected program_sha"):
        run_sweep(small_sweep(), tmp_path / "map.nc")
    identity.program_hash.cache_clear()
    assert path.read_bytes() == kept[8]


@pytest.mark.parametrize(
    "change", [{"under": {"temperature": 6.0}}, {"near": 0.03}, {"seed": 5},
               {"varied": ("elbow.link.young",)}, {"load": (0, 0, 0, 1.0, 0, 0)}]
)  # fmt: skip
def test_hash_of_a_sweep_depends_on_every_option(change):
    asked = small_sweep().question
    assert question_hash(asked) == question_hash(small_sweep().question)
    assert question_hash(replace(asked, **change)) != question_hash(asked)


def test_designs_with_different_numbers_have_different_hashes():
    design = load_design("five_bar")
    path = next(p for p in design.paths if p.endswith("link.young"))
    other = type(design)(design.changed({path: 1e11}), design.file, design.name)
    moved = type(design)(design.content, "elsewhere.toml", design.name)
    assert question_hash(design) == question_hash(moved) != question_hash(other)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (small_sweep("tx=-0.04:0.04:0.02,ty=0.10:0.14:0.04"),
         "found points 'tx 5 x ty 3', values_sha256 '"),
        (small_sweep(assumption="free"), "found assumption 'none', asked 'margin"),
        (small_sweep(near=0.5), "found near '0.02'; expected near '0.5'"),
    ],
)  # fmt: skip
def test_journal_of_another_sweep_is_rejected(whole, tmp_path, other, message):
    _, _, kept = whole
    path = journal_path(tmp_path / "map.nc")
    path.write_bytes(kept[8])
    with pytest.raises(BadInput) as error:
        run_sweep(other, tmp_path / "map.nc")
    assert str(error.value).startswith(f"{path}: journal of another sweep: found ")
    assert message in str(error.value)
    assert path.read_bytes() == kept[8]


def test_file_that_is_not_a_journal_is_rejected_and_unchanged(tmp_path):
    path = journal_path(tmp_path / "map.nc")
    path.write_text("notes\n")
    with pytest.raises(BadInput, match="found a file that is not a journal of a sweep"):
        run_sweep(small_sweep(), tmp_path / "map.nc")
    assert path.read_text() == "notes\n"


def test_block_size_does_not_change_the_results():
    """Results for blocks of 4 and 15 points are bit-identical."""
    small = small_sweep(assumption="frozen", wrenches=("left.elbow",),
                        clearance_only=True)  # fmt: skip
    one = sweep_in_memory(small)
    assert one.identical(sweep_in_memory(replace(small, block_size=15)))
    assert np.isfinite(one.rotation_error_clearance).any()


@pytest.mark.slow
def test_commands_killed_at_random_times_resume_and_write_the_same_file():
    """The process is killed 20 times."""
    words = [sys.executable, ROOT / "benchmarks" / "kills.py", "20", "--seed", "5"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


COMMAND = [sys.executable, "-m", "forcefit", "assembly", "sweep", "five_bar", "--grid",
           "tx=-0.045:0.045:0.0005,ty=0.10:0.15:0.001"]  # fmt: skip


def start_command(folder, *words):
    """Start the command, and stop it when its journal has grown."""
    path = folder / "map.nc"
    errors = folder.parent / f"{folder.name}.txt"  # a file, because a pipe must be read
    interrupted = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with (
        errors.open("w+") as stderr,
        subprocess.Popen([*COMMAND, "-o", path, *words], stderr=stderr,
                         start_new_session=True, preexec_fn=interrupted) as process,
    ):  # fmt: skip
        journal, end = journal_path(path), time.monotonic() + 120
        while not journal.exists() or journal.stat().st_size < 20_000:
            assert process.poll() is None, errors.read_text()
            assert time.monotonic() < end
            time.sleep(0.01)
        yield process
        yield process.wait(timeout=600), errors.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["--workers", "1"]])
def test_ctrl_c_preserves_the_journal_and_the_command_resumes(tmp_path, words):
    run = start_command(tmp_path, *words)
    os.killpg(next(run).pid, signal.SIGINT)
    status, message = next(run)
    assert status == 130
    assert "points are stored in" in message
    assert "Traceback" not in message
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.nc.journal"]
    subprocess.run([*COMMAND, "-o", tmp_path / "map.nc"], check=True)
    once = tmp_path / "once.nc"
    subprocess.run([*COMMAND, "-o", once], check=True)
    assert (tmp_path / "map.nc").read_bytes() == once.read_bytes()
