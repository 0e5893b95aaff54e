"""Run tests in forked processes, and record the lines that each test executes."""

import json
import os
import re
import resource
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy

import pytest
from coverage import Coverage, CoverageData

from benchmarks.faults import ROOT, Fault

FOLDERS = ("stiffness", "assembly", "validation", "forcefit")
BESIDE = ("tests/test_answers.py",)
MEMORY = 8 * 2**30  # [byte]
PASSED, FAILED, INTERRUPTED, NONE_COLLECTED = 0, 1, 2, 5
WORDS = [
    "-q", "-rfE", "-m", "not slow", "-p", "no:cacheprovider", "--tb=no",
    "-W", "ignore::pytest.PytestAssertRewriteWarning",
]  # fmt: skip


class Run:
    """Run of tests on a source tree in a forked process."""

    def __init__(self, tree: Path, seconds: float) -> None:
        self.tree, self.seconds = tree, seconds

    def __call__(self, tests: list[str], plugins: tuple[Any, ...] = ()) -> str | None:
        """Return the first test that fails, or None if all pass."""
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
        words = [*WORDS]
        if not plugins:
            words.append("-x")
        for plugin in plugins:
            plugin.start()
        code = pytest.main([*words, *tests], plugins=list(plugins))
        for plugin in plugins:
            plugin.stop()
        return int(code)


class Tracer:
    """Pytest plugin that records the lines and the processor time of each test."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.seconds: dict[str, float] = {}
        self.took = 0.0

    def start(self) -> None:
        """Start the trace in the working directory."""
        self.coverage = Coverage(str(self.data), source=[*FOLDERS])
        self.coverage.start()

    def stop(self) -> None:
        """Stop the trace, and write the executed lines and the processor times [s]."""
        self.coverage.stop()
        self.coverage.save()
        self.data.with_suffix(".json").write_text(json.dumps(self.seconds))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Record each test and its fixtures in a separate context of the trace."""
        self.coverage.switch_context(item.nodeid)
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Any:
        """Measure the processor time [s] of a test."""
        began = time.process_time()
        try:
            return (yield)
        finally:
            self.took = time.process_time() - began

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record whether a test passes."""
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = self.took


@dataclass(frozen=True)
class Trace:
    """The tests that execute each line, and the processor time [s] of each test."""

    lines: CoverageData
    seconds: dict[str, float]

    def of(self, path: Path, rows: range | set[int]) -> set[str]:
        """Return the tests that execute one of the given lines of a file."""
        # the trace may contain paths of another copy of the source tree
        files = [f for f in self.lines.measured_files() if f.endswith(f"/{path}")]
        tests = {
            test.partition("|")[0]
            for passing in map(self.lines.contexts_by_lineno, files)
            for row in rows
            for test in passing.get(row, [])
        }
        return tests & self.seconds.keys()

    def nearest(self, fault: Fault) -> list[str]:
        """Return the tests that execute a fault, with tests near the fault first."""
        tests = self.of(fault.path, fault.rows)
        if fault.name:
            named = re.compile(rf"\b{fault.name}\b")
            for path in (fault.path, *importers(fault.path)):
                lines = (ROOT / path).read_text("utf-8").splitlines()
                rows = {i for i, line in enumerate(lines, 1) if named.search(line)}
                tests |= self.of(path, rows)
        return sorted(tests, key=self.cost(fault))

    def cost(self, fault: Fault) -> Callable[[str], float]:
        """Return a function that computes the sort key of a test for a fault [s]."""
        near = f"tests/{fault.path.parent}/test_{fault.path.stem}"

        def cost(test: str) -> float:
            seconds = self.seconds[test] + 0.01
            if test.startswith(near):
                return seconds / 10
            if test.startswith(BESIDE):  # these tests compare many numbers
                return seconds / 3
            return (
                seconds if test.startswith(f"tests/{fault.chapter}/") else 3 * seconds
            )

        return cost


def sources() -> Iterator[Path]:
    """Return the source files of the packages."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield path.relative_to(ROOT)


def module_of(path: Path) -> str:
    """Return the module name of a source file."""
    name = ".".join(path.with_suffix("").parts).removesuffix(".__init__")
    return name if path.parts[0] == "forcefit" else f"forcefit.{name}"


def importers(path: Path) -> list[Path]:
    """Return the files of the packages that import names from a file."""
    module = module_of(path)
    text = re.compile(rf"^from {re.escape(module)} import", re.MULTILINE)
    return [p for p in sources() if text.search((ROOT / p).read_text("utf-8"))]


def traced(tree: Path, kept: Path) -> Trace:
    """Return the trace of the default tests of each folder.

    The stored trace is used if no test of the folder has changed.
    """
    lines = CoverageData(no_disk=True)
    seconds: dict[str, float] = {}
    for folder in places_of_tests():
        data = kept / f"{folder.replace('/', '.')}.coverage"
        times = data.with_suffix(".json")
        changed = max((path.stat().st_mtime for path in tests_in(folder)), default=0.0)
        if not times.exists() or times.stat().st_mtime < changed:
            data.unlink(missing_ok=True)
            Run(tree, 7200)([folder], (Tracer(data),))
            print(f"traced {folder}", flush=True)
        part = CoverageData(str(data))
        part.read()
        lines.update(part)
        seconds |= json.loads(times.read_text())
    return Trace(lines, seconds)


def places_of_tests() -> list[str]:
    """Return the folders and files of tests that are traced separately."""
    tests, places = ROOT / "tests", set[Path]()
    for path in tests.glob("*/**/test_*.py"):
        folder = path.parent
        places.add(path if any(folder.glob("*/test_*.py")) else folder)
    return [str(place.relative_to(ROOT)) for place in sorted(places)] + list(BESIDE)


def tests_in(place: str) -> list[Path]:
    """Return the Python files in a folder, or in the folder of a file."""
    path = ROOT / place
    return sorted(path.parent.glob("*.py") if path.is_file() else path.rglob("*.py"))
