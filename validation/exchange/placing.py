"""Transform readings to base axes and find implausible readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, quoted
from forcefit.results.text import in_unit
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.exchange.commands_table import Commands
from forcefit.validation.exchange.device_axes import check_axes, check_targets
from forcefit.validation.exchange.device_frame import (
    DeviceFrame,
    exchanged_here,
    exchanged_throughout,
    is_gross,
    robust_frame,
    scatter_of,
    spans_a_plane,
)
from forcefit.validation.exchange.orientation import turns_of
from forcefit.validation.exchange.reading import Reading
from forcefit.validation.exchange.targets_file import TargetsFile

# Scatter relative to the range of the commands above which readings and commands
# disagree.
_ASTRAY = 0.1
_HERE = DeviceFrame(np.eye(3), np.zeros(3))

# Rows of the campaign: the index of the command, and a mapping from target to reading.
Rows = Sequence[tuple[int, Mapping[str, Reading]]]


@dataclass(frozen=True, eq=False)
class Placed:
    """Deviations of the readings from the declared robot.

    Attributes:
        frame: pose of the device.
        scatter: [m] scatter of one component of all readings.
        read: (R, T) bool, whether the reading of a target is plausible.
        gaps: (R, T, 3) [m] deviation of each target, base axes; NaN if not measured.
        turns: (R, 3) [rad] rotation of the platform, base axes; NaN if not measured.
        mounts: mapping from each target with measured orientation to the rotation
            vector (3,) [rad] from platform axes to target axes.
        left_out: descriptions of implausible readings, which are omitted.
        remarks: descriptions of other inconsistencies.
    """

    frame: DeviceFrame
    scatter: float
    read: NDArray
    gaps: NDArray
    turns: NDArray
    mounts: Mapping[str, NDArray]
    left_out: list[str]
    remarks: list[str]


def place(declared: TargetsFile, commands: Commands, rows: Rows) -> Placed:
    """Estimate the device pose and transform the readings to base axes.

    Args:
        declared: content of the targets file.
        commands: the commands.
        rows: rows of the campaign, each with the index of its command and its readings.

    Returns:
        The deviations of the readings from the declared robot.

    Raises:
        BadInput: the readings do not determine the device pose, or fit much better in
            another unit, mirrored, or with exchanged targets.
    """
    names = list(declared.places)
    T = np.array([commands.postures[command].platform for command, _ in rows])
    places = np.array([declared.places[name] for name in names])
    nominal = T[:, None, :3, 3] + np.einsum("rij,tj->rti", T[:, :3, :3], places)
    measured = np.full(nominal.shape, np.nan)
    for i, (_, readings) in enumerate(rows):
        for k, name in enumerate(names):
            if name in readings:
                measured[i, k] = readings[name].position
    frame, scatter = _frame(declared, measured, nominal, names)
    remarks = check_targets(declared.file, declared.places, measured)
    remarks += _misfit(nominal, measured, scatter)
    base = frame.to_base(measured)
    read = np.asarray(np.isfinite(measured).all(axis=2))
    left_out = []
    for i, (command, readings) in enumerate(rows):
        for k, reason in _suspects(base[i], nominal[i], read[i], scatter, names):
            label, at = commands.ids[command], readings[names[k]].place
            left_out.append(f"{at}: command {quoted(label)}: {reason}")
            read[i, k] = False
    turns, mounts = np.full((len(rows), len(names), 3), np.nan), {}
    for k, name in enumerate(names):
        if any(r[name].rotation is not None for _, r in rows if name in r):
            turns[:, k], mounts[name] = _turns(
                declared, commands, rows, T[:, :3, :3], frame, name, left_out
            )
    turns[~read] = np.nan
    return Placed(
        frame=frame,
        scatter=scatter,
        read=read,
        gaps=np.where(read[..., None], base - nominal, np.nan),
        turns=_mean(turns),
        mounts=mounts,
        left_out=left_out,
        remarks=remarks,
    )


def _misfit(nominal: NDArray, measured: NDArray, scatter: float) -> list[str]:
    """If readings disagree with the commands, return a remark on the likely cause."""
    spread = np.linalg.norm(nominal - nominal.mean(axis=(0, 1)), axis=2)
    reach = float(np.sqrt(np.mean(spread**2)))
    if scatter < _ASTRAY * reach:
        return []
    reason = "check whether the readings are joined to the correct commands"
    # Distances between targets do not depend on the commands.
    apart = np.linalg.norm(measured - np.roll(measured, 1, axis=1), axis=2)
    known = apart[np.isfinite(apart).all(axis=1)]
    if len(known) and measured.shape[1] > 1 and np.ptp(known, axis=0).max() > scatter:
        reason = (
            "the distances between targets differ from row to row; check the columns "
            "and targets"
        )
    return [
        f"the scatter of the readings is {scatter:.3g} m, and the spread of the "
        f"commands is {reach:.3g} m: {reason}"
    ]


def _mean(turns: NDArray) -> NDArray:
    """Return the mean over the measured targets, (R, 3); NaN without such targets."""
    read = np.isfinite(turns).all(axis=2)
    total = np.where(read[..., None], turns, 0.0).sum(axis=1)
    count = read.sum(axis=1)[:, None]
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _turns(
    declared: TargetsFile, commands: Commands, rows: Rows, nominal: NDArray,
    frame: DeviceFrame, name: str, left_out: list[str],
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Return the rotations (R, 3) [rad] of the platform, and the target's mount."""
    seen = np.full((len(rows), 3, 3), np.nan)
    for i, (_, readings) in enumerate(rows):
        rotation = readings[name].rotation if name in readings else None
        if rotation is not None:
            seen[i] = rotation
    known = declared.rotations.get(name)
    mount = None if known is None else rotation_matrix(known)
    turns = turns_of(declared.file, seen, frame.rotation, nominal, mount)
    deviation = turns.deviation.copy()
    sizes = np.linalg.norm(deviation, axis=1)
    for i in np.flatnonzero(sizes > 0).tolist():
        if is_gross(float(sizes[i]), turns.scatter):
            label, at = commands.ids[rows[i][0]], rows[i][1][name].place
            reason = (
                f"found a deviation of {sizes[i]:.4g} rad, expected about "
                f"{turns.scatter:.2g} rad as for the other readings"
            )
            left_out.append(f"{at}: orientation at {quoted(label)}: {reason}")
            deviation[i] = np.nan
    return deviation, rotation_vector(turns.mount)


def _suspects(
    base: NDArray, nominal: NDArray, read: NDArray, scatter: float, names: list[str]
) -> list[tuple[int, str]]:
    """Return the implausible readings of one command, with reasons."""
    suspects = []
    ks = np.flatnonzero(read)
    order = exchanged_here(base[ks], nominal[ks], scatter)
    for place, k in enumerate(ks.tolist()):
        gap = float(np.linalg.norm(base[k] - nominal[k]))
        if order is not None and order[place] != place:
            other = quoted(names[ks[order[place]]])
            suspects.append((k, f"this is target {other}; targets were exchanged"))
        elif is_gross(gap, scatter):
            reason = (
                f"deviates by {in_unit(gap, 'mm')}, other readings by "
                f"{in_unit(scatter, 'mm', 2)}"
            )
            suspects.append((k, reason))
    return suspects


def _frame(
    declared: TargetsFile, measured: NDArray, nominal: NDArray, names: list[str]
) -> tuple[DeviceFrame, float]:
    """Return the device pose and the scatter about the declared robot."""
    read = np.isfinite(measured).all(axis=2)
    if declared.registration == "known":
        check_axes(declared.file, measured[read], nominal[read], known=True)
        gaps = np.linalg.norm(measured[read] - nominal[read], axis=1)
        return _HERE, scatter_of(gaps)
    if not spans_a_plane(nominal[read]):
        raise BadInput(
            f"{declared.file}: found only collinear points, which do not determine the "
            "pose of the device; expected points that are not collinear, or "
            'registration = "known"'
        )
    check_axes(declared.file, measured[read], nominal[read], known=False)
    order = exchanged_throughout(
        [measured[:, k] for k in range(len(names))],
        [nominal[:, k] for k in range(len(names))],
    )
    if order is not None:
        wrong = [k for k in range(len(names)) if order[k] != k]
        order_text = ", ".join(f"{names[k]} is {names[order[k]]}" for k in wrong)
        raise BadInput(
            f"{declared.file}: targets: found targets that are exchanged in "
            f"every row: {order_text}; correct their names"
        )
    return robust_frame(measured[read], nominal[read])
