"""Process capability indices Cp and Cpk, and parts per million outside the limits.

Functions for normal data accept one or two limits. Functions for draws from other
distributions require an upper limit.

Sources:
    Rodriguez (1992), Recent developments in process capability analysis, J. Quality
    Technology 24 (approximate interval of Cpk).
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2, nct, norm

from forcefit.assembly.statistics.estimates import quantile

_TAIL = 0.99865  # probability below mean + 3 sigma of a normal distribution


@dataclass(frozen=True)
class Capability:
    """Capability indices of a sample from a normal distribution.

    Attributes:
        cp: value and confidence bounds (lower, upper); NaN unless there are two limits.
        cpk: value and confidence bounds (lower, upper).
        share_outside: estimated probability that a value is outside the limits.
    """

    cp: tuple[float, float, float]
    cpk: tuple[float, float, float]
    share_outside: float


def capability(
    values: ArrayLike, lower: float, upper: float, level: float = 0.95
) -> Capability:
    """Compute Cp and Cpk of normal data.

    Args:
        values: (n,) sample of a normal distribution, n > 1.
        lower: lower limit; -inf if there is none.
        upper: upper limit; inf if there is none.
        level: confidence level of the intervals.

    Returns:
        The indices for the sample standard deviation (divisor n - 1).

    Raises:
        ValueError: there are fewer than two values, no limit, or only equal values.
    """
    x = np.asarray(values, dtype=float)
    if len(x) < 2 or not lower < upper or not np.isfinite([lower, upper]).any():
        raise ValueError(
            "capability: expected at least two values, and a lower or an upper limit "
            "with lower < upper"
        )
    mean, sigma = float(x.mean()), float(x.std(ddof=1))
    if sigma == 0:
        raise ValueError("capability: found values that do not vary")
    sides = (upper - mean) / (3 * sigma), (mean - lower) / (3 * sigma)
    cp, cpk = (upper - lower) / (6 * sigma), min(sides)
    one = not np.isfinite([lower, upper]).all()
    within = cpk_interval_one_sided if one else cpk_interval
    return Capability(
        (cp, *cp_interval(cp, len(x), level)) if not one else (np.nan,) * 3,
        (cpk, *within(cpk, len(x), level)), share_outside(*sides),
    )  # fmt: skip


def share_outside(cpk_upper: float, cpk_lower: float) -> float:
    """Return the probability that a normal variable is outside its limits."""
    return float(norm.sf(3 * cpk_upper) + norm.sf(3 * cpk_lower))


def cp_interval(cp: float, n: int, level: float = 0.95) -> tuple[float, float]:
    """Return the exact confidence interval of Cp for n normal values."""
    tails = chi2.ppf([(1 - level) / 2, (1 + level) / 2], n - 1)
    low, high = cp * np.sqrt(tails / (n - 1))
    return float(low), float(high)


def cpk_interval(cpk: float, n: int, level: float = 0.95) -> tuple[float, float]:
    """Return the approximate confidence interval of Cpk for two limits."""
    half = norm.ppf((1 + level) / 2) * np.sqrt(1 / (9 * n) + cpk**2 / (2 * (n - 1)))
    return float(cpk - half), float(cpk + half)


def cpk_interval_one_sided(
    cpk: float, n: int, level: float = 0.95
) -> tuple[float, float]:
    """Return the exact confidence interval of Cpk for one limit."""
    from scipy.optimize import brentq

    # For a sample, 3 sqrt(n) Cpk has a noncentral t distribution with noncentrality 3
    # sqrt(n) times the true Cpk.
    t, root = 3 * np.sqrt(n) * cpk, 3 * np.sqrt(n)
    low, high = cpk_interval(cpk, n, 1 - (1 - level) / 100)

    def solve(probability: float) -> float:
        def excess(delta: float) -> float:
            return float(nct.cdf(t, n - 1, delta)) - probability

        return float(brentq(excess, root * low, root * high))

    return solve((1 + level) / 2) / root, solve((1 - level) / 2) / root


def quantile_cpk(
    values: ArrayLike, limit: float, level: float = 0.95
) -> tuple[float, float, float]:
    """Compute Cpk of draws from any distribution with an upper limit.

    Cpk is (limit - median) / (99.865 % quantile - median), which equals the usual index
    for a normal distribution.

    Args:
        values: (k,) draws; inf for a draw without a solution.
        limit: upper limit.
        level: confidence level of the interval, which is based on order statistics and
            valid for any distribution.

    Returns:
        Value, lower and upper bound; a bound is 0 if there are too few draws.
    """
    each = (1 + level) / 2
    middle, tail = (quantile(values, share, each) for share in (0.5, _TAIL))

    def index(m: float, q: float) -> float:
        if not np.isfinite(m) or m == -np.inf:
            return float("nan")
        return (limit - m) / (q - m) if q > m else float("inf")

    ends = itertools.product(("lower", "upper"), repeat=2)
    corners = [index(middle[a], tail[b]) for a, b in ends]
    return index(middle["value"], tail["value"]), min(corners), max(corners)


def quantile_cp(
    values: ArrayLike, limit: float, level: float = 0.95
) -> tuple[float, float, float]:
    """Compute Cp of magnitudes, which lie between zero and an upper limit.

    Cp is limit / (99.865 % quantile - 0.135 % quantile). For a normal distribution
    between the limits zero and ``limit`` this equals the usual index.

    Args:
        values: (k,) draws; inf for a draw without a solution.
        limit: upper limit.
        level: confidence level as for :func:`quantile_cpk`.

    Returns:
        Value, lower and upper bound; a bound is 0 if there are too few draws.
    """
    each = (1 + level) / 2
    low, tail = (quantile(values, share, each) for share in (1 - _TAIL, _TAIL))

    def index(a: float, b: float) -> float:
        return limit / (b - max(a, 0.0)) if b > max(a, 0.0) else float("inf")

    ends = itertools.product(("lower", "upper"), repeat=2)
    corners = [index(low[a], tail[b]) for a, b in ends]
    return index(low["value"], tail["value"]), min(corners), max(corners)


def draws_capability(
    values: ArrayLike, exceeds: Mapping[str, Any], level: float = 0.95
) -> dict[str, Any]:
    """Compute Cp, Cpk and the number of draws above a limit in parts per million.

    Args:
        values: (k,) draws; NaN for a draw without a solution, which exceeds the limit.
        exceeds: dictionary with ``limit``, its ``unit``, the ``probability`` that the
            limit is exceeded, and its confidence bounds ``lower`` and ``upper``.
        level: confidence level of the intervals.

    Returns:
        ``limit``, ``unit``, and ``cp``, ``cpk`` and ``ppm`` with value, lower and upper
        bound; for ``cp`` see :func:`quantile_cp`.
    """
    values = np.where(np.isnan(values), np.inf, values)
    words, limit = ("value", "lower", "upper"), exceeds["limit"]
    ppm = [1e6 * exceeds[k] for k in ("probability", "lower", "upper")]
    cp, cpk = (index(values, limit, level) for index in (quantile_cp, quantile_cpk))
    return {
        "limit": limit, "unit": exceeds["unit"],
        "cp": dict(zip(words, cp, strict=True)),
        "cpk": dict(zip(words, cpk, strict=True)),
        "ppm": dict(zip(words, ppm, strict=True)),
    }  # fmt: skip


def capability_text(results: Mapping[str, Any]) -> str:
    """Format the capability of draws as text, with one line per quantity."""

    def index(one: Mapping[str, float]) -> str:
        # dividing by an infinite (unknown) width of the distribution may give -0.0
        value, low, high = (one[key] + 0.0 for key in ("value", "lower", "upper"))
        return f"{value:.3g} ({low:.3g} to {high:.3g})"

    return "\n".join(
        f"{key} up to {one['limit']:.4g} {one['unit']}: Cp {index(one['cp'])} and Cpk "
        f"{index(one['cpk'])} by quantiles, "
        f"{one['ppm']['value']:.4g} ppm above ({one['ppm']['lower']:.4g} to "
        f"{one['ppm']['upper']:.4g})"
        for key, one in results.items()
    )
