"""Random one-line faults in the numerical modules, and whether the tests see them.

    python benchmarks/mutants.py [COUNT] [--seed N] [--only FOLDER] [--traced FOLDER]

All default tests run once, traced: which test passes which line, and how long it takes
(kept in the folder after --traced, so that a second call goes on with it).  Each fault
is put into a copy of the tree, and the tests that pass its line run, the shortest
first, a minute of them; the first failure is enough.  Compiled lines are not traced:
for them the tests that import the module and those of its chapter run.  Faults not seen
so far are put in together, a dozen at once, and all default tests run: what fails is
run with each of them alone.  Printed: the share caught, and every survivor.
"""

import argparse
import ast
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

from coverage import CoverageData

ROOT = Path(__file__).parents[1]
CHAPTERS = (
    "stiffness/beam", "stiffness/surface", "stiffness/mesh", "stiffness/fem",
    "assembly/solvers", "assembly/kinematics", "assembly/linear", "assembly/batch",
    "assembly/exact", "assembly/measurement", "assembly/effects",
    "assembly/statistics", "validation/diagnosis",
)  # fmt: skip
SWAPS: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
    ast.MatMult: ast.Add, ast.Pow: ast.Mult,
}  # fmt: skip
AT_ONCE = 12
LONGEST = 60.0  # [s] of tests that run for one fault alone
# one test run's; a fault that makes it need more is caught
PROCESSOR_SECONDS = {"alone": 240, "all": 1800}
MEMORY = 8 * 2**30  # [byte]


@dataclass(frozen=True)
class Fault:
    """A wrong expression: in which file, on which row, the new line, what it is."""

    chapter: str
    path: Path
    row: int
    line: str
    what: str

    def __str__(self) -> str:
        return f"{self.path}:{self.row}  {self.what}"


def places(tree: ast.Module) -> Iterator[ast.AST]:
    """Nodes that can be made wrong: not in messages, annotations or docstrings."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
            continue
        if isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.UnaryOp):
            yield node
        if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            yield node
        for field, value in ast.iter_fields(node):
            if field in {"annotation", "returns", "decorator_list"}:
                continue
            children = value if isinstance(value, list) else [value]
            waiting += [child for child in children if isinstance(child, ast.AST)]


def wrong(node: ast.AST, random: Random) -> ast.AST | None:
    """The node with one fault; None where it has none of ours."""
    if isinstance(node, ast.Constant):
        value = node.value
        assert isinstance(value, int | float)
        other = value + 1 if isinstance(value, int) else (2 * value if value else 1.0)
        return ast.Constant(other)
    if isinstance(node, ast.UnaryOp):
        return node.operand if isinstance(node.op, ast.USub | ast.Not) else None
    if isinstance(node, ast.BinOp):
        swap = SWAPS.get(type(node.op))
        return swap and ast.BinOp(node.left, swap(), node.right)
    if isinstance(node, ast.BoolOp):
        return ast.BoolOp(SWAPS[type(node.op)](), node.values)
    assert isinstance(node, ast.Compare)
    k = random.randrange(len(node.ops))
    swap = SWAPS.get(type(node.ops[k]))
    ops = [*node.ops[:k], *([swap()] if swap else []), *node.ops[k + 1 :]]
    return swap and ast.Compare(node.left, ops, node.comparators)


def drawn(chapter: str, path: Path, random: Random) -> Fault | None:
    """A fault in a file; None where the expression drawn has none of ours."""
    source = (ROOT / path).read_text(encoding="utf-8")
    nodes = list(places(ast.parse(source)))
    if not nodes:
        return None
    node = random.choice(nodes)
    new = wrong(node, random)
    old = ast.get_source_segment(source, node)
    if new is None or old is None or "\n" in old:
        return None
    text = ast.unparse(ast.fix_missing_locations(new))
    row = node.lineno  # type: ignore[attr-defined]
    line = source.splitlines(keepends=True)[row - 1].encode()
    begin, end = node.col_offset, node.end_col_offset  # type: ignore[attr-defined]
    changed = (line[:begin] + f"({text})".encode() + line[end:]).decode()
    return Fault(chapter, path, row, changed, f"{old} -> {text}")


def put(faults: Iterable[Fault], tree: Path) -> None:
    """Lay a new copy of the tree with these faults in it."""
    # with the caches of compiled functions, whose files keep their times
    left_out = shutil.ignore_patterns(".git", ".venv", ".*_cache", "*_study")
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=left_out)
    for fault in faults:
        lines = (tree / fault.path).read_text(encoding="utf-8").splitlines(True)
        lines[fault.row - 1] = fault.line
        (tree / fault.path).write_text("".join(lines), encoding="utf-8")
        if any(line.startswith("@kernel") for line in lines):
            # built into what calls them, whose files have not changed
            for cached in (tree / "assembly").rglob("*.nbi"):
                cached.unlink()


def limit(seconds: int) -> None:
    """Processor time and memory of this process."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def failed(tree: Path, tests: list[str]) -> str | None:
    """The first test that fails, "" where none can be named; None if all pass."""
    every = tests == ["tests"]
    command = [
        sys.executable, "-m", "pytest", "-q", "-x", "-rfE", "-m", "not slow",
        "-p", "no:cacheprovider", "-p", "no:xdist", *tests,
    ]  # fmt: skip
    ran = subprocess.run(
        command,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: limit(PROCESSOR_SECONDS["all" if every else "alone"]),
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode in {0, 5}:
        return None
    first = re.search(r"^(?:FAILED|ERROR) (\S+)", ran.stdout, re.MULTILINE)
    return first[1] if first else ""


@dataclass(frozen=True)
class Trace:
    """Which tests pass a line, and seconds that each test takes."""

    lines: CoverageData
    seconds: dict[str, float]

    def nearest(self, fault: Fault) -> list[str]:
        """Tests for a fault, the shortest first."""
        file = next(
            (f for f in self.lines.measured_files() if f.endswith(f"/{fault.path}")), ""
        )
        passing = self.lines.contexts_by_lineno(file).get(fault.row, []) if file else []
        tests = [name.partition("|")[0] for name in passing if name]
        if not tests:
            files = set(importing(fault))
            tests = [t for t in self.seconds if t.partition("::")[0] in files]
        tests.sort(key=lambda test: self.seconds.get(test, 0.0))
        total, chosen = 0.0, []
        for test in dict.fromkeys(tests):
            total += self.seconds.get(test, 0.0)
            if chosen and total > LONGEST:
                break
            chosen.append(test)
        return chosen


def traced(tree: Path, folder: Path) -> Trace:
    """All default tests, traced, or what an earlier call left in the folder."""
    data, printed = folder / "lines.coverage", folder / "tests.txt"
    if not printed.exists():
        packages = ("stiffness", "assembly", "validation")
        command = [
            sys.executable, "-m", "pytest", "-n", "auto", "-m", "not slow", "-vv",
            *(f"--cov={name}" for name in packages), "--cov-context=test",
            "--cov-report=", "--durations=0", "--durations-min=0",
        ]  # fmt: skip
        environment = {"PYTHONPATH": str(tree), "COVERAGE_FILE": str(data)}
        ran = subprocess.run(
            command, cwd=tree, env={**os.environ, **environment}, check=True,
            capture_output=True, text=True,
        )  # fmt: skip
        printed.write_text(ran.stdout)
    lines = CoverageData(str(data))
    lines.read()
    rows = re.findall(r"^([\d.]+)s call +(\S.*)$", printed.read_text(), re.MULTILINE)
    return Trace(lines, {test.strip(): float(seconds) for seconds, test in rows})


def importing(fault: Fault) -> list[str]:
    """Files of the tests of a chapter and of those that import the module."""
    module = ".".join(fault.path.with_suffix("").parts)
    folder, _, name = module.rpartition(".")
    imports = re.compile(
        rf"{re.escape(module)}\b|from {re.escape(folder)} import [^\n]*\b{name}\b"
    )
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    chapter = ROOT / "tests" / fault.chapter
    return [
        str(path.relative_to(ROOT))
        for path in files
        if path.is_relative_to(chapter) or imports.search(path.read_text())
    ]


def survivors(faults: list[Fault], tree: Path) -> list[Fault]:
    """Those of some faults, put in together, that no default test sees."""
    left = list(faults)
    while left:
        put(left, tree)
        test = failed(tree, ["tests"])
        if test is None:
            break
        caught = []
        for fault in left if test else []:
            put([fault], tree)
            if failed(tree, [test]) is not None:
                caught.append(fault)
        if not caught:  # only together: one by one
            for fault in left:
                put([fault], tree)
                if failed(tree, ["tests"]) is not None:
                    caught.append(fault)
            return [fault for fault in left if fault not in caught]
        left = [fault for fault in left if fault not in caught]
    return left


def main() -> None:
    """Draw faults, count those caught, name those that were not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    parser.add_argument("--traced", type=Path)
    asked = parser.parse_args()
    random = Random(asked.seed)
    files = [
        (chapter, path.relative_to(ROOT))
        for chapter in CHAPTERS
        if chapter.startswith(asked.only)
        for path in sorted((ROOT / chapter).rglob("*.py"))
    ]
    weights = [len((ROOT / path).read_text().splitlines()) for _, path in files]
    began, done, survived = time.monotonic(), 0, 0
    unseen: list[Fault] = []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "forcefit"
        put([], tree)
        kept = asked.traced or Path(folder)
        kept.mkdir(parents=True, exist_ok=True)
        trace = traced(tree, kept)
        while done < asked.count:
            ((chapter, path),) = random.choices(files, weights)
            fault = drawn(chapter, path, random)
            if fault is None:
                continue
            put([fault], tree)
            if failed(tree, trace.nearest(fault)) is None:
                unseen.append(fault)
                print(f"not yet seen  {fault}", flush=True)
            done += 1
            if len(unseen) == AT_ONCE or done == asked.count:
                for fault in survivors(unseen, tree):
                    survived += 1
                    print(f"survived  {fault}", flush=True)
                unseen = []
            print(
                f"{done} faults, {survived} survived, {len(unseen)} not yet known, "
                f"{time.monotonic() - began:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
