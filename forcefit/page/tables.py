"""Tables and numbers of a page: each number knows its SI value, for the switch."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from forcefit.page.markup import piece
from forcefit.results.units import Shown, number_text, shown_in

_LONG = (
    48  # characters of a text that may wrap in its cell; shorter ones and numbers not
)
Marked = tuple[dict[str, str], str]  # attributes and text of a cell


@dataclass(frozen=True)
class Value:
    """A number with its unit.

    Attributes:
        value: in SI.
        unit: SI; empty for a pure number.
        digits: significant digits shown.
    """

    value: float
    unit: str = ""
    digits: int = 4

    @property
    def text(self) -> str:
        """The number in the unit of a drawing."""
        shown = shown_in(self.unit, self.value)
        return number_text(self.value * shown.factor, shown.shown, self.digits)

    @property
    def attributes(self) -> dict[str, str]:
        """The SI value in full, its unit, and its text where another unit is shown."""
        unit = shown_in(self.unit).unit
        si = number_text(self.value, unit, self.digits)
        marks = {"data-v": repr(float(self.value))}
        marks |= {"data-u": self.unit} if unit else {}
        return marks | ({"data-si": si} if si != self.text else {})


@dataclass(frozen=True)
class Column:
    """A column of numbers of one unit, which its head states.

    Attributes:
        title: in words.
        unit: SI.
        digits: significant digits shown.
    """

    title: str
    unit: str = ""
    digits: int = 4


Cell = str | float | Value


def table(
    head: Sequence[str | Column], rows: Sequence[Sequence[Cell]], name: str = "table"
) -> str:
    """A table that a click on its head sorts, and a button copies as CSV.

    Args:
        head: of each column; numbers under a :class:`Column` share its unit.
        rows: texts, numbers (under a :class:`Column`) or :class:`Value`.
        name: for the button's label.

    Returns:
        HTML; texts are escaped.
    """
    columns = [_shown_column(h, [row[k] for row in rows]) for k, h in enumerate(head)]
    heads = [_head_cell(h, s) for h, s in zip(head, columns, strict=True)]
    cells = [
        [_cell(cell, h, s) for cell, h, s in zip(row, head, columns, strict=True)]
        for row in rows
    ]
    return piece("table", name, heads, cells)


def _shown_column(head: str | Column, cells: Sequence[Cell]) -> Shown:
    """The unit of a column, by the size of its numbers."""
    if isinstance(head, str):
        return Shown("", "", 1.0)
    sizes = [abs(c) for c in cells if isinstance(c, int | float) and math.isfinite(c)]
    return shown_in(head.unit, max(sizes, default=0.0))


def _head_cell(head: str | Column, shown: Shown) -> Marked:
    """Title and unit of a column."""
    if isinstance(head, str):
        return {}, head
    if not shown.unit:
        return {}, head.title
    si = f"{head.title} [{shown.unit}]"
    return {"data-si": si}, f"{head.title} [{shown.shown}]"


def _cell(cell: Cell, head: str | Column, shown: Shown) -> Marked:
    """A text, a number under a unit, or a number with its own."""
    if isinstance(cell, str):
        return {"class": "long"} if len(cell) > _LONG else {}, cell
    if isinstance(cell, Value):
        return cell.attributes, cell.text
    digits = head.digits if isinstance(head, Column) else 6
    si = {"data-si": number_text(cell, digits=digits)} if shown.unit else {}
    text = number_text(cell * shown.factor, digits=digits)
    return {"data-v": repr(float(cell))} | si, text
