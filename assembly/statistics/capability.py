"""Capability of a normal quantity within two limits: Cp, Cpk, share outside.

Sources:
    Rodriguez (1992), Recent developments in process capability analysis, J. Quality
    Technology 24 (approximate interval of Cpk).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2, nct, norm


@dataclass(frozen=True)
class Capability:
    """Indices of a sample, each with its interval.

    Attributes:
        cp: value, lower, upper; NaN without two limits.
        cpk: value, lower, upper.
        share_outside: of the normal distribution of the sample's mean and deviation.
    """

    cp: tuple[float, float, float]
    cpk: tuple[float, float, float]
    share_outside: float


def capability(
    values: ArrayLike, lower: float, upper: float, level: float = 0.95
) -> Capability:
    """Return Cp and Cpk of normal data.

    Args:
        values: (n,) n > 1, of a normal distribution.
        lower: lower limit, -inf for none.
        upper: upper limit, inf for none.
        level: confidence of the intervals.

    Returns:
        The indices, with the sample's standard deviation (n - 1).

    Raises:
        ValueError: fewer than two values, no limit, or values that do not vary.
    """
    x = np.asarray(values, dtype=float)
    if len(x) < 2 or not lower < upper or not np.isfinite([lower, upper]).any():
        raise ValueError("capability needs two values and a limit, lower < upper")
    mean, sigma = float(x.mean()), float(x.std(ddof=1))
    if sigma == 0:
        raise ValueError("capability of values that do not vary")
    sides = (upper - mean) / (3 * sigma), (mean - lower) / (3 * sigma)
    cp, cpk = (upper - lower) / (6 * sigma), min(sides)
    one = not np.isfinite([lower, upper]).all()
    within = cpk_interval_one_sided if one else cpk_interval
    return Capability(
        (cp, *cp_interval(cp, len(x), level)) if not one else (np.nan,) * 3,
        (cpk, *within(cpk, len(x), level)), share_outside(*sides),
    )  # fmt: skip


def share_outside(cpk_upper: float, cpk_lower: float) -> float:
    """Return the share of a normal distribution outside its limits."""
    return float(norm.sf(3 * cpk_upper) + norm.sf(3 * cpk_lower))


def cp_interval(cp: float, n: int, level: float = 0.95) -> tuple[float, float]:
    """Return the interval of Cp, exact for n normal values."""
    tails = chi2.ppf([(1 - level) / 2, (1 + level) / 2], n - 1)
    low, high = cp * np.sqrt(tails / (n - 1))
    return float(low), float(high)


def cpk_interval(cpk: float, n: int, level: float = 0.95) -> tuple[float, float]:
    """Return the approximate interval of Cpk, for two limits."""
    half = norm.ppf((1 + level) / 2) * np.sqrt(1 / (9 * n) + cpk**2 / (2 * (n - 1)))
    return float(cpk - half), float(cpk + half)


def cpk_interval_one_sided(
    cpk: float, n: int, level: float = 0.95
) -> tuple[float, float]:
    """Return the interval of Cpk for one limit, exact by the noncentral t."""
    from scipy.optimize import brentq

    # 3 sqrt(n) Cpk of the sample is a noncentral t with 3 sqrt(n) times the true one
    t, root = 3 * np.sqrt(n) * cpk, 3 * np.sqrt(n)
    low, high = cpk_interval(cpk, n, 1 - (1 - level) / 100)

    def solve(probability: float) -> float:
        def excess(delta: float) -> float:
            return float(nct.cdf(t, n - 1, delta)) - probability

        return float(brentq(excess, root * low, root * high))

    return solve((1 + level) / 2) / root, solve((1 - level) / 2) / root
