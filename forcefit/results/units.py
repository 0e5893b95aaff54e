"""Display units of results, which depend on the magnitude or on the quantity."""

import math
from dataclasses import dataclass

# for each SI unit: smallest magnitude [SI units], display unit and conversion factor,
# with the largest display unit first
_SHOWN: dict[str, tuple[tuple[float, str, float], ...]] = {
    "m": ((1e-4, "mm", 1e3), (0.0, "µm", 1e6)),
    "rad": ((0.1, "deg", 180 / math.pi), (1e-4, "mrad", 1e3), (0.0, "µrad", 1e6)),
    "J": ((1e-1, "J", 1.0), (0.0, "mJ", 1e3)),
    "Pa": ((1e8, "GPa", 1e-9), (0.0, "MPa", 1e-6)),
    "N/m": ((0.0, "N/µm", 1e-6),),
    "N m/rad": ((0.0, "N m/mrad", 1e-3),),
    "m/N": ((0.0, "µm/N", 1e6),),
    "rad/(N m)": ((0.0, "µrad/(N m)", 1e6),),
}


# display units in texts: displayed number = factor * number in SI units
FACTORS = {
    "mm": 1e3, "um": 1e6, "mrad": 1e3, "urad": 1e6, "MPa": 1e-6, "%": 1e2,
}  # fmt: skip


@dataclass(frozen=True)
class Shown:
    """Display unit for numbers in an SI unit.

    Attributes:
        unit: SI unit; empty for a dimensionless number.
        shown: display unit.
        factor: displayed number divided by the number in SI units.
    """

    unit: str
    shown: str
    factor: float


def shown_in(unit: str, size: float = 1.0) -> Shown:
    """Return the display unit for numbers in an SI unit.

    Args:
        unit: SI unit, for example ``"m"``; empty, ``"1"`` or ``"-"`` for dimensionless
            numbers.
        size: largest absolute value of the numbers [unit].

    Returns:
        Display unit and conversion factor. If no display unit is defined, the SI unit
        is returned.
    """
    if unit in {"", "1", "-"}:
        return Shown("", "", 1.0)
    usual = _SHOWN.get(unit, ((0.0, unit, 1.0),))
    size = abs(size) if math.isfinite(size) else math.inf
    size = size or 1e-3  # zero is displayed in mm or mrad
    return next(
        Shown(unit, name, factor) for least, name, factor in usual if size >= least
    )


def number_text(value: float, unit: str = "", digits: int = 4) -> str:
    """Format a number with its unit; NaN becomes ``none``, infinity ``unbounded``."""
    if math.isnan(value):
        return "none"
    if math.isinf(value):
        return "unbounded"
    # adding 0.0 converts minus zero to zero
    return f"{value + 0.0:.{digits}g} {unit}".rstrip()
