"""Pose error bounds, problem (27), as a dictionary and as text."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    failure_status,
    solve_assembly,
)
from forcefit.assembly.linear.load import driven
from forcefit.assembly.linear.pose_error import PoseError, bound_pose_error
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS, reachable_screws
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.report.first_order import singular_status
from forcefit.assembly.report.results import proof_status
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.worst_left import is_left_worst, worst_left
from forcefit.inputs.table import BadInput
from forcefit.results.display import listing
from forcefit.results.text import lines_of, value_text


def pose_error_of(
    posture: Posture,
    assumptions: Sequence[str] | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
    direction: ArrayLike | None = None,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Compute pose error bounds as a dictionary.

    Args:
        posture: posture of the robot.
        assumptions: assumptions of problem (27); by default all or, under a load, all
            except ``budget``.
        point: (3,) [m] point whose translation is bounded, in platform axes.
        direction: (6,) direction for an additional bound, or None.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        options: options of
            :func:`forcefit.assembly.linear.pose_error.bound_pose_error`.

    Returns:
        The keys of the JSON output.

    Raises:
        BadInput: there is a load, and the assumption is ``budget`` or a joint has
            ``left = "worst"``.
    """
    loaded = bool(np.any(load) or np.any(gravity) or driven(posture.robot))
    if loaded and "budget" in (assumptions or ()):
        raise BadInput(
            "assumption budget: found a load, expected none, because the budget is "
            "defined by the energy without loads; use frozen or free"
        )
    assumptions = assumptions or (ASSUMPTIONS[:2] if loaded else ASSUMPTIONS)
    results: dict[str, Any] = {
        "robot": posture.robot.name,
        "status": "ok",
        "pose": posture.pose(),
        "load": np.zeros(6) if load is None else np.asarray(load, dtype=float),
        "gravity": np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float),
        "error": None,
        "point": np.asarray(point, dtype=float),
    }
    if direction is not None:
        results["direction"] = np.asarray(direction, dtype=float)
    if singular := singular_status(posture, load, gravity):
        return results | singular
    offset = posture.platform[:3, :3] @ results["point"]
    try:
        assembly = solve_assembly(posture, load, gravity=gravity)
        table: dict[str, Any] = {}
        unproved = []
        for name in assumptions:
            try:
                bound = bound_pose_error(assembly, name, offset=offset, **options)
            except FreeMotion as error:  # a motion may have no spring
                no_bounds = dict.fromkeys(("rotation", "translation"))
                table[name] = no_bounds | {"reason": str(error)}
                continue
            table[name] = _bounds(bound)
            unproved += [f"{name}: {bound.unproved}"] if bound.unproved else []
            if direction is not None:
                along = _support(assembly, name, offset, direction, **options)
                table[name]["along"] = along
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    if is_left_worst(posture.robot):
        if loaded:
            raise BadInput(
                f'{posture.robot.name}: found a load and a joint with left = "worst", '
                "expected no load; the worst position is defined without loads"
            )
        results["bolted_worst"] = _worst_left(posture, offset)
    certificate = {"relative_gap": assembly.relative_gap()}
    return results | proof_status("; ".join(unproved)) | {
        "energy": assembly.energy, "platform_screw": assembly.platform_screw,
        "error": table, "certificate": certificate,
    }  # fmt: skip


def _bounds(bound: PoseError) -> dict[str, Any]:
    """Return the pose error bounds under one assumption of problem (27)."""
    return {
        "rotation": _bracket(bound.rotation_error, bound.rotation_screw),
        "translation": _bracket(bound.translation_error, bound.translation_screw),
        "cuts": bound.supports,
        "method": bound.method,
    }


def _worst_left(posture: Posture, offset: NDArray) -> dict[str, Any]:
    """Return pose error bounds over all positions of bolted joints."""
    worst = worst_left(posture, offset)
    bounds = {
        part: dict(zip(("lower", "upper"), getattr(worst, part), strict=True))
        for part in ("rotation", "translation")
    }
    return bounds | {"assumption": worst.assumption}


def _support(
    assembly: Assembly, assumption: str, offset: NDArray, direction: ArrayLike,
    energy_budget: float = 0.05, **_: float,
) -> dict[str, Any]:  # fmt: skip
    """Return bounds on the largest error along a direction."""
    reach = reachable_screws(assembly, assumption, energy_budget).at_point(offset)
    support = reach.support(direction)
    if support.height == np.inf:
        return _bracket((np.inf, np.inf), reach.centre)
    attained = float(np.asarray(direction) @ support.screw)
    return _bracket((attained, support.height), support.screw)


def _bracket(bounds: Sequence[float] | NDArray, screw: NDArray) -> dict[str, Any]:
    """Return the lower and upper bound and the screw of the lower bound by name."""
    return {"lower": bounds[0], "upper": bounds[1], "platform_screw": screw}


def pose_error_text(results: dict[str, Any]) -> str:
    """Format pose error bounds as text."""
    lines = lines_of(results, "pose status reason")
    for assumption, bounds in (results["error"] or {}).items():
        if "reason" in bounds:
            lines[assumption] = f"no answer: {bounds['reason']}"
            continue
        lines[f"{assumption}, rotation"] = _bounds_text("rotation", bounds["rotation"])
        lines[f"{assumption}, translation"] = _bounds_text(
            "translation", bounds["translation"]
        )
        if "along" in bounds:
            turns = np.any(results["direction"][:3])
            part = "rotation" if turns else "translation"
            lines[f"{assumption}, along the direction"] = _bounds_text(
                part, bounds["along"]
            )
    if "bolted_worst" in results:
        worst = results["bolted_worst"]
        for part in ("rotation", "translation"):
            lines[f"bolted at worst, {part}"] = _bounds_text(part, worst[part])
        lines["bolted at worst"] = worst["assumption"]
    return listing(results["robot"], lines, results.get("remarks", ()))


def _bounds_text(part: str, bounds: dict[str, Any]) -> str:
    """Format the bounds on a rotation or translation."""
    low, high = bounds["lower"], bounds["upper"]
    return value_text(f"{part}_error", (low, high) if np.isfinite(high) else high)
