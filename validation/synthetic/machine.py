"""Compute the readings of a simulated machine with hidden effects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BASE, Frame, Robot
from forcefit.validation.multibody.motion import placement, shifted, turn_of
from forcefit.validation.multibody.open_robot import refuse_helical
from forcefit.validation.synthetic.delays import behind, with_delays
from forcefit.validation.synthetic.effects import (
    CHANGES,
    COVARIATES,
    POSES,
    READINGS,
    Machine,
    Parameters,
    Row,
)
from forcefit.validation.synthetic.outside import (
    OUTSIDE_CHANGES,
    OUTSIDE_COVARIATES,
    OUTSIDE_READINGS,
)
from forcefit.validation.synthetic.rest import Progress, rest_poses

_ALL_CHANGES = CHANGES | OUTSIDE_CHANGES
_ALL_READINGS = READINGS | OUTSIDE_READINGS
_ALL_COVARIATES = COVARIATES | OUTSIDE_COVARIATES


@dataclass(frozen=True, eq=False)
class Hidden:
    """An effect that the declared model of the machine does not contain.

    Attributes:
        name: name of the effect.  Names of effects outside the library begin with an
            underscore.
        parameters: parameters as in the public formats.
    """

    name: str
    parameters: Parameters


def simulate_readings(
    robot: Robot,
    reference_point: NDArray,
    rows: Sequence[Row],
    effects: Sequence[Hidden] = (),
    program: str = "multibody",
    update: Progress | None = None,
) -> NDArray:
    """Return the pose deviations of a simulated machine in the rows of a design.

    The deviations contain no noise.

    Args:
        robot: the declared robot.
        reference_point: (3,) [m] point at which the load acts and the pose is measured,
            platform axes.
        rows: commanded configurations, loads and covariates.
        effects: hidden effects of the machine.
        program: ``"multibody"`` for Exudyn, or ``"springs"``, which is much faster.
        update: function called with the number of finished machines and the total
            number.

    Returns:
        Rotation vector of R_actual R_nominal^T and displacement of the reference point,
        base axes, (rows, 6) [rad, m].

    Raises:
        BadInput: the robot contains a helical joint.
        SimulationFailed: no equilibrium was found for a row.
    """
    refuse_helical(robot)
    pointed = with_point(robot, reference_point)
    changing = [effect for effect in effects if effect.name in _ALL_CHANGES]
    used = sorted({c for e in changing for c in _ALL_COVARIATES.get(e.name, ())})
    late = {
        value for e in changing for key, value in e.parameters.items()
        if key.endswith(".time_constant")
    }  # fmt: skip
    rows, used = with_delays(rows, late), [*used, *map(behind, late)]
    machines: dict[tuple, Machine] = {}
    nominal: dict[tuple, NDArray] = {}
    keys: list[tuple] = []
    for row in rows:
        place = tuple(row.coordinates.values())
        conditions = tuple(row.covariates[name] for name in used)
        keys.append((place, row.load.tobytes(), *conditions))
        if keys[-1] not in machines:
            machines[keys[-1]] = _machine(pointed, row, changing)
        if place not in nominal:
            nominal[place] = nominal_pose(pointed, row)
    poses = rest_poses(list(machines.values()), program, update)
    known = dict(zip(machines, poses, strict=True))
    return np.array([
        _read(known[key], nominal[key[0]], row, effects)
        for key, row in zip(keys, rows, strict=True)
    ])


def acts_on_machine(name: str) -> bool:
    """Return whether an effect changes the machine."""
    return name in _ALL_CHANGES


def with_point(robot: Robot, reference_point: NDArray) -> Robot:
    """Move the platform frame of a robot to the reference point."""
    point = Frame("platform~point", robot.platform, translation=reference_point)
    return replace(robot, platform=point.name, frames=(*robot.frames, point))


def nominal_pose(robot: Robot, row: Row) -> NDArray:
    """Return the nominal platform pose (4, 4)."""
    T, frame = np.eye(4), robot.frame(robot.platform)
    while True:
        own = np.array([0.0, 0.0, row.coordinates.get(frame.name, 0.0)])
        if frame.joint == "prismatic":
            T = shifted(own) @ T
        elif frame.joint == "revolute":
            T = placement(own, np.zeros(3)) @ T
        T = placement(frame.rotation, frame.translation) @ T
        if frame.parent == BASE:
            return T
        frame = robot.frame(frame.parent)


def _machine(robot: Robot, row: Row, changing: Sequence[Hidden]) -> Machine:
    """Apply the effects that change the machine in a row."""
    gravity = np.array([row.covariates.get(f"gravity.{k}", 0.0) for k in "xyz"])
    machine = Machine(robot, row.coordinates, row.load, gravity)
    for effect in changing:
        change = _ALL_CHANGES[effect.name]
        machine = change(machine, row, effect.parameters)
    return machine


def _read(
    pose: NDArray, nominal: NDArray, row: Row, effects: Sequence[Hidden]
) -> NDArray:
    """Return the reading (6,) [rad, m] of the measuring device for a true pose."""
    for effect in effects:
        if effect.name in POSES:
            pose = POSES[effect.name](pose, row, effect.parameters)
    turn = turn_of(pose[:3, :3] @ nominal[:3, :3].T)
    reading = np.concatenate([turn, pose[:3, 3] - nominal[:3, 3]])
    for effect in effects:
        if effect.name in _ALL_READINGS:
            reading = _ALL_READINGS[effect.name](reading, row, effect.parameters)
    return reading
