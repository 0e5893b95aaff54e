"""Kills a sweep with SIGKILL at random moments until it is done, and counts losses.

Run from the repository's root: ``python benchmarks/sweep_kills.py [KILLS]``. A sweep of
the five-bar robot runs in a child process that says through a pipe how many points are
in the journal; the parent kills it, opens the journal and compares: a point that was
said to be finished and is not there is lost. The next child goes on; when the sweep is
complete its file is compared, byte by byte, with that of a run nobody killed.
"""

import os
import signal
import struct
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from assembly.robots import load_robot
from assembly.statistics.distributions import tolerance_sources
from assembly.sweeps.journal import open_journal
from assembly.sweeps.quantities import Question, record_type
from assembly.sweeps.sweep import Sweep, journal_path, run_sweep
from assembly.sweeps.targets import grid_targets, parse_grid

_COUNT = struct.Struct("<Q")


def sweep():
    """A sweep of some seconds: 1200 points in blocks of 32, with drawn errors."""
    robot = load_robot("five_bar")
    targets = grid_targets(parse_grid("tx=-0.045:0.05:0.005,ty=0.10:0.15:0.005", robot))
    sources = tolerance_sources(robot, np.array([1e-4] * 3 + [1e-5] * 3))
    question = Question(robot, None, (), targets.names, sources, 1)
    return Sweep(question, targets, (), 5, block_size=32)


def run_child(asked, path, say):
    """Run the sweep in a child process that reports to ``say``; its pid."""
    child = os.fork()
    if child:
        return child
    try:
        run_sweep(asked, path, lambda done, _: os.write(say, _COUNT.pack(done)))
        os._exit(0)
    finally:
        os._exit(1)


def last_said(listen, before):
    """The last number in a pipe."""
    content = os.read(listen, 1 << 20)
    whole = len(content) // _COUNT.size * _COUNT.size
    return _COUNT.unpack(content[whole - _COUNT.size : whole])[0] if whole else before


def kill_until_done(asked, path, rng, longest, counts):
    """One sweep, killed again and again; counts of kills by moment, and of losses."""
    journal, part = journal_path(path), path.with_name(path.name + ".part")
    while True:
        listen, say = os.pipe()
        started = journal.exists()
        child = run_child(asked, path, say)
        os.close(say)
        time.sleep(np.exp(rng.uniform(np.log(0.005), np.log(longest))))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        os.set_blocking(listen, False)
        said = last_said(listen, 0)
        os.close(listen)
        if os.WIFEXITED(status):
            assert os.WEXITSTATUS(status) == 0
            return
        counts["kills"] += 1
        if not journal.exists():
            moment = "after the file" if path.exists() else "before the journal"
            assert path.exists() or not started
        else:
            size = journal.stat().st_size
            kept = open_journal(journal, asked.identity, record_type(asked.question))
            counts["records cut short"] += journal.stat().st_size < size
            points = sum(len(kept.read(b)[0]) for b in kept.places)
            counts["lost"] += max(0, said - points)
            moment = "while solving"
            if len(kept.places) == asked.blocks:
                moment = "while the file was written" if part.exists() else "at the end"
        counts[moment] += 1


def main(kills=200, longest=2.0, seed=1):
    """Kill, count and print; the counts."""
    rng, counts = np.random.default_rng(seed), Counter(lost=0, different=0)
    asked = sweep()
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.nc"
        start = time.monotonic()
        run_sweep(asked, whole)  # compiles, too
        print(f"{asked.size} points in {asked.blocks} blocks; not killed: "
              f"{time.monotonic() - start:.1f} s")  # fmt: skip
        expected = whole.read_bytes()
        while counts["kills"] < kills:
            path = Path(folder) / f"killed{counts['sweeps']}.nc"
            kill_until_done(asked, path, rng, longest, counts)
            counts["sweeps"] += 1
            counts["different"] += path.read_bytes() != expected
            path.unlink()
    for name, count in counts.items():
        print(f"{name:28s} {count}")
    return counts


if __name__ == "__main__":
    counted = main(*map(int, sys.argv[1:2]))
    sys.exit(1 if counted["lost"] or counted["different"] else 0)
