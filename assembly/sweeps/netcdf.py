"""NetCDF files, written either completely or not at all, even if the disk is full."""

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

_HEAP = b"GCOL\x01\x00\x00\x00"  # signature and version of a global heap in HDF5


@contextmanager
def netcdf_file(path: Path | str) -> Generator[Any, None, None]:
    """Open a new NetCDF file for writing, as a context.

    Args:
        path: path of the file, which appears only if the block ends without an error.

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
    """A variable in a file, with the same attribute names as in xarray.

    Attributes:
        dims: names of the axes.
        values: values of the variable.
        attrs: attributes of the variable.
    """

    dims: tuple[str, ...]
    values: NDArray
    attrs: dict[str, Any]


class StoredDataset(NamedTuple):
    """A data set read without xarray, because importing xarray takes a second.

    Attributes:
        data_vars: variables by name, without coordinates.
        attrs: attributes of the whole data set.
    """

    data_vars: dict[str, Stored]
    attrs: dict[str, Any]


def stored_dataset(path: Path | str) -> StoredDataset:
    """Read a newly written data set, in order to compute its summary.

    Args:
        path: path of a NetCDF file written by forcefit.

    Returns:
        All variables except the coordinates.
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
    """Decode bytes in the values, because HDF5 returns text as bytes."""
    if values.dtype != object:
        return values
    texts = [text.decode() for text in values.ravel()]
    return np.array(texts, dtype=object).reshape(values.shape)


def forgive_damaged_files() -> None:
    """Prevent h5netcdf from writing to stderr when it closes a damaged file."""
    import h5netcdf

    h5netcdf.File._writable = False  # default, which an opened file overrides


def check_heaps(path: Path) -> None:
    """Reject a file with damaged text heaps, on which HDF5 would loop forever.

    Args:
        path: path of an HDF5 file; other files are accepted.

    Raises:
        BadInput: a heap entry points outside the heap.
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
                # a text, or free space, whose size includes its own header
                step = 16 + -(-own // 8) * 8 if number else own
                if step < 16:
                    raise BadInput(f"{path}: cannot be read as NetCDF: damaged heap")
                place += step
            start = data.find(_HEAP, start + 16)


class _Target:
    """File to which HDF5 writes; after a failure it continues as a copy in memory.

    HDF5 crashes the whole process if a file cannot be closed, or if data read back
    differ from the data written.
    """

    def __init__(self, file: FileIO) -> None:
        self.file: FileIO | BytesIO = file
        self.failure: OSError | None = None

    def write(self, content: Any) -> int:
        """Write the content; if this fails, record the failure and return success."""
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
        """Read bytes that were written before."""
        return self.file.readinto(content) or 0

    def read(self, size: int = -1) -> bytes:
        """Return bytes written before."""
        return self.file.read(size) or b""

    def seek(self, offset: int, whence: int = SEEK_SET) -> int:
        """Set the position in the file."""
        return self.file.seek(offset, whence)

    def tell(self) -> int:
        """Return the current position in the file [bytes]."""
        return self.file.tell()

    def truncate(self, size: int | None = None) -> int:
        """Set the size of the file; if this fails, record the failure."""
        try:
            return self.file.truncate(size)
        except OSError as error:
            self._go_on_in_memory(error)
            return self.truncate(size)

    def flush(self) -> None:
        """Do nothing, because no data are buffered."""

    def _go_on_in_memory(self, failure: OSError) -> None:
        """Record the failure, and copy the data written so far into memory."""
        self.failure = failure
        position = self.file.tell()
        self.file.seek(0)
        self.file = BytesIO(self.file.read() or b"")
        self.file.seek(position)
