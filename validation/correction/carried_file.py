"""Save a robot that was fitted to new sessions together with its covariance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import Robot
from forcefit.validation.correction.carrying import CarriedRobot, carried_robot
from forcefit.validation.correction.machine_numbers import renumbered
from forcefit.validation.diagnosis.saved_covariance import (
    EFFECT,
    FUNCTION,
    Number,
    SavedCovariance,
    write_covariance,
)


def save(carried: CarriedRobot, path: Path | str) -> None:
    """Write a fitted robot and its covariance to two files.

    Args:
        carried: the robot, fitted to the new sessions.
        path: path of the robot file.  The covariance file has the same name with the
            suffix ``.npz``.

    Raises:
        BadInput: a file cannot be written.
    """
    path, robot = Path(path), carried_robot(carried)
    record = {k: v for k, v in robot.diagnosis.items() if k != "covariance"}
    known = covariance_of(carried, robot)
    if known.numbers:
        beside = path.with_suffix(".npz")
        write_covariance(known, beside)
        record["covariance"] = str(beside.resolve())
    write_robot(replace(_with_std(robot, known), diagnosis=record), path)


def covariance_of(carried: CarriedRobot, robot: Robot) -> SavedCovariance:
    """Return the covariance of the robot parameters after the fit to the set-up rows.

    Args:
        carried: the robot, fitted to the new sessions.
        robot: the robot in the file.
    """
    fit, rows = carried.fit, dict[Number, NDArray]()
    count, machine = len(fit.x), fit.machine
    for number, root in zip(renumbered(machine), machine.root, strict=True):
        rows[number] = np.concatenate([np.zeros(count - len(machine)), root])
    added = sum(len(one.unknowns.functions) for one in carried.sessions)
    at, first = 0, len(robot.functions) - added
    for one in carried.sessions:
        for owner, name in one.unknowns.names:
            number = Number(EFFECT, owner, name, one.session or "")
            if owner not in LIBRARY:
                place = first + one.unknowns.owners.index(owner)
                number = Number(FUNCTION, str(place), name)
            rows.setdefault(number, np.zeros(count))[at] += 1.0
            at += 1
        first += len(one.unknowns.functions)
    T = np.array([*rows.values()]).reshape(len(rows), count)
    return SavedCovariance(tuple(rows), T @ fit.covariance @ T.T)


def _with_std(robot: Robot, known: SavedCovariance) -> Robot:
    """Return the robot with standard deviations of function coefficients."""
    functions = list(robot.functions)
    for number, sigma in zip(known.numbers, known.std.tolist(), strict=True):
        if number.kind == FUNCTION:
            one = functions[int(number.owner)]
            own = {**one.std, number.name: sigma}
            functions[int(number.owner)] = replace(one, std=own)
    return replace(robot, functions=tuple(functions))
