"""The commands of an import: what the machine was told, row by row."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import POSE, Posture, place_many, place_many_joints
from assembly.model.robot import Robot
from forcefit.inputs.errors import BadInput, describe, nearest, quoted
from validation.campaign.campaign import LOAD
from validation.campaign.dialect import UNITS, parse_number
from validation.exchange.device_table import Writing, cells_of, parse_time

_UNIT = re.compile(r"\s*[\[(]\s*([^\])]*?)\s*[\])]$")
_FACTORS = {unit: f for units in UNITS.values() for unit, f in units.items()}


@dataclass(frozen=True, eq=False)
class Commands:
    """What was commanded.

    Attributes:
        file: the table, for messages.
        ids: labels, unique.
        times: (C,) [s] of each command, NaN without one.
        columns: (C,) in SI by the name that a campaign has for it.
        postures: of the declared robot, one for each command.
    """

    file: str
    ids: tuple[str, ...]
    times: NDArray
    columns: dict[str, NDArray]
    postures: list[Posture]


def read_commands(path: Path | str, robot: Robot, writing: Writing) -> Commands:
    """Read a table of commands.

    Args:
        path: a table with ``id``, ``q.<frame>`` or ``pose.*``, and ``time``,
            ``load.*``, ``cov.*`` where there are any; in SI, or with a unit such as
            ``[deg]``.
        robot: that was commanded.
        writing: of numbers and times.

    Returns:
        The commands, every configuration placed.

    Raises:
        BadInput: an unknown column, a cell that is no number, an id given twice, or a
            configuration that the robot cannot reach.
    """
    rows = cells_of(path)
    header = [_UNIT.sub("", cell) for cell in rows[0][1]]
    factors = [_factor(path, cell) for cell in rows[0][1]]
    joints = [f"q.{f.name}" for f in robot.frames if f.actuated]
    poses = [f"pose.{name}" for name in POSE]
    known = ["id", "time", *joints, *poses, *(f"load.{name}" for name in LOAD)]
    for name in header:
        if name not in known and not (name.startswith("cov.") and len(name) > 4):
            hint = nearest(name, known)
            raise BadInput(f"{path}: line 1: unknown column {quoted(name)}{hint}")
    if len(set(header)) < len(header) or "id" not in header:
        raise BadInput(f'{path}: line 1: expected names that differ, "id" among them')
    ids: list[str] = []
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
                if not cell or cell in ids:
                    raise BadInput(f"{place}: found {describe(cell)}, expected a label")
                ids.append(cell)
            elif name == "time":
                times[i] = parse_time(place, cell, writing)
            else:
                columns[name][i] = parse_number(cell, writing.decimal) * factor
                if not np.isfinite(columns[name][i]):
                    given = describe(cell)
                    raise BadInput(f"{place}: found {given}, expected a number")
    if not ids:
        raise BadInput(f"{path}: no rows; expected one a command")
    postures = _placed(path, robot, ids, columns, joints)
    return Commands(str(path), tuple(ids), times, columns, postures)


def _factor(path: Path | str, column: str) -> float:
    """What a number of a column is times in SI."""
    stated = _UNIT.search(column)
    if stated and stated[1] not in _FACTORS:
        hint = nearest(stated[1], _FACTORS)
        raise BadInput(f"{path}: line 1: found the unit {quoted(stated[1])}{hint}")
    return _FACTORS[stated[1]] if stated else 1.0


def _placed(
    path: Path | str, robot: Robot, ids: list[str], columns: dict[str, NDArray],
    joints: list[str],
) -> list[Posture]:  # fmt: skip
    """The posture of each command."""
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
