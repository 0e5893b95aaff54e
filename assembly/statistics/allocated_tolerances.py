"""Result of a tolerance allocation, as plain values, text and a data set."""

from dataclasses import dataclass, field
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.error_distributions import KINDS
from forcefit.assembly.statistics.callout_sources import CalloutSources
from forcefit.assembly.statistics.clearance_positions import (
    clearance_means,
    contact_length_of,
)
from forcefit.assembly.statistics.quantities import UNITS
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.sweeps.identity import robot_hash
from forcefit.results.display import html_table, short_repr
from forcefit.results.text import in_unit

if TYPE_CHECKING:
    import pandas
    import xarray


_SHOWN = {"rad": "mrad", "m": "mm"}  # display units of tolerances
_SHARE_OF = {
    "reciprocal": "of the price",
    "logarithm": "of the saving by larger tolerances",
}


@dataclass(frozen=True, eq=False)
class Allocation:
    """Result of a tolerance allocation for G classes of errors.

    Attributes:
        plan: costs and limits.
        tolerances: (G,) [rad or m] tolerance of each class.
        price: cost of the tolerances.
        uniformly_scaled: (G,) [rad or m] tolerances that are proportional to the
            solution of the convex programme and satisfy all limits.
        price_uniformly_scaled: cost of ``uniformly_scaled``, at least ``price``.
        price_bound: lower bound on the minimum cost. NaN if the yield is below 1 or a
            limit is not convex.
        cuts: number of cutting planes in the convex programme.
        worst: for each limit, the largest value found at corners of the tolerance box,
            and a proven upper bound over all postures (NaN without a proof). Empty if
            the yield is below 1.
        proven_scale: common factor <= 1 on all tolerances for which the proven upper
            bounds satisfy the limits. NaN without a proof.
        verification: yields estimated from new random draws, with confidence intervals.
        perfect_parts: for each limit on a pose error, the pose error [rad or m] of a
            robot without geometric errors, and its posture.
    """

    plan: Plan
    tolerances: NDArray
    price: float
    uniformly_scaled: NDArray
    price_uniformly_scaled: float
    price_bound: float
    cuts: int
    worst: dict[str, tuple[float, float]] = field(default_factory=dict)
    proven_scale: float = float("nan")
    verification: dict[str, Any] = field(default_factory=dict)
    perfect_parts: dict[str, tuple[float, str]] = field(default_factory=dict)

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Return the tolerances as the data set that ``--output`` writes."""
        return tolerance_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the tolerances as a table with one row per class of errors."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "class")


def allocation_of(allocation: Allocation) -> dict[str, Any]:
    """Convert an allocation to a dictionary for JSON."""
    plan, shares = allocation.plan, price_shares(allocation)
    classes = [
        {
            "name": name,
            "tolerance": allocation.tolerances[g],
            "unit": _unit(allocation, g),
            "scaled_alike": allocation.uniformly_scaled[g],
            "cost": plan.costs[g],
            "share": float(shares[g]),
            "loosest_allowed": plan.most[g],
            "at_loosest": bool(allocation.tolerances[g] >= plan.most[g] * (1 - 1e-3)),
            **({"width": True} if _is_width(plan, g) else {}),
        }
        for g, name in enumerate(plan.names)
    ]
    return {
        "limits": dict(plan.limits),
        "yield": plan.asked_yield,
        "cost": plan.cost,
        "tolerances": classes,
        "price": allocation.price,
        "price_alike": allocation.price_uniformly_scaled,
        "price_bound": allocation.price_bound,
        "cuts": allocation.cuts,
        "worst": {
            k: {"found": a, "proven": b} for k, (a, b) in allocation.worst.items()
        },
        "proven_scale": allocation.proven_scale,
        "verification": allocation.verification,
        "clearance": plan.clearance if plan.limits_pose else None,
        "contact_length": _contact_length(plan),
        **_distribution(plan),
        "draws": plan.draws,
        "seed": plan.seed,
        "perfect_parts": {
            key: _taken(allocation, key, value, at)
            for key, (value, at) in allocation.perfect_parts.items()
        },
    }


def price_shares(allocation: Allocation) -> NDArray:
    """Return the share of each class in the cost that larger tolerances would save.

    The saving is the derivative of the cost with respect to the logarithm of the
    tolerance, with a minus sign. For the reciprocal cost law it is cost / tolerance.
    For the logarithmic law it is the cost coefficient.

    Args:
        allocation: result of the allocation.

    Returns:
        (G,) fractions that sum to 1.
    """
    plan = allocation.plan
    savings = plan.costs.astype(float)
    if plan.cost == "reciprocal":
        savings = savings / allocation.tolerances
    shares: NDArray = savings / savings.sum()
    return shares


def _taken(
    allocation: Allocation, key: str, reached: float, at: str
) -> dict[str, float | str]:
    """Return the pose error due to clearances, its limit, and its effect on cost."""
    plan, limit = allocation.plan, allocation.plan.limits[key]
    # The pose error is approximately the pose error due to clearances plus a term that
    # is proportional to the tolerances.
    looser = limit / (limit - reached) if reached < limit else np.inf
    without = allocation.price / looser
    if plan.cost == "logarithm":
        without = allocation.price - float(plan.costs.sum() * np.log(looser))
    return {
        "reached": reached, "limit": limit, "unit": UNITS[key], "at": at,
        "looser_without": looser, "price_without": without,
    }  # fmt: skip


def _distribution(plan: Plan) -> dict[str, Any]:
    """Return the name and the truncation of the error distribution."""
    sources = plan.sources
    own = sources.independent if isinstance(sources, CalloutSources) else sources
    kind = "as in the robot file" if own is None else KINDS[int(own.kind[0])]
    cut = float(own.limit[0]) if own is not None and kind == "truncated" else None
    return {"distribution": kind, "deviations": cut}


def _contact_length(plan: Plan) -> float | None:
    """Return the contact length [m]; None unless the clearance model is "contact"."""
    if not plan.limits_pose or plan.clearance != "contact":
        return None
    return plan.contact_length or contact_length_of(plan.sources.robot)


def _unit(allocation: Allocation, group: int) -> str:
    """Return the unit of the tolerance of a class."""
    first = int(np.flatnonzero(allocation.plan.group == group)[0])
    # The tolerance of a callout is the width of its zone, which is a length.
    return "rad" if allocation.plan.sources.units[first] == "rad" else "m"


def _is_width(plan: Plan, group: int) -> bool:
    """Return whether a tolerance is the full width of a zone, not a half width."""
    if not isinstance(plan.sources, CalloutSources):
        return False
    columns = set(np.flatnonzero(plan.group == group).tolist())
    return any(
        bool(placed.callout.widths) and bool(columns & set(of.tolist()))
        for placed, of in zip(plan.sources.placed, plan.sources.columns, strict=True)
    )


def allocation_text(results: dict[str, Any]) -> str:
    """Format an allocation as text."""
    lines = []
    for one in results["tolerances"]:
        sides = "" if one.get("width") else "+-"
        size = in_unit(one["tolerance"], _SHOWN[one["unit"]])
        line = f"  {one['name']}: {sides}{size}"
        note = "largest allowed" if one["at_loosest"] else f"{one['share']:.0%}"
        lines.append(f"{line} ({note})")
    if lines:
        lines.append(f"in brackets: share {_SHARE_OF[results['cost']]}")
    if results["clearance"]:
        means = clearance_means(results["clearance"], results["contact_length"])
        lines.append(f"pose errors: clearance {results['clearance']}: {means}")
    taken = results["perfect_parts"].items()
    lines += [_taken_text(key, one) for key, one in taken if one["reached"] > 0.0]
    lines.append(_price_text(results))
    for key, worst in results["worst"].items():
        proven = (
            f"at most {worst['proven']:.4g} proven" if np.isfinite(worst["proven"])
            else "no upper bound"
        )  # fmt: skip
        lines.append(
            f"worst {key}: {worst['found']:.4g} found, {proven}, "
            f"limit {results['limits'][key]:g}"
        )
    if np.isfinite(results["proven_scale"]):
        lines.append(
            "limits proven for all tolerances multiplied by "
            f"{results['proven_scale']:.4f}"
        )
    check = results["verification"]
    if check:
        one = check["yield"]
        lines.append(
            f"{check['draws']} new draws at all postures: yield "
            f"{one['probability']:.4f} ({one['lower']:.4f} to {one['upper']:.4f}), "
            f"required {results['yield']:g}: {check['verdict']}{_looks_text(check)}"
        )
    return "\n".join(lines)


def _taken_text(key: str, one: dict[str, Any]) -> str:
    """Format the pose error due to clearances alone as a sentence."""
    reached, limit = (
        in_unit(one[k], _SHOWN[one["unit"]]) for k in ("reached", "limit")
    )
    return (
        f"clearances alone cause {reached} of the limit of {limit} on {key} (at "
        f"{one['at']}). Without clearances, tolerances could be larger by a factor of "
        f"about {one['looser_without']:.3g}, at a cost of about "
        f"{one['price_without']:.3g}"
    )


def _looks_text(check: dict[str, Any]) -> str:
    """Format the number of verifications and their joint confidence level as text."""
    left = check["yield"]["undecided"]
    undecided = f", {left} draws undecided" if left else ""
    return (
        f" (test {check['look']} of at most {check['most_looks']}, each at "
        f"{check['confidence_of_a_look']:.2%}: {check['confidence']:.0%} for "
        f"all{undecided})"
    )


def _price_text(results: dict[str, Any]) -> str:
    """Format the cost of the tolerances and its lower bound as text."""
    price, alike, bound = (results[k] for k in ("price", "price_alike", "price_bound"))
    text = f"price {price:.5g}"
    if np.isfinite(bound):
        return f"{text}, no tolerances cost less than {bound:.5g}"
    if alike > price:
        text += (
            f", {alike:.5g} for the uniformly scaled solution of the convex programme"
        )
        if results["cost"] == "reciprocal":
            text += f": {1 - price / alike:.1%} less"
    return text


def tolerance_dataset(allocation: Allocation) -> "xarray.Dataset":
    """Convert an allocation to a data set with the dimension ``class``."""
    import xarray

    plan, results = allocation.plan, allocation_of(allocation)
    text = allocation_text(results | {"tolerances": []}).replace("\n", "; ")
    units = np.array([c["unit"] for c in results["tolerances"]])
    data = {
        "tolerance": ("class", allocation.tolerances, {"units": "rad or m, see unit"}),
        "scaled_alike": (
            "class",
            allocation.uniformly_scaled,
            {"units": "rad or m, see unit"},
        ),
        "loosest_allowed": ("class", plan.most, {"units": "rad or m, see unit"}),
        "cost": ("class", plan.costs, {"units": "1"}),
        "unit": ("class", units),
    }
    robot = plan.sources.robot
    limits = {f"limit.{key}": value for key, value in plan.limits.items()}
    verification = allocation.verification
    return xarray.Dataset(
        data,
        {"class": list(plan.names)},
        {
            "robot": robot.name,
            "robot_sha256": robot_hash(robot),
            "program": f"forcefit {version('forcefit')}",
            "seed": plan.seed,
            "yield": plan.asked_yield,
            "cost_law": plan.cost,
            "price": allocation.price,
            "price_alike": allocation.price_uniformly_scaled,
            "price_bound": allocation.price_bound,
            "said": text,
            "clearance": results["clearance"] or "",
            "verified_yield": verification["yield"]["probability"]
            if verification
            else float("nan"),
            **limits,
        },
    )
