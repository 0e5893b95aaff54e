"""Postures along a path, and the first natural frequency at these postures."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture, place_many, place_many_joints
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.trajectory import Trajectory
from forcefit.assembly.platform_stiffness.vibration import check_masses, natural_modes
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.sweeps.targets import goals_of, of_joints
from forcefit.inputs.table import BadInput

_FREQUENCIES = 5  # number of postures at which the first frequency is computed


def placed(
    robot: Robot, names: tuple[str, ...], values: NDArray
) -> tuple[list[Posture | None], list[str]]:
    """Return the posture for each row of a path, or the reason why there is none.

    Args:
        robot: any robot.
        names: components, ``tx`` .. or ``q.<frame>``.
        values: (k, components) [m or rad] values.

    Returns:
        For each row: a posture or None, and the reason, empty if there is a posture.
    """
    place = place_many_joints if of_joints(names) else place_many
    return place(robot, goals_of(names, robot, values))


def check_path_robot(robot: Robot) -> None:
    """Reject a robot without masses, or with effects, which a path does not include.

    Args:
        robot: any robot.

    Raises:
        BadInput: the robot has no masses, or has effects.
    """
    if robot.has_effects:
        raise BadInput(
            f"{robot.name}: found effects of the machine, which are not computed along "
            "a path; expected a robot without effects"
        )
    check_masses(robot)


def check_rows(robot: Robot, table: PathTable, where: str = "path") -> None:
    """Reject a path with a row that is out of the robot's reach.

    Args:
        robot: any robot.
        table: rows of the path.
        where: file of the path, for messages.

    Raises:
        BadInput: a row is out of reach; the message names the row.
    """
    _, reasons = placed(robot, table.names, table.values)
    for row, reason in enumerate(reasons):
        if reason:
            raise BadInput(f"{where}: {table.row_name(row)}: {reason}")


def first_frequency(robot: Robot, trajectory: Trajectory) -> float:
    """Return the least natural frequency along a path with locked drives.

    Args:
        robot: any robot.
        trajectory: the path.

    Returns:
        [Hz] frequency of the nominal robot; NaN if nothing vibrates.
    """
    count = len(trajectory.times)
    rows = np.unique(np.linspace(0, count - 1, _FREQUENCIES).astype(int))
    postures, _ = placed(robot, trajectory.names, trajectory.values[rows])
    found = []
    for posture in postures:
        try:
            modes = natural_modes(posture, 6) if posture is not None else None
        except (BadInput, SolverFailed):
            continue
        if modes is not None:
            found += [f for f in modes.frequencies.tolist() if f > 0.0]
    return min(found, default=float("nan"))
