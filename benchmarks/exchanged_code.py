"""Inject faults into imported functions in a forked process.

All tests are collected once, and all modules are imported.  For each fault, the process
forks, replaces the code of the function with the fault, and runs the tests that execute
its line.  This is much faster than a new process for each fault.  It is possible only
for statements within functions.
"""

import functools
import gc
import importlib
import os
import resource
import shutil
import signal
import sys
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FunctionType

import pytest

from benchmarks.faults import Fault
from benchmarks.traced_tests import (
    MEMORY,
    WORDS,
    module_of,
    places_of_tests,
    sources,
)

PASSED, FAILED, BROKEN = 0, 1, 2
WAITS = 10  # [-] largest allowed ratio of wall time to processor time of a test


class Session:
    """Pytest plugin that runs the tests selected by ``judge``."""

    def __init__(self, tree: Path, judge: Callable[["Session"], None]) -> None:
        self.tree, self.judge = tree, judge
        self.failed = ""

    def run(self) -> None:
        """Collect the tests, import all modules, and call ``judge``."""
        os.chdir(self.tree)
        os.environ |= {"PYTHONPATH": str(self.tree), "PYTHONDONTWRITEBYTECODE": "1"}
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(self.tree))
        pytest.main([*WORDS, "-s", *places_of_tests()], plugins=[self])

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Import every module that a test may import."""
        self.items = {item.nodeid: item for item in session.items}
        for path in sources():
            if path.name not in {"__main__.py", "mesh_worker.py"}:
                importlib.import_module(module_of(path))
        self.functions = defaultdict[str, list[FunctionType]](list)
        for found in gc.get_objects():
            if type(found) is FunctionType:  # isinstance fails for expired weak proxies
                self.functions[found.__code__.co_filename].append(found)
            elif type(found) is functools._lru_cache_wrapper:
                found.cache_clear()
        # forks share the memory of objects that they do not modify
        gc.collect()
        gc.freeze()

    def pytest_runtestloop(self) -> bool:
        """Call ``judge`` instead of running all tests."""
        self.judge(self)
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record the first test that fails."""
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def seen(self, fault: Fault, tests: list[str], seconds: float) -> str | None:
        """Return the first failing test, "" at a time limit, or None if all pass."""
        some = [self.items[test] for test in tests if test in self.items]
        if not some:
            return None
        folder = some[0].config._tmp_path_factory.getbasetemp()
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            code = FAILED
            try:
                limit = int(seconds) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
                resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
                signal.alarm(WAITS * limit)
                with open(os.devnull, "r+") as nothing:
                    for stream in range(3):
                        os.dup2(nothing.fileno(), stream)
                self.exchange(fault)
                for item, after in zip(some, [*some[1:], None], strict=True):
                    item.ihook.pytest_runtest_protocol(item=item, nextitem=after)
                    if self.failed:
                        os.write(writing, self.failed.encode())
                        os._exit(FAILED)
                code = PASSED
            except BaseException:
                os.write(writing, traceback.format_exc().encode())
                code = BROKEN
            finally:
                os._exit(code)
        os.close(writing)
        with os.fdopen(reading) as file:
            failed = file.read()
        _, status = os.waitpid(child, 0)
        if os.WIFEXITED(status) and os.WEXITSTATUS(status) == BROKEN:
            raise RuntimeError(failed)
        for left in folder.iterdir():
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
        return None if status == 0 else failed

    def exchange(self, fault: Fault) -> None:
        """Replace the code of the functions of a file by the code with the fault."""
        # the packages are imported through the symbolic links in forcefit
        name = str(self.tree / Path(*module_of(fault.path).split(".")))
        name += "/__init__.py" if fault.path.name == "__init__.py" else ".py"
        right = (self.tree / fault.path).read_text("utf-8")
        before, after = (
            list(within(compile(source, name, "exec", dont_inherit=True)))
            for source in (right, fault.put_into(right))
        )
        codes = dict(zip(before, after, strict=True))
        for function in self.functions[name]:
            function.__code__ = codes[function.__code__]


def within(code: CodeType) -> Iterator[CodeType]:
    """Yield a code object and all code objects inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from within(constant)
