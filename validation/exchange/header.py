"""Find the header of a device table and the target of each column."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from forcefit.validation.campaign.dialect import parse_number
from forcefit.validation.exchange.column_names import (
    LENGTH_UNITS,
    Column,
    column_of,
    unit_word,
)

_STATED = re.compile(r"\bunits?\b(.*)", re.IGNORECASE)
_KINDS = {"rotation", "position", "translation", "orientation"}
_PREAMBLE = 100  # largest number of lines before a header


@dataclass(frozen=True)
class Header:
    """The columns of a table.

    Attributes:
        first: index of the first row of data among the rows of the table.
        cells: unchanged cells of the header; empty if there is no header.
        columns: meaning of each column.
        unit: unit of lengths above the header; empty if there is none.
        unit_line: number of the line that contains this unit, for messages.
    """

    first: int
    cells: Sequence[str]
    columns: Sequence[Column]
    unit: str
    unit_line: int


def find_header(
    rows: Sequence[tuple[int, list[str]]], targets: Iterable[str]
) -> Header | None:
    """Find the header of a table.

    Other lines may precede the header.

    Args:
        rows: line number and cells of each row of the table.
        targets: names of the targets.

    Returns:
        The header; None if no row contains the names x, y and z.
    """
    for i, (_, cells) in enumerate(rows[:_PREAMBLE]):
        cells = _with_kinds(cells, rows[i - 1][1] if i else [])
        columns = [column_of(cell) for cell in cells]
        axes = [column.axis for column in columns if column.kind == "axis"]
        several = any(axes.count(axis) > 1 for axis in "xyz")
        if set(axes) != set("xyz") or several:
            wide = _by_target(cells, rows[:i], list(targets))
            columns = wide or columns
            if not wide and set(axes) != set("xyz"):
                continue
        after = rows[i + 1][1] if i + 1 < len(rows) else []
        units = [unit_word(cell) for cell in after]
        below = any(units) and not any(_is_number(cell) for cell in after)
        if below:
            columns = [
                Column(c.kind, c.axis, c.unit or unit, c.target)
                for c, unit in zip(
                    columns, [*units, *[""] * len(columns)], strict=False
                )
            ]
        line, unit = _stated(rows[:i])
        return Header(i + 1 + below, cells, columns, unit, line)
    return None


def without_header(rows: Sequence[tuple[int, list[str]]], decimal: str) -> Header:
    """Find the first row of data in a table without a header, and the unit above it.

    Args:
        rows: line number and cells of each row of the table.
        decimal: the decimal mark.

    Returns:
        A header without columns.
    """
    for i, (_, cells) in enumerate(rows[:_PREAMBLE]):
        if sum(_is_number(cell, decimal) for cell in cells) >= 3:
            line, unit = _stated(rows[:i])
            return Header(i, (), (), unit, line)
    return Header(0, (), (), "", 0)


def _by_target(
    cells: Sequence[str], before: Sequence[tuple[int, list[str]]], targets: list[str]
) -> list[Column]:
    """Return the columns of a table with several targets per row.

    Target names are in the column headings or in a row above the headings. Without
    names, the groups of columns x, y, z are assigned to the targets in order. This
    requires as many groups as targets.

    Args:
        cells: cells of the header.
        before: rows above the header.
        targets: names of the targets.

    Returns:
        The columns.
    """
    split = [_of_target(cell, targets) for cell in cells]
    named = [Column(c.kind, c.axis, c.unit, t) for c, t in split]
    if _complete(named):
        return named
    plain = [column_of(cell) for cell in cells]
    for _, above in reversed(before):
        labels = _filled(above, len(cells))
        # For example, the target arm is preferred to its markers arm:1 and arm:2.
        exact = set(labels) & set(targets)
        found = [
            label if label in exact else _only(label, [*{*targets} - exact])
            for label in labels
        ]
        marked = [
            Column(c.kind, c.axis, c.unit, t if c.kind not in {"name", "time"} else "")
            for c, t in zip(plain, found, strict=True)
        ]
        if _complete(marked):
            return marked
    numbered = [column_of(re.sub(r"[ _.]?\d+(?=\W*$|\s*[\[(])", "", c)) for c in cells]
    for columns in (plain, numbered):
        ordered = _by_order(columns, targets)
        if ordered:
            return ordered
    return []


def _by_order(columns: Sequence[Column], targets: list[str]) -> list[Column]:
    """Assign groups of columns x, y, z to the targets in order."""
    groups = -1
    ordered = []
    for column in columns:
        groups += column.kind == "axis" and column.axis == "x"
        own = column.kind in {"axis", "sigma", "U", "quaternion", "angle"}
        name = targets[groups] if own and 0 <= groups < len(targets) else ""
        ordered.append(Column(column.kind, column.axis, column.unit, name))
    several = groups + 1 == len(targets) > 1
    return ordered if several and _complete(ordered, len(targets)) else []


def _complete(columns: Sequence[Column], least: int = 1) -> bool:
    """Return whether columns x, y and z occur exactly once for every named target."""
    axes: dict[str, str] = {}
    for column in columns:
        if column.kind == "axis" and column.target:
            axes[column.target] = axes.get(column.target, "") + column.axis
    return len(axes) >= least and all(sorted(a) == list("xyz") for a in axes.values())


def _of_target(cell: str, targets: Sequence[str]) -> tuple[Column, str]:
    """Return the meaning and the target of a heading such as ``A x`` or ``x_A``."""
    for target in sorted(targets, key=len, reverse=True):
        name = re.escape(target)
        before = re.search(rf"(?:^|[^a-z0-9]){name}(?=[^a-z0-9]|[xyz]\b)", cell, re.I)
        after = re.search(rf"[^a-z0-9]{name}(?=\W*$|\s*[\[(])", cell, re.I)
        parts = [cell[before.end() :]] if before else []
        parts += [cell[: after.start()] + cell[after.end() :]] if after else []
        for part in parts:
            column = column_of(part)
            if column.kind not in {"", "name", "time"}:
                return column, target
    column = column_of(cell)
    own = column.kind in {"name", "time"}
    return (column if own else Column("", unit=column.unit)), ""


def _only(label: str, targets: Sequence[str]) -> str:
    """Return the name of the target in a label such as ``arm:SMR1``, or ``""``."""
    words = re.split(r"[:./|\s]+", label)
    found = [target for target in targets if target in words or target == label]
    return found[0] if len(found) == 1 else ""


def _with_kinds(cells: list[str], above: Sequence[str]) -> list[str]:
    """Add the quantity in the line above (Rotation or Position) to each heading."""
    kinds = [word if word.lower() in _KINDS else "" for word in above]
    if not any(kinds) or len(above) > len(cells):
        return cells
    kinds += [""] * (len(cells) - len(kinds))
    return [f"{kind} {cell}".strip() for kind, cell in zip(kinds, cells, strict=True)]


def _filled(cells: Sequence[str], count: int) -> list[str]:
    """Fill each empty cell with the label before it, as for merged cells."""
    labels: list[str] = []
    for cell in [*cells, *[""] * count][:count]:
        labels.append(cell or (labels[-1] if labels else ""))
    return labels


def _stated(rows: Sequence[tuple[int, list[str]]]) -> tuple[int, str]:
    """Return the unit of lengths above a header, and its line number, or 0 and ""."""
    for line, cells in rows:
        if match := _STATED.search(" ".join(cells)):
            words = re.findall(r"[A-Za-zµμ]+", match[1])[:4]
            units = [unit for w in words if (unit := unit_word(w)) in LENGTH_UNITS]
            if units:  # in "units in mm", "in" does not mean inches
                return line, next((u for u in units if u != "in"), "in")
    return 0, ""


def _is_number(cell: str, decimal: str = ".") -> bool:
    """Return whether a cell is a number."""
    return bool(np.isfinite(parse_number(cell, decimal)))


def by_target(columns: Sequence[Column]) -> Mapping[str, list[int]]:
    """Group the columns by target.

    The key of columns without a target is an empty string.

    Args:
        columns: columns of a table.

    Returns:
        Mapping from target to its columns, in the order of first occurrence.
    """
    groups: dict[str, list[int]] = {}
    for k, column in enumerate(columns):
        if column.kind not in {"", "name", "time"}:
            groups.setdefault(column.target, []).append(k)
    return groups
