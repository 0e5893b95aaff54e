"""ISO 2768 general tolerances for lengths and perpendicularity.

Lengths are from ISO 2768-1, and perpendicularity is from ISO 2768-2.
"""

import re
from typing import NamedTuple

import numpy as np

from forcefit.inputs.table import BadInput, quoted

# [mm] upper limits of the ranges of lengths, the first of which starts at 0.5 mm
LENGTHS = (3, 6, 30, 120, 400, 1000, 2000, 4000)
# [mm] symmetric tolerances; NaN where the standard does not specify a value
LINEAR = {
    "f": (0.05, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, np.nan),
    "m": (0.1, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0),
    "c": (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 4.0),
    "v": (np.nan, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 8.0),
}
_SIDES = (100, 300, 1000, 3000)  # [mm] upper limits for the length of the shorter side
# [mm] zone widths; NaN where the value has not been confirmed
PERPENDICULARITY = {
    "H": (0.2, 0.3, 0.4, 0.5),
    "K": (0.4, 0.6, 0.8, 1.0),
    "L": (np.nan, 1.0, 1.5, 2.0),
}
_SHORTEST = 0.5  # [mm] smallest length in ISO 2768-1
_TEXT = re.compile(r"\s*ISO\s*2768\s*-\s*([fmcv])([HKL])?\s*")


class GeneralTolerance(NamedTuple):
    """ISO 2768 tolerance classes for lengths and geometry, which may be empty."""

    linear: str
    geometry: str


def parse_general(text: str) -> GeneralTolerance:
    """Return the tolerance classes in a text such as ``"ISO 2768-mK"``.

    Raises:
        BadInput: the text does not contain valid classes.
    """
    match = _TEXT.fullmatch(text)
    if match is None:
        raise BadInput(
            f'found {quoted(text)}, expected a text such as "ISO 2768-mK" '
            "(f, m, c or v; then H, K, L or none)"
        )
    return GeneralTolerance(match[1], match[2] or "")


def linear_tolerance(length: float, kind: str) -> float:
    """Return the symmetric tolerance of a length [m] in a tolerance class.

    Raises:
        BadInput: the table does not contain a value for this length.
    """
    mm = length * 1e3
    if mm < _SHORTEST or mm > LENGTHS[-1]:
        fault = f"found a length of {mm:g} mm"
        raise BadInput(f"{fault}, expected {_SHORTEST} to {LENGTHS[-1]} mm (ISO 2768)")
    return _entry(LINEAR[kind], LENGTHS, mm, f"class {kind}")


def perpendicularity_tolerance(side: float, kind: str) -> float:
    """Return the zone width [m] for the length of the shorter side [m] in a class.

    Raises:
        BadInput: the table does not contain a value for this length.
    """
    mm = side * 1e3
    if not 0 < mm <= _SIDES[-1]:
        fault = f"found a side of {mm:g} mm"
        raise BadInput(f"{fault}, expected over 0 to {_SIDES[-1]} mm (ISO 2768)")
    return _entry(PERPENDICULARITY[kind], _SIDES, mm, f"class {kind}")


def _entry(
    row: tuple[float, ...], steps: tuple[int, ...], mm: float, name: str
) -> float:
    """Return the tolerance [m] for a size [mm] from a row of a table."""
    # with the factor, a rounding error does not select the next column
    value = row[int(np.searchsorted(steps, mm * (1 - 1e-12)))]
    if np.isnan(value):
        fault = f"found {mm:g} mm in {name}, for which ISO 2768 does not have a value"
        raise BadInput(f"{fault}, expected another class or a tolerance of the length")
    return value * 1e-3
