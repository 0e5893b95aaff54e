"""Read the tables of points that measuring devices export.

The reader accepts SpatialAnalyzer text (``collection::group::point``), exports of
Leica, FARO, API, Vicon and OptiTrack software, and plain tables.  The cells of a plain
table are separated by blanks, tabs, semicolons or commas.  A header and a preamble are
optional.  The table or the targets file must contain the units.  A decimal comma, the
order of day and month, and the order of angles must be declared in the targets file.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, quoted
from forcefit.validation.campaign.dialect import parse_number
from forcefit.validation.exchange.cell_values import CellValues, missing
from forcefit.validation.exchange.cells import read_sheet
from forcefit.validation.exchange.clock import parse_time
from forcefit.validation.exchange.header import by_target, find_header, without_header
from forcefit.validation.exchange.orientation import (
    ANGLES,
    from_angles,
    from_quaternion,
    orientation_columns,
)
from forcefit.validation.exchange.plain_rows import read_plain_rows
from forcefit.validation.exchange.reading import Reading, Writing

# Headings of the angles and distances that a tracker measures.
_SPHERICAL = {"az", "azimuth", "el", "elevation", "hz", "range", "distance", "theta"}


def read_device_table(
    path: Path | str, writing: Writing, targets: Mapping[str, NDArray]
) -> list[Reading]:
    """Read the points of an export.

    Args:
        path: the file.
        writing: declared format of the export, used if the file does not contain a unit
            or an order of angles.
        targets: mapping from the name of each target to its position (3,) [m], platform
            axes.  A table may contain separate columns for each target.

    Returns:
        The readings in the order of the file.  A row contains one or several readings.

    Raises:
        BadInput: the file contains no coordinates or no unit, or a cell is neither a
            number nor a time.
    """
    sheet = read_sheet(path, writing.decimal)
    writing = replace(writing, decimal=sheet.decimal)
    header = find_header(sheet.rows, targets)
    if header is not None:
        rows = _HeadedRows(CellValues(sheet, header, writing))
        return [r for row in sheet.rows[header.first :] for r in rows.readings(*row)]
    header = without_header(sheet.rows, sheet.decimal)
    _refuse_other_headings(path, sheet.rows[: header.first + 1])
    line, cells = sheet.rows[header.first]
    if not _is_data(cells, sheet.decimal):
        raise BadInput(
            f"{path}: line {line}: found no column {_lacking(cells)}; expected a "
            "header with x, y, z, or rows of a name and three numbers"
        )
    values = CellValues(sheet, header, writing)
    return read_plain_rows(values, sheet.rows[header.first :], targets)


def _refuse_other_headings(
    path: Path | str, rows: Sequence[tuple[int, list[str]]]
) -> None:
    """Raise BadInput if the row above the data has headings other than x, y, z."""
    if len(rows) < 2:
        return
    (line, heads), (_, cells) = rows[-2:]
    angular = _SPHERICAL & {re.sub(r"[^a-z].*", "", head.lower()) for head in heads}
    if angular and len(heads) == len(cells):
        raise BadInput(
            f"{path}: line {line}: found the column {quoted(min(angular))}, expected "
            "Cartesian coordinates in columns x, y, z"
        )


def _lacking(cells: Sequence[str]) -> str:
    """Return the first coordinate (x, y or z) for which a line contains no heading."""
    words = " ".join(cells).lower().split()
    return next((axis for axis in "xyz" if axis not in words), "x")


def _is_data(cells: Sequence[str], decimal: str) -> bool:
    """Return whether a line is a row of data."""
    return int(np.isfinite([parse_number(c, decimal) for c in cells]).sum()) >= 3


@dataclass(frozen=True, eq=False)
class _HeadedRows:
    """Converts the rows below a header to readings."""

    values: CellValues

    def readings(self, line: int, cells: list[str]) -> list[Reading]:
        """Return the readings of a row, one for each target that has columns."""
        header = self.values.header
        place = f"{self.values.sheet.file}: line {line}"
        while len(cells) > len(header.cells) and not cells[-1]:
            cells = cells[:-1]  # the row ends with a separator
        if len(cells) != len(header.cells):
            raise BadInput(
                f"{place}: found {len(cells)} cells, expected {len(header.cells)} as "
                "in the header"
            )
        kinds = list(zip(header.columns, cells, strict=True))
        label = [p for c, cell in kinds if c.kind == "name" for p in cell.split("::")]
        time = self._time(place, [(c.axis, x) for c, x in kinds if c.kind == "time"])
        readings = []
        for target, own in by_target(header.columns).items():
            if self._has_place(own):
                names = tuple(part for part in [*label, target] if part)
                readings.append(self._reading(line, cells, names, own, time))
        return readings

    def _time(self, place: str, parts: list[tuple[str, str]]) -> float:
        """Return the time [s] of a row from its date and time of day, or NaN."""
        stamp = " ".join(cell for _, cell in sorted(parts))
        if missing(stamp.strip()):
            return np.nan
        return parse_time(place, stamp, self.values.writing)

    def _has_place(self, own: list[int]) -> bool:
        """Return whether the columns contain x, y and z exactly once."""
        columns = self.values.header.columns
        axes = [columns[k].axis for k in own if columns[k].kind == "axis"]
        twice = [axis for axis in axes if axes.count(axis) > 1]
        if twice:
            raise BadInput(
                f"{self.values.sheet.file}: found {axes.count(twice[0])} columns "
                f"{twice[0]}; expected one, or target names in the headings or above"
            )
        return len(axes) == 3

    def _reading(
        self, line: int, cells: list[str], names: tuple[str, ...], own: list[int],
        time: float,
    ) -> Reading:  # fmt: skip
        """Return the reading of one target in a row."""
        columns, writing = self.values.header.columns, self.values.writing
        position, sigma = np.full(3, np.nan), np.full(3, np.nan)
        for k in own:
            kind, axis = columns[k].kind, columns[k].axis
            if kind not in {"axis", "sigma", "U"} or missing(cells[k]):
                continue
            value = self.values.length(line, k, cells[k])
            if kind == "axis":
                position["xyz".index(axis)] = value
            else:
                wide = writing.coverage if kind == "U" else 1.0
                sigma["xyz".index(axis)] = self._spread(line, k, value / wide)
        if np.isnan(position).any():
            position[:] = np.nan  # a coordinate is missing
        rotation = self._rotation(line, cells, own) if writing.oriented else None
        file = self.values.sheet.file
        return Reading(file, line, names, position, sigma, time, rotation)

    def _spread(self, line: int, k: int, value: float) -> float:
        """Return a standard deviation [m]. A value of 0 is converted to NaN."""
        if value < 0:
            name = self.values.header.cells[k]
            place = f"{self.values.sheet.file}: line {line}, {name}"
            raise BadInput(f"{place}: found {value:g} m, expected >= 0")
        return value if value > 0 else np.nan

    def _rotation(self, line: int, cells: list[str], own: list[int]) -> NDArray | None:
        """Return the rotation of a target in device axes; None if not measured."""
        header, writing = self.values.header, self.values.writing
        place = f"{self.values.sheet.file}: line {line}"
        kind, at = orientation_columns(header.columns, own)
        if not kind or any(missing(cells[k]) for k in at.values()):
            return None
        found = {
            axis: self.values.number(line, header.cells[k], cells[k])
            for axis, k in at.items()
        }
        if kind == "quaternion":
            return from_quaternion(place, list(found.values()))
        for axis, k in at.items():
            unit = header.columns[k].unit or writing.angle_unit
            if unit not in ANGLES:
                raise BadInput(
                    f"{place}, {header.cells[k]}: found no unit of angles; expected it "
                    'in the header, such as [deg], or angle_unit = "deg" in the '
                    "targets file"
                )
            found[axis] *= ANGLES[unit]
        return from_angles(place, found, writing.orientation)
