"""Results as text: the table's quantities, one a line, and tables of numbers.

The same lines are the short representation of an object and what a command prints.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.results.display import numbers, rounded
from forcefit.results.quantities import QUANTITIES, Quantity
from forcefit.results.units import FACTORS


def value_text(quantity: Quantity | str, value: Any) -> str:
    """A value in the quantity's display unit.

    Args:
        quantity: or its name in the table.
        value: a number, a vector, a text, a truth value, several of them, or None.

    Returns:
        Text with its unit; ``none`` where there is no such number.
    """
    known = QUANTITIES[quantity] if isinstance(quantity, str) else quantity
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "none"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):  # a pose
        return f"{numbers(value.values())} m, rad"
    if known.kind == "string":
        return ", ".join(value) or "none"
    units = known.display_unit.split(", ")
    if np.ndim(value) == 0:
        if math.isinf(value):
            return "without bound"
        return _with_unit(f"{rounded_in(value, units[0]):.{known.digits}g}", units[0])
    parts = np.split(np.asarray(value, dtype=float), len(units))
    if known.dims == ("bound",):
        low, high = (f"{rounded_in(v, units[0]):.6g}" for v in parts[0])
        return _with_unit(f"{low} to {high}", units[0])
    texts = (
        _with_unit(numbers(FACTORS.get(unit, 1.0) * part), unit)
        for part, unit in zip(parts, units, strict=True)
    )
    return ", ".join(texts)


def rounded_in(value: float, unit: str) -> float:
    """A number in a display unit; below 1e-9 of it, rounding error, it is zero."""
    return rounded(FACTORS.get(unit, 1.0) * value)


def in_unit(value: float, unit: str, digits: int = 4) -> str:
    """A number in SI as text in a display unit, such as ``um``."""
    return _with_unit(f"{rounded_in(value, unit):.{digits}g}", unit)


def readings_text(sizes: Mapping[str, float | None], digits: int = 4) -> str:
    """Errors of readings, as far as they are known.

    Args:
        sizes: ``position`` [m], ``rotation`` [rad], ``normalised`` by sigma.
        digits: significant ones.

    Returns:
        Such as ``12 um, 30 urad, 1.1 sigma``.
    """
    units = {"position": "um", "rotation": "urad", "normalised": "sigma"}
    known = {key: size for key in units if (size := sizes.get(key)) is not None}
    texts = [
        in_unit(size, units[key], digits)
        for key, size in known.items() if math.isfinite(size)
    ]  # fmt: skip
    return ", ".join(texts) or "unknown"


def lines_of(results: Mapping[str, Any], names: str) -> dict[str, str]:
    """Words and values of some results.

    Args:
        results: plain values of a command.
        names: of quantities, between blanks; points lead into records.  One that is
            absent, and the status ``ok``, have no line.

    Returns:
        By the quantities' words.
    """
    lines: dict[str, str] = {}
    for path in names.split():
        inner: Any = results
        for key in path.split("."):
            inner = inner.get(key, ...) if isinstance(inner, Mapping) else ...
        if inner is ... or (key == "status" and inner == "ok"):
            continue
        lines[QUANTITIES[key].words] = value_text(key, inner)
    return lines


def forced_lines(assembly: Any) -> dict[str, str]:
    """Pose, load, energy and platform error of a forced assembly, as lines of text."""
    values = {
        "pose": assembly.posture.pose(),
        "energy": assembly.energy,
        "platform_screw": assembly.platform_screw,
    }
    if any(assembly.load):
        values["load"] = assembly.load
    return lines_of(values, "pose load energy platform_screw")


def listing(title: str, lines: Mapping[str, str], notes: Sequence[str] = ()) -> str:
    """A title and lines of words and values, aligned, then notes."""
    width = max(map(len, lines), default=0)
    rows = [f"  {words:{width}}  {value}" for words, value in lines.items()]
    return "\n".join([title, *rows, *(f"note: {note}" for note in notes)])


def table_lines(
    head: Sequence[str], rows: Mapping[str, Sequence[Any]], digits: int = 5
) -> list[str]:
    """Rows of numbers under their heads, aligned.

    Args:
        head: of the names of the rows, then of each column, with its unit.
        rows: numbers, or texts, by name; one that is not finite is a dash.
        digits: significant ones.

    Returns:
        Lines.
    """
    first, *columns = head
    width = max(map(len, (first, *rows)))
    wide = [max(len(column), digits + 6) + 2 for column in columns]
    lines = [f"{first:{width}}" + "".join(map("{:>{}}".format, columns, wide))]
    for name, cells in rows.items():
        texts = (
            cell if isinstance(cell, str) else _cell(cell, digits) for cell in cells
        )
        lines.append(f"{name:{width}}" + "".join(map("{:>{}}".format, texts, wide)))
    return lines


def _cell(value: float, digits: int) -> str:
    """A number of a table."""
    return f"{value + 0.0:.{digits}g}" if math.isfinite(value) else "-"


def _with_unit(text: str, unit: str) -> str:
    """A text with its unit, if it has one."""
    return text if unit in {"", "1"} else f"{text} {unit}"
