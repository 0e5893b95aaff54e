"""Random one-line faults in the numerical modules, and whether the tests see them.

    python -m benchmarks.mutants [COUNT] [--seed N] [--only FOLDER] [--files PATH ...]
        [--seconds S] [--traced FOLDER]

The default tests of all folders and ``tests/test_answers.py`` run once, traced: which
test passes which line, and how long it takes (kept in the folder after --traced, and
traced anew where a test has changed; what was traced of a file that has changed since
is of no use).  Then the tests that pass a fault's line run, the nearest and shortest
first, as many as take S seconds; the first failure is enough.  A fault that longer or
other tests would see counts as survived.

Faults within functions are exchanged in a process that has loaded everything
(``exchanged_code.py``).  The others are put into a copy of the tree, and tests run in a
fork of this process, which has imported all libraries: of an eighth of S seconds first.
Compiled loops have no lines to trace: tests of loops by themselves run a second time
uncompiled, each for a few seconds at most; faults in them are judged uncompiled, then
once more compiled, by the tests that import their module.

After --files: every fault of these files instead of COUNT that are drawn.  Printed: the
share caught, and every survivor.
"""

import argparse
import ast
import importlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path
from random import Random

from benchmarks.exchanged_code import Session
from benchmarks.faults import ROOT, Fault, all_in, drawn, files_of, has_loops
from benchmarks.traced_tests import PACKAGES, Run, Trace, sources, traced

# imported once, before the forks
LIBRARIES = (
    "scipy.linalg", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial",
    "scipy.stats", "scipy.ndimage", "cvxpy", "clarabel", "skfem", "xarray", "pandas",
    "h5netcdf", "matplotlib.figure", "pyvista", "meshio", "typer.testing", "hypothesis",
    "hypothesis.extra.numpy", "numba.extending",
)  # fmt: skip
LEAST_SECONDS = 15  # of processor time, for collecting tests


def importing(fault: Fault) -> list[str]:
    """Files of the tests that import the module, or stand in its folder's mirror."""
    module = ".".join(fault.path.with_suffix("").parts)
    folder, _, name = module.rpartition(".")
    imports = re.compile(
        rf"{re.escape(module)}\b|from {re.escape(folder)} import [^\n]*\b{name}\b"
    )
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    folder_of_tests = ROOT / "tests" / fault.chapter
    return ["tests/test_answers.py"] + [
        str(path.relative_to(ROOT))
        for path in files
        if path.is_relative_to(folder_of_tests) or imports.search(path.read_text())
    ]


class Caches:
    """Compiled functions on disk, of the tree without a fault."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self.files = {path: path.read_bytes() for path in self._found()}

    def _found(self) -> list[Path]:
        return [path for p in PACKAGES for path in (self.tree / p).rglob("*.nb[ic]")]

    def restore(self) -> None:
        """As they were before the fault."""
        for path in set(self._found()) - self.files.keys():
            path.unlink()
        for path, content in self.files.items():
            path.write_bytes(content)

    def drop(self, fault: Fault) -> None:
        """Leave out those that a fault is built into, though their files are the same.

        A part is called by its address, a kernel and a constant are built in.
        """
        names, stale = built_in(fault), set[Path]()
        while names:
            named = re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})\b")
            more = {
                path
                for path in sources()
                if has_loops(ROOT / path) and named.search((ROOT / path).read_text())
            } - stale
            stale |= more
            names = {name for path in more for name in kernels_of(path)}
        for path in stale:
            for cached in (self.tree / path.parent).rglob(f"{path.stem}.*.nbi"):
                cached.unlink()


def built_in(fault: Fault) -> set[str]:
    """The kernel or the constant that a fault is in; nothing for a part."""
    for node in ast.walk(ast.parse((ROOT / fault.path).read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef):
            if node.lineno <= fault.row <= (node.end_lineno or 0):
                return {node.name} & kernels_of(fault.path)
    return {fault.name} if fault.name else set()


def kernels_of(path: Path) -> set[str]:
    """Names of a file's kernels."""
    text = (ROOT / path).read_text("utf-8")
    return set(re.findall(r"^@kernel.*\ndef (\w+)", text, re.MULTILINE))


def chosen(tests: list[str], trace: Trace, seconds: float) -> list[str]:
    """As many of the first tests as take so long."""
    total = 0.0
    some: list[str] = []
    for test in tests:
        total += trace.seconds[test]
        if some and total > seconds:
            break
        some.append(test)
    return some


def caught(
    fault: Fault, tree: Path, traces: dict[bool, Trace], caches: Caches, seconds: float
) -> str | None:
    """The test that sees a fault, "" where it is none's name; None if none does."""
    path = tree / fault.path
    whole, times = path.read_bytes(), path.stat()
    path.write_text(fault.put_into(whole.decode()), encoding="utf-8")
    try:
        if fault.compiled:
            caches.drop(fault)
        return seen(fault, tree, traces, seconds)
    finally:
        path.write_bytes(whole)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        if fault.compiled:
            caches.restore()


def seen(
    fault: Fault, tree: Path, traces: dict[bool, Trace], seconds: float
) -> str | None:
    """The first test that sees the fault in the tree; None if none does."""
    trace = traces[fault.compiled]
    tests = trace.nearest(fault)
    for share in (seconds / 8, seconds):
        some = chosen(tests, trace, share)
        run = Run(tree, fault.compiled, LEAST_SECONDS + 3 * share)
        if some and (test := run(some)) is not None:
            return test
        tests = tests[len(some) :]
    if not fault.compiled:
        return None
    files, trace = importing(fault), traces[False]
    tests = [test for test in trace.seconds if test.partition("::")[0] in files]
    # its own compilation takes half a minute at most
    run = Run(tree, False, LEAST_SECONDS + 120 + 3 * seconds)
    return run(chosen(sorted(tests, key=trace.cost(fault)), trace, seconds))


def exchangeable(fault: Fault) -> bool:
    """Whether it can be put into functions that are loaded already."""
    return fault.within and not fault.compiled


def judged(
    faults: list[Fault], tree: Path, traces: dict[bool, Trace], seconds: float
) -> Iterator[tuple[Fault, str | None]]:
    """Each fault with the test that sees it; first those that can be exchanged."""
    trace, some = traces[False], [fault for fault in faults if exchangeable(fault)]
    # before the fork, which leaves the trace's data base behind
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
    caches = Caches(tree)
    for fault in faults:
        if not exchangeable(fault):
            yield fault, caught(fault, tree, traces, caches, seconds)


def asked_for(asked: argparse.Namespace) -> list[Fault]:
    """All faults of the files asked for, or as many drawn as are asked for."""
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
    """Draw faults, count those caught, name those that were not."""
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
        # with the caches of compiled functions, whose files keep their times
        left_out = shutil.ignore_patterns(".git", ".venv", ".*_cache", "*_study")
        shutil.copytree(ROOT, tree, ignore=left_out)
        kept = asked.traced or Path(scratch)
        kept.mkdir(parents=True, exist_ok=True)
        traces = {loops: traced(tree, kept, loops) for loops in (False, True)}
        faults = asked_for(asked)
        for done, (fault, test) in enumerate(
            judged(faults, tree, traces, asked.seconds), start=1
        ):
            survived += test is None
            seen = "survived" if test is None else f"caught by {test or 'a limit'}"
            print(f"{fault}  {seen}", flush=True)
            if done == len(faults) or done % 25 == 0:
                spent = time.monotonic() - began
                print(f"{done} faults, {survived} survived, {spent:.0f} s", flush=True)


if __name__ == "__main__":
    main()
