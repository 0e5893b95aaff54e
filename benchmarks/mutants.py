"""Inject random faults into the numerical modules, and find tests that detect them.

    python -m benchmarks.mutants [COUNT] [--seed N] [--only FOLDER] [--files PATH ...]
        [--seconds S] [--traced FOLDER]

The tests are run once, and the lines and the time of each test are recorded. This trace
is stored in the folder after --traced, and updated for folders with changed tests. For
each fault, the tests that execute its line are run until the first failure, for up to S
seconds. Short tests and tests of the same folder are run first. If no test fails, the
fault survives.

Faults within functions are injected into an imported module (``exchanged_code.py``).
All other faults are written into a copy of the source tree.  C++ code is excluded.

With --files, all faults of these files are tested instead of COUNT random faults. The
program prints the fraction of detected faults and lists the undetected faults.
"""

import argparse
import importlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path
from random import Random

from benchmarks.exchanged_code import Session
from benchmarks.faults import ROOT, Fault, all_in, drawn, files_of
from benchmarks.traced_tests import Run, Trace, traced

# libraries that are imported before the process forks
LIBRARIES = (
    "scipy.linalg", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial",
    "scipy.stats", "scipy.ndimage", "cvxpy", "clarabel", "skfem", "xarray", "pandas",
    "h5netcdf", "matplotlib.figure", "pyvista", "meshio", "typer.testing", "hypothesis",
    "hypothesis.extra.numpy",
)  # fmt: skip
LEAST_SECONDS = 15  # [s] limit of the processor time to collect tests


def chosen(tests: list[str], trace: Trace, seconds: float) -> list[str]:
    """Return the first tests whose total time does not exceed a limit."""
    total = 0.0
    some: list[str] = []
    for test in tests:
        total += trace.seconds[test]
        if some and total > seconds:
            break
        some.append(test)
    return some


def caught(fault: Fault, tree: Path, trace: Trace, seconds: float) -> str | None:
    """Return the test that detects a fault, or None."""
    path = tree / fault.path
    whole, times = path.read_bytes(), path.stat()
    path.write_text(fault.put_into(whole.decode()), encoding="utf-8")
    try:
        return seen(fault, tree, trace, seconds)
    finally:
        path.write_bytes(whole)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def seen(fault: Fault, tree: Path, trace: Trace, seconds: float) -> str | None:
    """Return the first test that detects a fault in a copy of the tree, or None."""
    tests = trace.nearest(fault)
    for share in (seconds / 8, seconds):
        some = chosen(tests, trace, share)
        run = Run(tree, LEAST_SECONDS + 3 * share)
        if some and (test := run(some)) is not None:
            return test
        tests = tests[len(some) :]
    return None


def judged(
    faults: list[Fault], tree: Path, trace: Trace, seconds: float
) -> Iterator[tuple[Fault, str | None]]:
    """Yield each fault and the test that detects it."""
    some = [fault for fault in faults if fault.within]
    # tests are selected before the fork, because children cannot read the trace
    tests = [chosen(trace.nearest(fault), trace, seconds) for fault in some]
    reading, writing = Pipe(duplex=False)

    def send(session: Session) -> None:
        for one in zip(some, tests, strict=True):
            writing.send(session.seen(*one, 3 * seconds))

    child = os.fork()
    if not child:
        Session(tree, send).run()
        os._exit(0)
    writing.close()
    yield from ((fault, reading.recv()) for fault in some)
    os.waitpid(child, 0)
    for fault in faults:
        if not fault.within:
            yield fault, caught(fault, tree, trace, seconds)


def asked_for(asked: argparse.Namespace) -> list[Fault]:
    """Return all faults of given files, or a number of random faults."""
    files = files_of(asked.only)
    if asked.files:
        named = [(c, path) for c, path in files if path in asked.files]
        return [fault for chapter, path in named for fault in all_in(chapter, path)]
    weights = [len((ROOT / path).read_text().splitlines()) for _, path in files]
    random = Random(asked.seed)
    faults: list[Fault] = []
    while len(faults) < asked.count:
        ((chapter, path),) = random.choices(files, weights)
        if fault := drawn(chapter, path, random):
            faults.append(fault)
    return faults


def main() -> None:
    """Test the faults, print the detected fraction, and list undetected faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--files", type=Path, nargs="+")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--traced", type=Path)
    asked = parser.parse_args()
    for library in LIBRARIES:
        importlib.import_module(library)
    began, survived = time.monotonic(), 0
    with tempfile.TemporaryDirectory() as scratch:
        tree = Path(scratch) / "forcefit"
        # the copy includes the compiled modules
        left_out = shutil.ignore_patterns(".git", ".venv", ".*_cache", "*_study")
        shutil.copytree(ROOT, tree, symlinks=True, ignore=left_out)
        kept = asked.traced or Path(scratch)
        kept.mkdir(parents=True, exist_ok=True)
        trace = traced(tree, kept)
        faults = asked_for(asked)
        for done, (fault, test) in enumerate(
            judged(faults, tree, trace, asked.seconds), start=1
        ):
            survived += test is None
            seen = "survived" if test is None else f"caught by {test or 'a limit'}"
            print(f"{fault}  {seen}", flush=True)
            if done == len(faults) or done % 25 == 0:
                spent = time.monotonic() - began
                print(f"{done} faults, {survived} survived, {spent:.0f} s", flush=True)


if __name__ == "__main__":
    main()
