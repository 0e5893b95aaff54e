"""General tolerances of ISO 2768: lengths and perpendicularity by class.

Part 1 limits linear dimensions.  Of part 2, only perpendicularity is available. Part 2
is withdrawn, and its successor ISO 22081 contains no tables.  Neither part limits a
position or a coaxiality.
"""

import re
from typing import NamedTuple

import numpy as np

from forcefit.inputs.table import BadInput, quoted

# [mm] largest length of each table column; the first column begins above 0.5
LENGTHS = (3, 6, 30, 120, 400, 1000, 2000, 4000)
# [mm] tolerance to each side (+-); NaN where the standard has no value
LINEAR = {
    "f": (0.05, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, np.nan),
    "m": (0.1, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0),
    "c": (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 4.0),
    "v": (np.nan, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 8.0),
}
_SIDES = (100, 300, 1000, 3000)  # [mm] largest length of the shorter side
# [mm] width of the zone; class L up to 100 mm has no value, as it was not confirmed
PERPENDICULARITY = {
    "H": (0.2, 0.3, 0.4, 0.5),
    "K": (0.4, 0.6, 0.8, 1.0),
    "L": (np.nan, 1.0, 1.5, 2.0),
}
_SHORTEST = 0.5  # [mm] part 1 has no values for shorter lengths
_TEXT = re.compile(r"\s*ISO\s*2768\s*-\s*([fmcv])([HKL])?\s*")


class GeneralTolerance(NamedTuple):
    """ISO 2768 tolerance classes for lengths and for geometry; empty if not given."""

    linear: str
    geometry: str


def parse_general(text: str) -> GeneralTolerance:
    """Return the classes that a text such as ``"ISO 2768-mK"`` specifies.

    Raises:
        BadInput: the text does not specify classes.
    """
    match = _TEXT.fullmatch(text)
    if match is None:
        raise BadInput(
            f'found {quoted(text)}, expected a text such as "ISO 2768-mK" '
            "(f, m, c or v; then H, K, L or none)"
        )
    return GeneralTolerance(match[1], match[2] or "")


def linear_tolerance(length: float, kind: str) -> float:
    """Return the tolerance [m] to each side of a length [m] in a class.

    Raises:
        BadInput: the table contains no value.
    """
    mm = length * 1e3
    if mm < _SHORTEST or mm > LENGTHS[-1]:
        fault = f"found a length of {mm:g} mm"
        raise BadInput(f"{fault}, expected {_SHORTEST} to {LENGTHS[-1]} mm (ISO 2768)")
    return _entry(LINEAR[kind], LENGTHS, mm, f"class {kind}")


def perpendicularity_tolerance(side: float, kind: str) -> float:
    """Return the width [m] of the zone for a shorter side [m] in class H, K or L.

    Raises:
        BadInput: the table contains no value.
    """
    mm = side * 1e3
    if not 0 < mm <= _SIDES[-1]:
        fault = f"found a side of {mm:g} mm"
        raise BadInput(f"{fault}, expected over 0 to {_SIDES[-1]} mm (ISO 2768)")
    return _entry(PERPENDICULARITY[kind], _SIDES, mm, f"class {kind}")


def _entry(
    row: tuple[float, ...], steps: tuple[int, ...], mm: float, name: str
) -> float:
    """Return the tolerance [m] of the smallest size step that contains a size."""
    # a rounding error of a length in metres must not select the next step
    value = row[int(np.searchsorted(steps, mm * (1 - 1e-12)))]
    if np.isnan(value):
        fault = f"found {mm:g} mm in {name}, for which the table has no value"
        raise BadInput(f"{fault}, expected another class or a stated tolerance")
    return value * 1e-3
