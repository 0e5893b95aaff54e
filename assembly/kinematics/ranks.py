"""Thresholds below which singular values of closures are treated as zero.

The same thresholds are used by the compiled methods.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

RANK = 1e-10  # relative size below which a singular value is treated as zero
# relative threshold for singular values of closure equations without springs and free
# motions
ROWS_RANK = 1e-9
# RANK is increased by this factor times the nominal closure error
MISMATCH_FACTOR = 30.0
# relative round-off error of matrix columns after a projection
NOISE = 1e-12
UNBOUNDED = 1e-8  # [rad, m] smallest platform motion per unit unbounded joint motion


def rank_tolerance(mismatch: float, least: float = RANK) -> float:
    """Return the relative size below which singular values are treated as zero.

    Args:
        mismatch: [rad, m] nominal closure error.
        least: threshold without closure error.

    Returns:
        The threshold.
    """
    return least + MISMATCH_FACTOR * mismatch


def rank_of(values: NDArray, tolerance: float, noise: float = 0.0) -> int:
    """Return the number of singular values above the thresholds.

    Args:
        values: (k,) singular values, the largest first.
        tolerance: threshold relative to the largest value.
        noise: absolute threshold.

    Returns:
        The rank; 0 without values.
    """
    return int(np.sum(values > np.maximum(noise, tolerance * values[:1])))


def noise_of(columns: ArrayLike) -> float:
    """Estimate the round-off error of matrix columns after a projection.

    Args:
        columns: (m, n) columns before the projection.

    Returns:
        The argument ``noise`` of :func:`rank_of`; 0 without columns.
    """
    return NOISE * float(np.abs(columns).max(initial=0.0))
