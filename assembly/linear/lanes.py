"""Compiled solution of problems (21), (22), (27) and of the stiffness matrix K_C.

Each lane of the processor's vector registers computes one posture.  Lanes are
independent, so a point has bit-identical results alone and in a batch.  Points that the
kernels do not cover or cannot certify are marked for the reference method.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.linear.robot_structure import Structure

# outcome codes of a point: certified, or to be solved by the reference method
COMPILED, REFERENCE = range(2)
_KEPT = 64  # number of robots whose C++ objects are cached
_known: dict[int, tuple[Structure, Any]] = {}


def assemble_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    loads: NDArray | None, out: Mapping[str, NDArray],
) -> None:  # fmt: skip
    """Solve problem (22) at k points.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) transforms of the frames.  In every input array, a single row
            serves all points.
        errors: (k, n, 6) [rad, m] geometric errors.
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        loads: (k, 2, n, 6) [N m, N] wrenches on bodies and on joints, in the frames'
            axes.
        out: arrays to fill, in this order: (k,) outcomes, energies [J], certified lower
            bounds on the energies [J], energies without clearance [J], and work [J] of
            the loads on all small screws except the errors; (k, 6) [rad, m] platform
            screws, (k, nu) clearances, (k, nq) free motions, (k, 6 closures)
            multipliers; (k,) closure residuals; (k, ny) [sqrt(2 J)] deformations of the
            springs.

    Raises:
        ValueError: the shape, type or memory order of an array is wrong.
    """
    kernels.assemble_all(_robot(structure), T, errors, mismatch, loads, *out.values())


def margins_side_by_side(
    structure: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: tuple[NDArray, NDArray, NDArray, NDArray],
) -> None:  # fmt: skip
    """Compute the assembly margin (21) and its lower bound at k points.

    Args:
        structure: the robot without springs.
        T: (k, n, 4, 4) transforms of the frames.  In every input array, a single row
            serves all points.
        errors: (k, n, 6) [rad, m] geometric errors.
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        out: arrays to fill: (k,) margins; (k,) lower bounds; (k, nu) forces on the
            clearances that prove the bounds, normalised so that their magnitudes on all
            cones add up to 1; and (k,) outcomes.

    Raises:
        ValueError: the shape, type or memory order of an array is wrong.
    """
    kernels.all_margins(_robot(structure), T, errors, mismatch, *out)


def bounds_side_by_side(
    structure: Structure, T: NDArray, mismatch: NDArray, centres: tuple[NDArray, ...],
    held: Structure, loads: tuple[NDArray, ...], asked: tuple[NDArray, NDArray],
    out: tuple[NDArray, ...],
) -> None:  # fmt: skip
    """Bound the largest pose error at each point whose outcome is COMPILED.

    Args:
        structure: the robot without springs.
        T: (k, n, 4, 4) transforms of the frames.
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        centres: solution of (22): (k, 6) [rad, m] screws of the platform at its origin;
            (k, nu) clearances in the cones of ``structure``; and (k, nq) [rad, m]
            motions, of which only bounded motions are read.
        held: structure of the robot for which (22) was solved to identify the loaded
            clearances.
        loads: solution of (22) for ``held``: (k, 6 closures) multipliers of the scaled
            closures; (k, nu) clearances in the cones of ``held``; (k,) [J] energies;
            (k,) [J] energies with all clearances zero; and (cones,) indices of the
            cones of ``structure`` among the cones of ``held``.
        asked: (3,) [m] vector from the platform's origin to the point whose error is
            bounded; and (2,) [rad, m] required differences between upper and lower
            bounds.
        out: arrays to fill: (k, 2) [rad] lower and upper bounds on the rotation; (k, 2)
            [m] bounds of the translation; two arrays (k, 6) [rad, m] of screws that
            attain the lower bounds; (k,) number of support functions computed; and (k,)
            outcomes.  The outcome of an unsolved point becomes REFERENCE.

    Raises:
        ValueError: the shape, type or memory order of an array is wrong.
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
    """Compute the spring deformations under unit wrenches on the platform.

    Args:
        structure: the robot.
        T: (k, n, 4, 4) transforms of the frames.
        mismatch: (k,) [rad, m] nominal closure errors of the frames.
        springs: (k, 6, ny) [sqrt(2 J) per N m and N] array to fill; translations and
            forces are scaled by the reference length.
        status: (k,) array to fill: COMPILED, or a code for the reason of failure.

    Raises:
        ValueError: the shape, type or memory order of an array is wrong.
    """
    none = np.zeros((1, T.shape[1], 6))
    kernels.comply_all(_robot(structure), T, none, mismatch, springs, status)


def _robot(structure: Structure) -> Any:
    """Return the cached C++ object that describes a robot."""
    known = _known.get(id(structure))
    if known is None:
        if len(_known) >= _KEPT:
            _known.clear()
        known = _known[id(structure)] = structure, kernels.Robot(structure)
    return known[1]
