"""Formatting of results as text: one line per quantity, and tables of numbers.

Commands and the short representations of objects print the same lines.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.results.display import numbers, pose_text
from forcefit.results.quantities import QUANTITIES, Quantity
from forcefit.results.units import FACTORS


def value_text(quantity: Quantity | str, value: Any) -> str:
    """Format a value in the display unit of its quantity.

    Args:
        quantity: quantity, or its name in the table.
        value: number, vector, string, boolean, pose, list of strings, or None.

    Returns:
        Text with the unit; ``none`` if the value is None or NaN.
    """
    known = QUANTITIES[quantity] if isinstance(quantity, str) else quantity
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "none"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return pose_text(value)
    if known.kind == "string":
        return ", ".join(value) or "none"
    units = known.display_unit.split(", ")
    if np.ndim(value) == 0:
        if math.isinf(value):
            return "without bound"
        return in_unit(value, units[0], known.digits)
    parts = np.split(np.asarray(value, dtype=float), len(units))
    if known.dims == ("bound",):
        low, high = (f"{FACTORS.get(units[0], 1.0) * v + 0.0:.6g}" for v in parts[0])
        return _with_unit(f"{low} to {high}", units[0])
    texts = (
        _with_unit(numbers(FACTORS.get(unit, 1.0) * part), unit)
        for part, unit in zip(parts, units, strict=True)
    )
    return ", ".join(texts)


def in_unit(value: float, unit: str, digits: int = 4) -> str:
    """Format a number, given in SI units, in a display unit such as ``um``."""
    return _with_unit(f"{FACTORS.get(unit, 1.0) * value + 0.0:.{digits}g}", unit)


def readings_text(sizes: Mapping[str, float | None], digits: int = 4) -> str:
    """Format errors of readings as text, omitting unknown errors.

    Args:
        sizes: ``position`` [m], ``rotation`` [rad], and ``normalised``, the error
            divided by sigma.
        digits: number of significant digits.

    Returns:
        Text such as ``12 um, 30 urad, 1.1 sigma``.
    """
    units = {"position": "um", "rotation": "urad", "normalised": "sigma"}
    known = {key: size for key in units if (size := sizes.get(key)) is not None}
    texts = [
        in_unit(size, units[key], digits)
        for key, size in known.items() if math.isfinite(size)
    ]  # fmt: skip
    return ", ".join(texts) or "unknown"


def lines_of(results: Mapping[str, Any], names: str) -> dict[str, str]:
    """Format selected quantities of a result.

    Args:
        results: plain values of a command.
        names: names of quantities, separated by blanks. A dot separates the name of a
            record from a key of the record.  Absent quantities and the status ``ok``
            are omitted.

    Returns:
        Values as text; the keys are the names of the quantities in words.
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
    """Format the pose, load, energy and platform error of a forced assembly."""
    values = {
        "pose": assembly.posture.pose(),
        "energy": assembly.energy,
        "platform_screw": assembly.platform_screw,
    }
    if any(assembly.load):
        values["load"] = assembly.load
    return lines_of(values, "pose load energy platform_screw")


def table_lines(
    head: Sequence[str], rows: Mapping[str, Sequence[Any]], digits: int = 5
) -> list[str]:
    """Format a table with aligned columns.

    Args:
        head: heading of the row names, followed by the heading of each column with its
            unit.
        rows: mapping from row name to the numbers or texts in the row. A number that is
            not finite is printed as a dash.
        digits: number of significant digits.

    Returns:
        Lines of text.
    """
    first, *columns = head
    width = max(map(len, (first, *rows)))
    table = {first: columns} | {
        name: [c if isinstance(c, str) else _cell(c, digits) for c in cells]
        for name, cells in rows.items()
    }
    wide = [
        max(digits + 6, *map(len, column)) + 2
        for column in zip(*table.values(), strict=True)
    ]
    return [
        f"{name:{width}}" + "".join(map("{:>{}}".format, texts, wide))
        for name, texts in table.items()
    ]


def _cell(value: float, digits: int) -> str:
    """Format a number in a table."""
    return f"{value + 0.0:.{digits}g}" if math.isfinite(value) else "-"


def _with_unit(text: str, unit: str) -> str:
    """Append the unit to a text, unless the quantity is dimensionless."""
    return text if unit in {"", "1"} else f"{text} {unit}"
