"""Files of paths: poses or joint coordinates, with or without times."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.assembly.sweeps.targets import read_targets
from forcefit.inputs.errors import LARGEST
from forcefit.inputs.table import BadInput, quoted


@dataclass(frozen=True, eq=False)
class PathTable:
    """Poses or joint coordinates of a path.

    Attributes:
        names: components, either ``tx`` .. or ``q.<frame>``.
        values: (rows, components) [m or rad] values.
        times: (rows,) [s] increasing times, or None.
        labels: names of the rows, for messages.
    """

    names: tuple[str, ...]
    values: NDArray
    times: NDArray | None = None
    labels: tuple[str, ...] = ()

    def row_name(self, row: int) -> str:
        """Return the name of a row for messages."""
        return f"row {quoted(self.labels[row])}" if self.labels else f"row {row + 1}"


def read_path(file: Path | str, robot: Robot) -> PathTable:
    """Read a path from a CSV file.

    Args:
        file: CSV file with a row for each pose and the columns ``pose.tx`` .. [m, rad]
            or ``q.<frame>``, and optionally ``time`` [s] and ``id``.
        robot: robot that moves along the path.

    Returns:
        The path.

    Raises:
        BadInput: the file is invalid, has fewer than two rows, or its times do not
            increase.
    """
    targets = read_targets(file, robot, extra=("time",))
    names = tuple(name for name in targets.names if name != "time")
    columns = dict(zip(targets.names, targets.values, strict=True))
    table = PathTable(
        names, np.stack([columns[name] for name in names], axis=1),
        columns.get("time"), tuple(targets.labels or ()),
    )  # fmt: skip
    check_path(table, str(file))
    return table


def check_path(table: PathTable, where: str = "path") -> None:
    """Raise BadInput for a path without two poses or with times that do not increase.

    Args:
        table: the path.
        where: file of the path, for messages.

    Raises:
        BadInput: the path has fewer than two rows, or its times do not increase.
    """
    if len(table.values) < 2:
        raise BadInput(f"{where}: found one row, expected at least two poses")
    if table.times is None:
        return
    steps = np.diff(table.times)
    if not (steps > 0).all():
        row = int(np.argmin(steps > 0)) + 1
        raise BadInput(
            f"{where}: {table.row_name(row)}, time: found {table.times[row]:g} s after "
            f"{table.times[row - 1]:g} s; expected times that increase"
        )
    small = steps.min() < 1 / LARGEST
    if small or np.abs(table.times).max() > LARGEST:
        row = 1 + int(np.argmin(steps) if small else np.argmax(abs(table.times[1:])))
        raise BadInput(
            f"{where}: {table.row_name(row)}, time: found {table.times[row]:g} s after "
            f"{table.times[row - 1]:g} s; expected steps of at least {1 / LARGEST:g} s "
            f"and times of at most {LARGEST:g} s"
        )
