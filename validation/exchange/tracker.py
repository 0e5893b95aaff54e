"""``forcefit validation import``: a tracker's files and the commands, as a campaign."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.writing import check_new_folder, whole_folder, write_text
from validation.exchange.bag import is_bag, read_bag
from validation.exchange.commands_table import Commands, read_commands
from validation.exchange.device_frame import (
    DeviceFrame,
    exchanged_here,
    exchanged_throughout,
    is_gross,
    robust_frame,
    spans_a_plane,
)
from validation.exchange.device_table import Reading, read_device_table
from validation.exchange.matching import Match, match
from validation.exchange.targets_file import TargetsFile, read_targets

_MOST_LEFT_OUT = 0.2  # of all readings; more means that something else is wrong
_HERE = DeviceFrame(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Import:
    """A campaign made of a device's files.

    Attributes:
        robot: its name.
        how: what joined readings to commands: ``"name"``, ``"time"``, ``"order"``.
        header: columns of the table.
        cells: its rows.
        declaration: text of ``campaign.toml``.
        frame: where the device stood.
        scatter: [m] of one component about the declared robot.
        readings: taken over.
        left_out: readings that were not, with the reason, in words.
    """

    robot: str
    how: str
    header: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    declaration: str
    frame: DeviceFrame
    scatter: float
    readings: int
    left_out: tuple[str, ...]

    def table(self) -> dict[str, Any]:
        """Plain values for ``--json``."""
        return {
            "robot": self.robot,
            "joined_by": self.how,
            "rows": len(self.cells),
            "readings": self.readings,
            "device": {
                "rotation": self.frame.rotation.tolist(),
                "shift": self.frame.shift.tolist(),
            },
            "scatter": self.scatter,
            "left_out": list(self.left_out),
        }

    def text(self) -> str:
        """A few lines for people."""
        lines = [
            f"{self.robot}: {self.readings} readings in {len(self.cells)} rows, joined "
            f"to commands by {self.how}",
            f"scatter about the declared robot {1e6 * self.scatter:.4g} um",
        ]
        return "\n".join(lines + [f"left out: {line}" for line in self.left_out])


def import_readings(
    files: Sequence[Path | str], targets: Path | str, commands: Path | str,
    folder: Path | str,
) -> Import:  # fmt: skip
    """Make a campaign of a device's files.

    Args:
        files: exports of the device, or ROS bags of what it read.
        targets: what was measured on (:mod:`validation.exchange.targets_file`).
        commands: what was commanded (:mod:`validation.exchange.commands_table`).
        folder: to be written; it must be absent or empty.

    Returns:
        What was written.

    Raises:
        BadInput: a file breaks a rule, targets are exchanged throughout, or too many
            readings would be left out; nothing is written then.
    """
    folder = Path(folder)
    check_new_folder(folder)
    declared = read_targets(targets)
    commands_read = read_commands(commands, declared.robot, declared.writing)
    readings: list[Reading] = []
    for file in files:
        writing = declared.writing
        readings += read_bag(file) if is_bag(file) else read_device_table(file, writing)
    if not readings:
        raise BadInput(f"{files[0]}: found no readings, expected at least one")
    joined = match(readings, commands_read, declared.places, declared.window)
    imported = _campaign(declared, commands_read, joined, folder, len(readings))
    rows = [",".join(row) for row in (imported.header, *imported.cells)]
    with whole_folder(folder) as part:
        write_text("\n".join(rows) + "\n", part / "measurements.csv")
        write_text(imported.declaration, part / "campaign.toml")
    return imported


def _nominal(declared: TargetsFile, commands: Commands, command: int, target: str
             ) -> NDArray:  # fmt: skip
    """(3,) [m] where a target should stand, base axes."""
    T = commands.postures[command].platform
    return np.asarray(T[:3, :3] @ declared.places[target] + T[:3, 3])


def _campaign(
    declared: TargetsFile, commands: Commands, joined: Match, folder: Path, total: int
) -> Import:
    """Frame, suspects, and the campaign's two texts."""
    names = list(declared.places)
    measured = np.full((len(joined.rows), len(names), 3), np.nan)
    nominal = np.empty(measured.shape)
    for i, (command, readings) in enumerate(joined.rows):
        for k, name in enumerate(names):
            nominal[i, k] = _nominal(declared, commands, command, name)
            if name in readings:
                measured[i, k] = readings[name].position
    read = np.isfinite(measured).all(axis=2)
    frame, scatter = _frame(declared, measured, nominal, names)
    base = frame.to_base(measured)
    why = {"time": "no command near it in time"}.get(
        joined.how, "no command's id in its name"
    )
    left_out = [f"{reading.place}: {why}" for reading in joined.unmatched]
    for i, (command, readings) in enumerate(joined.rows):
        for k, reason in _suspects(base[i], nominal[i], read[i], scatter, names):
            label, place = commands.ids[command], readings[names[k]].place
            left_out.append(f"{place}: command {quoted(label)}: {reason}")
            read[i, k] = False
    total -= len(joined.strangers)
    if len(left_out) > _MOST_LEFT_OUT * total:
        raise BadInput(
            f"{left_out[0]}; and {len(left_out) - 1} more of {total} readings, "
            f"expected at most {_MOST_LEFT_OUT:.0%}; are targets, commands, units "
            "right?"
        )
    if joined.strangers:
        first, count = joined.strangers[0].place, len(joined.strangers)
        left_out.append(f"{count} readings of no target, the first: {first}")
    kept = np.flatnonzero(read.any(axis=1))
    rows = [joined.rows[i] for i in kept]
    gaps = np.where(read[..., None], base - nominal, np.nan)[kept]
    spread = [[_sigma(r.get(n), frame) for n in names] for _, r in rows]
    columns = _columns(commands, rows, gaps, np.array(spread), names, declared)
    header = ("id", *columns)
    values = zip(*columns.values(), strict=True)
    labels = _labels(commands, rows)
    cells = tuple((a, *map(_cell, row)) for a, row in zip(labels, values, strict=True))
    text = _declaration(declared, folder, np.array(spread)[read[kept]])
    return Import(
        robot=declared.robot.name,
        how=joined.how,
        header=header,
        cells=cells,
        declaration=text,
        frame=frame,
        scatter=scatter,
        readings=int(read.sum()),
        left_out=tuple(left_out),
    )


def _suspects(
    base: NDArray, nominal: NDArray, read: NDArray, scatter: float, names: list[str]
) -> list[tuple[int, str]]:
    """Targets of one command, read where they cannot stand, and why."""
    suspects = []
    ks = np.flatnonzero(read)
    order = exchanged_here(base[ks], nominal[ks], scatter)
    for place, k in enumerate(ks.tolist()):
        gap = float(np.linalg.norm(base[k] - nominal[k]))
        if order is not None and order[place] != place:
            other = quoted(names[ks[order[place]]])
            suspects.append((k, f"it is {other}, exchanged"))
        elif is_gross(gap, scatter):
            reason = f"{1e3 * gap:.4g} mm off, the others {1e3 * scatter:.2g}"
            suspects.append((k, reason))
    return suspects


def _frame(
    declared: TargetsFile, measured: NDArray, nominal: NDArray, names: list[str]
) -> tuple[DeviceFrame, float]:
    """Where the device stood, and the scatter about the declared robot."""
    read = np.isfinite(measured).all(axis=2)
    if declared.registration == "known":
        gaps = np.linalg.norm(measured[read] - nominal[read], axis=1)
        return _HERE, float(np.median(gaps)) / 1.538 + 1e-12
    if not spans_a_plane(nominal[read]):
        raise BadInput(
            f"{declared.file}: all readings are of points on one line, which cannot "
            'say where the device stood; expected more, or registration = "known"'
        )
    order = exchanged_throughout(
        [measured[:, k] for k in range(len(names))],
        [nominal[:, k] for k in range(len(names))],
    )
    if order is not None:
        wrong = [k for k in range(len(names)) if order[k] != k]
        order_text = ", ".join(f"{names[k]} is {names[order[k]]}" for k in wrong)
        raise BadInput(
            f"{declared.file}: targets: they fit far better exchanged, in every row: "
            f"{order_text}"
        )
    return robust_frame(measured[read], nominal[read])


def _sigma(reading: Reading | None, frame: DeviceFrame) -> NDArray:
    """(3,) [m] one standard deviation of a reading along the base's axes."""
    if reading is None:
        return np.full(3, np.nan)
    return np.asarray(np.sqrt(frame.rotation**2 @ reading.sigma**2))


def _columns(
    commands: Commands, rows: list[tuple[int, dict[str, Reading]]], gaps: NDArray,
    sigma: NDArray, names: list[str], declared: TargetsFile,
) -> dict[str, NDArray]:  # fmt: skip
    """Columns of the campaign's table, SI."""
    at = [command for command, _ in rows]
    columns = {name: values[at] for name, values in commands.columns.items()}
    times = np.array([
        np.nanmin([r.time for r in readings.values()] + [np.inf])
        for _, readings in rows
    ])
    if np.isfinite(times).all() and "cov.time" not in columns:
        columns["cov.time"] = times - times.min()
    for k, name in enumerate(names):
        point = f".{name}" if len(names) > 1 else ""
        for i, axis in enumerate("xyz"):
            columns[f"meas{point}.t{axis}"] = gaps[:, k, i]
        if np.isfinite(sigma[:, k]).any():
            for i, axis in enumerate("xyz"):
                columns[f"sigma{point}.t{axis}"] = sigma[:, k, i]
    return columns


def _labels(
    commands: Commands, rows: list[tuple[int, dict[str, Reading]]]
) -> list[str]:
    """Ids of the rows: the command's, numbered where it is there again."""
    seen: dict[int, int] = {}
    labels = []
    for command, _ in rows:
        seen[command] = seen.get(command, 0) + 1
        again = f".{seen[command]}" if seen[command] > 1 else ""
        labels.append(commands.ids[command] + again)
    return labels


def _cell(value: float) -> str:
    """A number with all its digits, nothing where there is none."""
    return repr(float(value)) if np.isfinite(value) else ""


def _declaration(declared: TargetsFile, folder: Path, spread: NDArray) -> str:
    """Text of ``campaign.toml``."""
    name = declared.robot_name
    path = declared.file.parent / name
    if path.is_file():
        name = os.path.relpath(path.resolve(), folder.resolve())
    places: Mapping[str, list[float]] = {
        k: [float(x) for x in v] for k, v in declared.places.items()
    }
    lines = [f'robot = "{name}"', 'measurements = "measurements.csv"',
             f'registration = "{declared.registration}"']  # fmt: skip
    if len(places) == 1:
        lines.append(f"reference_point = {next(iter(places.values()))}")
    if not np.isfinite(spread).all() and declared.noise is None:
        raise BadInput(
            f"{declared.file}: noise: missing; expected one standard deviation [m]: "
            "not every reading states its own"
        )
    if declared.noise is not None:
        lines += ["[noise]", f"position = {declared.noise!r}"]
    if len(places) > 1:
        lines += ["[points]", *(f'"{k}" = {v}' for k, v in places.items())]
    return "\n".join(lines) + "\n"
