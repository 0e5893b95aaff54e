"""Postures of a sweep: a grid or a list of poses or joint coordinates.

The axes of a grid are components. A list has the single axis ``posture``. Components
are either ``tx ty tz rx ry rz`` for the platform pose or ``q.<frame>`` for the
coordinates of actuated joints.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted, read_rows

# largest number of points
LARGEST_GRID = 10_000_000
_JOINT = "q."


@dataclass(frozen=True, eq=False)
class Targets:
    """Poses or joint coordinates, as a grid or as a list.

    Attributes:
        names: names of the components, such as ``tx`` or ``q.<frame>``.
        values: for each component, the values on its axis (grid) or at each posture
            (list) [m or rad].
        labels: labels of the postures of a list; None for a grid.
    """

    names: tuple[str, ...]
    values: tuple[NDArray, ...]
    labels: tuple[str, ...] | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of postures along each axis."""
        if self.labels is not None:
            return (len(self.labels),)
        return tuple(len(v) for v in self.values)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the axes."""
        return self.names if self.labels is None else ("posture",)

    def at(self, numbers: NDArray) -> NDArray:
        """Return the components of postures with given indices, (k, components)."""
        if self.labels is not None:
            return np.stack([v[numbers] for v in self.values], axis=1)
        places = np.unravel_index(numbers, self.shape)
        pairs = zip(self.values, places, strict=True)
        return np.stack([v[i] for v, i in pairs], axis=1)


def goals_of(names: Sequence[str], robot: Robot, rows: NDArray) -> NDArray:
    """Convert components of postures to poses or joint coordinates.

    Args:
        names: names of the components.
        robot: robot of n frames.
        rows: (k, components) values from :meth:`Targets.at`.

    Returns:
        Poses, (k, 6), with NaN for free components; or joint coordinates, (k, n), with
        NaN for passive joints.
    """
    if not of_joints(names):
        goals = np.full((len(rows), len(POSE)), np.nan)
        goals[:, [POSE.index(name) for name in names]] = rows
        return goals
    driven = [f.actuated for f in robot.frames]
    goals = np.tile(np.where(driven, robot.positions, np.nan), (len(rows), 1))
    goals[:, [robot.index(name.removeprefix(_JOINT)) for name in names]] = rows
    return goals


def of_joints(names: Sequence[str]) -> bool:
    """Return whether components are joint coordinates."""
    return any(name.startswith(_JOINT) for name in names)


def grid_targets(axes: Mapping[str, NDArray]) -> Targets:
    """Return the grid of all combinations of axis values."""
    return Targets(tuple(axes), tuple(np.asarray(v, float) for v in axes.values()))


def unit_of_target(name: str, robot: Robot) -> str:
    """Return the unit of a component, ``"m"`` or ``"rad"``."""
    if name.startswith(_JOINT):
        frame = robot.frame(name.removeprefix(_JOINT))
        return "m" if frame.joint == "prismatic" else "rad"
    return "m" if name.startswith("t") else "rad"


def parse_grid(text: str, robot: Robot | None = None) -> dict[str, NDArray]:
    """Return the axes of a grid such as ``"tx=-0.2:0.2:0.025,tz=-0.6:-0.3:0.025"``.

    Args:
        text: name and ``start:stop:step`` [m or rad] or a number for each component.
            The value ``stop`` is included if (stop - start)/step is an integer within
            1e-9.
        robot: robot whose actuated joints may be components; None if only poses are
            allowed.

    Returns:
        Values by component.

    Raises:
        BadInput: the text is invalid, or there are too many points.
    """
    axes: dict[str, NDArray] = {}
    for part in text.split(","):
        name, _, spec = (piece.strip() for piece in part.partition("="))
        _check_name("grid", "pose component", name, robot)
        if name in axes:
            raise BadInput(f'grid: "{name}" is given twice')
        axes[name] = parse_values(f"grid {name}", spec)
    _check_kind("grid", axes)
    if np.prod([float(len(v)) for v in axes.values()]) > LARGEST_GRID:
        raise BadInput(
            f"grid: more than {LARGEST_GRID} points, which are too many; is a step too "
            "small?"
        )
    return axes


def _check_name(whose: str, what: str, name: str, robot: Robot | None) -> None:
    """Raise an error unless a name is a component of a posture."""
    frames = robot.frames if robot is not None else ()
    valid = [*POSE, *(_JOINT + f.name for f in frames if f.actuated)]
    if name not in valid:
        hint = nearest(name, valid)
        raise BadInput(f'{whose}: unknown {what} "{name[:60]}"{hint}')


def _check_columns(
    whose: str, header: Sequence[str], extra: Sequence[str], robot: Robot
) -> None:
    """Raise an error if a table of postures has an unknown column."""
    joints = [_JOINT + f.name for f in robot.frames if f.actuated]
    valid = [*(f"pose.{name}" for name in POSE), *joints, *extra]
    for name in header:
        if name not in valid and name not in POSE:
            hint = nearest(name, valid)
            raise BadInput(f"{whose}: unknown column {quoted(name)}{hint}")


def _check_kind(whose: str, names: Mapping | Sequence[str]) -> None:
    """Raise an error if there are both pose components and joint coordinates."""
    joints = [name for name in names if name.startswith(_JOINT)]
    if joints and len(joints) < len(names):
        other = next(name for name in names if not name.startswith(_JOINT))
        raise BadInput(
            f'{whose}: found "{other}" and "{joints[0]}"; expected a pose or joints'
        )


def parse_values(whose: str, spec: str) -> NDArray:
    """Return the values of ``start:stop:step`` or of a number.

    Args:
        whose: option or file, for error messages.
        spec: the text.

    Returns:
        The values, including ``stop`` if (stop - start)/step is an integer within 1e-9.

    Raises:
        BadInput: the text is invalid, or there are too many points.
    """
    expected = "expected START:STOP:STEP or one number"
    try:
        numbers = [float(piece) for piece in spec.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) not in {1, 3} or not np.isfinite(numbers).all():
        raise BadInput(f'{whose}: found "{spec[:60]}", {expected}')
    if len(numbers) == 1:
        return np.array(numbers)
    start, stop, step = numbers
    if step == 0 or (stop - start) / step < 0:
        raise BadInput(
            f"{whose}: found a step of {step:g} that does not lead from "
            f"{start:g} to {stop:g}; expected a nonzero step of the right sign"
        )
    count = (stop - start) / step
    if count > LARGEST_GRID:
        raise BadInput(
            f"{whose}: {count:.3g} points, which are too many; is the step too small?"
        )
    return start + step * np.arange(int(np.floor(count + 1e-9)) + 1)


def read_targets(path: Path | str, robot: Robot, extra: Sequence[str] = ()) -> Targets:
    """Read postures from a CSV file with columns such as ``pose.tx`` or ``q.<frame>``.

    Args:
        path: path of the file, with a header and one row per posture.
        robot: robot. Actuated joints without a column have the coordinate ``position``.
        extra: names of additional numeric columns.

    Returns:
        The postures in the order of the file.

    Raises:
        BadInput: the file is invalid.
    """
    path = Path(path)
    rows = [row for row in enumerate(read_rows(path), 1) if any(map(str.strip, row[1]))]
    if len(rows) < 2:
        content = "only a header" if rows else "nothing"
        raise BadInput(
            f"{path}: found {content}; expected a header and a row for each posture"
        )
    header = [cell.strip() for cell in rows[0][1]]
    names = [cell.removeprefix("pose.") for cell in header if cell != "id"]
    _check_columns(f"{path}: line 1", header, ("id", *extra), robot)
    for name in names:
        if names.count(name) > 1 or header.count("id") > 1:
            raise BadInput(f"{path}: line 1: a column is given twice: {quoted(name)}")
    components = [name for name in names if name not in extra]
    if not components:
        raise BadInput(f"{path}: line 1: found no posture; expected pose.tx, .. or q.*")
    _check_kind(f"{path}: line 1", components)
    values, labels = np.empty((len(rows) - 1, len(names))), []
    for i, (line, cells) in enumerate(rows[1:]):
        if len(cells) != len(header):
            raise BadInput(
                f"{path}: line {line}: found {len(cells)} cells, expected "
                f"{len(header)} as in the header"
            )
        given = dict(zip(header, cells, strict=True))
        labels.append(given.pop("id", str(i + 1)).strip())
        for k, (column, cell) in enumerate(given.items()):
            values[i, k] = _cell(f"{path}: line {line}, {column}", cell)
    _check_labels(path, labels)
    return Targets(tuple(names), tuple(values.T.copy()), tuple(labels))


def _cell(whose: str, text: str) -> float:
    """Return the number in a cell of a table."""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise BadInput(f"{whose}: found {quoted(text)}, expected a finite number")
    return value


def _check_labels(path: Path, labels: Sequence[str]) -> None:
    """Raise an error if two rows have the same id."""
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise BadInput(f"{path}: id: found {quoted(twice)} twice; expected unique ids")
