"""Write the table and the ``campaign.toml`` of an imported campaign."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import path_from
from forcefit.validation.exchange.commands_table import Commands
from forcefit.validation.exchange.device_frame import DeviceFrame
from forcefit.validation.exchange.reading import Reading
from forcefit.validation.exchange.targets_file import TargetsFile

# Rows of the campaign, each with the index of its command and a mapping from target to
# reading.
Rows = Sequence[tuple[int, Mapping[str, Reading]]]


def columns_of(
    commands: Commands, rows: Rows, gaps: NDArray, turns: NDArray, frame: DeviceFrame,
    names: Sequence[str],
) -> dict[str, NDArray]:  # fmt: skip
    """Return the columns of the campaign table in SI units.

    Args:
        commands: the commands.
        rows: rows of the campaign, each with the index of its command and a mapping
            from target to reading.
        gaps: (R, T, 3) [m] deviation of each target; NaN if the target was not
            measured.
        turns: (R, 3) [rad] rotation of the platform; NaN if the rotation was not
            measured.
        frame: pose of the device.
        names: names of the targets.

    Returns:
        Mapping from the name of each column to its values.
    """
    at = [command for command, _ in rows]
    columns = {name: values[at] for name, values in commands.columns.items()}
    read = np.array([
        min((r.time for r in readings.values()), default=np.nan) for _, readings in rows
    ])
    for times in (read, commands.times[at]):
        if np.isfinite(times).all() and "cov.time" not in columns:
            columns["cov.time"] = times - times.min()
    sigma = spreads(rows, frame, names)
    for k, name in enumerate(names):
        point = f".{name}" if len(names) > 1 else ""
        for i, axis in enumerate("xyz"):
            columns[f"meas{point}.t{axis}"] = gaps[:, k, i]
        if np.isfinite(sigma[:, k]).any():
            for i, axis in enumerate("xyz"):
                columns[f"sigma{point}.t{axis}"] = sigma[:, k, i]
    if np.isfinite(turns).any():
        for i, axis in enumerate("xyz"):
            columns[f"meas.r{axis}"] = turns[:, i]
    return columns


def spreads(rows: Rows, frame: DeviceFrame, names: Sequence[str]) -> NDArray:
    """Return the standard deviations of readings along the axes of the base.

    Args:
        rows: rows of the campaign.
        frame: pose of the device.
        names: names of the targets.

    Returns:
        Standard deviations, (R, T, 3) [m]; NaN if the device file contains none.
    """
    sigma = np.full((len(rows), len(names), 3), np.nan)
    for i, (_, readings) in enumerate(rows):
        for k, name in enumerate(names):
            if name in readings:
                sigma[i, k] = np.sqrt(frame.rotation**2 @ readings[name].sigma ** 2)
    return sigma


def labels_of(commands: Commands, rows: Rows) -> list[str]:
    """Return a unique label for each row.

    Args:
        commands: the commands.
        rows: rows of the campaign.

    Returns:
        The id of the command of each row. If a command is repeated, a number is added.
    """
    seen: dict[int, int] = {}
    labels = []
    for command, _ in rows:
        seen[command] = seen.get(command, 0) + 1
        again = f".{seen[command]}" if seen[command] > 1 else ""
        labels.append(commands.ids[command] + again)
    return labels


def cell(value: float) -> str:
    """Format a number with all its digits; NaN becomes an empty string."""
    return repr(float(value)) if np.isfinite(value) else ""


def declaration(
    declared: TargetsFile, folder: Path, spread: NDArray, turned: bool
) -> str:
    """Return the text of ``campaign.toml`` for an imported campaign.

    Args:
        declared: content of the targets file.
        folder: folder of the campaign.
        spread: (..., 3) [m] standard deviations in the device files; NaN if absent.
        turned: whether orientations were measured.

    Returns:
        The text of the file.

    Raises:
        BadInput: neither the device file nor the targets file contains the standard
            deviation of a reading.
    """
    name = declared.robot_name
    path = declared.file.parent / name
    if path.is_file():
        name = path_from(folder.resolve(), path.resolve())
    places: Mapping[str, list[float]] = {
        k: [float(x) for x in v] for k, v in declared.places.items()
    }
    lines = [f'robot = "{name}"', 'measurements = "measurements.csv"',
             f'registration = "{declared.registration}"']  # fmt: skip
    if len(places) == 1:
        lines.append(f"reference_point = {next(iter(places.values()))}")
    if not np.isfinite(spread).all() and declared.noise is None:
        raise BadInput(
            f"{declared.file}: missing key noise; expected a standard deviation [m], "
            "because some readings have none"
        )
    if declared.noise is not None:
        lines += ["[noise]", f"position = {declared.noise!r}"]
    if turned:
        lines += ["[noise]"] if declared.noise is None else []
        lines += [f"rotation = {declared.noise_rotation!r}"]
    if len(places) > 1:
        lines += ["[points]", *(f'"{k}" = {v}' for k, v in places.items())]
    return "\n".join(lines) + "\n"
