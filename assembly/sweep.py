"""Margin, energy and platform error over a grid of postures, as a labelled data set."""

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.batch import minimise_energies, zone_margins
from assembly.conic import SolverFailed
from assembly.energy import solve_assembly
from assembly.pose_error import bound_pose_error
from assembly.posture import POSE, Posture, place_many
from assembly.robot import Robot
from assembly.robot_file import frame_table
from assembly.zone import ASSEMBLABLE
from stiffness.reading import BadInput, nearest
from stiffness.screws import SCREW

if TYPE_CHECKING:
    import xarray

_LARGEST_GRID = 10_000_000  # points; more is a slip of the step
_CHUNK = 256  # points solved together between two reports of progress
_POINT = {
    "margin": "1", "margin_free": "1", "energy": "J", "closure_residual": "1",
    "clearance_excess": "1", "duality_gap": "J",
}  # fmt: skip
_MEANING = {
    "margin": "factor on all clearances at which it just assembles, compliant rigid",
    "margin_free": "the same, compliant joints free about their own axis",
    "energy": "least elastic energy that closes it, eq. (22)",
    "platform_screw": "pose error at the platform's origin, base axes",
    "rotation_error": "certified bounds of the largest rotation error, eq. (27)",
    "translation_error": "certified bounds of the largest translation error, eq. (27)",
    "status": "ok, out of reach, cannot assemble, or solver failed",
}


def parse_grid(text: str) -> dict[str, NDArray]:
    """Axes of a grid from text such as ``"tx=-0.2:0.2:0.025,tz=-0.6:-0.3:0.025"``.

    Args:
        text: for each pose component ``start:stop:step`` [m or rad], or one number.
            Both ends count when (stop - start)/step is whole within 1e-9.

    Returns:
        Values by pose component, in the order given.

    Raises:
        BadInput: not of that form, or far too many points.
    """
    axes: dict[str, NDArray] = {}
    for part in text.split(","):
        name, _, spec = (piece.strip() for piece in part.partition("="))
        if name not in POSE:
            hint = nearest(name, POSE)
            raise BadInput(f'grid: unknown pose component "{name[:60]}"{hint}')
        if name in axes:
            raise BadInput(f'grid: "{name}" is given twice')
        axes[name] = _axis(name, spec)
    if np.prod([float(len(v)) for v in axes.values()]) > _LARGEST_GRID:
        raise BadInput(f"grid: more than {_LARGEST_GRID} points; is a step too small?")
    return axes


def _axis(name: str, spec: str) -> NDArray:
    """Values of one axis."""
    expected = "expected START:STOP:STEP or one number"
    try:
        numbers = [float(piece) for piece in spec.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in {1, 3} or not np.isfinite(numbers).all():
        raise BadInput(f'grid {name}: found "{spec[:60]}", {expected}')
    if len(numbers) == 1:
        return np.array(numbers)
    start, stop, step = numbers
    if step == 0 or (stop - start) / step < 0:
        raise BadInput(
            f"grid {name}: step {step:g} never leads from {start:g} to {stop:g}"
        )
    count = (stop - start) / step
    if count > _LARGEST_GRID:
        raise BadInput(f"grid {name}: {count:.3g} points; is the step too small?")
    return start + step * np.arange(int(np.floor(count + 1e-9)) + 1)


def sweep_poses(
    robot: Robot,
    axes: Mapping[str, NDArray],
    progress: Callable[[int, int], None] = lambda done, total: None,
    reading: str | None = None,
) -> "xarray.Dataset":
    """Solve (21) and (22), and if asked (27), at every pose of a grid.

    Args:
        robot: with its errors, clearances and stiffnesses.
        axes: values [m or rad] by pose component; components not named are free.
        reading: of problem (27): ``"frozen"``, ``"free"`` or ``"budget"``; None leaves
            the bounds of the pose error out, which take most of the time.
        progress: called after each point with the number done and the total.

    Returns:
        Data set over the axes: ``margin``, ``margin_free``, ``energy``,
        ``platform_screw``, with a reading ``rotation_error`` and ``translation_error``
        (lower and upper), certificates and ``status``; NaN where there is no answer,
        and the status then says why.

    Raises:
        BadInput: the robot's closures do not hold in its home pose.
    """
    shape = tuple(len(v) for v in axes.values())
    poses = np.full((int(np.prod(shape)), 6), np.nan)
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    for name, values in zip(axes, mesh, strict=True):
        poses[:, POSE.index(name)] = values.ravel()
    postures, reasons = place_many(robot, poses)
    rows: list[dict] = []
    for first in range(0, len(poses), _CHUNK):
        some = postures[first : first + _CHUNK]
        reached = [posture for posture in some if posture is not None]
        solved = iter(_solve(robot, reached))
        for posture, reason in zip(some, reasons[first:], strict=False):
            unreached = {"status": "out of reach", "reason": reason}
            row = _row(unreached if posture is None else next(solved))
            if reading is not None:
                row |= _pose_error(posture, reading, row)
            rows.append(row)
            progress(len(rows), len(poses))
    return _dataset(robot, axes, shape, rows)


def _pose_error(posture: Posture | None, reading: str, row: dict) -> dict:
    """Bounds of (27) where (22) has an answer."""
    unknown = np.full(2, np.nan)
    row = {
        "rotation_error": unknown, "translation_error": unknown,
        "status": row["status"], "reason": row["reason"],
    }  # fmt: skip
    if posture is None or row["status"] != "ok":
        return row
    try:
        found = bound_pose_error(solve_assembly(posture), reading)
    except SolverFailed as error:
        return row | {"status": "solver failed", "reason": str(error)}
    return row | {
        "rotation_error": np.array(found.rotation_error),
        "translation_error": np.array(found.translation_error),
    }


def _solve(robot: Robot, postures: list[Posture]) -> list[dict]:
    """What there is to say of each posture; one that fails stops nothing."""
    frames = np.zeros((len(postures), len(robot.frames), 4, 4))
    for T, posture in zip(frames, postures, strict=True):
        T[:] = posture.transforms
    off = np.array([posture.mismatch for posture in postures])
    margins = {
        key: zone_margins(robot, frames, reading, off)
        for key, reading in (("margin", "rigid"), ("margin_free", "free"))
    }
    energies = minimise_energies(robot, frames, mismatch=off)
    found = []
    for i in range(len(postures)):
        row: dict = {key: each.margin[i] for key, each in margins.items()}
        failed = [each.reason[i] for each in margins.values() if each.reason[i]]
        if failed:
            row |= {"status": "solver failed", "reason": failed[0]}
        elif energies.status[i] != "ok":
            row |= {"status": energies.status[i], "reason": energies.reason[i]}
        else:
            row |= {
                "energy": energies.energy[i],
                "platform_screw": energies.platform_screw[i],
                "closure_residual": energies.closure_residual[i],
                "clearance_excess": energies.clearance_excess[i],
                "duality_gap": energies.gap[i],
            }
        found.append(row)
    return found


def _row(found: dict) -> dict:
    """A row of the data set, NaN where nothing was found."""
    row: dict = dict.fromkeys(_POINT, np.nan)
    row |= {"platform_screw": np.full(6, np.nan), "status": "ok", "reason": ""}
    return row | found


def _dataset(
    robot: Robot, axes: Mapping[str, NDArray], shape: tuple[int, ...], rows: list[dict]
) -> "xarray.Dataset":
    """The data set with its units and where it came from."""
    import xarray

    dims = tuple(axes)
    units = {name: "m" if name.startswith("t") else "rad" for name in axes}
    data = {
        key: (dims, np.array([r[key] for r in rows]).reshape(shape), {"units": unit})
        for key, unit in _POINT.items()
    }
    screws = np.array([r["platform_screw"] for r in rows]).reshape(*shape, 6)
    data["platform_screw"] = ((*dims, "screw"), screws, {"units": "rad, m"})
    bounds = {"rotation_error": "rad", "translation_error": "m"}
    for key, unit in bounds.items():
        if key in rows[0]:
            values = np.array([r[key] for r in rows]).reshape(*shape, 2)
            data[key] = ((*dims, "bound"), values, {"units": unit})
    for key in ("status", "reason"):
        text = np.array([r[key] for r in rows], dtype=object).reshape(shape)
        data[key] = (dims, text, {})
    for key in _MEANING.keys() & data.keys():
        data[key][2]["long_name"] = _MEANING[key]
    coordinates = {k: (k, v, {"units": units[k]}) for k, v in axes.items()}
    attributes = {
        "robot": robot.name,
        "robot_sha256": robot_hash(robot),
        "program": f"forcefit {version('forcefit')}",
    }
    labels = {"screw": list(SCREW)}
    if "rotation_error" in data:
        labels["bound"] = ["lower", "upper"]
    return xarray.Dataset(data, {**coordinates, **labels}, attributes)


def robot_hash(robot: Robot) -> str:
    """SHA-256 of all that a robot file says of a robot, for provenance."""
    said = [robot.platform, robot.closures, [frame_table(f) for f in robot.frames]]
    return hashlib.sha256(json.dumps(said, default=str).encode()).hexdigest()


def save_dataset(data: "xarray.Dataset", path: Path | str) -> None:
    """Write a data set as NetCDF, whole or not at all.

    Args:
        data: of :func:`sweep_poses`.
        path: of the new file; it replaces an old one only once it is complete.

    Raises:
        BadInput: the file cannot be written.
    """
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        data.to_netcdf(part, engine="h5netcdf")
        part.replace(path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else error
        raise BadInput(f"{path}: cannot be written: {reason}") from None


def assemblable(data: "xarray.Dataset", key: str = "margin_free") -> NDArray:
    """Bool over the grid: where the margin says it goes together rigidly."""
    return np.asarray(data[key] <= ASSEMBLABLE)
