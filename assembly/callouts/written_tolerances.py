"""Parsing of tolerances: zone widths, lengths with tolerances, and modifiers."""

import re

from forcefit.inputs.number_arrays import as_number
from forcefit.inputs.table import BadInput, describe

_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
_NUMBER = r"(\d+\.?\d*|\.\d+)(?:[eE]([-+]?\d+))?"
_WIDTH = re.compile(rf"\s*{_NUMBER}\s*(m|mm|um|in)\s*(\(M\))?\s*")
_LENGTH = re.compile(
    rf"\s*{_NUMBER}\s*(m|mm|um|in)?\s*(?:\+-|\+/-|±)\s*{_NUMBER}\s*(m|mm|um|in)"
    r"\s*(\(E\))?\s*"
)


def parse_width(value: object) -> tuple[float, bool]:
    """Parse the width of a zone with an optional maximum material modifier.

    Args:
        value: number in m, or text such as ``"0.05 mm"`` or ``"0.05 mm (M)"``.

    Returns:
        Positive width [m], and whether the modifier ``(M)`` is present.

    Raises:
        BadInput: the value is not a valid width.
    """
    expected = 'expected a width > 0 such as "0.05 mm"'
    width, at_most = -1.0, False
    if not isinstance(value, str):
        width = as_number(value)
    elif match := _WIDTH.fullmatch(value):
        width, at_most = _value(match[1], match[2]) * _UNITS[match[3]], bool(match[4])
    if not 0 < width < 1.0:
        raise BadInput(f"found {describe(value)}, {expected}")
    return width, at_most


def parse_length(value: object) -> tuple[float, float]:
    """Parse a length with its symmetric tolerance.

    Args:
        value: text such as ``"452 +- 0.1 mm"`` or ``"20 +- 0.1 mm (E)"``.

    Returns:
        Length [m] and positive tolerance [m].

    Raises:
        BadInput: the text is not a length with a tolerance, or the tolerance is 0 or is
            not smaller than the length.
    """
    expected = 'expected a length such as "452 +- 0.1 mm"'
    match = _LENGTH.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise BadInput(f"found {describe(value)}, {expected}")
    unit = _UNITS[match[6]]
    length = _value(match[1], match[2]) * (_UNITS[match[3]] if match[3] else unit)
    tolerance = _value(match[4], match[5]) * unit
    if not 0 < tolerance < length:
        raise BadInput(f"found {describe(value)}, {expected}: 0 < tolerance < length")
    return length, tolerance


def within_envelope(value: object) -> bool:
    """Return whether a length has the modifier ``(E)`` (envelope principle)."""
    match = _LENGTH.fullmatch(value) if isinstance(value, str) else None
    return match is not None and bool(match[7])


def _value(digits: str, power: str | None) -> float:
    """Return the number with the given digits and exponent."""
    return float(f"{digits}e{power or 0}")
