"""Random faults: changed expressions in the numerical modules.

The probability of a file is proportional to its length.  Reports and pictures
(``report.py``, ``plot.py``, ``figures.py``, ``scene.py``) are excluded.

An operator is replaced by its opposite (``+`` and ``-``, ``<`` and ``>=``, ``and`` and
``or``), a sign or a ``not`` is removed, or a number is increased by one.  Numbers above
ten are replaced by one, because 401 steps instead of 400 are not a fault.  The size -1
in ``reshape`` is not changed.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

ROOT = Path(__file__).parents[1]
CHAPTERS = (
    "stiffness/beam", "stiffness/surface", "stiffness/mesh", "stiffness/fem",
    "assembly/solvers", "assembly/kinematics", "assembly/linear",
    "assembly/exact", "assembly/measurement", "assembly/effects",
    "assembly/platform_stiffness", "assembly/drawing", "assembly/callouts",
    "assembly/steps", "assembly/path", "assembly/statistics", "validation/diagnosis",
)  # fmt: skip
SWAPS: dict[type, type] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.And: ast.Or, ast.Or: ast.And,
    ast.MatMult: ast.Add, ast.Pow: ast.Mult,
}  # fmt: skip
LARGE = 10  # limit above which numbers are replaced by one
LEFT_OUT = {
    "report.py", "plot.py", "figures.py", "scene.py", "scenes.py",
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """A wrong expression in a file.

    ``rows`` contains the lines of its statement.  ``name`` is the variable that a
    statement outside functions assigns.  It is None inside a function.
    """

    chapter: str
    path: Path
    row: int
    line: str
    what: str
    rows: range
    name: str | None
    within: bool

    def put_into(self, source: str) -> str:
        """Return the text of a file with a fault."""
        lines = source.splitlines(keepends=True)
        lines[self.row - 1] = self.line
        return "".join(lines)

    def __str__(self) -> str:
        return f"{self.path}:{self.row}  {self.what}"


def places(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the expressions that can be changed."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
            continue
        if isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.UnaryOp):
            yield node
        if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            yield node
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("reshape"):
            sizes = [arg for arg in node.args if not is_left_open(arg)]
            waiting += [node.func, *sizes]
            continue
        for field, value in ast.iter_fields(node):
            if field in {"annotation", "returns", "decorator_list"}:
                continue
            children = value if isinstance(value, list) else [value]
            waiting += [child for child in children if isinstance(child, ast.AST)]


def is_left_open(node: ast.AST) -> bool:
    """Return whether a node is the size -1, which numpy computes."""
    return isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub)


def wrong(node: ast.AST) -> list[ast.AST]:
    """Return variants of an expression, each with a fault."""
    if isinstance(node, ast.Constant):
        value = node.value
        assert isinstance(value, int | float)
        return [ast.Constant(value + 1 if value <= LARGE else type(value)(1))]
    if isinstance(node, ast.UnaryOp):
        return [node.operand] if isinstance(node.op, ast.USub | ast.Not) else []
    if isinstance(node, ast.BinOp):
        swap = SWAPS.get(type(node.op))
        return [ast.BinOp(node.left, swap(), node.right)] if swap else []
    if isinstance(node, ast.BoolOp):
        return [ast.BoolOp(SWAPS[type(node.op)](), node.values)]
    assert isinstance(node, ast.Compare)
    return [
        ast.Compare(
            node.left, [*node.ops[:k], swap(), *node.ops[k + 1 :]], node.comparators
        )
        for k, op in enumerate(node.ops)
        if (swap := SWAPS.get(type(op)))
    ]


def faults_at(chapter: str, path: Path, node: ast.AST, source: str) -> list[Fault]:
    """Return the faults of an expression in a file."""
    old = ast.get_source_segment(source, node)
    if old is None or "\n" in old:
        return []
    row = node.lineno  # type: ignore[attr-defined]
    line = source.splitlines(keepends=True)[row - 1].encode()
    begin, end = node.col_offset, node.end_col_offset  # type: ignore[attr-defined]
    where = statement(ast.parse(source), row)
    faults = []
    for new in wrong(node):
        text = ast.unparse(ast.fix_missing_locations(new))
        changed = (line[:begin] + f"({text})".encode() + line[end:]).decode()
        faults.append(Fault(chapter, path, row, changed, f"{old} -> {text}", *where))
    return faults


def drawn(chapter: str, path: Path, random: Random) -> Fault | None:
    """Return a random fault in a file, or None if the expression cannot be changed."""
    source = (ROOT / path).read_text(encoding="utf-8")
    nodes = list(places(ast.parse(source)))
    if not nodes:
        return None
    faults = faults_at(chapter, path, random.choice(nodes), source)
    return random.choice(faults) if faults else None


def all_in(chapter: str, path: Path) -> list[Fault]:
    """Return all faults of a file in the order of its lines."""
    source = (ROOT / path).read_text(encoding="utf-8")
    faults = [
        fault
        for node in places(ast.parse(source))
        for fault in faults_at(chapter, path, node, source)
    ]
    return sorted(faults, key=lambda fault: fault.row)


def statement(tree: ast.Module, row: int) -> tuple[range, str | None, bool]:
    """Return the lines of a statement, its name, and whether it is in a function."""
    within: list[ast.stmt] = []
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.stmt) and node.lineno <= row <= (node.end_lineno or 0):
            within.append(node)
    within.sort(key=lambda node: node.lineno)
    last = within[-1]
    body = getattr(last, "body", None)
    end = body[0].lineno - 1 if body else last.end_lineno or row
    rows = range(last.lineno, max(end, row) + 1)
    functions = [n for n in within if isinstance(n, ast.FunctionDef)]
    if functions and functions[-1] is last:  # the line contains a default argument
        return range(last.body[0].lineno, (last.end_lineno or row) + 1), None, False
    if functions:
        return rows, None, True
    classes = [n.name for n in within if isinstance(n, ast.ClassDef)]
    if classes:  # the line contains the default of a field, which is used later
        return rows, classes[-1], False
    targets = getattr(last, "targets", None) or [getattr(last, "target", None)]
    names = [n.id for n in targets if isinstance(n, ast.Name)]
    # the body of a lambda is executed after the import
    return rows, names[0] if names else path_name(last), False


def path_name(node: ast.AST) -> str | None:
    """Return the first name in an expression that is evaluated at import."""
    names = [n.id for n in ast.walk(node) if isinstance(n, ast.Name)]
    return names[0] if names else None


def files_of(chapters: str) -> list[tuple[str, Path]]:
    """Return the packages whose names start with a text, and their files."""
    return [
        (chapter, path.relative_to(ROOT))
        for chapter in CHAPTERS
        if chapter.startswith(chapters)
        for path in sorted((ROOT / chapter).rglob("*.py"))
        if path.name not in LEFT_OUT
    ]
