"""Read the format of a measurement table: delimiter, decimal mark and units.

The format is declared in ``campaign.toml``. By default, values are separated by commas,
numbers have a decimal point, and units are SI units.
"""

import math
import re
from dataclasses import dataclass, field

from forcefit.inputs.table import Table

DELIMITERS = {",": ",", ";": ";", "tab": "\t"}
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?", re.ASCII)
_LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_ANGLES = {
    "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": math.pi / 180,
    "arcsec": math.pi / 648000,
}  # fmt: skip
# Accepted units of each key in [units], with factors to the SI unit.  The first unit is
# the SI unit.
UNITS = {
    "position": _LENGTHS,
    "rotation": _ANGLES,
    "command_position": _LENGTHS,
    "command_rotation": _ANGLES,
    "force": {"N": 1.0, "kN": 1e3},
    "moment": {"N m": 1.0, "N mm": 1e-3, "kN m": 1e3},
    "time": {"s": 1.0, "min": 60.0, "h": 3600.0},
}

MOTIONS = _ANGLES | _LENGTHS


@dataclass(frozen=True)
class Dialect:
    """Format of a measurement table.

    Attributes:
        delimiter: character between two values.
        decimal: the decimal mark.
        units: mapping from each key of ``[units]`` to its unit.
        motions: unit of each covariate that is a measured motion, by name.
    """

    delimiter: str
    decimal: str
    units: dict[str, str]
    motions: dict[str, str] = field(default_factory=dict)

    def unit(self, key: str) -> str:
        """Return the unit for a key of ``[units]``."""
        return self.units.get(key) or next(iter(UNITS[key]))

    def factor(self, key: str) -> float:
        """Return the factor that converts the unit of a key to the SI unit."""
        return UNITS[key][self.unit(key)]

    @property
    def motion_units(self) -> dict[str, str]:
        """SI unit of each covariate that is a measured motion, by name."""
        return {n: "m" if u in _LENGTHS else "rad" for n, u in self.motions.items()}


def read_dialect(root: Table) -> Dialect:
    """Read the table format that ``campaign.toml`` declares.

    Args:
        root: root of ``campaign.toml``, with optional tables ``[table]`` and
            ``[units]``.

    Returns:
        The format.

    Raises:
        BadInput: a value or unit is invalid.
    """
    delimiter, decimal, units = ",", ".", {}
    motions: dict[str, str] = {}
    if root.has("table"):
        table = root.table("table")
        delimiter = DELIMITERS[table.choice("delimiter", DELIMITERS, ",")]
        decimal = table.choice("decimal", (".", ","), ".")
        if decimal == delimiter:
            message = (
                'found "," as decimal mark and as delimiter; expected '
                'delimiter = ";" or "tab"'
            )
            raise table.bad("decimal", message)
        table.finish()
    if root.has("units"):
        table = root.table("units")
        units = {k: table.choice(k, UNITS[k]) for k in UNITS if table.has(k)}
        if table.has("cov"):
            own = table.table("cov")
            motions = {k: own.choice(k, MOTIONS) for k in own.content}
        table.finish()
    return Dialect(delimiter, decimal, units, motions)


def parse_number(cell: str, decimal: str) -> float:
    """Convert the text in a table cell to a number, or to NaN if it is not valid."""
    if decimal != ".":
        cell = cell.replace(".", "?").replace(decimal, ".")
    return float(cell) if _NUMBER.fullmatch(cell) else math.nan
