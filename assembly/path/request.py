"""Errors along a path for the options of ``forcefit assembly path``."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.model.force_control import with_drive_forces
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.conditions import Covariates, check_effects
from forcefit.assembly.path.dataset import path_dataset
from forcefit.assembly.path.path_errors import PathErrors, Progress, path_errors
from forcefit.assembly.path.path_file import PathTable, check_path, read_path
from forcefit.assembly.path.placing import check_rows
from forcefit.assembly.path.tangents import check_state
from forcefit.assembly.path.trajectory import Trajectory, profiled, timed
from forcefit.assembly.platform_stiffness.vibration import check_masses
from forcefit.assembly.statistics.replay import journalled
from forcefit.assembly.sweeps.dataset import save_dataset
from forcefit.assembly.sweeps.identity import program_hash, robot_hash
from forcefit.inputs.errors import checked
from forcefit.inputs.renamed import warn_renamed
from forcefit.inputs.table import BadInput, nearest

P = ParamSpec("P")
R = TypeVar("R")
ENDS = ("rest", "moving")
POINTS = 201


@dataclass(frozen=True)
class PathTimes:
    """Timing of a path.

    Attributes:
        profile: name of a rest-to-rest profile in
            :data:`forcefit.assembly.path.profiles.PROFILES`; None if times are given.
        duration: [s] duration of the profile.
        speed: [m/s, or rad/s or m/s of drives] largest speed of the profile.
        acceleration: [m/s^2, or rad/s^2 or m/s^2 of drives] largest acceleration of the
            profile.
        interval: [s] time between the poses of a path without times.
        ends: for a path with times, ``"rest"`` if speed and acceleration are zero at
            both ends, or ``"moving"``.
        points: number of equally spaced instants.
    """

    profile: str | None = None
    duration: float | None = None
    speed: float | None = None
    acceleration: float | None = None
    interval: float | None = None
    ends: str = "rest"
    points: int = POINTS


def _accepting_times(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that accepts the deprecated argument ``times``."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        times = kwargs.pop("times", None)
        if isinstance(times, PathTimes):
            warn_renamed("errors_along_path(times)", "errors_along_path(profile, ..)")
            kwargs.update(vars(times))
        return function(*args, **kwargs)

    return call


@_accepting_times
def errors_along_path(
    robot: Robot | str | Path,
    path: PathTable | str | Path,
    *,
    profile: str | None = None,
    duration: float | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    interval: float | None = None,
    ends: str = "rest",
    points: int = POINTS,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    assumption: str = "none",
    state: str = "nominal",
    drive_force: Mapping[str, float] | None = None,
    under: Covariates | None = None,
    output: Path | str | None = None,
    command: str = "",
    progress: Progress = lambda done, most: None,
) -> PathErrors:
    """Compute the errors of a robot along a path, including inertial effects.

    Args:
        robot: robot with masses, robot file, or name of a built-in robot.
        path: poses or joint coordinates, or a CSV file for
            :func:`forcefit.assembly.path.path_file.read_path`.
        profile: name of a rest-to-rest profile in
            :data:`forcefit.assembly.path.profiles.PROFILES`; None if times are given.
        duration: [s] duration of the profile.
        speed: [m/s, or rad/s or m/s of drives] largest speed of the profile.
        acceleration: [m/s^2, or rad/s^2 or m/s^2 of drives] largest acceleration of the
            profile.
        interval: [s] time between the poses of a path without times.
        ends: for a path with times, ``"rest"`` if speed and acceleration are zero at
            both ends, or ``"moving"``.
        points: number of equally spaced instants.
        load: (6,) [N m, N] constant load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        assumption: assumption for the pose error bounds, problem (27): ``"frozen"`` or
            ``"free"``, or ``"none"`` for no bounds.
        state: state for which the compliance of the platform is computed:
            ``"nominal"``, or ``"contact"`` or ``"exact"`` under the loads at each
            instant.
        drive_force: [N m or N] forces of force-controlled drives by name.
        under: values of covariates by name, such as ``temperature``, for the effects in
            the robot file.  ``time`` is the time at the first instant.
        output: NetCDF file to write.  Finished points are stored in
            ``<output>.journal``.  After an interruption, the same call resumes from it.
        command: command line for the provenance in the file, or an empty string.
        progress: function called with the number of solved points and the number of
            all points.

    Returns:
        The results at all instants.

    Raises:
        BadInput: the path, its times or the robot are invalid, the robot cannot reach a
            pose, the journal belongs to another path, or a file cannot be written.
    """
    machine = robot if isinstance(robot, Robot) else load_robot(robot)
    if drive_force:
        machine = with_drive_forces(machine, drive_force)
    check_state(machine, state)
    check_effects(machine, under or {})
    times = PathTimes(profile, duration, speed, acceleration, interval, ends, points)
    trajectory = trajectory_of(machine, path, times)
    asked = {"load": load, "gravity": gravity, "assumption": assumption, "state": state}
    asked["under"] = str(sorted((under or {}).items()))
    file = None if output is None else Path(output)
    with journalled(file, _identity(machine, trajectory, asked)) as replay:
        errors = path_errors(
            machine, trajectory, load=load, gravity=gravity, assumption=assumption,
            state=state, under=under, progress=progress, recall=replay.recall,
        )  # fmt: skip
        if file is not None:
            save_dataset(path_dataset(errors, command), file)
    return errors


def _identity(
    robot: Robot, trajectory: Trajectory, asked: Mapping[str, Any]
) -> dict[str, Any]:
    """Return values that must agree with those in a journal."""
    digest = sha256(trajectory.law.encode())
    for name in ("times", "values", "first", "second"):
        digest.update(np.ascontiguousarray(getattr(trajectory, name)).tobytes())
    return {
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
        "robot_sha256": robot_hash(robot),
        "path_sha256": digest.hexdigest(),
        "path_columns": " ".join(trajectory.names),
        "options": str({
            name: value if value is None or isinstance(value, str)
            else np.asarray(value, float).tolist()
            for name, value in asked.items()
        }),
    }  # fmt: skip


def trajectory_of(
    robot: Robot, path: PathTable | str | Path, times: PathTimes
) -> Trajectory:
    """Return the trajectory of a path that the robot can reach.

    Args:
        robot: robot with masses.
        path: path as for :func:`errors_along_path`.
        times: timing of the path.

    Returns:
        The trajectory.

    Raises:
        BadInput: the path, its times or the robot are invalid, or the robot cannot
            reach a pose.
    """
    check_masses(robot)
    where = "path" if isinstance(path, PathTable) else str(path)
    table = path if isinstance(path, PathTable) else read_path(path, robot)
    check_path(table, where)
    table = _with_times(table, times, where)
    check_rows(robot, table, where)
    if times.profile is not None:
        return profiled(
            table, times.points, times.profile, size_of(robot), times.duration,
            times.speed, times.acceleration,
        )  # fmt: skip
    return timed(table, times.points, times.ends)


def _with_times(table: PathTable, times: PathTimes, where: str) -> PathTable:
    """Return a path with times, or raise BadInput for contradictory options."""
    limits = {
        "--duration": (times.duration, "s"), "--speed": (times.speed, "m/s"),
        "--acceleration": (times.acceleration, "m/s^2"),
        "--interval": (times.interval, "s"),
    }  # fmt: skip
    for option, (value, unit) in limits.items():
        if value is not None:
            checked(option, value, unit, above=0)
    if times.ends not in ENDS:
        raise BadInput(f'--ends: found "{times.ends[:60]}"{nearest(times.ends, ENDS)}')
    given = {
        "column time": table.times is not None,
        "--interval": times.interval is not None,
        "--profile": times.profile is not None,
    }  # fmt: skip
    found = [name for name, there in given.items() if there]
    if len(found) != 1:
        expected = "expected one of a column time, --interval and --profile"
        raise BadInput(
            f"{where}: found {' and '.join(found) or 'no times'}; {expected}"
        )
    if times.profile is None:
        for option in ("--duration", "--speed", "--acceleration"):
            if limits[option][0] is not None:
                raise BadInput(f"{option}: found no --profile, which it requires")
    elif times.ends == "moving":
        raise BadInput(
            "--ends moving: found --profile, whose motion starts and ends at rest; "
            "expected only one of these options"
        )
    if times.interval is None:
        return table
    return replace(table, times=times.interval * np.arange(len(table.values)))
