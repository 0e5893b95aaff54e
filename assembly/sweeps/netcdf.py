"""NetCDF files that are replaced only by complete files."""

import struct
from collections.abc import Generator
from contextlib import contextmanager
from io import SEEK_SET, BytesIO, FileIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import unwritable, whole_file

_HEAP = b"GCOL\x01\x00\x00\x00"  # first bytes of a global heap in HDF5


@contextmanager
def netcdf_file(path: Path | str) -> Generator[Any, None, None]:
    """Open a new NetCDF file for writing, as a context manager.

    Args:
        path: path of the file. It is created or replaced if no exception is raised.

    Yields:
        The open ``h5netcdf.File``.

    Raises:
        BadInput: the file cannot be written.
    """
    import h5netcdf

    with whole_file(path) as part, FileIO(part, "w+") as file:
        target = _Target(file)
        try:
            with h5netcdf.File(target, "w") as content:
                yield content
        finally:
            if target.failure is not None:
                raise BadInput(unwritable(path, target.failure)) from None


class Stored(NamedTuple):
    """A variable in a NetCDF file.

    Attributes:
        dims: names of the axes.
        values: values of the variable.
        attrs: attributes of the variable.
    """

    dims: tuple[str, ...]
    values: NDArray
    attrs: dict[str, Any]


class StoredDataset(NamedTuple):
    """A data set that is read without xarray, whose import takes a second.

    Attributes:
        data_vars: variables by name, except the coordinates.
        attrs: attributes of the data set.
    """

    data_vars: dict[str, Stored]
    attrs: dict[str, Any]


def stored_dataset(path: Path | str) -> StoredDataset:
    """Read a data set for a summary.

    Args:
        path: path of a NetCDF file written by forcefit.

    Returns:
        The data set without coordinates.
    """
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        attrs = dict(file.attrs)
        beside = {*file.dimensions, *attrs.get("coordinates", "").split()}
        return StoredDataset(
            {
                name: Stored(one.dimensions, _decoded(one[...]), dict(one.attrs))
                for name, one in file.variables.items()
                if name not in beside
            },
            attrs,
        )


def _decoded(values: NDArray) -> NDArray:
    """Return values in which bytes are decoded to text."""
    if values.dtype != object:
        return values
    texts = [text.decode() for text in values.ravel()]
    return np.array(texts, dtype=object).reshape(values.shape)


def forgive_damaged_files() -> None:
    """Prevent messages of h5netcdf on stderr when it closes a damaged file."""
    import h5netcdf

    h5netcdf.File._writable = False  # default value for files that cannot be opened


def check_heaps(path: Path) -> None:
    """Reject a file with damaged text heaps, which cause an endless loop in HDF5.

    Args:
        path: path of the file. Files of other formats are not checked.

    Raises:
        BadInput: an entry extends beyond its heap.
    """
    size = path.stat().st_size
    if not size:
        return
    with open(path, "rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        start = data.find(_HEAP)
        while start >= 0:
            (length,) = struct.unpack_from("<Q", data, start + 8)
            end, place = start + min(length, size - start), start + 16
            while place + 16 <= end:
                number, _, own = struct.unpack_from("<HH4xQ", data, place)
                # An entry contains a text. An entry with number 0 is free space, whose
                # size includes the header.
                step = 16 + -(-own // 8) * 8 if number else own
                if step < 16:
                    raise BadInput(f"{path}: cannot be read as NetCDF: damaged heap")
                place += step
            start = data.find(_HEAP, start + 16)


class _Target:
    """File object for HDF5 that continues in memory after a failed write.

    This prevents crashes of HDF5 if a file cannot be written to the end.
    """

    def __init__(self, file: FileIO) -> None:
        self.file: FileIO | BytesIO = file
        self.failure: OSError | None = None

    def write(self, content: Any) -> int:
        """Write content, and record a failure without raising an error."""
        left = memoryview(content).cast("B")
        size = len(left)
        while left:
            try:
                count = self.file.write(left)
            except OSError as error:
                self._go_on_in_memory(error)
            else:
                left = left[count:]
        return size

    def readinto(self, content: Any) -> int:
        """Read bytes into a buffer."""
        return self.file.readinto(content) or 0

    def read(self, size: int = -1) -> bytes:
        """Read bytes."""
        return self.file.read(size) or b""

    def seek(self, offset: int, whence: int = SEEK_SET) -> int:
        """Set the position in the file."""
        return self.file.seek(offset, whence)

    def tell(self) -> int:
        """Return the position in the file [bytes]."""
        return self.file.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the size of the file, and record a failure."""
        try:
            return self.file.truncate(size)
        except OSError as error:
            self._go_on_in_memory(error)
            return self.truncate(size)

    def flush(self) -> None:
        """Do nothing, because no data are buffered."""

    def _go_on_in_memory(self, failure: OSError) -> None:
        """Record a failure, and copy the file into memory."""
        self.failure = failure
        position = self.file.tell()
        self.file.seek(0)
        self.file = BytesIO(self.file.read() or b"")
        self.file.seek(position)
