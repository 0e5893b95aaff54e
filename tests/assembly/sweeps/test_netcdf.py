"""NetCDF files on a full disk, and damaged NetCDF files."""

import os
import resource

import h5py
import numpy as np
import pytest
import xarray

from forcefit.assembly.sweeps.dataset import open_dataset, save_dataset
from forcefit.assembly.sweeps.netcdf import check_heaps, netcdf_file
from forcefit.inputs.table import BadInput

SIZE = 6_500_000  # [bytes] approximate size of the file


def write(path):
    """Write texts and numbers in parts, as a sweep does."""
    names = ("error", "message", "screw", "wrench")
    with netcdf_file(path) as file:
        file.dimensions = {"point": 6_000}
        for name in names:
            file.create_variable(name, ("point",), h5py.string_dtype())
        for first in range(0, 6_000, 500):
            texts = [f"point {first + row}, " * 20 for row in range(500)]
            for name in names:
                file[name][first : first + 500] = np.array(texts, dtype=object)


def write_on_a_disk_of(size, path):
    """Return the exit status of a process with a limit on its file size."""
    child = os.fork()
    if not child:
        status = 1
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
            write(path)
            status = 0
        except BadInput as error:
            status = 2 if "File too large" in str(error) else 3
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.parametrize("share", [0.02, 0.1, 0.6])
def test_full_disk_is_rejected_and_leaves_no_file(tmp_path, share):
    """HDF5 would crash when it reads data that were not written."""
    path = tmp_path / "sweep.nc"
    assert write_on_a_disk_of(int(share * SIZE), path) == 2
    assert list(tmp_path.iterdir()) == []


def test_file_is_written_if_the_disk_is_large_enough(tmp_path):
    path = tmp_path / "sweep.nc"
    assert write_on_a_disk_of(2 * SIZE, path) == 0
    assert path.stat().st_size == pytest.approx(SIZE, rel=0.3)


def test_file_with_a_damaged_text_heap_is_rejected(tmp_path):
    """HDF5 would run forever on an entry of size 0."""
    path = tmp_path / "x.nc"
    texts = {f"a{k}": f"a text of some length, number {k}" for k in range(9)}
    save_dataset(xarray.Dataset({"x": ("y", np.arange(3.0), texts)}), path)
    check_heaps(path)
    content = path.read_bytes()
    entry = content.index(b"GCOL") + 16
    path.write_bytes(content[:entry] + bytes(16) + content[entry + 16 :])
    with pytest.raises(BadInput, match="damaged heap"):
        open_dataset(path)
