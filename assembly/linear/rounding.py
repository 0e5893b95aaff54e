"""Detect energies that are only round-off, and ill-conditioned stiffnesses.

The screws in a closure sum to zero.  In floating-point arithmetic, a residual of a few
units in the last place remains.  The work of the wrenches on this residual is
round-off, not elastic energy.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.linear.closure import VirtualJoints, in_reference_lengths

# [-] relative round-off error of a sum of a few dozen terms
ROUNDING = 8 * float(np.finfo(float).eps)
# ratio of largest to smallest stiffness above which round-off is significant
SPREAD = 1e13


def closure_rounding(errors: NDArray, joints: VirtualJoints, size: float) -> NDArray:
    """Estimate the largest closure error that round-off can cause.

    Args:
        errors: (..., n, 6) [rad, m] geometric errors.
        joints: the virtual joints.
        size: [m] reference length.

    Returns:
        (...,) [rad, lengths] 8 units in the last place of the sum of errors and
        clearances.
    """
    sums = (np.abs(errors) @ in_reference_lengths(size)).sum(axis=-1)
    return ROUNDING * (sums + _clearance_sum(joints, size))


@lru_cache(maxsize=64)
def _clearance_sum(joints: VirtualJoints, size: float) -> float:
    """Return the sum [rad, reference lengths] of the bounds of all clearances."""
    clearances = np.abs(joints.cones[:, joints.scaled]).sum(axis=1).reshape(-1, 6)
    return float((clearances @ in_reference_lengths(size)).sum())


def differs_from_zero(
    energy: ArrayLike, gap: ArrayLike, multipliers: NDArray, residual: ArrayLike
) -> NDArray:
    """Return whether minimum energies exceed their uncertainty.

    An energy that does not exceed the duality gap can be zero.  The work of the
    wrenches on closure round-off is added to the gap.

    Args:
        energy: (...,) [J] minimum energies.
        gap: (...,) [J] energy minus its certified bound.
        multipliers: (..., 6 closures) multipliers of the scaled closures.
        residual: (...,) [rad, reference lengths] closure residual, including round-off.

    Returns:
        (...,) bool; True also if the energy is NaN.
    """
    uncertainty = gap + residual * np.add.reduce(np.abs(multipliers), axis=-1)
    return ~(np.asarray(energy) <= uncertainty)


def drop_zeros(
    energy: NDArray, bound: NDArray, multipliers: NDArray, residual: NDArray,
    loaded: ArrayLike = False,
) -> None:  # fmt: skip
    """Set energies that are only round-off to zero, in place.

    Args:
        energy: (k,) [J] minimum energies.
        bound: (k,) [J] certified lower bounds.
        multipliers: (k, 6 closures) multipliers of the scaled closures, set to zero at
            unloaded points where they are only round-off.
        residual: (k,) [rad, lengths] closure residual, including round-off.
        loaded: (k,) bool, points under loads.
    """
    zero = ~differs_from_zero(energy, energy - bound, multipliers, residual)
    # If no energy is zero, no multiplier is round-off.
    if not np.count_nonzero(zero):
        return
    rounding = ~differs_from_zero(energy, 0.0, multipliers, residual) & ~np.array(
        loaded
    )
    energy[zero], multipliers[rounding] = 0.0, 0.0
    bound[zero] = np.minimum(bound[zero], 0.0)


@lru_cache(maxsize=64)
def stiffness_spread(joints: VirtualJoints, size: float) -> float:
    """Return the ratio of the largest to the smallest spring stiffness."""
    weights = np.tile(in_reference_lengths(size), len(joints.elastic) // 6)
    compliance = ((joints.elastic * weights[:, None]) ** 2).sum(axis=0)
    return float(compliance.max(initial=1e-300) / compliance.min(initial=np.inf))
