"""Results for perfect parts, which have clearances and loads but no geometric errors.

If a robot without geometric errors exceeds a limit, no tolerances can satisfy this
limit. In the worst clearance model, the largest pose error of such a robot is a
homogeneous function of the clearances. By Euler's theorem, it is the sum of the
products of each clearance and the derivative with respect to it. These products are
reported as contributions of the clearances.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.clearance import bound_name
from forcefit.assembly.model.joint_names import clearance_name
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.ranking import kind_of
from forcefit.assembly.statistics.worst_clearance import (
    bound_worst_errors,
    worst_error_slopes,
)

# number of random clearance positions for the median
_DRAWS = 200
_PRECISION = (1e-9, 1e-9)  # [rad, m] precision of the largest pose errors
_SHARE = 1e-3  # smallest reported contribution, relative to the sum
_OWN = 0.02  # smallest reported contribution of motion limits, relative to the error
OWN_MOTION = "own motion of passive joints"
_EXCEEDED = 1e-9  # relative tolerance for the comparison with a limit


def perfect_parts(experiment: Experiment) -> dict[str, Any]:
    """Compute the results of a robot without geometric errors.

    Args:
        experiment: posture, loads and clearance model.

    Returns:
        For each quantity, ``reached`` is the value without errors; for random clearance
        models, it is the median of 200 positions. For pose errors in the worst model
        without loads, ``clearances`` contains the contribution [rad or m] of each
        clearance. The dictionary is empty if there is no solution.
    """
    random = experiment.clearance in {"uniform", "contact"}
    count = _DRAWS if random else 1
    rows = experiment.evaluate(np.zeros((count, len(experiment.sources))), range(count))
    reached: dict[str, Any] = {}
    for key in (*POSE_ERRORS, "energy", "force", "moment", "stress"):
        lower = f"{key}_lower"
        values = rows[lower if lower in (rows.dtype.names or ()) else key]
        values = values.max(axis=1, initial=0.0) if values.ndim == 2 else values
        value = float(np.median(values))
        if not np.isnan(value):  # NaN if the platform can move freely
            reached[key] = {"reached": value, "unit": UNITS[key]}
    prepared = experiment.energies
    if experiment.clearance == "worst" and prepared.loads is None:
        for key, parts in _clearance_parts(prepared).items():
            whole = reached.get(key, {}).get("reached", np.nan)
            if np.isfinite(whole):
                own = whole - sum(parts.values())
                # The remaining contribution is due to motion limits of passive joints.
                if np.isfinite(prepared.ranges).any() and own > _OWN * whole:
                    parts[OWN_MOTION] = own
                largest_first = sorted(parts.items(), key=lambda item: -item[1])
                reached[key]["clearances"] = dict(largest_first)
    return reached


def _clearance_parts(prepared: LinearResponse) -> dict[str, dict[str, float]]:
    """Return the contributions of clearances to the largest pose errors."""
    draws = prepared.solve(np.zeros((1, len(prepared.posture.robot.frames), 6)))
    if not (np.isfinite(draws.energy).all() and np.isfinite(draws.clearances).all()):
        return {}
    _, screws = bound_worst_errors(draws, _PRECISION)
    names, heads = _clearance_kinds(prepared), prepared.starts[:-1]
    parts = {}
    for i, key in enumerate(POSE_ERRORS):
        _, slopes = worst_error_slopes(prepared, draws, key, screws[:, i])
        sizes = (
            np.sqrt(np.add.reduceat(slopes[0] ** 2, heads)) if len(heads) else slopes[0]
        )
        by_kind: dict[str, float] = {}
        for name, size in zip(names, sizes.tolist(), strict=True):
            by_kind[name] = by_kind.get(name, 0.0) + size
        least = _SHARE * sum(by_kind.values())
        parts[key] = {k: v for k, v in by_kind.items() if v > least}
    return parts


def _clearance_kinds(prepared: LinearResponse) -> list[str]:
    """Return names of clearances without the leg name, such as ``hinge.tilt``."""
    robot, kinds = prepared.posture.robot, []
    for first, end in zip(prepared.starts[:-1], prepared.starts[1:], strict=True):
        columns: NDArray = prepared.joints.cones[:, first:end]
        row = int(columns.any(axis=1).argmax()) // 6
        joint, _, bound = clearance_name(robot, row, bound_name(columns)).rpartition(
            "."
        )
        kinds.append(f"{kind_of(joint)}.{bound}")
    return kinds


def stored_perfect_parts(experiment: Experiment) -> str:
    """Return the results for perfect parts as JSON text."""
    return json.dumps(perfect_parts(experiment))


def limits_broken(
    parts: Mapping[str, Any], limits: Mapping[str, float]
) -> dict[str, Any]:
    """Return the limits that a robot without geometric errors exceeds.

    Args:
        parts: result of :func:`perfect_parts`.
        limits: limits by quantity.

    Returns:
        For each exceeded limit: value without errors, unit and limit.
    """
    return {
        key: {**parts[key], "limit": limit}
        for key, limit in limits.items()
        if key in parts and parts[key]["reached"] > limit * (1.0 + _EXCEEDED)
    }


def perfect_text(summary: Mapping[str, Any]) -> list[str]:
    """Format the results for perfect parts as lines of text."""
    parts, lines = summary.get("perfect_parts", {}), []
    alone = {k: parts[k] for k in POSE_ERRORS if parts.get(k, {}).get("reached")}
    why = "clearances and loads alone" if summary.get("load") else "clearances alone"
    if alone:
        reach = ", ".join(f"{k} {_size_text(v)}{_of_text(v)}" for k, v in alone.items())
        lines.append(f"perfect parts, {why}: {reach}")
    advice = "" if summary.get("load") else ", or specify the service load (--load)"
    for key, one in summary.get("perfect_parts_break", {}).items():
        lines.append(
            f"warning: without geometric errors, a {key} {_size_text(one)} exceeds the "
            f"limit of {one['limit']:.4g} {one['unit']}; tighten the clearances{advice}"
        )
    return lines


def _size_text(one: Mapping[str, Any]) -> str:
    """Format a value and its unit as text."""
    if np.isinf(one["reached"]):
        return "without bound"
    return f"of {one['reached']:.4g} {one['unit']}"


def _of_text(one: Mapping[str, Any]) -> str:
    """Format the two largest contributions of clearances as text."""
    parts = list(one.get("clearances", {}).items())[:2]
    if not parts:
        return ""
    shares = ", ".join(f"{k} {v / one['reached']:.0%}" for k, v in parts)
    return f" ({shares})"
