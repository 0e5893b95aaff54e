"""Campaign folders in: ``campaign.toml`` and its table, whole and sound or not at all.

The format is that of ``docs/campaigns.md``.
"""

import os.path
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.files.robot_file import read_robot
from assembly.kinematics.posture import POSE, Posture, place_many, place_many_joints
from assembly.model.robot import Robot
from assembly.robots import BUILT_IN
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml
from validation.campaign.campaign import LOAD, READING, Campaign, number_rows
from validation.campaign.checks import (
    check_commands,
    check_measured,
    check_readings,
    extent_of,
)
from validation.campaign.dialect import read_dialect
from validation.campaign.measurement_table import MeasurementTable, read_table

_CLOSED = 1e-6  # [rad, m] what rounded robot files may leave open


def read_campaign(folder: Path | str) -> Campaign:
    """The campaign of a folder.

    Args:
        folder: with ``campaign.toml`` in it, or that file.

    Returns:
        The campaign, every configuration placed.

    Raises:
        BadInput: something in it breaks a rule of the format, is not plausible, or a
            configuration is out of reach; file, place, found and expected are named.
    """
    file = Path(folder)
    if not os.path.isfile(file):
        file /= "campaign.toml"
    root = read_toml(file)
    robot_name = root.text("robot", expected="a built-in robot or a robot file")
    path = file.parent / root.text("measurements", expected="a CSV file")
    point = root.array("reference_point", (3,), "m", np.zeros(3), largest=1e4)
    points = _read_points(root)
    registration = root.choice("registration", ("known", "unknown"), "known")
    noise = _read_noise(root)
    dialect = read_dialect(root)
    root.finish()

    robot = _read_robot(root, robot_name)
    table = read_table(path, robot, dialect, points)
    commanded = _commanded(table, robot)
    check_commands(table, robot)
    configuration = number_rows(_command(table, robot, commanded))
    _, first = np.unique(configuration, return_index=True)
    postures = _place(table, robot, commanded, first)
    coordinates = np.array([p.coordinates for p in postures])[configuration]
    transforms = np.array([p.transforms for p in postures])
    platform = transforms[:, robot.index(robot.platform)]
    extent = extent_of(transforms, platform[:, :3, 3])
    named = {"reference_point": point, **{f"points.{k}": p for k, p in points.items()}}
    for place, at in named.items():
        if np.linalg.norm(at) > 10 * extent:
            message = f"found {np.linalg.norm(at):g} m from the platform, the robot is "
            message += f"{extent:.3g} m across; expected a point in m"
            raise root.bad(place, message)
    check_measured(table, points)
    row, which, measured, sigma = [], [], [], []
    for name, at in {"": point, **points}.items():
        readings, stated = _readings(table, name, noise)
        seen = platform[:, :3, 3] + platform[:, :3, :3] @ at
        check_readings(table, name, stated, registration, extent_of(transforms, seen))
        chosen = np.flatnonzero(np.isfinite(readings).any(axis=1))
        row.append(chosen)
        which += [name] * len(chosen)
        measured.append(readings[chosen])
        sigma.append(stated[chosen])
    # row after row of the file, the points of each in the order declared
    order = np.argsort(np.concatenate(row), kind="stable")
    row_of = np.concatenate(row)[order]
    name_of = np.array(which, dtype=str)[order]
    configuration = configuration[row_of]
    loads = (table.stack("load", LOAD, 0.0) + 0.0)[row_of]  # no negative zero
    session = np.array(table.sessions)[row_of] if table.sessions else None
    kinds = [np.unique(name_of, return_inverse=True)[1]]
    if session is not None:
        kinds.append(np.unique(session, return_inverse=True)[1])
    return Campaign(
        name=file.parent.resolve().name,
        robot=robot,
        ids=tuple(
            f"{table.ids[i]}:{name}" if name else table.ids[i]
            for i, name in zip(row_of, name_of, strict=True)
        ),
        coordinates=coordinates,
        transforms=transforms[configuration],
        mismatch=np.array([p.mismatch for p in postures])[configuration],
        commanded=commanded,
        loads=loads,
        measured=np.concatenate(measured)[order],
        sigma=np.concatenate(sigma)[order],
        covariates={
            name.removeprefix("cov."): values[row_of]
            for name, values in table.columns.items()
            if name.startswith("cov.")
        },
        reference_point=point,
        registration=registration,
        configuration=configuration,
        repeat=number_rows(configuration, loads, *kinds),
        session=session,
        points=points,
        point=name_of if points else None,
    )


def _read_points(root: Table) -> dict[str, NDArray]:
    """(3,) [m] each of ``[points]`` by name, platform axes; none if absent."""
    if not root.has("points"):
        return {}
    table = root.table("points")
    for name in table.content:
        if not name or "." in name or ":" in name or name in READING:
            message = "expected a name without . and :, other than those of readings"
            raise table.bad("", f"found {quoted(name)}, {message}")
    return {name: table.array(name, (3,), "m", largest=1e4) for name in table.content}


def _readings(
    table: MeasurementTable, point: str, noise: NDArray
) -> tuple[NDArray, NDArray]:
    """(R, 6) readings of a point, and [rad, m] sigma as stated or of the device."""
    at = f".{point}" if point else ""
    stated = table.stack(f"sigma{at}", READING, np.nan)
    sigma = np.where(np.isnan(stated), noise, stated)
    return table.stack(f"meas{at}", READING, np.nan), sigma


def _read_noise(root: Table) -> NDArray:
    """(6,) [rad, m] one standard deviation of the device, NaN where not stated."""
    noise = np.full(6, np.nan)
    if root.has("noise"):
        table = root.table("noise")
        if table.has("rotation"):
            noise[:3] = table.number("rotation", "rad", above=0.0, largest=np.pi)
        if table.has("position"):
            noise[3:] = table.number("position", "m", above=0.0)
        table.finish()
    return noise


def _read_robot(root: Table, name: str) -> Robot:
    """The robot: built in, or a file beside the campaign's."""
    if name in BUILT_IN:
        return BUILT_IN[name]()
    path = Path(root.file).parent / name
    if not os.path.isfile(path):
        found = f"found {quoted(name)}, neither a built-in robot nor a file beside this"
        raise root.bad("robot", f"{found}{nearest(name, BUILT_IN)}")
    return read_robot(path)


def _commanded(table: MeasurementTable, robot: Robot) -> str:
    """What the table commands; all of the joints or some of the pose."""
    actuated = [f"q.{f.name}" for f in robot.frames if f.actuated]
    given = [name for name in table.columns if name.startswith("q.")]
    pose = [name for name in table.columns if name.startswith("pose.")]
    if given and pose:
        raise BadInput(
            f"{table.file}: line 1: found both {quoted(given[0])} and "
            f"{quoted(pose[0])}; expected joint coordinates or poses"
        )
    if pose:
        return "pose"
    missing = [name for name in actuated if name not in given]
    if missing and given:
        raise BadInput(
            f"{table.file}: line 1: missing column {quoted(missing[0])}; expected one "
            "for every actuated joint"
        )
    if missing:
        raise BadInput(
            f"{table.file}: line 1: no commanded configuration; expected columns "
            f"{', '.join(quoted(n) for n in actuated[:6])} or pose.tx ... pose.rz"
        )
    return "joints"


def _command(table: MeasurementTable, robot: Robot, commanded: str) -> NDArray:
    """(R, 6) poses ``[t r]``, or (R, n) joint coordinates; NaN where free."""
    if commanded == "pose":
        return table.stack("pose", POSE, np.nan)
    return table.stack("q", tuple(f.name for f in robot.frames), np.nan)


def _place(table: MeasurementTable, robot: Robot, commanded: str,
           rows: NDArray) -> list[Posture]:  # fmt: skip
    """The posture of each of these rows, or an error that names the first missed."""
    place = place_many if commanded == "pose" else place_many_joints
    postures, reasons = place(robot, _command(table, robot, commanded)[rows])
    found = []
    for row, posture, reason in zip(rows, postures, reasons, strict=True):
        if posture is None:
            raise table.bad(int(row), "", reason)
        if not posture.mismatch < _CLOSED:
            message = f"the closures stay open by {posture.mismatch:.3g} rad or m"
            raise table.bad(int(row), "", f"{message}, expected < {_CLOSED:g}")
        found.append(posture)
    return found
