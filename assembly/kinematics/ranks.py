"""Thresholds below which singular values of closures count as zero.

The same thresholds are used by the compiled methods.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

RANK = 1e-10  # relative size below which a singular value counts as zero
ROWS_RANK = 1e-9  # the same for closure equations that only clearances can satisfy
# this factor times the nominal closure error is added to RANK, for rounded robot files
MISMATCH_FACTOR = 30.0
# relative round-off of columns that a projection removes
NOISE = 1e-12
UNBOUNDED = 1e-8  # [rad, m] smallest platform motion per unit of a free motion


def rank_tolerance(mismatch: float, least: float = RANK) -> float:
    """Return the relative size below which a singular value of closures counts as zero.

    Args:
        mismatch: [rad, m] nominal closure error.
        least: threshold for closures that hold exactly.

    Returns:
        The threshold.
    """
    return least + MISMATCH_FACTOR * mismatch


def rank_of(values: NDArray, tolerance: float, noise: float = 0.0) -> int:
    """Return the number of singular values that do not count as zero.

    Args:
        values: (k,) singular values, the largest first.
        tolerance: fraction of the largest value that a value must exceed.
        noise: absolute threshold that a value must exceed.

    Returns:
        The rank; 0 without values.
    """
    return int(np.sum(values > np.maximum(noise, tolerance * values[:1])))


def noise_of(columns: ArrayLike) -> float:
    """Estimate the round-off in columns that a projection removes.

    Args:
        columns: (m, n) columns before the projection.

    Returns:
        The argument ``noise`` of :func:`rank_of`; 0 without columns.
    """
    return NOISE * float(np.abs(columns).max(initial=0.0))
