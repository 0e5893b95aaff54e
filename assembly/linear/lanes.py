"""Problems (22), (21), (27) and K_C of several postures side by side, compiled.

The same equations and thresholds as :mod:`assembly.linear.compiled_energy`,
:mod:`assembly.linear.compiled_zone`, :mod:`assembly.linear.compiled_reach` and
:mod:`assembly.platform_stiffness.compiled_compliance`, one posture, or one search of
(27), in each lane of the processor's vector registers.  No lane depends on another: a
point solved alone, in a batch or in another order has the same answer to the last bit.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.kernels.choice import kernels
from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import Bounds, Centres, ClearanceLoads, Solutions
from forcefit.native.libraries import numba_alone

_KEPT = 64  # robots that are known to C++
_known: dict[int, tuple[Structure, Any]] = {}


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
        Whether it did; not where callers asked for numba.

    Raises:
        ValueError: an array has another shape, type or order of its numbers.
    """
    if numba_alone():
        return False
    kernels.assemble_all(_robot(structure), T, errors, mismatch, loads, *out)
    return True


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

    Raises:
        ValueError: as above.
    """
    if numba_alone():
        return False
    kernels.all_margins(_robot(structure), T, errors, mismatch, *out)
    return True


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

    Raises:
        ValueError: as above.
    """
    if numba_alone():
        return False
    none, held = np.zeros((1, T.shape[1], 6)), _robot(loads.structure)
    kernels.bound_all(
        _robot(structure), T, none, mismatch, *centres, held, *loads[1:], *asked, *out
    )
    return True


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

    Raises:
        ValueError: as above.
    """
    if not structure.patterns.size or numba_alone():
        return False
    none = np.zeros((1, T.shape[1], 6))
    kernels.comply_all(_robot(structure), T, none, mismatch, springs, status)
    return True


def _robot(structure: Structure) -> Any:
    """What C++ keeps of a structure, checked once."""
    known = _known.get(id(structure))
    if known is None:
        if len(_known) >= _KEPT:
            _known.clear()
        known = _known[id(structure)] = structure, kernels.Robot(structure)
    return known[1]
