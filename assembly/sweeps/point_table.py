"""Conversion of data sets to tables with one row per point or draw.

In contrast, ``xarray.Dataset.to_dataframe`` returns one row for each combination of all
axes, including components.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from forcefit.assembly.model.tables import component_unit, frame_table
from forcefit.assembly.sweeps.dataset import open_dataset
from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.inputs.writing import TABLE, check_writable, whole_file

if TYPE_CHECKING:
    import pandas
    import xarray

# variables whose axes are the axes of the table rows: ``status`` for sweeps and draws,
# ``tolerance`` for tolerances
_OF_POINTS = ("status", "tolerance")


def point_table(
    data: "xarray.Dataset | Path | str", rows: Sequence[str] = ()
) -> "pandas.DataFrame":
    """Convert a data set to a table with one row per point, draw or tolerance.

    Args:
        data: data set of a sweep, of random draws or of tolerances; or the path of a
            NetCDF file.
        rows: axes of the table rows, for example ``["quantity", "group"]`` for the
            importance of errors; by default the axes of points, draws or tolerance
            classes.

    Returns:
        Table with columns (variable, component), such as ``table["platform_screw",
        "TX"]``. The component is empty for scalars. The index contains the axes, and
        ``attrs["units"]`` contains the units of variables and axes.

    Raises:
        BadInput: the file cannot be read, an axis is unknown, or ``rows`` is missing
            for another kind of data set.
    """
    whose = "table"
    if isinstance(data, str | Path):
        whose, data = str(data), open_dataset(data)
    axes = [str(name) for name in data.dims]
    for name in rows:
        if name not in axes:
            raise BadInput(f"{whose}: no axis {quoted(name)}{nearest(name, axes)}")
    first = next((name for name in _OF_POINTS if name in data), None)
    if not rows and first is not None:
        rows = [str(name) for name in data[first].dims]
    if not rows and first is None:
        raise BadInput(
            f"{whose}: found axes {', '.join(axes) or 'none'} and no status; expected "
            "a data set of a sweep, of draws or of tolerances, or the axes of its rows"
        )
    return frame_table(data, *rows)


def write_point_table(
    data: "xarray.Dataset | Path | str", path: Path | str, rows: Sequence[str] = ()
) -> None:
    """Write the table of :func:`point_table` as a CSV file.

    The columns are ``id`` (row index from 0), the axes, and ``variable.component
    [unit]``. NaN values are written as empty cells.

    Args:
        data: see :func:`point_table`.
        path: path of the file.
        rows: see :func:`point_table`.

    Raises:
        BadInput: as for :func:`point_table`, or the file cannot be written.
    """
    check_writable(path, TABLE)
    table = point_table(data, rows)
    units = table.attrs["units"]
    heads = [
        _head(f"{name}.{one}" if one else name, component_unit(units[name], one))
        for name, one in table.columns
    ]
    axes = [_head(str(name), units[name]) for name in table.index.names]
    table = table.set_axis(heads, axis=1).rename_axis(axes).reset_index()
    table.index.name = "id"
    with whole_file(path) as part:
        table.to_csv(part, encoding="utf-8", errors="backslashreplace",
                     lineterminator="\n")  # fmt: skip


def _head(name: str, unit: str) -> str:
    """Return the header of a column."""
    return f"{name} [{unit}]" if unit else name
