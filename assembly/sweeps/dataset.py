"""Results of a sweep as an xarray data set, in memory or in a NetCDF file.

To limit memory use, a file is written block by block from the journal. Files of equal
sweeps are byte-identical.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.statuses import OF_POINTS
from forcefit.assembly.sweeps.netcdf import (
    check_heaps,
    forgive_damaged_files,
    netcdf_file,
)
from forcefit.assembly.sweeps.quantities import TEXTS, variables
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import NETCDF, check_writable
from forcefit.results.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray

    from forcefit.assembly.sweeps.plan import Sweep

Texts = dict[str, dict[int, str]]
# kinds of NetCDF files, and for each kind an attribute that identifies it
KINDS = {
    "a sweep": "near", "draws": "sources_and_posture_sha256", "tolerances": "cost_law",
    "a path": "path_law",
}  # fmt: skip
_TEXT = {name: QUANTITIES[name].meaning for name in ("status", *TEXTS)}
_TEXT["status"] += ": " + ", ".join(OF_POINTS[1:])
# variable names of older releases, and current names
_OLD_NAMES = {
    "rotation_error_play": "rotation_error_clearance",
    "translation_error_play": "translation_error_clearance",
    "play_mixed": "clearance_mixed",
}
_OLD_ATTRIBUTES = {"play": "clearance", "reading": "assumption"}
# number of blocks that are written together, because each write takes some time
_TOGETHER = 256


def sweep_dataset(sweep: "Sweep", records: NDArray, texts: Texts) -> "xarray.Dataset":
    """Return the data set of a sweep in memory.

    Args:
        sweep: sweep to which the results belong.
        records: (points,) records of all points.
        texts: for each text variable, its nonempty texts by point index.

    Returns:
        The data set. The unit of each variable is its attribute ``units``.
    """
    import xarray

    data: dict[str, Any] = {}
    for name, one in variables(sweep.question).items():
        values = records[name].reshape(*sweep.shape, *records[name].shape[1:])
        data[name] = ((*sweep.dims, *one.dims), values.copy(), one.attributes)
    for name in _TEXT:
        column = _text_column(name, records, texts).reshape(sweep.shape)
        data[name] = (sweep.dims, column, {"long_name": _TEXT[name]})
    coordinates = {
        name: (dims, list(values) if values.dtype == object else values, attributes)
        for name, (dims, values, attributes) in _coordinates(sweep).items()
    }
    return xarray.Dataset(data, coordinates, sweep.provenance)


def write_sweep(
    sweep: "Sweep", read: Callable[[int], tuple[NDArray, Texts]], path: Path
) -> None:
    """Write the data set of a sweep as a NetCDF file.

    Args:
        sweep: sweep to which the results belong.
        read: function that returns the records and texts of a block.
        path: path of the file. An existing file is replaced after the complete file
            has been written.

    Raises:
        BadInput: the file cannot be written.
    """
    with netcdf_file(path) as file:
        _write(sweep, read, file)


def _write(
    sweep: "Sweep", read: Callable[[int], tuple[NDArray, Texts]], file: Any
) -> None:
    """Write coordinates and variables to an open NetCDF file."""
    import h5py

    text = h5py.string_dtype()
    coordinates, asked = _coordinates(sweep), variables(sweep.question)
    sizes = dict(zip(sweep.dims, sweep.shape, strict=True))
    for one in asked.values():
        sizes |= {dim: len(labels) for dim, labels in one.dims.items()}
    file.dimensions = sizes
    for name, (dims, values, attributes) in coordinates.items():
        kind = text if values.dtype == object else values.dtype
        variable = file.create_variable(name, dims, kind, data=values)
        variable.attrs.update(attributes)
    for name, one in asked.items():
        dims = (*sweep.dims, *one.dims)
        file.create_variable(name, dims, "<f8").attrs.update(one.attributes)
    for name, meaning in _TEXT.items():
        variable = file.create_variable(name, sweep.dims, text)
        variable.attrs["long_name"] = meaning
    file.attrs.update(sweep.provenance)
    beside = [name for name in coordinates if name not in sizes]
    if beside:
        file.attrs["coordinates"] = " ".join(beside)
    for first in range(0, sweep.blocks, _TOGETHER):
        last = min(first + _TOGETHER, sweep.blocks)
        start = first * sweep.block_size
        records, texts = _joined([read(block) for block in range(first, last)])
        for name in (*asked, *_TEXT):
            values = (
                _text_column(name, records, texts) if name in _TEXT
                else records[name]
            )  # fmt: skip
            _put(file[name], sweep.shape, start, values)


def _put(variable: Any, shape: tuple[int, ...], first: int, values: NDArray) -> None:
    """Write values of consecutive points to a variable."""
    done = 0
    for slab in slabs(shape, first, first + len(values)):
        size = [s.stop - s.start for s in slab]
        count = int(np.prod(size))
        some = values[done : done + count]
        variable[slab] = some.reshape(*size, *values.shape[1:])
        done += count


def slabs(shape: tuple[int, ...], first: int, last: int) -> Iterator[tuple[slice, ...]]:
    """Yield index ranges that cover the points ``first`` to ``last - 1`` of an array.

    Args:
        shape: shape of the array.
        first: index of the first point in C order.
        last: index after the last point.

    Yields:
        One slice per axis, in the order of the points.
    """
    if len(shape) == 1:
        yield (slice(first, last),)
        return
    inner = int(np.prod(shape[1:]))
    row, column = divmod(first, inner)
    while first < last:
        whole = (last - first) // inner if column == 0 else 0
        if whole:
            yield (slice(row, row + whole), *(slice(0, n) for n in shape[1:]))
            row, first = row + whole, first + whole * inner
            continue
        stop = min(inner, column + last - first)
        for slab in slabs(shape[1:], column, stop):
            yield (slice(row, row + 1), *slab)
        first += stop - column
        row, column = row + 1, 0


def _joined(blocks: list[tuple[NDArray, Texts]]) -> tuple[NDArray, Texts]:
    """Concatenate the results of several blocks."""
    texts: Texts = {name: {} for name in TEXTS}
    start = 0
    for records, texts_of_block in blocks:
        for name in TEXTS:
            texts[name] |= {
                start + row: text for row, text in texts_of_block[name].items()
            }
        start += len(records)
    return np.concatenate([records for records, _ in blocks]), texts


def _text_column(name: str, records: NDArray, texts: Texts) -> NDArray:
    """Return the values of a text variable, (k,), as an object array."""
    if name == "status":
        return np.array(OF_POINTS, dtype=object)[records["status"]]
    column = np.full(len(records), "", dtype=object)
    for row, text in texts[name].items():
        column[row] = text
    return column


def _coordinates(sweep: "Sweep") -> dict[str, tuple[tuple[str, ...], NDArray, dict]]:
    """Return axes, values and attributes of all coordinates by name."""
    table: dict[str, tuple[tuple[str, ...], NDArray, dict]] = {}
    units = sweep.units
    for path, values in zip(sweep.question.varied, sweep.values, strict=True):
        table[path] = (path,), values, {"units": units[path]}
    targets = sweep.targets
    if targets.labels is not None:
        labels = np.array(targets.labels, dtype=object)
        table["posture"] = ("posture",), labels, {}
    for name, values in zip(targets.names, targets.values, strict=True):
        dims = (name,) if targets.labels is None else ("posture",)
        table[name] = dims, values, {"units": units[name]}
    if sweep.draws:
        table["draw"] = ("draw",), np.arange(sweep.draws), {}
    for one in variables(sweep.question).values():
        for dim, names in one.dims.items():
            table[dim] = (dim,), np.array(names, dtype=object), {}
    return table


def save_dataset(data: "xarray.Dataset", path: Path | str) -> None:
    """Write a data set as a NetCDF file.

    Args:
        data: data set to write.
        path: path of the file. An existing file is replaced after the complete file
            has been written.

    Raises:
        BadInput: the file cannot be written.
    """
    from xarray.backends import H5NetCDFStore

    with netcdf_file(path) as file:
        data.dump_to_store(H5NetCDFStore(file))


def check_dataset(path: Path | str, what: str) -> None:
    """Check before a computation that a NetCDF file can be written.

    Args:
        path: path of the file.
        what: required kind of an existing file, one of :data:`KINDS`.

    Raises:
        BadInput: an existing file is of a different kind, or the file cannot be
            written.
    """
    check_writable(path, NETCDF)
    path = Path(path)
    if path.is_file() and path.stat().st_size and not _is(path, what):
        raise BadInput(
            f"{path}: found a NetCDF file that does not contain {what} of forcefit, "
            "so it is not overwritten; write to another file"
        )


def _is(path: Path, what: str) -> bool:
    """Return whether a file is of the given kind according to its attributes."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            attributes = {str(name): file.attrs[name] for name in file.attrs}
    except (OSError, RuntimeError, KeyError, ValueError, TypeError):
        return False
    ours = str(attributes.get("program", "")).startswith("forcefit ")
    return ours and KINDS[what] in attributes


def open_dataset(path: Path | str) -> "xarray.Dataset":
    """Load a data set from a NetCDF file.

    Args:
        path: path of a NetCDF file.

    Returns:
        The data set.

    Raises:
        BadInput: the file does not exist or is not a NetCDF file.
    """
    import xarray

    path = Path(path)
    if not os.path.isfile(path):
        raise BadInput(f"{path}: no such file; expected a data set of a sweep")
    forgive_damaged_files()
    check_heaps(path)
    try:
        data = xarray.load_dataset(path, engine="h5netcdf")
    except Exception as error:  # damaged files cause various exceptions
        reason = str(error).partition("\n")[0][:200]
        raise BadInput(f"{path}: cannot be read as NetCDF: {reason}") from None
    return _with_new_names(data)


def _with_new_names(data: "xarray.Dataset") -> "xarray.Dataset":
    """Return a data set of an older release with current variable names."""
    old = {name: new for name, new in _OLD_NAMES.items() if name in data.data_vars}
    data.attrs = {_OLD_ATTRIBUTES.get(str(k), k): v for k, v in data.attrs.items()}
    return data.rename_vars(old)
