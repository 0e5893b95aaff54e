"""Summary of random draws: yields, quantiles and most probable values.

Yields refer to all draws. Energies, wrenches and pose errors are defined only for draws
that can be assembled. Margins are defined for all draws.
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.zone import ASSEMBLABLE
from forcefit.assembly.statistics.capability import capability_text, draws_capability
from forcefit.assembly.statistics.clearance_positions import clearance_means
from forcefit.assembly.statistics.estimates import (
    bracketed,
    mean,
    most_probable,
    proportion,
    quantile,
)
from forcefit.assembly.statistics.importance_table import (
    importance_report,
    importance_text,
)
from forcefit.assembly.statistics.perfect_parts import limits_broken, perfect_text
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.ranking import ranked, shares_sentence
from forcefit.assembly.statistics.stiffness_spread import (
    stiffness_report,
    stiffness_spread_text,
)
from forcefit.inputs.table import BadInput

if TYPE_CHECKING:
    import xarray

QUANTILES = (0.05, 0.5, 0.95, 0.99)
_ROUNDING = 1e-18  # energies below this fraction of the maximum are treated as zero
_MARGINS = {"margin": "rigid", "margin_free": "rigid_compliant_free"}
WORDS = {
    "forced": "assembles, by force if necessary",
    "rigid": "assembles by clearances alone, compliant joints rigid",
    "rigid_compliant_free": "assembles by clearances alone, compliant joints free",
}


def summarise(
    data: "xarray.Dataset",
    limits: Mapping[str, float] | None = None,
    strength: float | None = None,
    level: float = 0.95,
    capable: bool = False,
) -> dict[str, Any]:
    """Summarise draws from :func:`.monte_carlo.run_draws`.

    Args:
        data: the draws.
        limits: limits by quantity.
        strength: [Pa] yield strength of the links.
        level: confidence level of all intervals.
        capable: whether Cp, Cpk and parts per million are computed for every limit.

    Returns:
        Dictionary with the number of ``draws`` and of ``assembled`` draws; the
        clearance model and ``contact_length`` [m]; the probabilities that a draw
        ``assembles``, ``exceeds`` each limit, and is ``within_limits``; results for
        ``perfect_parts``; mean, quantiles and most probable value of each quantity over
        assembled draws; mean, covariance and most probable value of the platform screw.

    Raises:
        BadInput: a limited quantity was not computed.
    """
    limits = dict(limits or {})
    if strength is not None:
        limits.setdefault("stress", strength)
    count, clearance = data.sizes["draw"], str(data.attrs["clearance"])
    length = data.attrs.get("contact_length")
    solved = data["status"].values == 0
    report: dict[str, Any] = {
        "draws": count, "assembled": int(solved.sum()), "confidence": level,
        "clearance": clearance, "clearance_means": clearance_means(clearance, length),
        "contact_length": length,
        "assembles": {"forced": proportion(int(solved.sum()), count, level)},
        "duality_gap": float(np.nanmax(data["duality_gap"].values, initial=0.0)),
    }  # fmt: skip
    for key, name in _MARGINS.items():
        if key in data:
            inside = int((data[key].values <= ASSEMBLABLE).sum())
            report["assembles"][name] = proportion(inside, count, level)
    if "clearance_mixed" in data:
        unmixed = int((data["clearance_mixed"].values[solved] == 0).sum())
        report["clearance_not_mixed"] = unmixed
    report |= _yields(data, solved, limits, level)
    report["perfect_parts"] = json.loads(data.attrs.get("perfect_parts", "{}"))
    report["perfect_parts_break"] = limits_broken(report["perfect_parts"], limits)
    report["quantities"] = {
        key: _described(data, key, solved, level)
        for key in UNITS
        if key in data and data[key].dims[0] == "draw" and data[key].size
        and key not in {"duality_gap", "platform_screw"} and not key.endswith("_lower")
    }  # fmt: skip
    screws = data["platform_screw"].values[solved]
    screws = screws[np.isfinite(screws).all(axis=1)]
    if len(screws) > 1:
        report["platform_screw"] = {
            "clearance": "least" if clearance == "worst" else clearance,
            "draws": len(screws),
            "mean": screws.mean(axis=0), "covariance": np.cov(screws.T),
            "most_probable": [most_probable(part, level) for part in screws.T],
        }  # fmt: skip
    if strength is not None:
        largest = data["stress"].values[solved].max(axis=0, initial=0.0)
        with np.errstate(divide="ignore"):  # the safety is inf for zero stress
            report["safety"] = strength / largest
        errors = data["stress"].attrs.get("estimated_relative_error")
        if errors is not None:
            report["stress_error"] = np.atleast_1d(errors)
    if "stiffness" in data:
        report["stiffness"] = stiffness_report(
            data["stiffness"].values[solved],
            data["free_motion"].values[solved],
            str(data.attrs["stiffness"]),
            level,
        )
    if capable:
        report["capability"] = {
            key: draws_capability(_worst(data, key), one, level)
            for key, one in report["exceeds"].items()
        }
    if "total_index" in data:
        report["importance"] = importance_report(data)
    return report


def _yields(
    data: "xarray.Dataset", solved: NDArray, limits: Mapping[str, float], level: float
) -> dict[str, Any]:
    """Estimate the probability that each limit is exceeded, and the yield."""
    count = len(solved)
    met, failed, exceeds = solved.copy(), ~solved, {}
    for key, limit in limits.items():
        if key not in data or not data[key].size:
            raise BadInput(
                f"limit {key}: found a quantity that was not computed; expected "
                "one of the computed quantities"
            )
        values, lower = _worst(data, key), f"{key}_lower"
        over = ~(values <= limit)
        # The largest pose errors are known by a lower and an upper bound.
        least = data[lower].values if lower in data else values
        surely = ~solved | (least > limit)
        met &= ~over
        failed |= surely
        exceeds[key] = {
            "limit": limit, "unit": UNITS[key],
            **bracketed(int(surely.sum()), int((~over).sum()), count, level),
        }  # fmt: skip
        if key in POSE_ERRORS:
            exceeds[key]["clearance"] = data.attrs["clearance"]
    report: dict[str, Any] = {"exceeds": exceeds}
    if limits:
        within = bracketed(int(met.sum()), int(failed.sum()), count, level)
        report["within_limits"] = within
        if set(POSE_ERRORS) & set(limits):
            within["clearance"] = data.attrs["clearance"]
    return report


def _worst(data: "xarray.Dataset", key: str) -> NDArray:
    """Return the values of a quantity, or their maxima over all links, (k,)."""
    values = np.asarray(data[key].values, dtype=float)
    return values.max(axis=1) if values.ndim == 2 else values


def _described(
    data: "xarray.Dataset", key: str, solved: NDArray, level: float
) -> dict[str, Any]:
    """Compute mean, quantiles and most probable value of a quantity."""
    every = _worst(data, key)
    values = every[solved]
    finite = values[np.isfinite(values)]
    description: dict[str, Any] = {
        "unit": UNITS[key], "of": len(every), "assembled": int(solved.sum()),
        "draws": len(finite),
    }  # fmt: skip
    if key in POSE_ERRORS:
        description["clearance"] = str(data.attrs["clearance"])
    if key in _MARGINS:
        every = np.where(np.isnan(every), np.inf, every)
        description["all_draws"] = {
            "infinite": proportion(int(np.isinf(every).sum()), len(every), level),
            "quantiles": {str(q): quantile(every, q, level) for q in QUANTILES},
        }
    if len(finite) < 2:
        return description
    # Inside an assembly zone, the energy is zero except for round-off errors.
    zero = finite <= _ROUNDING * finite.max()
    often = dict.fromkeys(("value", "lower", "upper"), 0.0)
    if zero.sum() <= len(finite) / 2:
        often = most_probable(finite[~zero], level, positive=True)
    return description | {
        "zero": proportion(int(zero.sum()), len(finite), level),
        "mean": mean(finite, level),
        "quantiles": {str(q): quantile(finite, q, level) for q in QUANTILES},
        "most_probable": often,
    }


def summary_text(summary: Mapping[str, Any]) -> str:
    """Format the results of :func:`summarise` as text."""
    draws, assembled = summary["draws"], summary["assembled"]
    lines = [
        f"{draws} draws; in brackets: {summary['confidence']:.0%} confidence intervals",
        f"pose errors: clearance {summary['clearance']}: {summary['clearance_means']}",
    ]
    if summary["clearance"] == "contact" and not summary.get("load"):
        lines.append(
            "the positions within the clearances depend on the contact length; if the "
            "service load is known, specify it with --load"
        )
    if summary.get("clearance_not_mixed"):
        lines.append(
            f"warning: in {summary['clearance_not_mixed']} draws, the random walk of "
            "the uniform model did not mix, so the variation of these pose errors is "
            "underestimated"
        )
    lines += [f"{WORDS[k]}: {_share(v)}" for k, v in summary["assembles"].items()]
    for key, results in summary["exceeds"].items():
        limit = _named(results["limit"], results["unit"])
        lines.append(f"{_titled(key, results)} above {limit}: {_share(results)}")
    if "within_limits" in summary:
        results = summary["within_limits"]
        lines.append(f"{_titled('yield', results)}, all limits met: {_share(results)}")
    if "capability" in summary:
        lines.append(capability_text(summary["capability"]))
    lines += perfect_text(summary)
    lines.append(f"of the {assembled} of {draws} draws that assemble:")
    if not assembled:
        lines[-1] += " no results"
    for key, results in summary["quantities"].items():
        if "mean" in results:
            often = _named(results["most_probable"]["value"], results["unit"])
            lines.append(
                f"  {_titled(key, results)}: most probable {often}, "
                f"{_quantiles_text(results['quantiles'])}"
            )
    lines += [
        f"{key} of all {draws} draws: "
        f"{_quantiles_text(results['all_draws']['quantiles'])}"
        for key, results in summary["quantities"].items() if "all_draws" in results
    ]  # fmt: skip
    if "stiffness" in summary:
        lines.append(stiffness_spread_text(summary["stiffness"]))
    if "importance" in summary:
        lines.append(importance_text(summary["importance"]))
        if shares := ranked(summary, "translation"):
            lines.append(shares_sentence(shares, "translation"))
    if "worst_case" in summary:
        from forcefit.assembly.statistics.worst_pose_report import worst_text

        lines.append(worst_text(summary["worst_case"]))
    return "\n".join(lines)


def _titled(name: str, results: Mapping[str, Any]) -> str:
    """Return the name of a quantity, followed by any clearance model."""
    return (
        f"{name} [clearance {results['clearance']}]" if "clearance" in results else name
    )


def _share(interval: Mapping[str, float]) -> str:
    """Format a probability and its confidence interval as text."""
    low, high = interval["lower"], interval["upper"]
    text = f"{interval['probability']:.5g} ({low:.5g} to {high:.5g})"
    undecided = interval.get("undecided", 0)
    return text + (f", {undecided} draws undecided" if undecided else "")


def _named(value: float, unit: str) -> str:
    """Format a number and its unit as text."""
    return f"{value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def _quantiles_text(quantiles: Mapping[str, Mapping[str, float]]) -> str:
    """Format the median and the 95 % quantile as text."""
    half, high = quantiles["0.5"], quantiles["0.95"]
    return (
        f"median {half['value']:.4g} ({half['lower']:.4g} to {half['upper']:.4g}), "
        f"95 % below {high['value']:.4g} ({high['lower']:.4g} to {high['upper']:.4g})"
    )
