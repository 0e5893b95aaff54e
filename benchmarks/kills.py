"""Interrupt commands at random times and count lost results.

Run ``python benchmarks/kills.py [KILLS] [--seed N]`` in the root of the repository.
The commands are ``assembly sweep``, ``statistics``, ``tolerances`` and ``validation
diagnose``.  They run in forks of this process and are interrupted by SIGKILL, SIGTERM,
Ctrl-C or a full disk.  A full disk is simulated by a limit on file sizes or by a small
tmpfs.  Between runs, a journal is truncated, or a bit is flipped.  Finally, the command
runs without an interruption, and its files are compared with those of an undisturbed
run.

A point is lost if it was stored in the intact part of the journal and is missing or
computed again.  A file is incomplete if it has its final name and differs from the file
of the undisturbed run.
"""

import argparse
import io
import mmap
import os
import resource
import shlex
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import zlib
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random

from forcefit.commands import app as forcefit_command

sys.path.insert(0, str(Path(__file__).parent.parent))
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # must be set before numpy is imported

import numpy as np

import forcefit.assembly.statistics.monte_carlo as monte_carlo
import forcefit.assembly.sweeps.sweep as sweeps
from benchmarks.kills_commands import COMMANDS, SHARES, Case, inputs
from forcefit.assembly.sweeps import journal

WAYS = {signal.SIGKILL: 12, signal.SIGTERM: 2, signal.SIGINT: 3, "full": 3}


SOLVED, KEPT = 0, 8  # [byte] offsets of two counters in shared memory
shared = mmap.mmap(-1, 16)


def count(place: int, more: int) -> None:
    """Increase a counter in shared memory."""
    struct.pack_into("<q", shared, place, counted(place) + more)


def counted(place: int) -> int:
    """Return a counter of the last child process."""
    return struct.unpack_from("<q", shared, place)[0]


def watch() -> None:
    """Count the computed points and the points stored in the journal."""
    solve, draw, add = (
        sweeps.solve_points,
        monte_carlo.Experiment.solve,
        journal.Journal.add,
    )

    def solve_and_count(question, points):
        solution = solve(question, points)
        count(SOLVED, len(points.rows))
        return solution

    def draw_and_count(self, first, number):
        rows = draw(self, first, number)
        count(SOLVED, number)
        return rows

    def add_and_count(self, block, records, texts):
        add(self, block, records, texts)
        count(KEPT, len(records))

    sweeps.solve_points = solve_and_count
    monte_carlo.Experiment.solve = draw_and_count
    journal.Journal.add = add_and_count


def start(words: list[str], limit: int | None = None) -> int:
    """Start a command in a child process, and return its process id."""
    shared[:] = bytes(16)
    child = os.fork()
    if child:
        return child
    status, printed = 99, io.StringIO()
    printed.close = lambda: None  # type: ignore[method-assign]
    try:
        with Path("/dev/null").open("w") as nothing:
            os.dup2(nothing.fileno(), 1)
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        sys.stdout, sys.stderr = io.StringIO(), printed
        sys.argv = ["forcefit", *words]
        forcefit_command.main()
    except SystemExit as done:
        status = done.code if isinstance(done.code, int) else 98
        if (
            status not in {0, 130} and limit is None
        ):  # there is no message if the disk is full
            os.write(2, printed.getvalue()[-300:].encode())
    except BaseException:
        with suppress(OSError):
            os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(status)


def run_here(words: list[str]) -> None:
    """Run a command in this process."""
    before = sys.argv, sys.stdout, sys.stderr
    sys.argv, sys.stdout, sys.stderr = (
        ["forcefit", *words],
        io.StringIO(),
        io.StringIO(),
    )
    try:
        forcefit_command.main()
    except SystemExit as done:
        if done.code:
            raise RuntimeError(
                f"{words}: {done.code}\n{sys.stderr.getvalue()}"
            ) from None
    finally:
        sys.argv, sys.stdout, sys.stderr = before


def finish(child: int) -> int:
    """Wait for a child process, and return its exit status or minus its signal."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def records(content: bytes, case: Case) -> list[tuple[int, int, int]]:
    """Return the start, the end and the number of points of each valid record."""
    owner = zlib.crc32(case.header)
    places, _ = journal._scan(content, len(case.header), owner)
    head = journal._HEAD.size
    return [
        (start - head, start + length, struct.unpack_from("<Q", content, start)[0])
        for start, length in places.values()
    ]


def points_in(path: Path, case: Case) -> int:
    """Return the number of points in a journal, or 0 if it does not exist."""
    if not case.header or not path.exists():
        return 0
    return sum(points for *_, points in records(path.read_bytes(), case))


def undisturbed(command: str) -> Case:
    """Return the files and the journal of an undisturbed run of a command."""
    case = Case(shlex.split(command))
    run_here(case.words)
    began = time.monotonic()
    status = finish(start(case.words))
    case.seconds = time.monotonic() - began
    assert status == 0, f"{command}: {status}"
    case.files = {p.name: p.read_bytes() for p in Path().glob("out.*")}
    assert not [
        name for name in case.files if name.endswith((".part", ".journal", ".lock"))
    ]
    path = Path("out.nc.journal")
    if "five_bar" in command and "tolerances" not in command:
        child = start(case.words)
        while not counted(KEPT):
            time.sleep(0.001)
        os.kill(child, signal.SIGKILL)
        finish(child)
        case.header = path.read_bytes().partition(b"\n")[0] + b"\n"
        assert points_in(path, case) == counted(KEPT)
        assert finish(start(case.words)) == 0
        case.points = points_in_all(case)
    for name in case.files:
        Path(name).unlink()
    return case


def points_in_all(case: Case) -> int:
    """Return the number of points of a complete run."""
    return {"sweep": 54 * 20, "statistics": 4000}[case.words[1]]


def spoil(path: Path, case: Case, random: Random, counts: Counter) -> int:
    """Truncate a journal, flip a bit or do nothing, and count the intact points."""
    content = bytearray(path.read_bytes())
    sound = records(bytes(content), case)
    everything = sum(points for *_, points in sound)
    how = random.random()
    if how < 0.6 or not content:
        return everything
    at = random.randrange(len(content))
    if how < 0.8:
        counts["journals cut"] += 1
        path.write_bytes(content[:at])
        return sum(points for _, end, points in sound if end <= at)
    counts["journals with a flipped bit"] += 1
    content[at] ^= 1 << random.randrange(8)
    if not sound and (at <= content.find(b"\n") or b"\n" not in content):
        path.unlink()  # a journal without its header must be removed
        return 0
    path.write_bytes(content)
    return sum(points for start, end, points in sound if not start <= at < end)


def trial(case: Case, random: Random, counts: Counter, small: bool) -> None:
    """Interrupt a command several times, complete it, and compare its files."""
    path, standing = Path("out.nc.journal"), 0
    while random.random() < 0.75:
        (way,) = random.choices(list(WAYS), list(WAYS.values()))
        limit = None
        if way == "full" and not small:
            largest = max(map(len, case.files.values()))
            limit = int(np.exp(random.uniform(0, np.log(1.2 * largest))))
        # temporary files of a killed process
        before = {*Path().glob("*.part"), *Path().glob("*.lock")}
        child = start(case.words, limit)
        if way == "full":
            status = finish(child)
            counts["disks full"] += status == 2
            counts["wrong exit status"] += wrong(status, {0, 2}, case, way)
        else:
            time.sleep(case.seconds * random.uniform(0, 1.15))
            os.kill(child, way)
            status = finish(child)
            counts[f"stopped by {way.name}"] += status != 0
            # the exit status is 2 if the disk is full
            right = {0, -way, 130} | ({2} if small else set())
            counts["wrong exit status"] += wrong(status, right, case, way)
        counts["lost"] += solved_again(case, standing)
        counts["half-written"] += check(case, counts, status, before)
        if status == 0 or removed(case, standing):
            standing = 0
            counts["half-written"] += any(not Path(n).exists() for n in case.files)
            continue
        if case.header:  # the command has a journal
            standing += counted(KEPT)
            counts["lost"] += max(0, standing - points_in(path, case))
        standing = spoil(path, case, random, counts) if path.exists() else 0
    if small:
        subprocess.run(["mount", "-o", "remount,size=64m", "."], check=True)
    status = finish(start(case.words))
    counts["wrong exit status"] += wrong(status, {0}, case, "nothing")
    counts["lost"] += solved_again(case, standing)
    files = {p.name: p.read_bytes() for p in Path().glob("out.*")}
    counts["different final files"] += files != case.files
    counts["ended"] += 1
    for name in files:
        Path(name).unlink()


def wrong(status: int, right: set[int], case: Case, way: object) -> bool:
    """Return whether an exit status is wrong, and print it."""
    if status in right:
        return False
    print(f"exit status {status} of {case.words[1]} after {way}")
    return True


def removed(case: Case, standing: int) -> bool:
    """Return whether all points were stored and the journal was removed."""
    everything = standing + counted(KEPT) == case.points
    return bool(case.header) and everything and not Path("out.nc.journal").exists()


def solved_again(case: Case, standing: int) -> int:
    """Return the number of stored points that the last child computed again."""
    return max(0, counted(SOLVED) - (case.points - standing)) if case.header else 0


def check(case: Case, counts: Counter, status: int, before: set[Path]) -> int:
    """Return the number of files that differ from those of an undisturbed run."""
    different = 0
    for path in Path().glob("out.*"):
        if path.suffix in {".part", ".lock"}:
            left = status in {2, 130} and path not in before
            counts["temporary files left"] += left
        elif path.suffix != ".journal":
            different += path.read_bytes() != case.files[path.name]
    return different


def mounted(folder: Path, kilobytes: int) -> bool:
    """Mount a small tmpfs on a folder, and return whether this succeeded."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "none", str(folder)]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def main() -> int:
    """Interrupt the commands, print the counts, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kills", nargs="?", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    random = Random(asked.seed)
    counts = Counter(dict.fromkeys(
        ("lost", "half-written", "temporary files left", "different final files",
         "wrong exit status"), 0
    ))  # fmt: skip
    watch()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        inputs(folder)
        os.chdir(folder)
        cases = {}
        for name, command in COMMANDS.items():
            cases[name] = undisturbed(command)
            print(f"{name}: {cases[name].seconds:.2f} s undisturbed", flush=True)
        warm = time.monotonic() - began
        disturbed = 0
        while disturbed < asked.kills:
            (name,) = random.choices(list(SHARES), list(SHARES.values()))
            folder_of_trial = folder / "trial"
            folder_of_trial.mkdir()
            small = random.random() < 0.1 and mounted(
                folder_of_trial, random.choice([64, 128, 256])
            )
            for path in ("errors.toml", "plan.toml"):
                shutil.copy(folder / path, folder_of_trial)
            shutil.copytree(folder / "campaign", folder_of_trial / "campaign")
            os.chdir(folder_of_trial)
            counts["of them on a small tmpfs"] += small
            trial(cases[name], random, counts, small)
            os.chdir(folder)
            if small:
                subprocess.run(["umount", str(folder_of_trial)], check=True)
            shutil.rmtree(folder_of_trial)
            disturbed = counts["disks full"] + sum(
                counts[f"stopped by {way.name}"] for way in WAYS if way != "full"
            )
        os.chdir("/")
    for name, number in counts.items():
        print(f"{name:28s} {number}")
    print(f"{'interruptions in total':28s} {disturbed}")
    print(
        f"{warm:.0f} s to import and compile, {time.monotonic() - began - warm:.0f} s"
    )
    return int(any(list(counts.values())[:5]))


if __name__ == "__main__":
    sys.exit(main())
