"""General tolerances of ISO 2768: lengths by class, perpendicularity by class.

Part 1 limits linear dimensions.  Of part 2 (withdrawn, ISO 22081 has no tables) only
perpendicularity is here.  Neither part limits a position or a coaxiality.
"""

import re
from typing import NamedTuple

import numpy as np

from forcefit.inputs.table import BadInput, quoted

# [mm] largest length of each column, the first column over 0.5
LENGTHS = (3, 6, 30, 120, 400, 1000, 2000, 4000)
# [mm] plus and minus; nan: the class has no value
LINEAR = {
    "f": (0.05, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, np.nan),
    "m": (0.1, 0.1, 0.2, 0.3, 0.5, 0.8, 1.2, 2.0),
    "c": (0.2, 0.3, 0.5, 0.8, 1.2, 2.0, 3.0, 4.0),
    "v": (np.nan, 0.5, 1.0, 1.5, 2.5, 4.0, 6.0, 8.0),
}
_SIDES = (100, 300, 1000, 3000)  # [mm] largest length of the shorter side
# [mm] width of the zone; class L up to 100 mm was not confirmed, so it has no value
PERPENDICULARITY = {
    "H": (0.2, 0.3, 0.4, 0.5),
    "K": (0.4, 0.6, 0.8, 1.0),
    "L": (np.nan, 1.0, 1.5, 2.0),
}
_SHORTEST = 0.5  # [mm] below it part 1 has no value
_TEXT = re.compile(r"\s*ISO\s*2768\s*-\s*([fmcv])([HKL])?\s*")


class GeneralTolerance(NamedTuple):
    """Classes of ISO 2768: of lengths, and of geometry (empty if not stated)."""

    linear: str
    geometry: str


def parse_general(text: str) -> GeneralTolerance:
    """Return the classes that a text such as ``"ISO 2768-mK"`` states.

    Raises:
        BadInput: it states no classes.
    """
    match = _TEXT.fullmatch(text)
    if match is None:
        raise BadInput(
            f'found {quoted(text)}, expected a text such as "ISO 2768-mK" '
            "(f, m, c or v; then H, K, L or none)"
        )
    return GeneralTolerance(match[1], match[2] or "")


def linear_tolerance(length: float, kind: str) -> float:
    """Return [m] the tolerance, plus and minus, of a length [m] in a class.

    Raises:
        BadInput: the table has no value.
    """
    mm = length * 1e3
    if mm < _SHORTEST or mm > LENGTHS[-1]:
        fault = f"found a length of {mm:g} mm"
        raise BadInput(f"{fault}, expected {_SHORTEST} to {LENGTHS[-1]} mm (ISO 2768)")
    return _entry(LINEAR[kind], LENGTHS, mm, f"class {kind}")


def perpendicularity_tolerance(side: float, kind: str) -> float:
    """Return [m] the width of the zone of a shorter side [m] in a class H, K or L.

    Raises:
        BadInput: the table has no value.
    """
    mm = side * 1e3
    if not 0 < mm <= _SIDES[-1]:
        fault = f"found a side of {mm:g} mm"
        raise BadInput(f"{fault}, expected over 0 to {_SIDES[-1]} mm (ISO 2768)")
    return _entry(PERPENDICULARITY[kind], _SIDES, mm, f"class {kind}")


def _entry(
    row: tuple[float, ...], steps: tuple[int, ...], mm: float, name: str
) -> float:
    """[m] the value of a size, of the first step that reaches it."""
    # rounding of a length in metres must not move it to the next step
    value = row[int(np.searchsorted(steps, mm * (1 - 1e-12)))]
    if np.isnan(value):
        fault = f"found {mm:g} mm in {name}, for which the table has no value"
        raise BadInput(f"{fault}, expected another class or a stated tolerance")
    return value * 1e-3
