"""Pose accuracy and repeatability of ISO 9283, by its formulas.

Sources:
    ISO 9283:1998, Manipulating industrial robots, performance criteria and related test
    methods: 7.2 (AP, RP), 7.3 (AD, RD), 7.6 (drift of AP).  The standard measures 30
    cycles; here as many as there are.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

DRIFT_CYCLES = 10  # of each block whose AP is compared with the first block's


def position_accuracy(deviations: ArrayLike) -> float:
    """Return AP_P [m]: from the commanded position to the barycentre of those attained.

    Args:
        deviations: (n, 3) [m] attained less commanded.

    Returns:
        The distance.
    """
    return float(np.linalg.norm(np.asarray(deviations, dtype=float).mean(axis=0)))


def position_repeatability(deviations: ArrayLike) -> float:
    """Return RP_l [m]: radius of the sphere about the barycentre, mean plus three S_l.

    Args:
        deviations: (n, 3) [m] attained less commanded, n >= 2.

    Returns:
        The radius.
    """
    d = np.asarray(deviations, dtype=float)
    lengths = np.linalg.norm(d - d.mean(axis=0), axis=1)
    return float(lengths.mean() + 3 * lengths.std(ddof=1))


def orientation_accuracy(angles: ArrayLike) -> NDArray:
    """AP_a, AP_b, AP_c (3,) [rad]: mean attained less commanded angle about each axis.

    Args:
        angles: (n, 3) [rad] attained less commanded.

    Returns:
        The differences, with their signs.
    """
    return np.mean(np.asarray(angles, dtype=float), axis=0)


def orientation_repeatability(angles: ArrayLike) -> NDArray:
    """Return RP_a, RP_b, RP_c (3,) [rad]: three standard deviations of each angle.

    Args:
        angles: (n, 3) [rad] attained less commanded, n >= 2.

    Returns:
        Half the widths.
    """
    return 3 * np.std(np.asarray(angles, dtype=float), axis=0, ddof=1)


def distance_accuracy(
    first: ArrayLike, second: ArrayLike, commanded: float
) -> tuple[float, float]:
    """Return AD_P and RD [m] of the distance between two positions.

    Args:
        first: (n, 3) [m] attained, cycle by cycle.
        second: (n, 3) [m] likewise, n >= 2.
        commanded: [m] the distance asked for.

    Returns:
        Mean attained less commanded distance, and three standard deviations of it.
    """
    lengths = np.linalg.norm(np.asarray(first) - np.asarray(second), axis=1)
    return float(lengths.mean() - commanded), float(3 * lengths.std(ddof=1))


def accuracy_drift(deviations: ArrayLike, cycles: int = DRIFT_CYCLES) -> float | None:
    """dAP_P [m]: largest change of AP_P from the first block of cycles to a later one.

    Args:
        deviations: (n, 3) [m] attained less commanded, in the order measured.
        cycles: of a block; what is left over at the end is not looked at.

    Returns:
        The change, None with fewer than two blocks.
    """
    d = np.asarray(deviations, dtype=float)
    count = len(d) // cycles
    if count < 2:
        return None
    accuracy = [
        position_accuracy(block) for block in np.split(d[: count * cycles], count)
    ]
    return float(max(abs(value - accuracy[0]) for value in accuracy[1:]))
