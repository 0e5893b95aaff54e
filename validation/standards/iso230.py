"""Compute reversal and repeatability by the formulas of ISO 230-2.

Sources:
    ISO 230-2:2014, Test code for machine tools, part 2: determination of accuracy and
    repeatability of positioning of numerically controlled axes; clause 3 defines the
    characteristics, with coverage factor 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class AxisFigures:
    """ISO 230-2 characteristics [m or rad] of one component over m positions.

    Attributes:
        reversal: B, the largest absolute reversal.
        mean_reversal: B-bar, the signed mean reversal.
        repeatability_forward: R up, the largest repeatability in forward direction.
        repeatability_backward: R down, the largest repeatability in backward direction.
        repeatability: R, the largest bidirectional repeatability.
        systematic_deviation: E, the bidirectional systematic deviation.
        mean_deviation: M, the range of the mean bidirectional deviations.
        accuracy: A, the bidirectional accuracy.
    """

    reversal: float
    mean_reversal: float
    repeatability_forward: float
    repeatability_backward: float
    repeatability: float
    systematic_deviation: float
    mean_deviation: float
    accuracy: float


def axis_figures(
    forward: Sequence[ArrayLike], backward: Sequence[ArrayLike]
) -> AxisFigures:
    """Return the ISO 230-2 characteristics from repeated approaches to m positions.

    Args:
        forward: at least two deviations [m or rad] at each position, approached from
            below.
        backward: at least two deviations at each position, approached from above.

    Returns:
        The characteristics.
    """
    (mean_up, s_up), (mean_down, s_down) = _moments(forward), _moments(backward)
    reversal = mean_up - mean_down
    both = 2 * s_up + 2 * s_down + np.abs(reversal)
    each = np.maximum.reduce([both, 4 * s_up, 4 * s_down])
    means = np.concatenate([mean_up, mean_down])
    spread = 2 * np.concatenate([s_up, s_down])
    return AxisFigures(
        reversal=float(np.abs(reversal).max()),
        mean_reversal=float(reversal.mean()),
        repeatability_forward=float(4 * s_up.max()),
        repeatability_backward=float(4 * s_down.max()),
        repeatability=float(each.max()),
        systematic_deviation=float(np.ptp(means)),
        mean_deviation=float(np.ptp((mean_up + mean_down) / 2)),
        accuracy=float((means + spread).max() - (means - spread).min()),
    )


def _moments(positions: Sequence[ArrayLike]) -> tuple[NDArray, NDArray]:
    """Return the mean and the standard deviation at each position, (m,) each."""
    rows = [np.asarray(row, dtype=float) for row in positions]
    return np.array([r.mean() for r in rows]), np.array([r.std(ddof=1) for r in rows])
