"""Lengths and angles in files, which are numbers or texts with a unit."""

import re
from collections.abc import Sequence
from typing import Any

from forcefit.inputs.table import BadInput, Table, describe

UNITS = {  # conversion factors to m or rad, by dimension and unit
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": 0.017453292519943295},
}
SCREW = ("angle",) * 3 + ("length",) * 3
_TEXT = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z]+)\s*")


def without_units(table: Table, key: str, dimension: str | Sequence[str]) -> None:
    """Convert texts such as ``"200 mm"`` in a value to numbers in m or rad.

    Args:
        table: table with the value, which is modified in place.
        key: key of the value, which is a number, a text, or a nested list.
        dimension: ``"length"`` or ``"angle"``, or one dimension for each list entry.

    Raises:
        BadInput: a text is not a number with a unit of this dimension.
    """
    if key in table.content:
        table.content[key] = _plain(table, key, table.content[key], dimension)


def _plain(table: Table, key: str, value: Any, dimension: str | Sequence[str]) -> Any:
    """Convert the texts in a value to numbers."""
    if isinstance(value, list):
        if isinstance(dimension, str) or len(dimension) != len(value):
            dimension = [dimension if isinstance(dimension, str) else "length"] * len(
                value
            )
        pairs = zip(value, dimension, strict=True)
        return [_plain(table, key, inner, kind) for inner, kind in pairs]
    if isinstance(value, str) and isinstance(dimension, str):
        return _number(table, key, value, dimension)
    return value


def _number(table: Table, key: str, text: str, dimension: str) -> float:
    """Convert a text such as ``"200 mm"`` to a number in m or rad."""
    match = _TEXT.fullmatch(text)
    factor = UNITS[dimension].get(match.group(2)) if match else None
    if match is None or factor is None:
        raise _wrong(table, key, text, dimension)
    return float(match.group(1)) * factor


def _wrong(table: Table, key: str, text: str, dimension: str) -> BadInput:
    """Return an error about a text that is not a number with a unit."""
    units = " ".join(UNITS[dimension])
    example = '"200 mm"' if dimension == "length" else '"30 deg"'
    fault = f"found {describe(text)}, expected a number, or a text with a unit"
    return table.bad(key, f"{fault} such as {example} ({units})")
