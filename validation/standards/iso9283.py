"""Compute pose accuracy and repeatability by the formulas of ISO 9283.

Sources:
    ISO 9283:1998, Manipulating industrial robots, performance criteria and related test
    methods: 7.2 (AP, RP), 7.3 (AD, RD), 7.6 (drift of AP).  The standard requires 30
        cycles, whereas these functions accept any number.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Number of cycles per block in the computation of drift.
DRIFT_CYCLES = 10


def position_accuracy(deviations: ArrayLike) -> float:
    """Return AP_P [m], the distance between commanded and mean attained position.

    Args:
        deviations: (n, 3) [m] attained minus commanded positions.

    Returns:
        The distance [m].
    """
    return float(np.linalg.norm(np.asarray(deviations, dtype=float).mean(axis=0)))


def position_repeatability(deviations: ArrayLike) -> float:
    """Return RP_l [m], the mean distance from the mean position plus 3 S_l.

    Args:
        deviations: (n, 3) [m] attained minus commanded positions, n >= 2.

    Returns:
        The radius [m].
    """
    d = np.asarray(deviations, dtype=float)
    lengths = np.linalg.norm(d - d.mean(axis=0), axis=1)
    return float(lengths.mean() + 3 * lengths.std(ddof=1))


def orientation_accuracy(angles: ArrayLike) -> NDArray:
    """Return AP_a, AP_b, AP_c, the mean attained minus commanded angles.

    Args:
        angles: (n, 3) [rad] attained minus commanded angles.

    Returns:
        The differences (3,) [rad].
    """
    return np.mean(np.asarray(angles, dtype=float), axis=0)


def orientation_repeatability(angles: ArrayLike) -> NDArray:
    """Return RP_a, RP_b, RP_c, which are three standard deviations of each angle.

    Args:
        angles: (n, 3) [rad] attained minus commanded angles, n >= 2.

    Returns:
        Half the width of the range of each angle, (3,) [rad].
    """
    return 3 * np.std(np.asarray(angles, dtype=float), axis=0, ddof=1)


def distance_accuracy(
    first: ArrayLike, second: ArrayLike, commanded: float
) -> tuple[float, float]:
    """Return accuracy and repeatability of the distance between two positions.

    Args:
        first: (n, 3) [m] attained first positions in n >= 2 cycles.
        second: (n, 3) [m] attained second positions.
        commanded: [m] commanded distance.

    Returns:
        AD_P [m], the mean attained minus commanded distance, and RD [m], three standard
        deviations of the distance.
    """
    lengths = np.linalg.norm(np.asarray(first) - np.asarray(second), axis=1)
    return float(lengths.mean() - commanded), float(3 * lengths.std(ddof=1))


def accuracy_drift(deviations: ArrayLike, cycles: int = DRIFT_CYCLES) -> float | None:
    """Return dAP_P [m], the largest change of AP_P relative to the first block.

    Args:
        deviations: (n, 3) [m] attained minus commanded positions, in measuring order.
        cycles: number of cycles per block.  An incomplete last block is ignored.

    Returns:
        The change [m]; None if there are fewer than two blocks.
    """
    d = np.asarray(deviations, dtype=float)
    count = len(d) // cycles
    if count < 2:
        return None
    accuracy = [
        position_accuracy(block) for block in np.split(d[: count * cycles], count)
    ]
    return float(max(abs(value - accuracy[0]) for value in accuracy[1:]))
