"""Read the table of machine commands for an import of measured data."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import (
    POSE,
    Posture,
    place_many,
    place_many_joints,
)
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput, describe, nearest, quoted
from forcefit.validation.campaign.campaign import LOAD
from forcefit.validation.campaign.dialect import UNITS, parse_number
from forcefit.validation.exchange.cells import read_sheet
from forcefit.validation.exchange.clock import parse_time
from forcefit.validation.exchange.reading import Writing

_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]$")
# Factors that convert temperature differences to K.
_TEMPERATURES = {"K": 1.0, "degC": 1.0, "°C": 1.0, "C": 1.0}
_INCHES = {"cm": 1e-2, "in": 0.0254, "inch": 0.0254}


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of a machine during a measurement.

    Attributes:
        file: path of the table, for messages.
        ids: unique labels of the commands.
        times: (C,) [s] time of each command; NaN if the table contains no time.
        columns: mapping from the name of each column of the campaign to (C,) values in
            SI units.
        postures: postures of the declared robot, one for each command.
    """

    file: str
    ids: tuple[str, ...]
    times: NDArray
    columns: dict[str, NDArray]
    postures: list[Posture]


def read_commands(path: Path | str, robot: Robot, writing: Writing) -> Commands:
    """Read a table of commands.

    Args:
        path: a table with ``id``, ``q.<frame>`` or ``pose.*``, and optionally ``time``,
            ``load.*``, ``cov.*``, in SI units or with a unit such as ``[deg]``.
            Covariates other than time and temperature may be in any unit and are not
            converted.
        robot: the commanded robot.
        writing: format of numbers and times.

    Returns:
        The commands, with the posture of every configuration.

    Raises:
        BadInput: a column is unknown, a cell is not a number, an id occurs twice, or
            the robot cannot reach a configuration.
    """
    sheet = read_sheet(path, writing.commands_decimal)
    writing = replace(writing, decimal=sheet.decimal)
    rows = sheet.rows
    header = [_UNIT.sub("", cell) for cell in rows[0][1]]
    factors = [
        _factor(path, name, cell, robot)
        for name, cell in zip(header, rows[0][1], strict=True)
    ]
    joints = [f"q.{f.name}" for f in robot.frames if f.actuated]
    poses = [f"pose.{name}" for name in POSE]
    known = ["id", "time", *joints, *poses, *(f"load.{name}" for name in LOAD)]
    for name in header:
        if name not in known and not (name.startswith("cov.") and len(name) > 4):
            hint = nearest(name, known)
            raise BadInput(f"{path}: line 1: unknown column {quoted(name)}{hint}")
    twice = [name for name in header if header.count(name) > 1]
    if twice:
        raise BadInput(
            f"{path}: line 1: found column {quoted(twice[0])} twice, expected it once"
        )
    if "id" not in header:
        raise BadInput(f'{path}: line 1: missing column "id"')
    ids: dict[str, int] = {}  # mapping from label to line number
    times = np.full(len(rows) - 1, np.nan)
    columns = {n: np.empty(len(rows) - 1) for n in header if n not in {"id", "time"}}
    for i, (line, cells) in enumerate(rows[1:]):
        if len(cells) != len(header):
            raise BadInput(
                f"{path}: line {line}: found {len(cells)} cells, expected {len(header)}"
            )
        for name, factor, cell in zip(header, factors, cells, strict=True):
            place = f"{path}: line {line}, {name}"
            if name == "id":
                _check_label(place, cell, ids)
                ids[cell] = line
            elif name == "time":
                times[i] = factor * parse_time(place, cell, writing)
            else:
                columns[name][i] = parse_number(cell, sheet.decimal) * factor
                if not np.isfinite(columns[name][i]):
                    given, hint = describe(cell), _decimal_hint(cell, sheet.decimal)
                    raise BadInput(f"{place}: found {given}, expected a number{hint}")
    if not ids:
        raise BadInput(f"{path}: found no rows; expected one row for each command")
    postures = _placed(path, robot, [*ids], columns, joints)
    return Commands(str(path), tuple(ids), times, columns, postures)


def _check_label(place: str, label: str, seen: Mapping[str, int]) -> None:
    """Reject a missing or duplicate label."""
    if not label:
        raise BadInput(f"{place}: found an empty cell, expected a label")
    if label in seen:
        raise BadInput(
            f"{place}: found {quoted(label)}, which is already the label of line "
            f"{seen[label]}; expected a different label"
        )


def _decimal_hint(cell: str, decimal: str) -> str:
    """Return a hint for the message if a cell has the wrong decimal mark."""
    other = "," if decimal == "." else "."
    if not np.isfinite(parse_number(cell, other)):
        return ""
    return (
        f'; if this is a decimal mark, set decimal = {{ commands = "{other}" }} in '
        "the targets file"
    )


def _factor(path: Path | str, name: str, column: str, robot: Robot) -> float:
    """Return the factor that converts a column to SI units."""
    stated = _UNIT.search(column)
    if not stated:
        return 1.0
    units = _units(name, robot)
    if units is None:
        return 1.0
    if stated[1] not in units:
        hint = nearest(stated[1], units) or f"; expected {', '.join(units)}"
        found = f"{quoted(name)}: found the unit {quoted(stated[1])}"
        raise BadInput(f"{path}: line 1, {found}{hint}")
    return units[stated[1]]


def _units(name: str, robot: Robot) -> Mapping[str, float] | None:
    """Return conversion factors of the accepted units; None if all are accepted."""
    lengths = UNITS["command_position"] | _INCHES
    if name in {"time", "cov.time"}:
        return UNITS["time"]
    if name == "cov.temperature":
        return _TEMPERATURES
    if name.startswith("load."):
        return UNITS["moment" if name[5] == "m" else "force"]
    if name.startswith("pose."):
        return UNITS["command_rotation"] if name[5] == "r" else lengths
    if name.startswith("q.") and name[2:] in {f.name for f in robot.frames}:
        turns = robot.frame(name[2:]).turns
        return UNITS["command_rotation"] if turns else lengths
    return None


def _placed(
    path: Path | str, robot: Robot, ids: list[str], columns: dict[str, NDArray],
    joints: list[str],
) -> list[Posture]:  # fmt: skip
    """Compute the posture of each command."""
    given = [name for name in joints if name in columns]
    posed = any(name.startswith("pose.") for name in columns)
    if posed == bool(given) or (given and len(given) < len(joints)):
        expected = ", ".join(map(quoted, joints[:6]))
        raise BadInput(
            f"{path}: line 1: expected a column for every drive ({expected}), or "
            "pose.tx ... pose.rz"
        )
    empty = np.full(len(ids), np.nan)
    if posed:
        goals = np.column_stack([columns.get(f"pose.{name}", empty) for name in POSE])
        postures, reasons = place_many(robot, goals)
    else:
        held = [columns.get(f"q.{f.name}", empty) for f in robot.frames]
        postures, reasons = place_many_joints(robot, np.column_stack(held))
    for label, posture, reason in zip(ids, postures, reasons, strict=True):
        if posture is None:
            raise BadInput(f"{path}: id {quoted(label)}: {reason}")
    return [posture for posture in postures if posture is not None]
