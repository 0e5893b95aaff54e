"""Point estimates with confidence intervals for random samples.

Intervals of probabilities are Clopper-Pearson intervals. Intervals of quantiles are
based on order statistics, those of means on the central limit theorem, and those of the
most probable value on the bootstrap.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft, stats

_BINS, _RESAMPLES = 1024, 200


def proportion(successes: int, count: int, level: float = 0.95) -> dict[str, float]:
    """Estimate a probability of success with its Clopper-Pearson interval.

    Args:
        successes: number of successes in ``count`` independent trials.
        count: number of trials, > 0.
        level: confidence level; the probability that the interval contains the true
            value is at least as large.

    Returns:
        ``probability``, ``lower``, ``upper``.
    """
    interval = stats.binomtest(successes, count).proportion_ci(level, method="exact")
    return {
        "probability": successes / count,
        "lower": float(interval.low), "upper": float(interval.high),
    }  # fmt: skip


def bracketed(
    holds: int, fails: int, count: int, level: float = 0.95
) -> dict[str, float]:
    """Estimate a probability of success when the outcome of some trials is unknown.

    Args:
        holds: number of certain successes in ``count`` independent trials.
        fails: number of certain failures.
        count: number of trials, > 0.
        level: confidence level, which is valid for every outcome of undecided trials.

    Returns:
        ``probability`` of a certain success, ``lower`` and ``upper`` bound on the
        probability of success, and number of ``undecided`` trials.
    """
    surely = proportion(holds, count, level)
    perhaps = proportion(count - fails, count, level)
    return surely | {"upper": perhaps["upper"], "undecided": count - holds - fails}


def quantile(values: ArrayLike, share: float, level: float = 0.95) -> dict[str, float]:
    """Estimate a quantile, with a confidence interval from order statistics.

    Args:
        values: (k,) a sample.
        share: probability below the quantile, in (0, 1).
        level: confidence level.

    Returns:
        ``value``, ``lower``, ``upper``. A bound is infinite if the sample is too small
        for it.
    """
    x = np.sort(np.asarray(values, dtype=float))
    count = len(x)
    # Interpolation between infinite values is not possible.
    way: Literal["linear", "higher"] = "linear" if np.isfinite(x).all() else "higher"
    low, high = stats.binom.ppf([(1 - level) / 2, (1 + level) / 2], count, share)
    # The quantile is outside each bound with a probability below (1 - level) / 2.
    below, above = int(low) - 1, int(high)
    return {
        "value": float(np.quantile(x, share, method=way)),
        "lower": float(x[below]) if below >= 0 else -np.inf,
        "upper": float(x[above]) if above < count else np.inf,
    }


def mean(values: ArrayLike, level: float = 0.95) -> dict[str, float]:
    """Estimate a mean, with a confidence interval from the central limit theorem.

    Args:
        values: (k,) a sample, k > 1.
        level: confidence level.

    Returns:
        ``value``, ``lower``, ``upper``, and the standard ``deviation`` of the sample.
    """
    x = np.asarray(values, dtype=float)
    value, deviation = float(x.mean()), float(x.std(ddof=1))
    half = float(stats.t.ppf((1 + level) / 2, len(x) - 1)) * deviation / len(x) ** 0.5
    return {
        "value": value, "lower": value - half, "upper": value + half,
        "deviation": deviation,
    }  # fmt: skip


def most_probable(
    values: ArrayLike, level: float = 0.95, *, positive: bool = False, seed: int = 1
) -> dict[str, float]:
    """Estimate the mode of a sample's density, with a bootstrap interval.

    The density is estimated by a Gaussian kernel with Silverman's width on 1024 bins.

    Args:
        values: (k,) a sample.
        level: confidence level.
        positive: whether all values are >= 0; the density is then reflected at zero.
        seed: seed of the bootstrap.

    Returns:
        ``value``, ``lower``, ``upper``.

    Sources:
        Silverman (1986), Density Estimation for Statistics and Data Analysis, 3.4.2.
    """
    x = np.asarray(values, dtype=float)
    spread = float(np.quantile(x, 0.75) - np.quantile(x, 0.25)) / 1.349
    scale = min(float(x.std()), spread) or float(x.std())
    if scale <= 1e-12 * np.abs(x).max():  # all values are equal up to round-off
        return dict.fromkeys(("value", "lower", "upper"), float(x[0]))
    # Limit the bins to the vicinity of the quartiles.
    ends = np.quantile(x, [0.25, 0.75]) + np.array([-8.0, 8.0]) * scale
    low = 0.0 if positive else max(float(x.min()) - 4 * scale, float(ends[0]))
    high = min(float(x.max()) + 4 * scale, float(ends[1]))
    counts, edges = np.histogram(x, _BINS, (low, high))
    step = edges[1] - edges[0]
    width = 0.9 * scale * len(x) ** -0.2 / step
    rng = np.random.default_rng(seed)
    tables = rng.multinomial(int(counts.sum()), counts / counts.sum(), _RESAMPLES)
    modes = _modes(np.vstack([counts, tables]), width)
    at = edges[0] + (modes + 0.5) * step
    lower, upper = np.quantile(at[1:], [(1 - level) / 2, (1 + level) / 2])
    return {"value": float(at[0]), "lower": float(lower), "upper": float(upper)}


def _modes(counts: NDArray, width: float) -> NDArray:
    """Return the mode of each smoothed histogram, refined by a parabola."""
    # The cosine transform reflects the density at both ends.
    bins = counts.shape[1]
    decay = np.exp(-0.5 * (np.pi * np.arange(bins) / bins * width) ** 2)
    density = fft.idct(fft.dct(counts.astype(float), axis=1) * decay, axis=1)
    i = density.argmax(axis=1)
    inner = (i > 0) & (i < bins - 1)
    rows, middle = np.arange(len(i)), np.clip(i, 1, bins - 2)
    a, b, c = (density[rows, middle + k] for k in (-1, 0, 1))
    # The parabola has no maximum if the density is constant.
    with np.errstate(invalid="ignore", divide="ignore"):
        offset = (a - c) / (2 * (a - 2 * b + c))
    return np.where(inner, i + offset, i)
