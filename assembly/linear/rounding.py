"""Rounding: energies indistinguishable from zero, and ill-conditioned stiffnesses.

Closures are sums of screws that cancel.  In floating point a residual of some units in
the last place of their terms remains.  The work of wrenches on it is no energy.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.linear.closure import VirtualJoints, in_reference_lengths

ROUNDING = 8 * float(np.finfo(float).eps)  # relative, of sums of some tens of terms
SPREAD = 1e13  # ratio of stiffnesses: rounding of the stiffest is 1e-3 of the softest


def closure_rounding(errors: NDArray, joints: VirtualJoints, size: float) -> NDArray:
    """Return the bound (...,) [rad, lengths] of closure errors that rounding can cause.

    Args:
        errors: (..., n, 6) [rad, m] geometric errors.
        joints: the virtual joints.
        size: [m] reference length.

    Returns:
        8 units in the last place of the sum of errors and clearances.
    """
    sums = (np.abs(errors) @ in_reference_lengths(size)).sum(axis=-1)
    return ROUNDING * (sums + _clearance_sum(joints, size))


@lru_cache(maxsize=64)
def _clearance_sum(joints: VirtualJoints, size: float) -> float:
    """Return the sum [rad, lengths] of all clearances."""
    clearances = np.abs(joints.cones[:, joints.scaled]).sum(axis=1).reshape(-1, 6)
    return float((clearances @ in_reference_lengths(size)).sum())


def differs_from_zero(
    energy: ArrayLike, gap: ArrayLike, multipliers: NDArray, residual: ArrayLike
) -> NDArray:
    """Return whether least energies exceed their certified uncertainty.

    Springs are known to sqrt(2 gap), so an energy up to the gap may be zero.  The
    wrenches' work on the closures' rounding counts as uncertainty too.

    Args:
        energy: (...,) [J].
        gap: (...,) [J] energy minus its certified bound.
        multipliers: (..., 6 closures) of the scaled closures.
        residual: (...,) [rad, lengths] open in the closures, rounding included.

    Returns:
        (...,) bool; also where the energy is not a number.
    """
    uncertainty = gap + residual * np.add.reduce(np.abs(multipliers), axis=-1)
    return ~(np.asarray(energy) <= uncertainty)


def drop_zeros(
    energy: NDArray, bound: NDArray, multipliers: NDArray, residual: NDArray,
    loaded: ArrayLike = False,
) -> None:  # fmt: skip
    """Set to zero, in place, energies that do not differ from it.

    Args:
        energy: (k,) [J].
        bound: (k,) [J] certified lower bound.
        multipliers: (k, 6 closures) of the scaled closures; set to zero where, without
            loads, they are rounding.
        residual: (k,) [rad, lengths] open in the closures, rounding included.
        loaded: (k,) bool, points under loads.
    """
    zero = ~differs_from_zero(energy, energy - bound, multipliers, residual)
    if not np.count_nonzero(zero):  # then no multiplier is rounding either
        return
    rounding = ~differs_from_zero(energy, 0.0, multipliers, residual) & ~np.array(
        loaded
    )
    energy[zero], multipliers[rounding] = 0.0, 0.0
    bound[zero] = np.minimum(bound[zero], 0.0)


@lru_cache(maxsize=64)
def stiffness_spread(joints: VirtualJoints, size: float) -> float:
    """Return stiffest over softest spring [-], rotations at the reference length."""
    weights = np.tile(in_reference_lengths(size), len(joints.elastic) // 6)
    compliance = ((joints.elastic * weights[:, None]) ** 2).sum(axis=0)
    return float(compliance.max(initial=1e-300) / compliance.min(initial=np.inf))
