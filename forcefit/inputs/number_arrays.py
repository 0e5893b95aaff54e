"""Conversion of plain values from a file or an option to numbers and arrays."""

import math

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import describe


def find_fault(value: object, shape: tuple[int, ...], infinite: bool = False) -> str:
    """Describe what is wrong with an array, with the place counted from 1.

    Args:
        value: nested lists that are not a valid array, or a value of another type.
        shape: expected shape.
        infinite: whether inf is allowed.

    Returns:
        The wrong entry or row with its place, or the abbreviated whole value.
    """
    if not isinstance(value, list):
        return describe(value)
    if len(value) != shape[0]:
        return f"{describe(value)} of length {len(value)}"
    for i, inner in enumerate(value, 1):
        if len(shape) > 1:
            fault = find_fault(inner, shape[1:], infinite)
            if fault:
                return f"{fault} in row {i}"
        elif not (math.isfinite(x := as_number(inner)) or (infinite and math.isinf(x))):
            return f"{describe(inner)} as number {i}"
    return ""


def number_array(value: object) -> NDArray | None:
    """Return nested lists as an array, or None if they are ragged or not numeric."""
    if not isinstance(value, list):
        return None
    if value and all(isinstance(v, list) for v in value):
        rows = [row for row in map(number_array, value) if row is not None]
        same = len(rows) == len(value) and len({row.shape for row in rows}) == 1
        return np.array(rows) if same else None
    return np.array([as_number(v) for v in value]) if _proper(value) else None


def comma_numbers(text: str) -> NDArray:
    """Return the numbers between commas, or an empty array if one is not finite."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def as_number(value: object) -> float:
    """Return a number as a float, or NaN for any other value, including booleans."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def _proper(values: list) -> bool:
    """Return whether all values are numbers that a float can represent, inf or NaN."""
    return all(isinstance(v, float) or not math.isnan(as_number(v)) for v in values)
