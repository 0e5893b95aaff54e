"""Read the rows of a device table without a header."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput
from forcefit.validation.campaign.dialect import parse_number
from forcefit.validation.exchange.cell_values import CellValues, missing
from forcefit.validation.exchange.reading import Reading

# Largest number of columns before the coordinates, for example a counter or a time.
_COUNTERS = 3
# Largest relative scatter of the distances between targets in the correct columns.
_ALIKE = 0.1


def read_plain_rows(
    values: CellValues,
    rows: Sequence[tuple[int, list[str]]],
    targets: Mapping[str, NDArray],
) -> list[Reading]:
    """Read the rows of a table without a header.

    Args:
        values: reader of the cells' values.
        rows: line number and cells of each row.  A row contains a name and x, y, z.
            Alternatively, it contains x, y, z of one point, or of all targets in order.
            Additional cells are ignored.
        targets: mapping from the name of each target to its position (3,) [m], platform
            axes.

    Returns:
        The readings in the order of the file.

    Raises:
        BadInput: a row contains too few numbers, or a cell is not a number.
    """
    decimal = values.sheet.decimal
    if len(targets) > 1 and all(_nameless(cells, decimal) for _, cells in rows):
        first = _first_column([cells for _, cells in rows], decimal, targets)
        return [r for row in rows for r in _of_all(values, *row, first, targets)]
    counted = all(cells[0].isdigit() for _, cells in rows)
    return [_of_one(values, *row, counted) for row in rows]


def _nameless(cells: Sequence[str], decimal: str) -> bool:
    """Return whether a row begins with a number or with a missing reading."""
    return missing(cells[0]) or bool(np.isfinite(parse_number(cells[0], decimal)))


def _first_column(
    rows: Sequence[Sequence[str]], decimal: str, targets: Mapping[str, NDArray]
) -> int:
    """Return the column of the first coordinate in rows of numbers.

    A counter or a time may precede the coordinates.  In the correct columns, distances
    between targets agree with the declared distances.

    Args:
        rows: rows of cells.
        decimal: the decimal mark.
        targets: mapping from each target to its position (3,) [m], platform axes.

    Returns:
        Index of the column.
    """
    places = np.array(list(targets.values()))
    width = 3 * len(places)
    numbers = [[parse_number(c, decimal) for c in cells] for cells in rows]
    shortest = min(len(row) for row in numbers)
    declared = np.linalg.norm(places[1:] - places[:-1], axis=1)
    off = {}
    for first in range(min(_COUNTERS, shortest - width + 1)):
        table = np.array([row[first : first + width] for row in numbers])
        points = table.reshape(len(table), -1, 3)
        lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
        ratio = (lengths / np.where(declared > 0, declared, np.nan)).ravel()
        ratio = ratio[np.isfinite(ratio)]
        if ratio.any():
            off[first] = float(ratio.std() / ratio.mean())
    best = min(off, key=lambda first: off[first], default=0)
    return best if off and off[best] < _ALIKE * off.get(0, np.inf) else 0


def _of_one(values: CellValues, line: int, cells: list[str], counted: bool) -> Reading:
    """Parse a row of name, x, y, z.  If ``counted``, the name may be an integer."""
    names, cells = [], list(cells)
    decimal = values.sheet.decimal
    while cells and not np.isfinite(parse_number(cells[0], decimal)):
        if missing(cells[0]) and (cells[0] or all(map(missing, cells[:3]))):
            break
        names += cells.pop(0).split("::")
    if not names and len(cells) > 3 and counted:
        names.append(cells.pop(0))
    if len(cells) < 3:
        raise BadInput(
            f"{values.sheet.file}: line {line}: found {len(cells)} numbers after the "
            "name, expected x, y, z"
        )
    return _reading(values, line, cells[:3], tuple(name for name in names if name))


def _of_all(
    values: CellValues, line: int, cells: list[str], first: int,
    targets: Mapping[str, NDArray],
) -> list[Reading]:  # fmt: skip
    """Parse a row with x, y, z of each target in order."""
    found = len(cells) - first
    if found < 3 * len(targets):
        raise BadInput(
            f"{values.sheet.file}: line {line}: found {found} numbers and no name, "
            f"expected the name of a target, or x, y, z of all {len(targets)}"
        )
    return [
        _reading(values, line, cells[first + 3 * k : first + 3 * k + 3], (name,))
        for k, name in enumerate(targets)
    ]


def _reading(
    values: CellValues, line: int, xyz: list[str], names: tuple[str, ...]
) -> Reading:
    """Return the reading with x, y and z in three adjacent cells of a row."""
    position = nothing = np.full(3, np.nan)
    if not any(map(missing, xyz)):
        numbers = [values.number(line, a, c) for a, c in zip("xyz", xyz, strict=True)]
        position = values.unit("") * np.array(numbers)
    return Reading(values.sheet.file, line, names, position, nothing, np.nan)
