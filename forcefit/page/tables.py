"""Tables and numbers on a page, stored in SI units so that units can be switched."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from forcefit.page.markup import piece
from forcefit.results.units import Shown, number_text, shown_in

_LONG = 48  # [characters] longer texts may be wrapped in a cell
Marked = tuple[dict[str, str], str]  # attributes and text of a cell


@dataclass(frozen=True)
class Value:
    """Number with its unit.

    Attributes:
        value: value in SI units.
        unit: SI unit; empty for a dimensionless number.
        digits: number of significant digits on the page.
    """

    value: float
    unit: str = ""
    digits: int = 4

    @property
    def text(self) -> str:
        """Number in its display unit, as text."""
        shown = shown_in(self.unit, self.value)
        return number_text(self.value * shown.factor, shown.shown, self.digits)

    @property
    def attributes(self) -> dict[str, str]:
        """HTML attributes: SI value at full precision, SI unit and text in SI units."""
        unit = shown_in(self.unit).unit
        si = number_text(self.value, unit, self.digits)
        marks = {"data-v": repr(float(self.value))}
        marks |= {"data-u": self.unit} if unit else {}
        return marks | ({"data-si": si} if si != self.text else {})


def rotation_and_translation(
    rotation: float, translation: float, digits: int = 4
) -> list[str | Value]:
    """Compose text from the magnitudes of a rotation [rad] and a translation [m]."""
    return [Value(rotation, "rad", digits), " and ", Value(translation, "m", digits)]


@dataclass(frozen=True)
class Column:
    """Column of numbers in a common unit, which is stated in the column heading.

    Attributes:
        title: description of the quantity.
        unit: SI unit.
        digits: number of significant digits on the page.
    """

    title: str
    unit: str = ""
    digits: int = 4


Cell = str | float | Value


def table(
    head: Sequence[str | Column], rows: Sequence[Sequence[Cell]], name: str = "table"
) -> str:
    """Return a table that can be sorted by its headings and copied as CSV.

    Args:
        head: column headings; numbers in a :class:`Column` are in its unit.
        rows: cells, each a text, a number (in a :class:`Column`) or a :class:`Value`.
        name: name of the table, for the label of the copy button.

    Returns:
        HTML in which special characters are escaped.
    """
    columns = [_shown_column(h, [row[k] for row in rows]) for k, h in enumerate(head)]
    heads = [_head_cell(h, s) for h, s in zip(head, columns, strict=True)]
    cells = [
        [_cell(cell, h, s) for cell, h, s in zip(row, head, columns, strict=True)]
        for row in rows
    ]
    return piece("table", name, heads, cells)


def _shown_column(head: str | Column, cells: Sequence[Cell]) -> Shown:
    """Return the display unit of a column, chosen by the magnitude of its numbers."""
    if isinstance(head, str):
        return Shown("", "", 1.0)
    sizes = [abs(c) for c in cells if isinstance(c, int | float) and math.isfinite(c)]
    return shown_in(head.unit, max(sizes, default=0.0))


def _head_cell(head: str | Column, shown: Shown) -> Marked:
    """Return the attributes and text of a column heading."""
    if isinstance(head, str):
        return {}, head
    if not shown.unit:
        return {}, head.title
    si = f"{head.title} [{shown.unit}]"
    return {"data-si": si}, f"{head.title} [{shown.shown}]"


def _cell(cell: Cell, head: str | Column, shown: Shown) -> Marked:
    """Return the attributes and text of a cell."""
    if isinstance(cell, str):
        return {"class": "long"} if len(cell) > _LONG else {}, cell
    if isinstance(cell, Value):
        return cell.attributes, cell.text
    digits = head.digits if isinstance(head, Column) else 6
    si = {"data-si": number_text(cell, digits=digits)} if shown.unit else {}
    text = number_text(cell * shown.factor, digits=digits)
    return {"data-v": repr(float(cell))} | si, text
