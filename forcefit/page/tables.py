"""Tables and numbers of a page: each number knows its SI value, for the switch."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

from forcefit.page.units import Shown, number_text, shown_in

_SORTS = " scope=col tabindex=0"  # heads take the focus: Enter sorts, as a click does
_LONG = (
    48  # characters of a text that may wrap in its cell; shorter ones and numbers not
)


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


def inline(value: Value) -> str:
    """A number within a sentence, as HTML."""
    return f"<span{_two_texts(value)}>{html.escape(_texts(value)[0])}</span>"


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
    top = "".join(_head_cell(h, s) for h, s in zip(head, columns, strict=True))
    body = "".join(
        "<tr>"
        + "".join(
            _cell(cell, h, s) for cell, h, s in zip(row, head, columns, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    label = html.escape(f"copy {name} as CSV")
    return (
        f"<div class=table><button class=copy type=button aria-label='{label}'>CSV"
        f"</button><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
        "</div>"
    )


def _shown_column(head: str | Column, cells: Sequence[Cell]) -> Shown:
    """The unit of a column, by the size of its numbers."""
    if isinstance(head, str):
        return Shown("", "", 1.0)
    sizes = [abs(c) for c in cells if isinstance(c, int | float) and math.isfinite(c)]
    return shown_in(head.unit, max(sizes, default=0.0))


def _head_cell(head: str | Column, shown: Shown) -> str:
    """Title and unit of a column."""
    if isinstance(head, str):
        return f"<th{_SORTS}>{html.escape(head)}</th>"
    title = html.escape(head.title)
    if not shown.unit:
        return f"<th{_SORTS}>{title}</th>"
    si = html.escape(f"{head.title} [{shown.unit}]")
    return f'<th{_SORTS} data-si="{si}">{title} [{html.escape(shown.shown)}]</th>'


def _cell(cell: Cell, head: str | Column, shown: Shown) -> str:
    """A text, a number under a unit, or a number with its own."""
    if isinstance(cell, str):
        kind = " class=long" if len(cell) > _LONG else ""
        return f"<td{kind}>{html.escape(cell)}</td>"
    if isinstance(cell, Value):
        return f"<td{_two_texts(cell)}>{html.escape(_texts(cell)[0])}</td>"
    digits = head.digits if isinstance(head, Column) else 6
    text = number_text(cell * shown.factor, digits=digits)
    si = f' data-si="{number_text(cell, digits=digits)}"' if shown.unit else ""
    return f'<td data-v="{float(cell)!r}"{si}>{text}</td>'


def _texts(value: Value) -> tuple[str, str]:
    """A number in the unit of a drawing, and in SI."""
    shown = shown_in(value.unit, value.value)
    return (
        number_text(value.value * shown.factor, shown.shown, value.digits),
        number_text(value.value, shown.unit, value.digits),
    )


def _two_texts(value: Value) -> str:
    """Attributes that hold the SI value in full, its unit, and both as text."""
    own, si = _texts(value)
    unit = f' data-u="{html.escape(value.unit)}"' if shown_in(value.unit).unit else ""
    other = f' data-si="{html.escape(si)}"' if si != own else ""
    return f' data-v="{float(value.value)!r}"{unit}{other}'
