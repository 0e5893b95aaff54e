"""Problems (22) and (21) of very many postures, one in each thread of a GPU.

``device.cpp`` is what :mod:`assembly.linear.lanes` compiles, with one lane: the same
equations, thresholds and certificates.  It is compiled at run time for the device at
hand, by CuPy (the extra ``device``), which keeps what it compiled; without CuPy or a
device nothing happens here, and the processor computes.

Sources: CUDA C++ Programming Guide, "Device Memory Accesses" (local memory lies so that
the threads of a warp read it together) and "Dynamic Global Memory Allocation".
"""

import ctypes
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import Solutions
from forcefit.native.libraries import digest_of, numba_alone

SOURCE = "assembly/linear/device.cpp"
LEAST = 50_000  # points; below that the processor has done before a device begins
THREADS = 64  # of a block, as arena.h says
_BLOCKS = 8192  # of a launch: more threads than any device keeps busy
_SHARE = 0.5  # of the free memory, for points and answers
_STEP, _LARGEST = 32_768, 458_752  # [bytes] rooms of threads; each size is compiled

_ARRAYS = (
    "on_path", "patterns", "pattern_of", "springs", "spring_frame", "spring_order",
    "of_joint", "groups", "group_pattern", "group_on_path", "cone_frame", "cone_axis",
    "cone_size", "starts", "free_frame", "free_axis", "free_bound",
)  # fmt: skip
_COUNTS = ("n", "closures", "np", "ny", "ng", "nu", "cones", "nq")
Points = tuple[NDArray, NDArray, NDArray]


class RobotRecord(ctypes.Structure):
    """``Robot`` of device.cpp: the fields of a structure, and how many there are."""

    _fields_ = (
        ("size", ctypes.c_double),
        ("platform", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in _ARRAYS),
        *((name, ctypes.c_int64) for name in _COUNTS),
    )


class PointsRecord(ctypes.Structure):
    """``Points`` of device.cpp; ``erring`` and ``loads`` may be left out."""

    _fields_ = (
        ("count", ctypes.c_int64), ("T", ctypes.c_void_p), ("errors", ctypes.c_void_p),
        ("mismatch", ctypes.c_void_p), ("own_errors", ctypes.c_int64),
        ("erring", ctypes.c_void_p), ("loads", ctypes.c_void_p),
    )  # fmt: skip


class Device(NamedTuple):
    """Where kernels run.

    Attributes:
        put: copies an array there.
        get: copies it back.
        address: where its numbers are there.
        launch: runs a kernel, in threads of so much room [bytes], on records at these
            addresses.
        free_bytes: memory that is free.
        failures: what says that the device cannot do it.
    """

    put: Callable[[NDArray], Any]
    get: Callable[[Any], NDArray]
    address: Callable[[Any], int]
    launch: Callable[[str, int, tuple[int, int, int]], None]
    free_bytes: Callable[[], int]
    failures: tuple[type[Exception], ...]


def assemble_on_device(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: Solutions,
) -> bool:  # fmt: skip
    """Solve (22) at every point, as :func:`.lanes.assemble_side_by_side` does.

    Returns:
        Whether it did; not where there is no device, or points are few.
    """
    return _on_device("assemble_all", structure, (T, errors, mismatch), out)


def margins_on_device(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: tuple[NDArray, NDArray, NDArray],
) -> bool:  # fmt: skip
    """Margins (21) of all points, as :func:`.lanes.margins_side_by_side` finds them.

    Returns:
        Whether it did, as above.
    """
    return _on_device("all_margins", structure, (T, errors, mismatch), out)


def _on_device(
    name: str, structure: Structure, points: Points, out: tuple[NDArray, ...]
) -> bool:
    """Run a kernel on all points; whether it did."""
    if len(points[0]) < LEAST or numba_alone():
        return False
    device = cuda_device()
    if device is None:
        return False
    try:
        _run(device, name, structure, points, out)
    except device.failures as error:
        warnings.warn(
            f"the GPU could not do it, the processor does: {error}",
            RuntimeWarning, stacklevel=2,
        )  # fmt: skip
        return False
    return True


def _run(
    device: Device, name: str, structure: Structure, points: Points,
    out: tuple[NDArray, ...],
) -> None:  # fmt: skip
    """As many points at a time as the device's memory holds."""
    T, errors, mismatch = points
    own = len(errors) > 1
    kept: list[Any] = []  # what addresses point to must not be dropped

    def put(array: NDArray) -> int:
        if not array.size:
            return 0
        kept.append(device.put(np.ascontiguousarray(array)))
        return device.address(kept[-1])

    def record(fields: ctypes.Structure | ctypes.Array) -> int:
        return put(np.frombuffer(bytes(fields), dtype=np.uint8))

    robot = record(robot_record(structure, put))
    erring = put(np.any(errors != 0.0, axis=(0, 2)))
    shared = 0 if own else put(errors)
    rows = (T, mismatch, *out, *([errors] if own else []))
    each = sum(array[:1].nbytes for array in rows)
    at_once = max(1, int(_SHARE * device.free_bytes()) // each)
    room = room_of(structure)
    always = len(kept)
    for first in range(0, len(T), at_once):
        some = slice(first, first + at_once)
        given = PointsRecord(
            len(T[some]), put(T[some]), put(errors[some]) if own else shared,
            put(mismatch[some]), own, erring,
        )  # fmt: skip
        before = len(kept)
        addresses = [put(array[some]) for array in out]
        filled = [array for array in out if array.size]
        answers = kept[before:]
        pointers = (ctypes.c_void_p * len(out))(*addresses)
        device.launch(name, room, (robot, record(given), record(pointers)))
        for array, answer in zip(filled, answers, strict=True):
            array[some] = device.get(answer)
        del kept[always:]


def room_of(structure: Structure) -> int:
    """Room for a thread's tables; what it does not hold comes from the device's heap.

    Args:
        structure: the robot.

    Returns:
        [bytes] a multiple of 32 KiB, so that few kernels are compiled.
    """
    s = structure
    n, m, ng = len(s.on_path), 6 * s.patterns.shape[1], len(s.groups) - 1
    nu, nq, ny = len(s.cone_frame), len(s.free_frame), len(s.springs)
    numbers = (
        18 * n + 6 * (nq + nu + ny)  # columns
        + m * (nq + 6 * ng + m + 6 * len(s.patterns)) + 36 * ng  # reduction
        + m * (2 * nu + m) + 36 * nu  # programme and solver
        + nq**2 + 10 * (m + nq + 6 * ng + n)  # the way back
    )  # fmt: skip
    return min(-(-8 * numbers // _STEP) * _STEP, _LARGEST)


@cache
def cuda_device() -> Device | None:
    """The current CUDA device, by CuPy; None without them."""
    try:
        import cupy
    except ImportError:
        return None
    runtime = cupy.cuda.runtime
    failures = (
        runtime.CUDARuntimeError, cupy.cuda.driver.CUDADriverError,
        cupy.cuda.compiler.CompileException, cupy.cuda.memory.OutOfMemoryError,
    )  # fmt: skip
    try:
        if not runtime.getDeviceCount():
            return None
    except failures:
        return None
    source = Path(__file__).with_name("device.cpp")

    @cache
    def module(room: int) -> Any:
        # by the options and its text CuPy knows what it kept, not by the headers
        digest = f"-DSOURCE_DIGEST={digest_of(SOURCE)}"
        options = ("-std=c++17", f"-I{source.parent}", f"-DROOM={room}", digest)
        return cupy.RawModule(code=source.read_text("utf-8"), options=options)

    def launch(name: str, room: int, records: tuple[int, int, int]) -> None:
        kernel = module(room).get_function(name)
        threads = np.int64(THREADS * _BLOCKS)
        kernel((_BLOCKS,), (THREADS,), (*map(np.uintp, records), threads))
        runtime.deviceSynchronize()

    return Device(
        put=cupy.asarray,
        get=cupy.asnumpy,
        address=lambda array: array.data.ptr,
        launch=launch,
        free_bytes=lambda: runtime.memGetInfo()[0],
        failures=failures,
    )


def robot_record(
    structure: Structure, addressed: Callable[[NDArray], int]
) -> RobotRecord:
    """What C++ reads of a robot.

    Args:
        structure: the robot.
        addressed: where the numbers of one of its arrays are.

    Returns:
        Addresses, good as long as the numbers stay there.
    """
    s = structure
    counts = (
        len(s.on_path), s.patterns.shape[1], len(s.patterns), len(s.springs),
        len(s.groups) - 1, len(s.cone_frame), len(s.starts) - 1, len(s.free_frame),
    )  # fmt: skip
    arrays = [addressed(getattr(s, name)) for name in _ARRAYS]
    return RobotRecord(s.size, s.platform, *arrays, *counts)
