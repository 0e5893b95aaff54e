"""Postures and the first natural frequency along a path."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.effects.robot_effects import apply_robot_effects
from forcefit.assembly.kinematics.posture import Posture, place_many, place_many_joints
from forcefit.assembly.linear.energy import CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.conditions import Covariates
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.trajectory import Trajectory
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.sweeps.targets import goals_of, of_joints
from forcefit.inputs.table import BadInput

_FREQUENCIES = 5  # number of postures at which natural frequencies are computed


def placed(
    robot: Robot, names: tuple[str, ...], values: NDArray
) -> tuple[list[Posture | None], list[str]]:
    """Return the posture at each point of a path.

    Args:
        robot: any robot.
        names: components, ``tx`` .. or ``q.<frame>``.
        values: (k, components) [m or rad] values.

    Returns:
        For each point, a posture and an empty string, or None and the reason why the
        robot cannot reach the point.
    """
    place = place_many_joints if of_joints(names) else place_many
    return place(robot, goals_of(names, robot, values))


def check_rows(robot: Robot, table: PathTable, where: str = "path") -> None:
    """Raise BadInput if the robot cannot reach a point of a path.

    Args:
        robot: any robot.
        table: rows of the path.
        where: file of the path, for messages.

    Raises:
        BadInput: the robot cannot reach a row.
    """
    _, reasons = placed(robot, table.names, table.values)
    for row, reason in enumerate(reasons):
        if reason:
            raise BadInput(f"{where}: {table.row_name(row)}: {reason}")


def first_frequency(
    robot: Robot, trajectory: Trajectory, load: ArrayLike | None,
    gravity: ArrayLike | None, under: Covariates,
) -> float:  # fmt: skip
    """Return the lowest natural frequency along a path with locked drives.

    Args:
        robot: any robot.
        trajectory: the path.
        load: (6,) [N m, N] load on the platform, which determines the secant stiffness
            of nonlinear effects.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        under: values of the covariates of the robot's effects, by name.

    Returns:
        [Hz] frequency of the robot with its effects; NaN if it has no vibration mode.
    """
    count = len(trajectory.times)
    rows = np.unique(np.linspace(0, count - 1, _FREQUENCIES).astype(int))
    postures, _ = placed(robot, trajectory.names, trajectory.values[rows])
    found = []
    for posture in postures:
        if posture is None:
            continue
        try:
            applied = apply_robot_effects(posture, load, gravity, under)
            modes = natural_modes(applied.posture, 6)
        except (BadInput, CannotAssemble, FreeMotion, SolverFailed):
            continue
        if modes is not None:
            found += [f for f in modes.frequencies.tolist() if f > 0.0]
    return min(found, default=float("nan"))
