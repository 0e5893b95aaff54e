"""Conversion of values from files and options to numbers and arrays."""

import math

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import describe


def find_fault(value: object, shape: tuple[int, ...], infinite: bool = False) -> str:
    """Describe the first fault in an array, with its position counted from 1.

    Args:
        value: nested lists that are not a valid array, or a value of another type.
        shape: expected shape.
        infinite: whether inf is allowed.

    Returns:
        The invalid entry or row with its position, or the abbreviated value.
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
    """Convert nested lists to an array; return None if ragged or not numeric."""
    if not isinstance(value, list):
        return None
    if value and all(isinstance(v, list) for v in value):
        rows = [row for row in map(number_array, value) if row is not None]
        same = len(rows) == len(value) and len({row.shape for row in rows}) == 1
        return np.array(rows) if same else None
    return np.array([as_number(v) for v in value]) if _proper(value) else None


def comma_numbers(text: str) -> NDArray:
    """Parse comma-separated finite numbers; return an empty array if one is invalid."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def as_number(value: object) -> float:
    """Convert a number to a float; return NaN for other values, including booleans."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def _proper(values: list) -> bool:
    """Return whether all values are floats or integers within the range of floats."""
    return all(isinstance(v, float) or not math.isnan(as_number(v)) for v in values)
