"""Convert device files to a campaign, as ``forcefit validation import`` does."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import check_new_folder, whole_folder, write_text
from forcefit.results.text import in_unit
from forcefit.validation.exchange.bag import is_bag, read_bag
from forcefit.validation.exchange.campaign_text import (
    cell,
    columns_of,
    declaration,
    labels_of,
    spreads,
)
from forcefit.validation.exchange.commands_table import Commands, read_commands
from forcefit.validation.exchange.device_frame import DeviceFrame
from forcefit.validation.exchange.device_table import read_device_table
from forcefit.validation.exchange.matching import Match, match
from forcefit.validation.exchange.placing import Placed, place
from forcefit.validation.exchange.reading import Reading
from forcefit.validation.exchange.targets_file import TargetsFile, read_targets

# Largest accepted fraction of omitted readings. If this fraction is exceeded, the input
# files are probably wrong.
_MOST_LEFT_OUT = 0.2


@dataclass(frozen=True, eq=False)
class Import:
    """A campaign created from device files.

    Attributes:
        robot: name of the robot.
        how: method of assigning readings to commands: ``"name"``, ``"time"`` or
            ``"order"``.
        header: columns of the table.
        cells: rows of the table.
        declaration: text of ``campaign.toml``.
        frame: pose of the device.
        scatter: [m] scatter of one component of the deviations from the declared robot.
        readings: number of readings used.
        left_out: descriptions of the readings that were not used, with the reasons.
        mounts: mapping from each target with measured orientation to the rotation
            vector (3,) [rad] from platform axes to target axes.
        remarks: descriptions of other inconsistencies.
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
    mounts: Mapping[str, NDArray]
    remarks: tuple[str, ...]

    def table(self) -> dict[str, Any]:
        """Return plain values for ``--json``."""
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
            "mounts": {name: turn.tolist() for name, turn in self.mounts.items()},
            "remarks": list(self.remarks),
        }

    def text(self) -> str:
        """Format a summary of a few lines."""
        lines = [
            f"{self.robot}: {self.readings} readings in {len(self.cells)} rows, joined "
            f"to commands by {self.how}",
            f"scatter about the declared robot: {in_unit(self.scatter, 'um')}",
        ]
        lines += [
            f"rotation of target {name} on the platform: "
            f"{np.round(turn, 7).tolist()} rad"
            for name, turn in self.mounts.items()
        ]
        lines += [f"left out: {line}" for line in self.left_out]
        return "\n".join(lines + [f"remark: {line}" for line in self.remarks])


def import_readings(
    files: Sequence[Path | str], targets: Path | str, commands: Path | str,
    folder: Path | str,
) -> Import:  # fmt: skip
    """Create a campaign from device files.

    Args:
        files: exports of the device, or ROS bags.
        targets: the targets file (:mod:`forcefit.validation.exchange.targets_file`).
        commands: the table of commands
            (:mod:`forcefit.validation.exchange.commands_table`).
        folder: folder to write.  It must be empty or not yet exist.

    Returns:
        The campaign that was written.

    Raises:
        BadInput: a file is invalid, too many readings would be omitted, or the readings
            fit much better in another unit, mirrored or with exchanged targets.  No
            file is written in these cases.
    """
    folder = Path(folder)
    check_new_folder(folder)
    declared = read_targets(targets)
    commands_read = read_commands(commands, declared.robot, declared.writing)
    readings = [reading for file in files for reading in _read(file, declared)]
    if not readings:
        raise BadInput(f"{files[0]}: found no readings, expected at least one")
    joined = match(readings, commands_read, declared.places, declared.window)
    imported = _campaign(declared, commands_read, joined, folder, len(readings))
    rows = [",".join(row) for row in (imported.header, *imported.cells)]
    with whole_folder(folder) as part:
        write_text("\n".join(rows) + "\n", part / "measurements.csv")
        write_text(imported.declaration, part / "campaign.toml")
    return imported


def _read(file: Path | str, declared: TargetsFile) -> list[Reading]:
    """Return the readings of a table or a bag."""
    if is_bag(file):
        return read_bag(file, declared.writing.oriented)
    return read_device_table(file, declared.writing, declared.places)


def _campaign(
    declared: TargetsFile, commands: Commands, joined: Match, folder: Path, total: int
) -> Import:
    """Return the campaign for readings that were assigned to commands."""
    names = list(declared.places)
    placed = place(declared, commands, joined.rows)
    left_out = _left_out(joined, placed, total)
    kept = np.flatnonzero(placed.read.any(axis=1))
    rows = [joined.rows[i] for i in kept]
    turns = placed.turns[kept]
    columns = columns_of(commands, rows, placed.gaps[kept], turns, placed.frame, names)
    values = zip(*columns.values(), strict=True)
    labels = labels_of(commands, rows)
    spread = spreads(rows, placed.frame, names)[placed.read[kept]]
    turned = bool(np.isfinite(turns).any())
    return Import(
        robot=declared.robot.name,
        how=joined.how,
        header=("id", *columns),
        cells=tuple(
            (a, *map(cell, row)) for a, row in zip(labels, values, strict=True)
        ),
        declaration=declaration(declared, folder, spread, turned),
        frame=placed.frame,
        scatter=placed.scatter,
        readings=int(placed.read.sum()),
        left_out=tuple(left_out),
        mounts=placed.mounts,
        remarks=(*placed.remarks, *_remarks(declared, joined, placed)),
    )


def _left_out(joined: Match, placed: Placed, total: int) -> list[str]:
    """Describe the omitted readings; raise BadInput if there are too many."""
    why = {"time": "no command is near it in time"}.get(
        joined.how, "its name contains no id of a command"
    )
    left_out = [f"{reading.place}: {why}" for reading in joined.unmatched]
    left_out += [f"{r.place}: this reading occurs twice" for r in joined.duplicates]
    left_out += placed.left_out
    total -= len(joined.strangers) + len(joined.missing)
    if len(left_out) > _MOST_LEFT_OUT * total:
        raise BadInput(
            f"{left_out[0]}; {len(left_out) - 1} more of {total} readings cannot be "
            f"used either, expected at most {_MOST_LEFT_OUT:.0%}; check targets, "
            "commands and units"
        )
    for readings, what in (
        (joined.missing, "without coordinates"), (joined.strangers, "of no target"),
    ):  # fmt: skip
        if readings:
            first = readings[0].place
            left_out.append(f"{len(readings)} readings {what}, the first: {first}")
    return left_out


def _remarks(declared: TargetsFile, joined: Match, placed: Placed) -> list[str]:
    """Return remarks about the readings of the campaign."""
    remarks = []
    if joined.copies:
        remarks.append(
            f"{len(joined.copies)} readings occur in two files with identical "
            f"digits, the first: {joined.copies[0].place}"
        )
    if declared.writing.oriented and not placed.mounts:
        remarks.append("noise_rotation is declared, but no orientation was found")
    return remarks
