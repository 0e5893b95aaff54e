"""Read the measurement table of a campaign and check every cell.

Delimiter, decimal mark and units are declared in ``campaign.toml``. If the table has a
different format, the error message contains the key to change.
"""

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import (
    LARGEST,
    BadInput,
    describe,
    nearest,
    printable,
    quoted,
)
from forcefit.inputs.table import read_text
from forcefit.validation.campaign.campaign import LOAD, READING
from forcefit.validation.campaign.dialect import (
    DELIMITERS,
    MOTIONS,
    Dialect,
    parse_number,
)

_TEXTS = ("id", "session")  # names of columns that contain text instead of numbers


@dataclass(frozen=True, eq=False)
class MeasurementTable:
    """Measurement table of a campaign, converted to SI units.

    Attributes:
        file: path of the file.
        ids: unique label of each row.
        lines: number of the last line of each row in the file.
        columns: mapping from the name of each numeric column to its (R,) values, NaN
            for an empty cell.
        dialect: format of the table.
        sessions: session name of each row.  Empty if the file contains no sessions.
        files: path of the file of each row.  Empty if there is only one file.
    """

    file: str
    ids: tuple[str, ...]
    lines: tuple[int, ...]
    columns: dict[str, NDArray]
    dialect: Dialect
    sessions: tuple[str, ...] = ()
    files: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.ids)

    def bad(self, row: int, column: str, message: str) -> BadInput:
        """Return an error about a cell of the table."""
        place = f"line {self.lines[row]} (id {quoted(self.ids[row])})"
        where = f"{place}, {column}" if column else place
        file = self.files[row] if self.files else self.file
        return BadInput(f"{file}: {where}: {message}")

    def stack(self, prefix: str, names: tuple[str, ...], absent: float) -> NDArray:
        """Return the table columns ``prefix.name`` for k names as an array (R, k).

        Missing columns are filled with ``absent``.
        """
        empty = np.full(len(self), absent)
        return np.column_stack([
            self.columns.get(f"{prefix}.{n}", empty) for n in names
        ])


def read_table(
    path: Path | str, robot: Robot, dialect: Dialect, points: Iterable[str] = ()
) -> MeasurementTable:
    """Read a table of measurements.

    Args:
        path: a CSV file with a header.
        robot: robot whose actuated joints are valid column names.
        dialect: format of the table.
        points: names of additional measured points.

    Returns:
        The table in SI units.

    Raises:
        BadInput: the file is not a valid table.
    """
    path = Path(path)
    lines, rows = _cells(path, dialect)
    if not rows:
        raise BadInput(
            f"{path}: found an empty file; expected a header and one row for "
            "each measurement"
        )
    header = _header(path, rows[0], robot, tuple(points))
    lines, rows = lines[1:], rows[1:]
    if not rows:
        raise BadInput(f"{path}: found no rows; expected one row for each measurement")
    for line, row in zip(lines, rows, strict=True):
        if len(row) != len(header):
            raise BadInput(
                f"{path}: line {line}: found {len(row)} cells, expected {len(header)} "
                f"as in the header{_dialect_hint(row, len(header), dialect)}"
            )
    ids = tuple(row[header.index("id")] for row in rows)
    sessions: tuple[str, ...] = ()
    if "session" in header:
        sessions = tuple(row[header.index("session")] for row in rows)
    table = MeasurementTable(str(path), ids, tuple(lines), {}, dialect, sessions)
    for i in [i for i, name in enumerate(sessions) if not name][:1]:
        raise table.bad(i, "session", "found an empty cell, expected a session name")
    for k, name in enumerate(header):
        if name not in _TEXTS:
            table.columns[name] = _numbers(table, robot, name, [row[k] for row in rows])
    _check_labels(table)  # errors in the format are reported first
    return table


def join_tables(tables: Sequence[MeasurementTable]) -> MeasurementTable:
    """Concatenate measurement tables.

    Args:
        tables: tables of one campaign.  The rows of a table without the column
            ``session`` belong to one session.

    Returns:
        The joined table.  Each label is prefixed with the name of its file.  Missing
        covariates and readings are NaN.

    Raises:
        BadInput: a column that must be in all tables is missing in one table.
    """
    if len(tables) == 1:
        return tables[0]
    names = list(dict.fromkeys(name for t in tables for name in t.columns))
    columns = {}
    for name in names:
        may_lack = name.startswith(("meas.", "sigma.", "load.", "cov."))
        for table in tables:
            if name not in table.columns and not may_lack:
                message = (
                    f"line 1: missing column {quoted(name)}, which another table has"
                )
                raise BadInput(f"{table.file}: {message}")
        absent = 0.0 if name.startswith("load.") else math.nan
        columns[name] = np.concatenate([
            t.columns.get(name, np.full(len(t), absent)) for t in tables
        ])
    stems = [Path(table.file).stem for table in tables]
    pairs = list(zip(stems, tables, strict=True))
    return MeasurementTable(
        file=tables[0].file,
        ids=tuple(f"{stem}/{label}" for stem, t in pairs for label in t.ids),
        lines=tuple(line for t in tables for line in t.lines),
        columns=columns,
        dialect=tables[0].dialect,
        sessions=tuple(
            s for stem, t in pairs for s in (t.sessions or (stem,) * len(t))
        ),
        files=tuple(t.file for t in tables for _ in t.ids),
    )


def _cells(path: Path, dialect: Dialect) -> tuple[list[int], list[list[str]]]:
    """Return the number of the last line of each row, and the cells of each row."""
    lines, rows = [], []
    text = io.StringIO(read_text(path), newline="")
    reader = csv.reader(text, delimiter=dialect.delimiter, strict=True)
    try:
        for row in reader:
            if row:  # skip blank lines
                lines.append(reader.line_num)
                rows.append([cell.strip() for cell in row])
                _check_printable(path, reader.line_num, rows)
    except csv.Error as error:
        raise BadInput(f"{path}: line {reader.line_num}: not CSV: {error}") from None
    return lines, rows


def _check_printable(path: Path, line: int, rows: list[list[str]]) -> None:
    """Reject control characters in the last row."""
    header, row = rows[0], rows[-1]
    for k, cell in enumerate(row):
        if not cell.isprintable() and not printable(cell):
            named = len(rows) > 1 and k < len(header)
            column = quoted(header[k]) if named else f"column {k + 1}"
            raise BadInput(
                f"{path}: line {line}, {column}: found {describe(cell)}, expected text "
                "without line breaks and control characters"
                f"{_other(row) if len(rows) == 1 else ''}"
            )


def _header(
    path: Path, names: list[str], robot: Robot, points: tuple[str, ...]
) -> list[str]:
    """Return the column names after checking that all are valid."""
    q = [f"q.{f.name}" for f in robot.frames if f.actuated]
    groups: dict[str, tuple[str, ...]] = {
        "pose": POSE, "load": LOAD, "meas": READING, "sigma": READING,
    }  # fmt: skip
    for point in points:
        groups |= dict.fromkeys((f"meas.{point}", f"sigma.{point}"), READING[3:])
    known = [*_TEXTS, *q, *(f"{g}.{c}" for g, cs in groups.items() for c in cs)]
    known += ["cov.temperature", "cov.time", "cov.approach"]
    if not any(name in known or name.startswith("cov.") for name in names):
        # The message does not contain the names, because the file may not be a table.
        raise BadInput(
            f"{path}: line 1: found no column name of a measurement "
            f"table{_other(names)}; expected id, q.<frame> or pose.tx ..., meas.tx ..."
        )
    for k, name in enumerate(names, 1):
        if not name:
            raise BadInput(f"{path}: line 1: column {k} has no name")
        if name in names[: k - 1]:
            raise BadInput(
                f"{path}: line 1: found column {quoted(name)} twice, expected it once"
            )
        if name not in known and not (name.startswith("cov.") and name != "cov."):
            hint = nearest(name, known)
            raise BadInput(
                f"{path}: line 1: unknown column {quoted(name)}{_passive(name, robot)}"
                f"{hint} (names of additional covariates begin with cov.)"
            )
    if "id" not in names:
        raise BadInput(f'{path}: line 1: missing column "id"')
    return names


def _passive(name: str, robot: Robot) -> str:
    """Return the reason why a joint cannot be commanded, or an empty text."""
    frames = {f"q.{f.name}": f for f in robot.frames}
    if name not in frames:
        return ""
    joint = frames[name].joint
    return f": that joint is {'fixed' if joint == 'fixed' else 'passive'}"


def _other(names: list[str]) -> str:
    """Return a hint about a wrong delimiter if a row has only one cell."""
    for word, mark in DELIMITERS.items():
        if len(names) == 1 and mark in names[0]:
            return (f"; it contains {word}: if this separates the cells, set "
                f'delimiter = "{word}" in [table] of campaign.toml')  # fmt: skip
    return ""


def _dialect_hint(row: list[str], expected: int, dialect: Dialect) -> str:
    """Return a hint about a wrong delimiter if a row has too many cells."""
    if dialect.delimiter == "," and len(row) > expected:
        return (
            '; if the decimal mark is a comma, separate cells by ";" and set '
            'delimiter = ";", decimal = "," in [table] of campaign.toml'
        )
    return ""


def _check_labels(table: MeasurementTable) -> None:
    """Reject missing and duplicate ids."""
    seen: dict[str, int] = {}
    for label, line in zip(table.ids, table.lines, strict=True):
        where = f"{table.file}: line {line}, id"
        if not label:
            raise BadInput(f"{where}: found an empty cell, expected a label")
        if label in seen:
            raise BadInput(
                f"{where}: found {quoted(label)}, already the label of "
                f"line {seen[label]}; expected a different label"
            )
        seen[label] = line


def _numbers(
    table: MeasurementTable, robot: Robot, name: str, cells: list[str]
) -> NDArray:
    """Convert a column to numbers in SI units, NaN for empty readings."""
    key = _unit_key(name, robot)
    unit = table.dialect.unit(key) if key else ""
    factor = table.dialect.factor(key) if key else 1.0
    moved = table.dialect.motions.get(name.removeprefix("cov."))
    if name.startswith("cov.") and moved is not None:
        unit, factor = moved, MOTIONS[moved]
    values = np.empty(len(cells))
    for i, cell in enumerate(cells):
        if not cell and name.startswith(("meas.", "sigma.")):
            values[i] = math.nan
            continue
        if not cell:
            raise table.bad(
                i,
                name,
                "found an empty cell, expected a value; only cells of meas. and sigma. "
                "columns may be empty",
            )
        values[i] = parse_number(cell, table.dialect.decimal)
        if not abs(values[i]) <= LARGEST:
            expected = f"expected a finite number{f' [{unit}]' if unit else ''}"
            hint = _number_hint(name, cell, table.dialect)
            raise table.bad(i, name, f"found {quoted(cell)}, {expected}{hint}")
    return values * factor


def _number_hint(name: str, cell: str, dialect: Dialect) -> str:
    """Return the likely mistake if a cell contains no valid number."""
    other = "," if dialect.decimal == "." else "."
    if other in cell and math.isfinite(parse_number(cell, other)):
        written = quoted(cell.replace(other, dialect.decimal))
        setting = f'decimal = "{other}" in campaign.toml'
        # The delimiter must be changed too, because it is also a comma.
        if other == dialect.delimiter:
            setting = f'delimiter = ";", {setting} and separate cells by ";"'
        return (
            f'; "{other}" is not the declared decimal mark: write {written}, or set '
            f"in [table] {setting}"
        )
    if cell.lower() in {"nan", "na", "n/a", "null", "none", "-"}:
        taken = name.startswith(("meas.", "sigma."))
        return "; leave the cell empty if it was not measured" if taken else ""
    return ""


def _unit_key(name: str, robot: Robot) -> str:
    """Return the key of a column in ``[units]``, or an empty text if it has no unit."""
    group, _, rest = name.partition(".")
    if group in {"meas", "sigma"}:
        turns = rest.rpartition(".")[2][0] == "r"
        return "rotation" if turns else "position"
    if group == "pose":
        return "command_rotation" if rest[0] == "r" else "command_position"
    if group == "q":
        turns = robot.frame(rest).turns
        return "command_rotation" if turns else "command_position"
    if group == "load":
        return "moment" if rest[0] == "m" else "force"
    return "time" if name == "cov.time" else ""
