"""Problems (22), (21), (27) and K_C of several postures in parallel, compiled.

Each lane of the processor's vector registers takes one posture, or one search of (27),
from the frames' poses to the certificate.  No lane depends on another: answers are
bit-identical for a point alone, in a batch or in another order.  Points that are not
covered, or not proved, are marked for the reference.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.linear.robot_structure import Structure

# outcomes of (21), (27) and K_C: proved, or for the reference
COMPILED, REFERENCE = range(2)
_KEPT = 64  # robots whose C++ data are kept
_known: dict[int, tuple[Structure, Any]] = {}


def assemble_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    loads: NDArray | None, out: Mapping[str, NDArray],
) -> None:  # fmt: skip
    """Solve problem (22) at every point.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) frames; here and below one row may serve all points.
        errors: (k, n, 6) [rad, m].
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        loads: (k, 2, n, 6) [N m, N] on bodies and on joints in the frames' axes.
        out: arrays to fill, in this order: (k,) outcomes, energies [J], certified lower
            bounds of them, energies without clearance, work of the loads on all but the
            errors; (k, 6) [rad, m] platform screws, (k, nu) clearances, (k, nq) free
            motions, (k, 6 closures) multipliers; (k,) closures' residuals; (k, ny)
            [sqrt(2 J)] deformations of the springs.

    Raises:
        ValueError: an array has another shape, type or order of its numbers.
    """
    kernels.assemble_all(_robot(structure), T, errors, mismatch, loads, *out.values())


def margins_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: tuple[NDArray, NDArray, NDArray, NDArray],
) -> None:  # fmt: skip
    """Compute the margins of all points, with their lower bounds.

    Args:
        structure: the robot, without springs.
        T: (k, n, 4, 4) frames; here and below one row may serve all points.
        errors: (k, n, 6) [rad, m].
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        out: arrays to fill: (k,) margins, their bounds, (k, nu) forces on the
            clearances that prove these, with sizes on all cones that add up to 1, and
            (k,) outcomes.

    Raises:
        ValueError: an array has another shape, type or order of its numbers.
    """
    kernels.all_margins(_robot(structure), T, errors, mismatch, *out)


def bounds_side_by_side(
    structure: Structure, T: NDArray, mismatch: NDArray, centres: tuple[NDArray, ...],
    held: Structure, loads: tuple[NDArray, ...], asked: tuple[NDArray, NDArray],
    out: tuple[NDArray, ...],
) -> None:  # fmt: skip
    """Bound the largest pose errors of the points whose outcome is COMPILED.

    Args:
        structure: the robot, without springs.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        centres: the solution of (22): (k, 6) [rad, m] screws of the platform at its
            origin, (k, nu) clearances in the cones of ``structure``, and (k, nq)
            [rad, m] motions; only those that have a bound are read.
        held: the robot in whose solution of (22) the loaded clearances are found.
        loads: that solution: (k, 6 closures) multipliers of the scaled closures,
            (k, nu) clearances in the cones of ``held``, (k,) [J] energies, and those
            with every clearance at zero; and (cones,) the cone of ``held`` of each of
            ``structure``.
        asked: (3,) [m] from the platform's origin to the point whose error is bounded;
            (2,) [rad, m] required difference of upper and lower bounds.
        out: arrays to fill: (k, 2) [rad] lower and upper bounds of the rotation and [m]
            of the translation, (k, 6) [rad, m] screws that attain each lower bound,
            (k,) number of support functions computed, and (k,) outcomes; an unsolved
            point becomes REFERENCE.

    Raises:
        ValueError: an array has another shape, type or order of its numbers.
    """
    none = np.zeros((1, T.shape[1], 6))
    kernels.bound_all(
        _robot(structure), T, none, mismatch, *centres, _robot(held), *loads, *asked,
        *out,
    )  # fmt: skip


def compliances_side_by_side(
    structure: Structure, T: NDArray, mismatch: NDArray, springs: NDArray,
    status: NDArray,
) -> None:  # fmt: skip
    """Compute deformations of all springs under unit wrenches on the platform.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        springs: (k, 6, ny) [sqrt(2 J) per N m and N] array to fill; translations and
            forces are scaled by the reference length.
        status: (k,) array to fill: COMPILED, or the reason without a result.

    Raises:
        ValueError: an array has another shape, type or order of its numbers.
    """
    none = np.zeros((1, T.shape[1], 6))
    kernels.comply_all(_robot(structure), T, none, mismatch, springs, status)


def _robot(structure: Structure) -> Any:
    """Return the C++ object of a structure, checked once."""
    known = _known.get(id(structure))
    if known is None:
        if len(_known) >= _KEPT:
            _known.clear()
        known = _known[id(structure)] = structure, kernels.Robot(structure)
    return known[1]
