"""Read campaign folders, which contain ``campaign.toml`` and a measurement table."""

import os.path
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.posture import (
    POSE,
    Posture,
    place_many,
    place_many_joints,
)
from forcefit.assembly.measurement.conditions import COVARIATES
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import BUILT_IN
from forcefit.inputs.table import (
    BadInput,
    Table,
    describe,
    nearest,
    quoted,
    read_toml,
)
from forcefit.validation.campaign.campaign import LOAD, READING, Campaign, number_rows
from forcefit.validation.campaign.checks import (
    check_commands,
    check_measured,
    check_readings,
    extent_of,
)
from forcefit.validation.campaign.dialect import Dialect, read_dialect
from forcefit.validation.campaign.measurement_table import (
    MeasurementTable,
    join_tables,
    read_table,
)

# [rad, m] Largest accepted closure error of the loops.
_CLOSED = 1e-6


@dataclass(frozen=True, eq=False)
class _Declared:
    """Content of ``campaign.toml``, or default values without this file."""

    root: Table
    name: str
    files: tuple[Path, ...]
    point: NDArray
    points: dict[str, NDArray]
    registration: str
    noise: NDArray
    dialect: Dialect
    per_session: tuple[str, ...]


def read_campaign(
    folder: Path | str, robot: Robot | None = None, *, links: bool = True
) -> Campaign:
    """Read a campaign from a folder.

    Args:
        folder: folder that contains ``campaign.toml``, or the path of this file.  If
            ``robot`` is given, it may be the path of a measurement table in SI units.
        robot: robot that replaces the robot of the campaign.  Missing measurements are
            then accepted and become NaN. None for the robot of the campaign.
        links: whether to compute the stiffness of links that are described by meshes.

    Returns:
        The campaign, with joint coordinates for every configuration.

    Raises:
        BadInput: a file has an invalid format, a value is implausible, or a
            configuration is unreachable.
    """
    if robot is not None:
        return read_commands(folder, robot)
    root = read_toml(_declaration(folder))
    robot_name = root.text("robot", expected="a built-in robot or a robot file")
    declared = _declared(root)
    return _campaign(declared, _read_robot(root, robot_name, links))


def read_commands(source: Path | str, robot: Robot) -> Campaign:
    """Return the commands of a machine as a campaign, with optional measurements.

    Args:
        source: a campaign folder, or a measurement table in SI units.  The readings of
            such a table refer to the reference point of the robot file, or to the
            platform origin.
        robot: robot that executes the commands.

    Returns:
        A campaign.  Readings that were not measured are NaN.

    Raises:
        BadInput: as for :func:`read_campaign`.
    """
    if Path(source).suffix.lower() == ".csv":
        content: dict[str, Any] = {"measurements": Path(source).name}
        if robot.reference_point is not None:
            content["reference_point"] = list(robot.reference_point)
        root = Table(content, str(source), "")
        return _campaign(_declared(root), robot, measured=False)
    root = read_toml(_declaration(source))
    root.text("robot", expected="a built-in robot or a robot file")
    return _campaign(_declared(root), robot, measured=False)


def _declaration(folder: Path | str) -> Path:
    """Return the path of ``campaign.toml`` for a given folder or file."""
    file = Path(folder)
    return file if os.path.isfile(file) else file / "campaign.toml"


def _declared(root: Table) -> _Declared:
    """Read the content of ``campaign.toml``, except for the robot."""
    folder = Path(root.file).parent
    declared = _Declared(
        root=root,
        name=folder.resolve().name,
        files=tuple(folder / name for name in _table_names(root)),
        point=root.array("reference_point", (3,), "m", np.zeros(3), largest=1e4),
        points=_read_points(root),
        registration=root.choice("registration", ("known", "unknown"), "known"),
        noise=_read_noise(root),
        dialect=read_dialect(root),
        per_session=_per_session(root),
    )
    root.finish()
    return declared


def _per_session(root: Table) -> tuple[str, ...]:
    """Read the names of effects whose parameters may differ between sessions."""
    given = root.get("per_session", [])
    valid = [name for name, effect in LIBRARY.items() if effect.by_row]
    if not isinstance(given, list):
        raise root.bad(
            "per_session", f"found {describe(given)}, expected a list of effects"
        )
    for name in given:
        if name not in valid:
            hint = nearest(str(name), valid)
            message = (
                f"found {describe(name)}, expected an effect that can differ between "
                f"sessions{hint}"
            )
            raise root.bad("per_session", message)
    return tuple(given)


def _table_names(root: Table) -> list[str]:
    """Read the file names of the measurement tables."""
    given = root.get("measurements")
    if not isinstance(given, list):
        return [root.text("measurements", expected="a CSV file")]
    proper = given and all(isinstance(v, str) and v.strip() for v in given)
    if not proper or len({Path(v).stem for v in given}) < len(given):
        message = f"found {describe(given)}, expected a list of different CSV files"
        raise root.bad("measurements", message)
    return given


def _campaign(declared: _Declared, robot: Robot, *, measured: bool = True) -> Campaign:
    """Create the campaign that ``campaign.toml`` describes.

    Args:
        declared: content of ``campaign.toml``.
        robot: robot that executes the commands.
        measured: whether every row must contain a measurement.

    Returns:
        The campaign, with one row per measured point.
    """
    point, points = declared.point, declared.points
    table = join_tables([
        read_table(path, robot, declared.dialect, points) for path in declared.files
    ])
    for name in declared.dialect.motions:
        if f"cov.{name}" not in table.columns or name in COVARIATES:
            units = declared.root.table("units")
            message = f"found {quoted(name)}, expected a covariate column of the table"
            raise units.bad(f"cov.{name}", message)
    commanded = _commanded(table, robot)
    check_commands(table, robot)
    configuration = number_rows(_command(table, robot, commanded))
    _, first = np.unique(configuration, return_index=True)
    postures = _place(table, robot, commanded, first)
    transforms = np.array([p.transforms for p in postures])
    platform = transforms[:, robot.index(robot.platform)]
    extent = extent_of(transforms, platform[:, :3, 3])
    _check_points(declared, extent)
    if measured:
        check_measured(table, points)
    # Map each measured point to its readings and their standard deviations.
    every: dict[str, tuple[NDArray, NDArray]] = {}
    for name, at in {"": point, **points}.items():
        every[name] = _readings(table, name, declared.noise)
        reach = extent_of(transforms, platform[:, :3, 3] + platform[:, :3, :3] @ at)
        check_readings(table, name, every[name][1], declared.registration, reach)
    row, which = _rows_of_points(every, measured)
    configuration = configuration[row]
    loads = (table.stack("load", LOAD, 0.0) + 0.0)[row]  # replace -0.0 by 0.0
    session = np.array(table.sessions)[row] if table.sessions else None
    kinds = [which]
    if session is not None:
        kinds.append(np.unique(session, return_inverse=True)[1])
    covariates = {
        name.removeprefix("cov."): values[row]
        for name, values in table.columns.items()
        if name.startswith("cov.")
    }
    return Campaign(
        name=declared.name,
        robot=robot,
        ids=_labels(table.ids, [*every], row, which),
        coordinates=np.array([p.coordinates for p in postures])[configuration],
        transforms=transforms[configuration],
        mismatch=np.array([p.mismatch for p in postures])[configuration],
        commanded=commanded,
        loads=loads,
        measured=np.array([readings for readings, _ in every.values()])[which, row],
        sigma=np.array([sigma for _, sigma in every.values()])[which, row],
        covariates={k: v for k, v in covariates.items() if np.isfinite(v).all()},
        partial={k: v for k, v in covariates.items() if not np.isfinite(v).all()},
        reference_point=point,
        registration=declared.registration,
        configuration=configuration,
        repeat=number_rows(configuration, loads, *kinds),
        session=session,
        motion_units=declared.dialect.motion_units,
        points=points,
        per_session=declared.per_session,
        point=np.array([*every], dtype=str)[which] if points else None,
    )


def _check_points(declared: _Declared, extent: float) -> None:
    """Reject measured points that are far away from the robot."""
    points = {f"points.{name}": at for name, at in declared.points.items()}
    for place, at in ({"reference_point": declared.point} | points).items():
        if np.linalg.norm(at) > 10 * extent:
            message = (
                f"found a point {np.linalg.norm(at):g} m from the platform, but "
                "the robot is "
            )
            message += f"{extent:.3g} m across; expected a point in m"
            raise declared.root.bad(place, message)


def _labels(
    ids: Sequence[str], points: Sequence[str], row: NDArray, which: NDArray
) -> tuple[str, ...]:
    """Return a label for each row, composed of its label in the file and its point."""
    return tuple(
        f"{ids[i]}:{points[k]}" if points[k] else ids[i]
        for i, k in zip(row, which, strict=True)
    )


def _rows_of_points(
    every: dict[str, tuple[NDArray, NDArray]], measured: bool
) -> tuple[NDArray, NDArray]:
    """Return the file row and the point for each row of the campaign.

    Args:
        every: mapping from the name of each point to its readings (R, 6) and their
            sigma.
        measured: whether to omit rows without a reading.

    Returns:
        For each row of the campaign, the index of its row in the file, (C,), and the
        index of its point, (C,).
    """
    taken = np.column_stack([
        np.isfinite(readings).any(axis=1) for readings, _ in every.values()
    ])
    if not measured:
        # If there are no readings, the campaign contains a row for each additional
        # point. If there are no additional points, it contains a row for the reference
        # point.
        alone = not taken.any() and len(every) > 1
        taken[~taken.any(axis=1)] = taken.any(axis=0) if taken.any() else True
        taken[:, 0] &= not alone
    rows, which = np.nonzero(taken)
    return rows, which


def _read_points(root: Table) -> dict[str, NDArray]:
    """Read the position (3,) [m] of each additional point, platform axes."""
    if not root.has("points"):
        return {}
    table = root.table("points")
    for name in table.content:
        if not name or "." in name or ":" in name or name in READING:
            message = "expected a name without . and : other than tx ... rz"
            raise table.bad("", f"found {quoted(name)}, {message}")
    return {name: table.array(name, (3,), "m", largest=1e4) for name in table.content}


def _readings(
    table: MeasurementTable, point: str, noise: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the readings (R, 6) [rad, m] of a point and their standard deviations."""
    at = f".{point}" if point else ""
    stated = table.stack(f"sigma{at}", READING, np.nan)
    sigma = np.where(np.isnan(stated), noise, stated)
    return table.stack(f"meas{at}", READING, np.nan), sigma


def _read_noise(root: Table) -> NDArray:
    """Read the standard deviations (6,) [rad, m] of the measuring device, or NaN."""
    noise = np.full(6, np.nan)
    if root.has("noise"):
        table = root.table("noise")
        if table.has("rotation"):
            noise[:3] = table.number("rotation", "rad", above=0.0, largest=np.pi)
        if table.has("position"):
            noise[3:] = table.number("position", "m", above=0.0)
        table.finish()
    return noise


def _read_robot(root: Table, name: str, links: bool) -> Robot:
    """Load a built-in robot or a robot file in the campaign folder."""
    if name in BUILT_IN:
        return BUILT_IN[name]()
    path = Path(root.file).parent / name
    if not os.path.isfile(path):
        message = (
            f"found {quoted(name)}, which is neither a built-in robot nor a file in "
            "this folder"
        )
        raise root.bad("robot", f"{message}{nearest(name, BUILT_IN)}")
    return load_robot(path, links=links)


def _commanded(table: MeasurementTable, robot: Robot) -> str:
    """Return ``"joints"`` or ``"pose"``, depending on the columns of the table."""
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
            f"{table.file}: line 1: missing column {quoted(missing[0])}; expected a "
            "column for every actuated joint"
        )
    if missing:
        raise BadInput(
            f"{table.file}: line 1: found no commanded configuration; expected columns "
            f"{', '.join(quoted(n) for n in actuated[:6])} or pose.tx ... pose.rz"
        )
    return "joints"


def _command(table: MeasurementTable, robot: Robot, commanded: str) -> NDArray:
    """Return commanded poses (R, 6) or joint coordinates (R, n).

    Values that are not commanded are NaN.
    """
    if commanded == "pose":
        return table.stack("pose", POSE, np.nan)
    return table.stack("q", tuple(f.name for f in robot.frames), np.nan)


def _place(table: MeasurementTable, robot: Robot, commanded: str,
           rows: NDArray) -> list[Posture]:  # fmt: skip
    """Compute the postures of selected rows."""
    place = place_many if commanded == "pose" else place_many_joints
    postures, reasons = place(robot, _command(table, robot, commanded)[rows])
    placed = []
    for row, posture, reason in zip(rows, postures, reasons, strict=True):
        if posture is None:
            raise table.bad(int(row), "", reason)
        if not posture.mismatch < _CLOSED:
            message = f"found loops with a gap of {posture.mismatch:.3g} rad or m"
            raise table.bad(int(row), "", f"{message}, expected < {_CLOSED:g}")
        placed.append(posture)
    return placed
