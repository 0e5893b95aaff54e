"""Random one-line faults in the numerical modules, and whether the tests see them.

    python benchmarks/mutants.py [COUNT] [--seed N] [--only FOLDER]

Each fault is put into a copy of the tree; the tests of its chapter run first, then
those of its package, then all default tests; the first failure is enough.  Functions
compiled by numba are compiled anew for faults in their files.  Printed:
the share caught, and every survivor with its line.
"""

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random

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


def mutant(path: Path, random: Random) -> tuple[str, int, str] | None:
    """A file with one fault: its text, the line, and what was done to it."""
    source = path.read_text(encoding="utf-8")
    nodes = list(places(ast.parse(source)))
    if not nodes:
        return None
    node = random.choice(nodes)
    new = wrong(node, random)
    old = ast.get_source_segment(source, node)
    if new is None or old is None or "\n" in old:
        return None
    text = ast.unparse(ast.fix_missing_locations(new))
    lines = source.splitlines(keepends=True)
    row = node.lineno - 1  # type: ignore[attr-defined]
    line = lines[row].encode()
    begin, end = node.col_offset, node.end_col_offset  # type: ignore[attr-defined]
    lines[row] = (line[:begin] + f"({text})".encode() + line[end:]).decode()
    return "".join(lines), row + 1, f"{old} -> {text}"


def caught(tree: Path, chapter: str, compiled: bool) -> bool:
    """Whether any default test fails, the nearest asked first."""
    package = chapter.partition("/")[0]
    environment = {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryDirectory() as cache:
        if compiled:
            environment["NUMBA_CACHE_DIR"] = cache
        for tests in (f"tests/{chapter}", f"tests/{package}", "tests"):
            if not (tree / tests).is_dir():
                continue
            command = [
                sys.executable, "-m", "pytest", "-q", "-x", "-m", "not slow",
                "-p", "no:cacheprovider", "-p", "no:xdist", tests,
            ]  # fmt: skip
            try:
                ran = subprocess.run(
                    command, cwd=tree, env=environment, timeout=1800,
                    capture_output=True,
                )  # fmt: skip
            except subprocess.TimeoutExpired:
                return True  # a loop that no longer ends
            if ran.returncode not in {0, 5}:
                return True
    return False


def main() -> None:
    """Draw faults, count those caught, name those that were not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    random = Random(asked.seed)
    files = [
        (chapter, path.relative_to(ROOT))
        for chapter in CHAPTERS
        if chapter.startswith(asked.only)
        for path in sorted((ROOT / chapter).rglob("*.py"))
    ]
    weights = [len((ROOT / path).read_text().splitlines()) for _, path in files]
    began, done, survivors = time.monotonic(), 0, []
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "forcefit"
        # with the caches of compiled functions, whose files keep their times
        left_out = shutil.ignore_patterns(".git", ".venv", ".mypy_cache", "*_study")
        shutil.copytree(ROOT, tree, ignore=left_out)
        while done < asked.count:
            ((chapter, path),) = random.choices(files, weights)
            drawn = mutant(ROOT / path, random)
            if drawn is None:
                continue
            text, row, what = drawn
            (tree / path).write_text(text, encoding="utf-8")
            seen = caught(tree, chapter, "import kernel" in text)
            shutil.copy2(ROOT / path, tree / path)
            done += 1
            if not seen:
                survivors.append(f"{path}:{row}  {what}")
                print(f"survived  {survivors[-1]}", flush=True)
            print(
                f"{done} faults, {done - len(survivors)} caught, "
                f"{time.monotonic() - began:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
