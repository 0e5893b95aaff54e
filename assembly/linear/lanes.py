"""Problems (22), (21), (27) and K_C of several postures side by side, by ``lanes.cpp``.

The same equations and thresholds as :mod:`assembly.linear.compiled_energy`,
:mod:`assembly.linear.compiled_zone`, :mod:`assembly.linear.compiled_reach` and
:mod:`assembly.platform_stiffness.compiled_compliance`, one posture, or one search of
(27), in each lane of the processor's vector registers.  No lane depends on another: a
point solved alone, in a batch or in another order has the same answer to the last bit.
"""

import ctypes
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import Bounds, Centres, ClearanceLoads, Solutions
from forcefit.native.libraries import address, library_at_hand, load_library

SOURCE = "assembly/linear/lanes.cpp"
# (22) and (21) of one or two points, with the same bits: `forcefit warm-up` compiles
# it, and no command waits for it
FEW_LANES = "assembly/linear/few_lanes.cpp"
_ARRAYS = (
    "on_path", "patterns", "pattern_of", "springs", "spring_frame", "spring_order",
    "of_joint", "groups", "group_pattern", "group_on_path", "cone_frame", "cone_axis",
    "cone_size", "starts", "free_frame", "free_axis", "free_bound",
)  # fmt: skip
_COUNTS = ("n", "closures", "np", "ny", "ng", "nu", "cones", "nq")
_KEPT = 64  # robots whose arrays' addresses are known
_known: dict[int, tuple[Structure, "RobotRecord"]] = {}


class RobotRecord(ctypes.Structure):
    """``Robot`` of lanes.cpp: the fields of a structure, and how many there are."""

    _fields_ = (
        ("size", ctypes.c_double),
        ("platform", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in _ARRAYS),
        *((name, ctypes.c_int64) for name in _COUNTS),
    )


class PointsRecord(ctypes.Structure):
    """``Points`` of lanes.cpp; ``erring`` and ``loads`` may be left out."""

    _fields_ = (
        ("count", ctypes.c_int64), ("T", ctypes.c_void_p), ("errors", ctypes.c_void_p),
        ("mismatch", ctypes.c_void_p), ("own_errors", ctypes.c_int64),
        ("erring", ctypes.c_void_p), ("loads", ctypes.c_void_p),
    )  # fmt: skip


def assemble_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: Solutions, loads: NDArray | None = None,
) -> bool:  # fmt: skip
    """Solve every point; see :class:`~assembly.linear.solutions.Solutions`.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) frames.
        errors: (k, n, 6) [rad, m], or (1, n, 6) for all.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        out: arrays to fill.
        loads: (k, 2, n, 6) [N m, N] on bodies and on joints in the frames' axes.

    Returns:
        Whether it did; not where there is no compiler.
    """
    points = (T, errors, mismatch)
    return _side_by_side("assemble_all", structure, points, out, loads=loads)


def margins_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: tuple[NDArray, NDArray, NDArray],
) -> bool:  # fmt: skip
    """Margins of all points, with their lower bounds.

    Args:
        structure: the robot, without springs.
        T: (k, n, 4, 4) frames.
        errors: (k, n, 6) [rad, m], or (1, n, 6) for all.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        out: (k,) margins, their bounds and outcomes to fill, as
            :func:`assembly.linear.compiled_zone.all_margins` does.

    Returns:
        Whether it did, as above.
    """
    return _side_by_side("all_margins", structure, (T, errors, mismatch), out)


def bounds_side_by_side(
    structure: Structure, T: NDArray, mismatch: NDArray, centres: Centres,
    loads: ClearanceLoads, asked: tuple[NDArray, NDArray], out: Bounds,
) -> bool:  # fmt: skip
    """Bounds of the largest pose errors of the points whose outcome is SOLVED.

    Args:
        structure: the robot, without springs.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        centres: the solution of (22).
        loads: which of its clearances are held.
        asked: (3,) [m] offset and (2,) tolerances, as
            :func:`assembly.linear.compiled_reach.bound_all` takes them.
        out: arrays to fill; rows that are not solved become FALLBACK.

    Returns:
        Whether it did, as above.
    """
    none, held = np.zeros((1, T.shape[1], 6)), _robot(loads.structure)
    loaded = (ctypes.addressof(held), *loads[1:])
    return _side_by_side(
        "bound_all", structure, (T, none, mismatch), centres, loaded, asked, out
    )


def compliances_side_by_side(
    structure: Structure, T: NDArray, mismatch: NDArray, springs: NDArray,
    status: NDArray,
) -> bool:  # fmt: skip
    """Deformations of all springs under unit wrenches on the platform, at all points.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        springs: (k, 6, ny) to fill, as
            :func:`assembly.platform_stiffness.compiled_compliance.comply_all` does.
        status: (k,) to fill.

    Returns:
        Whether it did, as above; not where there are no closures.
    """
    if not structure.patterns.size:
        return False
    none = np.zeros((1, T.shape[1], 6))
    return _side_by_side(
        "comply_all", structure, (T, none, mismatch), (springs, status)
    )


def _side_by_side(
    name: str, structure: Structure, points: tuple[NDArray, NDArray, NDArray],
    *tables: tuple[NDArray | int, ...], loads: NDArray | None = None,
) -> bool:  # fmt: skip
    """Call a function of the library on every point; whether it did."""
    # tables are what its other arguments point to: addresses of arrays, in their order
    T, errors, mismatch = points
    few = len(T) <= 2 and name in {"assemble_all", "all_margins"}
    library = (few and library_at_hand(FEW_LANES)) or load_library(SOURCE)
    if library is None:
        return False
    given = PointsRecord(len(T), *map(_address, points), len(errors) > 1)
    if loads is not None:
        given.loads = _address(loads)
    rows = [(ctypes.c_void_p * len(table))(*map(_address, table)) for table in tables]
    getattr(library, name)(*map(ctypes.byref, (_robot(structure), given, *rows)))
    return True


def _address(array: NDArray | int) -> int | None:
    """Where an array's numbers are; None if it has none."""
    if isinstance(array, int):
        return array
    return address(array) if array.size else None


def _robot(structure: Structure) -> RobotRecord:
    """A structure's addresses; it is kept as long as they are."""
    known = _known.get(id(structure))
    if known is None:
        if len(_known) >= _KEPT:
            _known.clear()
        robot = robot_record(structure, address)
        known = _known[id(structure)] = structure, robot
    return known[1]


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
