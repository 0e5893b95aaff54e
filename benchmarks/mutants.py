"""Random one-line faults in the numerical modules, and whether the tests see them.

    python -m benchmarks.mutants [COUNT] [--seed N] [--only FOLDER] [--seconds S]
        [--traced FOLDER]

The default tests of the numerical modules and ``tests/test_answers.py`` run once,
traced: which test passes which line, and how long it takes (kept in the folder after
--traced, and traced anew where a test has changed).  Compiled loops have no lines to
trace: tests of loops by themselves run a second time uncompiled, each for a few seconds
at most.  Then every fault is put into a copy of the tree and the tests that pass its
line run, in a fork of this process, which has imported all libraries: those of an
eighth of S seconds, the nearest and shortest first, then of S seconds; the first
failure is enough.  A fault that longer or other tests would see counts as survived.
Faults in compiled loops are judged uncompiled, then once more compiled, by the tests
that import their module.  Printed: the share caught, and every survivor.
"""

import argparse
import ast
import importlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numba
import pytest
from coverage import Coverage, CoverageData

from benchmarks.faults import CHAPTERS, ROOT, Fault, drawn, files_of, has_loops

PACKAGES = ("stiffness", "assembly", "validation", "forcefit")
# imported once, before the forks
LIBRARIES = (
    "scipy.linalg", "scipy.optimize", "scipy.sparse.linalg", "scipy.spatial",
    "scipy.stats", "scipy.ndimage", "cvxpy", "clarabel", "skfem", "xarray", "pandas",
    "h5netcdf", "matplotlib.figure", "pyvista", "meshio", "typer.testing", "hypothesis",
    "hypothesis.extra.numpy", "numba.extending",
)  # fmt: skip
BESIDE = ("tests/test_answers.py",)  # asked besides the chapters' own tests
LEAST_SECONDS = 15  # of processor time, for collecting tests
# of loops by themselves; elsewhere whole robots are solved, minutes uncompiled
UNCOMPILED = tuple(f"tests/assembly/{c}" for c in ("solvers", "kinematics", "batch"))
UNCOMPILED_SECONDS = 1.5  # of processor time, of a test that is to be of use uncompiled
MEMORY = 8 * 2**30  # [byte]
PASSED, FAILED, INTERRUPTED, NONE_COLLECTED = 0, 1, 2, 5


class Run:
    """Some tests in a fork of this process, on a tree."""

    def __init__(self, tree: Path, uncompiled: bool, seconds: float) -> None:
        self.tree, self.uncompiled, self.seconds = tree, uncompiled, seconds

    def __call__(self, tests: list[str], plugins: tuple[Any, ...] = ()) -> str | None:
        """The first test that fails, "" where none can be named; None if all pass."""
        printed = self.tree.parent / "printed.txt"
        child = os.fork()
        if not child:
            try:
                os._exit(self._tested(tests, printed, plugins))
            except BaseException:
                traceback.print_exc()
            finally:
                os._exit(NONE_COLLECTED + 1)
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status):
            code = os.WEXITSTATUS(status)
            if code in {PASSED, NONE_COLLECTED}:
                return None
            broken = "ImportError while loading conftest" in printed.read_text()
            if code not in {FAILED, INTERRUPTED} and not broken:
                raise RuntimeError(printed.read_text()[-2000:])
        first = re.search(r"^(?:FAILED|ERROR) (\S+)", printed.read_text(), re.MULTILINE)
        return first[1] if first else ""

    def _tested(self, tests: list[str], printed: Path, plugins: tuple) -> int:
        with printed.open("w") as file:
            os.dup2(file.fileno(), 1)
            os.dup2(file.fileno(), 2)
        seconds = int(self.seconds)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        os.chdir(self.tree)
        os.environ |= {"PYTHONPATH": str(self.tree), "PYTHONDONTWRITEBYTECODE": "1"}
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(self.tree))
        words = ["-q", "-rfE", "-m", "not slow", "-p", "no:cacheprovider", "--tb=no"]
        words += ["-W", "ignore::pytest.PytestAssertRewriteWarning"]
        if not plugins:
            words.append("-x")
        if self.uncompiled:
            os.environ["NUMBA_DISABLE_JIT"] = "1"
            numba.config.DISABLE_JIT = True
            # loops divide by zero where they then look at what came out
            words += ["-W", "ignore::RuntimeWarning"]
        for plugin in plugins:
            plugin.start()
        code = pytest.main([*words, *tests], plugins=list(plugins))
        for plugin in plugins:
            plugin.stop()
        return int(code)


class Tracer:
    """A plugin: lines that each test passes, and how long each test takes."""

    def __init__(self, data: Path, limit: float | None) -> None:
        self.data, self.limit = data, limit
        self.seconds: dict[str, float] = {}

    def start(self) -> None:
        """Trace from here on."""
        self.coverage = Coverage(str(self.data), source=list(PACKAGES))
        self.coverage.start()

    def stop(self) -> None:
        """Write lines and seconds."""
        self.coverage.stop()
        self.coverage.save()
        self.data.with_suffix(".json").write_text(json.dumps(self.seconds))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """A context of its own for each test, fixtures included."""
        self.coverage.switch_context(item.nodeid)
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Any:
        """The test ends where it takes too long."""

        def end(*_: Any) -> None:
            raise TimeoutError

        if self.limit:
            signal.signal(signal.SIGVTALRM, end)
            signal.setitimer(signal.ITIMER_VIRTUAL, self.limit)
        try:
            return (yield)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Only a test that passes can see a fault."""
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = report.duration


@dataclass(frozen=True)
class Trace:
    """Which tests pass a line, and seconds that each test takes."""

    lines: CoverageData
    seconds: dict[str, float]

    def of(self, path: Path, rows: range | set[int]) -> set[str]:
        """Tests that pass one of these rows of a file."""
        # traced in one copy of the tree or another
        files = [f for f in self.lines.measured_files() if f.endswith(f"/{path}")]
        tests = {
            test.partition("|")[0]
            for passing in map(self.lines.contexts_by_lineno, files)
            for row in rows
            for test in passing.get(row, [])
        }
        return tests & self.seconds.keys()

    def nearest(self, fault: Fault) -> list[str]:
        """Tests that pass a fault, the nearest and shortest first."""
        tests = self.of(fault.path, fault.rows)
        if fault.name:
            named = re.compile(rf"\b{fault.name}\b")
            for path in (fault.path, *importers(fault.path)):
                lines = (ROOT / path).read_text("utf-8").splitlines()
                rows = {i for i, line in enumerate(lines, 1) if named.search(line)}
                tests |= self.of(path, rows)
        return sorted(tests, key=self.cost(fault))

    def cost(self, fault: Fault) -> Callable[[str], float]:
        """A test's seconds, less where it is nearer to a fault."""
        near = f"tests/{fault.path.parent}/test_{fault.path.stem}"

        def cost(test: str) -> float:
            seconds = self.seconds[test] + 0.01
            if test.startswith(near):
                return seconds / 10
            if test.startswith(BESIDE):  # compare the most numbers
                return seconds / 3
            return (
                seconds if test.startswith(f"tests/{fault.chapter}/") else 3 * seconds
            )

        return cost


def sources() -> Iterator[Path]:
    """Files of the packages."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT)


def importers(path: Path) -> list[Path]:
    """Files of the packages that import a file's names."""
    module = ".".join(path.with_suffix("").parts)
    text = re.compile(rf"^from {re.escape(module)} import", re.MULTILINE)
    return [p for p in sources() if text.search((ROOT / p).read_text("utf-8"))]


def traced(tree: Path, kept: Path, uncompiled: bool) -> Trace:
    """The default tests of each folder, traced, or what an earlier call left of them.

    A folder of which a test has changed since is traced anew.
    """
    lines = CoverageData(no_disk=True)
    seconds: dict[str, float] = {}
    for folder in UNCOMPILED if uncompiled else places_of_tests():
        name = "uncompiled" if uncompiled else "compiled"
        data = kept / f"{name}.{folder.replace('/', '.')}.coverage"
        times = data.with_suffix(".json")
        changed = max((path.stat().st_mtime for path in tests_in(folder)), default=0.0)
        if not times.exists() or times.stat().st_mtime < changed:
            data.unlink(missing_ok=True)
            tracer = Tracer(data, UNCOMPILED_SECONDS if uncompiled else None)
            Run(tree, uncompiled, 7200)([folder], (tracer,))
            print(f"traced {folder}, {name}", flush=True)
        part = CoverageData(str(data))
        part.read()
        lines.update(part)
        seconds |= json.loads(times.read_text())
    return Trace(lines, seconds)


def places_of_tests() -> list[str]:
    """Folders of the tests that mirror a chapter, and what else is asked."""
    mirrors = [f"tests/{chapter}" for chapter in CHAPTERS]
    return [m for m in mirrors if any((ROOT / m).glob("test_*.py"))] + list(BESIDE)


def tests_in(place: str) -> list[Path]:
    """Python files of a folder of tests; of one file, those beside it."""
    path = ROOT / place
    return sorted(path.parent.glob("*.py") if path.is_file() else path.rglob("*.py"))


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
    lines = whole.decode().splitlines(True)
    lines[fault.row - 1] = fault.line
    path.write_text("".join(lines), encoding="utf-8")
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


def main() -> None:
    """Draw faults, count those caught, name those that were not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--traced", type=Path)
    asked = parser.parse_args()
    random = Random(asked.seed)
    files = files_of(asked.only)
    weights = [len((ROOT / path).read_text().splitlines()) for _, path in files]
    for library in LIBRARIES:
        importlib.import_module(library)
    began, done, survived = time.monotonic(), 0, 0
    with tempfile.TemporaryDirectory() as scratch:
        tree = Path(scratch) / "forcefit"
        # with the caches of compiled functions, whose files keep their times
        left_out = shutil.ignore_patterns(".git", ".venv", ".*_cache", "*_study")
        shutil.copytree(ROOT, tree, ignore=left_out)
        kept = asked.traced or Path(scratch)
        kept.mkdir(parents=True, exist_ok=True)
        traces = {loops: traced(tree, kept, loops) for loops in (False, True)}
        caches = Caches(tree)
        while done < asked.count:
            ((chapter, path),) = random.choices(files, weights)
            fault = drawn(chapter, path, random)
            if fault is None:
                continue
            test = caught(fault, tree, traces, caches, asked.seconds)
            done += 1
            survived += test is None
            seen = "survived" if test is None else f"caught by {test or 'a limit'}"
            print(f"{fault}  {seen}", flush=True)
            if test is None or done == asked.count or done % 25 == 0:
                spent = time.monotonic() - began
                print(f"{done} faults, {survived} survived, {spent:.0f} s", flush=True)


if __name__ == "__main__":
    main()
