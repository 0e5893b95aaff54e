"""Tolerances over a workspace: an assessment of present errors, and an allocation.

The part between the command and :mod:`assembly.statistics.allocation`: postures of a
grid, the errors a robot has now, results as plain values and as a data set.
"""

from collections.abc import Callable, Sequence
from hashlib import sha256
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from assembly.batch.many_margins import prepare_margins
from assembly.kinematics.posture import Posture, place_many
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.model.clearance import Compliant
from assembly.model.robot import Robot
from assembly.solvers.conic import SolverFailed
from assembly.statistics.allocation import Allocation
from assembly.statistics.clearance_positions import CLEARANCE_MODELS
from assembly.statistics.requirement import Plan
from assembly.statistics.sensitivity import energy_slopes
from assembly.sweeps.identity import program_hash, robot_hash
from assembly.sweeps.targets import goals_of, grid_targets, parse_grid
from forcefit.inputs.table import BadInput
from stiffness.screws import SCREW

if TYPE_CHECKING:
    import xarray


def grid_postures(robot: Robot, grid: str) -> list[Posture]:
    """Postures of a grid that the robot reaches.

    Args:
        robot: any.
        grid: such as ``"tx=-0.2:0.2:0.1,tz=-0.5"``.

    Returns:
        The postures, those out of reach left out.

    Raises:
        BadInput: the grid is not one, or none of it is reached.
    """
    targets = grid_targets(parse_grid(grid))
    rows = targets.at(np.arange(int(np.prod(targets.shape))))
    postures, reasons = place_many(robot, goals_of(targets.names, robot, rows))
    reached = [p for p in postures if p is not None]
    if not reached:
        raise BadInput(f"grid: no posture is reached; the first: {reasons[0]}")
    return reached


def identity_of(postures: Sequence[Posture], plan: Plan, fresh: int) -> dict[str, Any]:
    """Values that must be equal for two allocations to share stored results."""
    arrays = [p.transforms for p in postures]
    for one in (plan, plan.sources):
        arrays += [v for v in vars(one).values() if isinstance(v, np.ndarray)]
    digest = sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays))
    return {
        "robot_sha256": robot_hash(plan.sources.robot),
        "plan_and_postures_sha256": digest.hexdigest(),
        "limits": str(dict(plan.limits)),
        "cost": plan.cost,
        "play": plan.clearance_model,
        "yield": plan.asked_yield,
        "draws": plan.draws,
        "seed": plan.seed,
        "fresh": fresh,
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
    }


def present_errors(
    postures: Sequence[Posture],
    compliant: Compliant = "free",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Assess the robot's own errors: largest margin over the postures, and its causes.

    Args:
        postures: of a robot with errors.
        compliant: ``"free"`` or ``"rigid"``, reading of compliant joints.
        progress: called with postures done and their number.

    Returns:
        The largest margin and where; the factor on all errors at which it is 1; slopes
        of the margin and of the energy there, by error, the steepest first.
    """
    margins = []
    for i, posture in enumerate(postures):
        margins_there = prepare_margins(posture, compliant).solve(
            posture.robot.errors[None]
        )
        margins.append(margins_there)
        progress(i + 1, len(postures))
    values = np.array([m.margin[0] for m in margins])
    worst = int(np.nanargmax(values))
    posture, margin = postures[worst], float(values[worst])
    robot = posture.robot
    slopes = margins[worst].slopes[0]
    try:
        assembly = solve_assembly(posture)
        energy, energies = assembly.energy, energy_slopes(assembly)
    except (CannotAssemble, SolverFailed):
        energy, energies = float("nan"), np.full_like(slopes, np.nan)
    present = np.argwhere(robot.errors != 0.0)
    effect = np.array([slopes[i, c] * robot.errors[i, c] for i, c in present])
    order = np.argsort(-np.nan_to_num(effect))
    return {
        "postures": len(postures),
        "compliant": compliant,
        "largest_margin": margin,
        "at": posture.pose(),
        "factor_on_errors": 1.0 / margin if margin > 0 else float("inf"),
        "energy_there": energy,
        "assemblable_share": float(np.mean(values <= 1.0 + 1e-6)),
        "slopes": [
            {
                "error": f"{robot.frames[i].name}.{SCREW[c]}",
                "value": robot.errors[i, c],
                "margin_slope": slopes[i, c],
                "share_of_margin": float(effect[k]) / margin if margin > 0 else 0.0,
                "energy_slope": energies[i, c],
            }
            for k in order.tolist() for i, c in [present[k].tolist()]
        ],
    }  # fmt: skip


def present_text(results: dict[str, Any]) -> str:
    """The results of :func:`present_errors` for people: the five largest errors."""
    where = ", ".join(
        f"{k} = {v:.4g}" for k, v in results["at"].items() if abs(v) > 1e-9
    )
    lines = [
        f"{results['postures']} postures, {results['assemblable_share']:.1%} go "
        f"together; largest margin {results['largest_margin']:.4g} "
        f"at {where or 'the origin'}",
        f"everywhere with all errors times {results['factor_on_errors']:.4g}",
    ]
    for error in results["slopes"][:5]:
        lines.append(
            f"  {error['error']} = {error['value']:.3g} makes "
            f"{error['share_of_margin']:.1%} of that margin"
        )
    return "\n".join(lines)


def allocation_of(allocation: Allocation) -> dict[str, Any]:
    """An allocation as plain values."""
    plan = allocation.plan
    classes = [
        {
            "name": name,
            "tolerance": allocation.tolerances[g],
            "unit": _unit(allocation, g),
            "scaled_alike": allocation.uniformly_scaled[g],
            "cost": plan.costs[g],
            "loosest_allowed": plan.most[g],
            "at_loosest": bool(allocation.tolerances[g] >= plan.most[g] * (1 - 1e-3)),
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
        "play": plan.clearance_model if plan.limits_pose else None,
    }


def _unit(allocation: Allocation, group: int) -> str:
    """Unit of a class of tolerances."""
    first = int(np.flatnonzero(allocation.plan.group == group)[0])
    return "rad" if allocation.plan.sources.component[first] < 3 else "m"


def allocation_text(results: dict[str, Any]) -> str:
    """An allocation for people."""
    scales = {"rad": (1e3, "mrad"), "m": (1e3, "mm")}
    lines = []
    for one in results["tolerances"]:
        scale, unit = scales[one["unit"]]
        line = f"  {one['name']}: +-{scale * one['tolerance']:.4g} {unit}"
        lines.append(line + (" (the loosest allowed)" if one["at_loosest"] else ""))
    if results["play"]:
        lines.append(
            f"pose errors: play {results['play']}: {CLEARANCE_MODELS[results['play']]}"
        )
    lines.append(_price_text(results))
    for key, worst in results["worst"].items():
        proven = (
            f"at most {worst['proven']:.4g} proven" if np.isfinite(worst["proven"])
            else "nothing proven"
        )  # fmt: skip
        lines.append(
            f"worst {key}: {worst['found']:.4g} found, {proven}, "
            f"limit {results['limits'][key]:g}"
        )
    if np.isfinite(results["proven_scale"]):
        lines.append(f"proven when scaled by {results['proven_scale']:.4f}")
    check = results["verification"]
    if check:
        one = check["yield"]
        lines.append(
            f"{check['draws']} fresh draws at all postures: yield "
            f"{one['probability']:.4f} ({one['lower']:.4f} to {one['upper']:.4f}), "
            f"asked {results['yield']:g}: {check['verdict']}{_looks_text(check)}"
        )
    return "\n".join(lines)


def _looks_text(check: dict[str, Any]) -> str:
    """Number of looks, and the confidence of each and of all."""
    left = check["yield"]["undecided"]
    undecided = f", {left} draws undecided" if left else ""
    return (
        f" (look {check['look']} of at most {check['most_looks']}, each at "
        f"{check['confidence_of_a_look']:.2%}: {check['confidence']:.0%} for "
        f"all{undecided})"
    )


def _price_text(results: dict[str, Any]) -> str:
    """Cost of the tolerances, and its lower bound or its reduction."""
    price, alike, bound = (results[k] for k in ("price", "price_alike", "price_bound"))
    text = f"price {price:.5g}"
    if np.isfinite(bound):
        return f"{text}, no tolerances cost less than {bound:.5g}"
    if alike > price:
        text += f", {alike:.5g} with those of the convex programme scaled alike"
        if results["cost"] == "reciprocal":
            text += f": {1 - price / alike:.1%} less"
    return text


def tolerance_dataset(allocation: Allocation) -> "xarray.Dataset":
    """An allocation as a data set over ``class``."""
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
            "play": results["play"] or "",
            "verified_yield": verification["yield"]["probability"]
            if verification
            else float("nan"),
            **limits,
        },
    )
