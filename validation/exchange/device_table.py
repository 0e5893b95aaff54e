"""Exports of measuring devices: points by name, in any table that says its units.

SpatialAnalyzer text (``collection::group::point``), exports of Leica and API software,
plain tables: blanks, tabs, semicolons or commas between cells, a header or none.  What
is not certain is not guessed: units stand in the header or in the targets file, a
decimal comma and the order of day and month in the targets file.
"""

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, describe, quoted
from forcefit.inputs.table import read_text
from validation.campaign.dialect import parse_number

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "inch": 0.0254}
LARGEST = 1e12  # of any number of a table
DATES = ("day_first", "month_first")
_NAMES = {"name", "point", "pointid", "pointname", "target", "id", "label", "group",
          "groupname", "collection", "collectionname", "targetname"}  # fmt: skip
_TIMES = {"timestamp", "time", "date", "datetime"}
_BEFORE = "(?:measurement|measured|meas|actual|point|position|coord)?"
_AXIS = re.compile(_BEFORE + "([xyz])")
_SPREAD = re.compile(r"(?:measurement)?(u95|u|uncertainty|sigma|std|stddev|sd)([xyz])")
_UNIT = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]")
_DATE = re.compile(r"(\d{1,2})([./])(\d{1,2})[./](\d{4})(.*)")


@dataclass(frozen=True)
class Writing:
    """How an export is written, where it does not say so itself.

    Attributes:
        unit: of lengths, None if its header says so.
        decimal: the decimal mark.
        dates: ``"day_first"`` or ``"month_first"`` for dates with slashes, or None.
        coverage: what an uncertainty (U95, U) is times one standard deviation.
    """

    unit: str | None = None
    decimal: str = "."
    dates: str | None = None
    coverage: float = 2.0


@dataclass(frozen=True, eq=False)
class Reading:
    """One point that a device read.

    Attributes:
        file: its file, for messages.
        line: there.
        names: parts of its name, the point's own last.
        position: (3,) [m] in the device's axes.
        sigma: (3,) [m] one standard deviation, NaN where not stated.
        time: [s] on the clock of the file, NaN without one.
    """

    file: str
    line: int
    names: tuple[str, ...]
    position: NDArray
    sigma: NDArray
    time: float

    @property
    def place(self) -> str:
        """File, line and name, for messages."""
        return f"{self.file}: line {self.line} ({quoted('::'.join(self.names))})"


def cells_of(path: Path | str) -> list[tuple[int, list[str]]]:
    """Lines of a table in cells, comments and blank lines left out.

    Args:
        path: a text file.

    Returns:
        For each line its number and its cells, without quotes and blanks around them.

    Raises:
        BadInput: the file cannot be read, or has no rows.
    """
    lines = [
        (number, line.strip())
        for number, line in enumerate(read_text(path).split("\n"), 1)
        if line.strip() and not line.lstrip().startswith(("//", "#"))
    ]
    if not lines:
        raise BadInput(f"{path}: empty; expected a table")
    first = lines[0][1]
    mark = next((mark for mark in (";", "\t", ",") if mark in first), None)
    return [(n, [c.strip().strip('"') for c in line.split(mark)]) for n, line in lines]


def read_device_table(path: Path | str, writing: Writing) -> list[Reading]:
    """Points of an export.

    Args:
        path: the file.
        writing: what it does not say itself.

    Returns:
        The readings in their order.

    Raises:
        BadInput: no coordinates, no unit, a cell that is no number or no time.
    """
    rows = cells_of(path)
    header = rows[0][1]
    plain = [re.sub(r"[^a-z0-9]", "", _UNIT.sub("", c).lower()) for c in header]
    columns = {m[1]: k for k, c in enumerate(plain) if (m := _AXIS.fullmatch(c))}
    if not columns and _is_data(header, writing):
        return _without_header(path, rows, writing)
    missing = [axis for axis in "xyz" if axis not in columns]
    if missing:
        raise BadInput(
            f"{path}: line {rows[0][0]}: found no column {missing[0]}; expected a "
            "header with x, y, z, or rows of a name and three numbers"
        )
    named = [k for k, c in enumerate(plain) if c in _NAMES]
    timed = [k for k, c in enumerate(plain) if c in _TIMES]
    spreads = {m[2]: (k, m[1]) for k, c in enumerate(plain)
               if (m := _SPREAD.fullmatch(c))}  # fmt: skip
    readings = []
    for line, cells in rows[1:]:
        if len(cells) != len(header):
            raise BadInput(
                f"{path}: line {line}: found {len(cells)} cells, expected "
                f"{len(header)} as in the header"
            )
        at = [columns[axis] for axis in "xyz"]
        lengths = [
            _number(path, line, header[k], cells[k], writing)
            * _unit(path, header[k], writing)
            for k in at
        ]
        sigma = np.full(3, np.nan)
        for i, axis in enumerate("xyz"):
            if axis in spreads:
                k, kind = spreads[axis]
                value = _number(path, line, header[k], cells[k], writing)
                factor = writing.coverage if kind[0] == "u" else 1.0
                sigma[i] = value * _unit(path, header[k], writing) / factor
                if not sigma[i] > 0:
                    place = f"{path}: line {line}, {header[k]}"
                    raise BadInput(f"{place}: found {value:g}, expected > 0")
        names = [part for k in named for part in cells[k].split("::") if part]
        stamp = " ".join(cells[k] for k in sorted(timed, key=lambda k: plain[k]))
        time = parse_time(f"{path}: line {line}", stamp, writing) if timed else np.nan
        position = np.array(lengths)
        readings.append(Reading(str(path), line, tuple(names), position, sigma, time))
    return readings


def _is_data(cells: list[str], writing: Writing) -> bool:
    """Whether the first line is a row already."""
    values = [parse_number(cell, writing.decimal) for cell in cells]
    return int(np.isfinite(values).sum()) >= 3


def _without_header(
    path: Path | str, rows: list[tuple[int, list[str]]], writing: Writing
) -> list[Reading]:
    """Rows of names, then x, y, z; what follows is passed over."""
    readings = []
    for line, cells in rows:
        names = []
        while cells and not np.isfinite(parse_number(cells[0], writing.decimal)):
            names += cells.pop(0).split("::")
        if not names and len(cells) > 3:  # a point named by a number
            names.append(cells.pop(0))
        if len(cells) < 3:
            raise BadInput(
                f"{path}: line {line}: found {len(cells)} numbers after the name, "
                "expected x, y, z"
            )
        factor = _unit(path, "", writing)
        xyz = [_number(path, line, "xyz"[k], cells[k], writing) for k in range(3)]
        position, sigma = factor * np.array(xyz), np.full(3, np.nan)
        parts = tuple(name for name in names if name)
        readings.append(Reading(str(path), line, parts, position, sigma, np.nan))
    return readings


def _unit(path: Path | str, column: str, writing: Writing) -> float:
    """[m] of a column's unit: from its name, else as declared."""
    stated = _UNIT.search(column)
    unit = stated[1] if stated else writing.unit
    if unit is None:
        raise BadInput(
            f"{path}: found no unit of lengths; expected it in the header, such as "
            'x [mm], or unit = "mm" in the targets file'
        )
    if unit not in LENGTHS:
        known = ", ".join(LENGTHS)
        raise BadInput(f"{path}: found the unit {quoted(unit)}, expected {known}")
    return LENGTHS[unit]


def _number(
    path: Path | str, line: int, column: str, cell: str, writing: Writing
) -> float:
    """A finite number of a cell."""
    value = parse_number(cell, writing.decimal)
    if abs(value) <= LARGEST:
        return value
    other = "," if writing.decimal == "." else "."
    hint = ""
    if np.isfinite(parse_number(cell, other)):
        hint = (
            f'; if that is a decimal mark say decimal = "{other}" in the targets file'
        )
    raise BadInput(
        f"{path}: line {line}, {column}: found {describe(cell)}, expected a "
        f"number{hint}"
    )


def parse_time(place: str, text: str, writing: Writing) -> float:
    """[s] of a time: seconds, ISO 8601, 14 digits, or a date with dots or slashes.

    Args:
        place: file and line, for messages.
        text: the cell, or date and time.
        writing: says which comes first where a date has slashes.

    Returns:
        Seconds on a clock of its own; only differences mean something.

    Raises:
        BadInput: none of these.
    """
    number = parse_number(text, writing.decimal)
    digits = text.isascii() and text.isdigit() and len(text) == 14
    if np.isfinite(number) and not digits:
        return float(number)
    try:
        if digits:
            moment = datetime.strptime(text, "%Y%m%d%H%M%S").replace(tzinfo=UTC)
        elif match := _DATE.fullmatch(text):
            a, mark, b, year, rest = match.groups()
            if mark == "/" and writing.dates is None:
                raise BadInput(
                    f"{place}: found {describe(text)}; expected dates = "
                    '"day_first" or "month_first" in the targets file'
                )
            swap = mark == "/" and writing.dates == "month_first"
            day, month = (b, a) if swap else (a, b)
            clock = rest.strip()
            style = "%I:%M:%S %p" if clock[-1:] in {"M", "m"} else "%H:%M:%S"
            style += ".%f" if "." in clock and style.endswith("S") else ""
            moment = datetime.strptime(
                f"{year}-{month}-{day} {clock}", f"%Y-%m-%d {style}"
            ).replace(tzinfo=UTC)
        else:
            moment = datetime.fromisoformat(text)
            moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    except BadInput:
        raise
    except ValueError:
        raise BadInput(
            f"{place}: found {describe(text)}, expected a time: seconds, "
            "2026-11-22T10:30:00, 20261122103000 or 22.11.2026 10:30:00"
        ) from None
    return moment.timestamp()
