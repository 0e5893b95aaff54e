"""What a sample of draws says, each number with its confidence interval.

Intervals of probabilities are Clopper's and Pearson's, exact for any number of draws;
those of quantiles are order statistics, which ask nothing of the distribution; those
of means and of the most probable value come from the central limit and the bootstrap.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage, stats

from assembly.zone import ASSEMBLABLE
from stiffness.reading import BadInput

if TYPE_CHECKING:
    import xarray

QUANTILES = (0.05, 0.5, 0.95, 0.99)
_BINS, _RESAMPLES = 1024, 200
_ROUNDING = 1e-18  # of the largest value: nothing


def proportion(successes: int, count: int, level: float = 0.95) -> dict[str, float]:
    """Probability of success with its Clopper-Pearson interval.

    Args:
        successes: of ``count`` independent trials.
        count: > 0.
        level: of confidence; the interval holds the truth at least so often.

    Returns:
        ``probability``, ``lower``, ``upper``.
    """
    interval = stats.binomtest(successes, count).proportion_ci(level, method="exact")
    return {
        "probability": successes / count,
        "lower": float(interval.low), "upper": float(interval.high),
    }  # fmt: skip


def quantile(values: ArrayLike, share: float, level: float = 0.95) -> dict[str, float]:
    """A quantile with its interval by order statistics.

    Args:
        values: (k,) a sample.
        share: of the distribution below it, in (0, 1).
        level: of confidence.

    Returns:
        ``value``, ``lower``, ``upper``; infinite where the sample is too small.
    """
    x = np.sort(np.asarray(values, dtype=float))
    count = len(x)
    low, high = stats.binom.ppf([(1 - level) / 2, (1 + level) / 2], count, share)
    # at most low - 1 values below it has probability < (1 - level)/2, and so on
    below, above = int(low) - 1, int(high)
    return {
        "value": float(np.quantile(x, share)),
        "lower": float(x[below]) if below >= 0 else -np.inf,
        "upper": float(x[above]) if above < count else np.inf,
    }


def mean(values: ArrayLike, level: float = 0.95) -> dict[str, float]:
    """A mean with its interval by the central limit theorem.

    Args:
        values: (k,) a sample, k > 1.
        level: of confidence.

    Returns:
        ``value``, ``lower``, ``upper``, ``deviation`` of one draw.
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
    """Where the density of a sample is highest, with a bootstrap interval.

    The density is a Gaussian kernel's of Silverman's width, on 1024 bins.

    Args:
        values: (k,) a sample.
        level: of confidence.
        positive: sizes: the kernel is reflected at zero, below which nothing is.
        seed: of the bootstrap.

    Returns:
        ``value``, ``lower``, ``upper``.

    Sources:
        Silverman (1986), Density Estimation for Statistics and Data Analysis, 3.4.2.
    """
    x = np.asarray(values, dtype=float)
    spread = float(np.quantile(x, 0.75) - np.quantile(x, 0.25)) / 1.349
    scale = min(float(x.std()), spread) or float(x.std())
    if scale <= 1e-12 * np.abs(x).max():  # all the same, but for rounding
        return dict.fromkeys(("value", "lower", "upper"), float(x[0]))
    # a long tail must not widen the bins: the density is not highest so far out
    ends = np.quantile(x, [0.25, 0.75]) + np.array([-8.0, 8.0]) * scale
    low = 0.0 if positive else max(float(x.min()) - 4 * scale, float(ends[0]))
    high = min(float(x.max()) + 4 * scale, float(ends[1]))
    counts, edges = np.histogram(x, _BINS, (low, high))
    step = edges[1] - edges[0]
    width = 0.9 * scale * len(x) ** -0.2 / step
    rng = np.random.default_rng(seed)
    tables = rng.multinomial(int(counts.sum()), counts / counts.sum(), _RESAMPLES)
    modes = [_mode(table, width, positive) for table in (counts, *tables)]
    at = edges[0] + (np.array(modes) + 0.5) * step
    lower, upper = np.quantile(at[1:], [(1 - level) / 2, (1 + level) / 2])
    return {"value": float(at[0]), "lower": float(lower), "upper": float(upper)}


def _mode(counts: NDArray, width: float, positive: bool) -> float:
    """Bin where the smoothed counts are largest, between bins by a parabola."""
    edge = "reflect" if positive else "constant"
    density = ndimage.gaussian_filter1d(counts.astype(float), width, mode=edge)
    i = int(density.argmax())
    if not 0 < i < len(density) - 1:
        return float(i)
    a, b, c = density[i - 1 : i + 2]
    return i + float((a - c) / (2 * (a - 2 * b + c)))


def summarise(
    data: "xarray.Dataset",
    limits: Mapping[str, float] | None = None,
    strength: float | None = None,
    level: float = 0.95,
) -> dict[str, Any]:
    """What the draws of :func:`assembly.statistics.monte_carlo.run_draws` say.

    Args:
        data: the draws.
        limits: by quantity; a draw meets them if none is exceeded.
        strength: [Pa] yield strength of the links.
        level: of confidence of all intervals.

    Returns:
        ``assembles`` (with any energy, rigidly in both readings), ``exceeds`` and
        ``within_limits`` with the probabilities; mean, quantiles and most probable
        value of every quantity; mean, covariance and most probable platform screw.

    Raises:
        BadInput: a limit's quantity was not computed.
    """
    limits = dict(limits or {})
    count = data.sizes["draw"]
    solved = data["status"].values == 0
    report: dict[str, Any] = {
        "draws": count, "confidence": level,
        "assembles": {"forced": proportion(int(solved.sum()), count, level)},
        "duality_gap": float(np.nanmax(data["duality_gap"].values, initial=0.0)),
    }  # fmt: skip
    for key, name in (("margin", "rigid"), ("margin_free", "rigid_compliant_free")):
        if key in data:
            inside = int((data[key].values <= ASSEMBLABLE).sum())
            report["assembles"][name] = proportion(inside, count, level)
    if strength is not None:
        limits.setdefault("stress", strength)
    met, exceeds = solved.copy(), {}
    for key, limit in limits.items():
        if key not in data or not data[key].size:
            raise BadInput(f"limit {key}: not among what was computed")
        values = _worst(data, key)
        over = ~(values <= limit)
        met &= ~over
        exceeds[key] = {
            "limit": limit, "unit": _unit(data, key),
            **proportion(int(over.sum()), count, level),
        }  # fmt: skip
    report["exceeds"] = exceeds
    if limits:
        report["within_limits"] = proportion(int(met.sum()), count, level)
    report["quantities"] = {
        key: _described(_worst(data, key)[solved], _unit(data, key), level)
        for key in map(str, data)
        if data[key].dims[0] == "draw" and data[key].size
        and key not in {"status", "duality_gap", "platform_screw"}
    }  # fmt: skip
    screws = data["platform_screw"].values[solved]
    if len(screws) > 1:
        report["platform_screw"] = {
            "mean": screws.mean(axis=0),
            "covariance": np.cov(screws.T),
            "most_probable": [most_probable(part, level) for part in screws.T],
        }
    if strength is not None:
        report["safety"] = strength / np.maximum(
            data["stress"].values[solved].max(axis=0, initial=0.0), 1e-300
        )
    return report


def _worst(data: "xarray.Dataset", key: str) -> NDArray:
    """(k,) a quantity of every draw; of all links the most stressed."""
    values = np.asarray(data[key].values, dtype=float)
    return values.max(axis=1) if values.ndim == 2 else values


def _unit(data: "xarray.Dataset", key: str) -> str:
    """Unit of a quantity."""
    return str(data[key].attrs.get("units", "1"))


def _described(values: NDArray, unit: str, level: float) -> dict[str, Any]:
    """Mean, quantiles and most probable value of sizes, 0 if that is half of them."""
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return {}
    # what fits by play alone stores nothing: a point of its own, up to rounding
    zero = finite <= _ROUNDING * finite.max()
    often = dict.fromkeys(("value", "lower", "upper"), 0.0)
    if zero.sum() <= len(finite) / 2:
        often = most_probable(finite[~zero], level, positive=True)
    return {
        "unit": unit,
        "zero": proportion(int(zero.sum()), len(finite), level),
        "mean": mean(finite, level),
        "quantiles": {str(q): quantile(values, q, level) for q in QUANTILES},
        "most_probable": often,
    }


def summary_text(summary: Mapping[str, Any]) -> str:
    """What :func:`summarise` says, for people."""

    def share(found: Mapping[str, float]) -> str:
        low, high = found["lower"], found["upper"]
        return f"{found['probability']:.5g} ({low:.5g} to {high:.5g})"

    def named(value: float, found: Mapping[str, Any]) -> str:
        unit = found["unit"]
        return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"

    lines = [
        f"{summary['draws']} draws; in brackets {summary['confidence']:.0%} intervals"
    ]
    words = {
        "forced": "goes together, by force if need be",
        "rigid": "goes together by play alone, compliant joints rigid",
        "rigid_compliant_free": "goes together by play alone, compliant joints free",
    }
    for key, found in summary["assembles"].items():
        lines.append(f"{words[key]}: {share(found)}")
    for key, found in summary["exceeds"].items():
        lines.append(f"{key} above {named(found['limit'], found)}: {share(found)}")
    if "within_limits" in summary:
        lines.append(f"yield, all limits met: {share(summary['within_limits'])}")
    for key, found in summary["quantities"].items():
        if not found:
            continue
        often, half = found["most_probable"], found["quantiles"]["0.5"]
        high = found["quantiles"]["0.95"]
        lines.append(
            f"{key}: most probable {named(often['value'], found)}, median "
            f"{half['value']:.4g} ({half['lower']:.4g} to {half['upper']:.4g}), 95 % "
            f"below {high['value']:.4g} ({high['lower']:.4g} to {high['upper']:.4g})"
        )
    return "\n".join(lines)
