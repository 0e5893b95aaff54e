"""Convert numbers in a device table to metres and detect missing readings."""

from dataclasses import dataclass

import numpy as np

from forcefit.inputs.errors import BadInput, describe, quoted
from forcefit.validation.campaign.dialect import parse_number
from forcefit.validation.exchange.cells import Sheet
from forcefit.validation.exchange.header import Header
from forcefit.validation.exchange.reading import LARGEST, LENGTHS, Writing

_NO_READING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "---"}


def missing(cell: str) -> bool:
    """Return whether the text of a cell denotes a missing reading."""
    return cell.lower() in _NO_READING


@dataclass(frozen=True, eq=False)
class CellValues:
    """Numeric values of the cells of a table.

    Attributes:
        sheet: the table.
        header: columns of the table.
        writing: declared format of the export, used if the table does not contain a
            unit.
    """

    sheet: Sheet
    header: Header
    writing: Writing

    def length(self, line: int, k: int, cell: str) -> float:
        """Return the length [m] in a cell of column k."""
        name = self.header.cells[k]
        return self.number(line, name, cell) * self.unit(self.header.columns[k].unit)

    def unit(self, stated: str) -> float:
        """Return the factor that converts lengths in a column to metres."""
        path, declared, found = self.sheet.file, self.writing.unit, self.header.unit
        if not stated and declared and found:
            if LENGTHS[found] != LENGTHS[declared]:
                raise BadInput(
                    f"{path}: line {self.header.unit_line}: found the unit "
                    f"{quoted(found)}, expected {quoted(declared)} as declared "
                    "in the targets file"
                )
        unit = stated or declared or found
        if not unit:
            raise BadInput(
                f"{path}: found no unit of lengths; expected it in the header, such as "
                'x [mm], or unit = "mm" in the targets file'
            )
        if unit not in LENGTHS:
            known = ", ".join(LENGTHS)
            raise BadInput(f"{path}: found the unit {quoted(unit)}, expected {known}")
        return LENGTHS[unit]

    def number(self, line: int, column: str, cell: str) -> float:
        """Return the finite number in a cell."""
        decimal = self.sheet.decimal
        value = parse_number(cell, decimal)
        if abs(value) <= LARGEST:
            return value
        other = "," if decimal == "." else "."
        hint = ""
        if np.isfinite(parse_number(cell, other)):
            hint = (
                f'; if this is a decimal mark, set decimal = "{other}" in the '
                "targets file"
            )
        raise BadInput(
            f"{self.sheet.file}: line {line}, {column}: found {describe(cell)}, "
            f"expected a number{hint}"
        )
