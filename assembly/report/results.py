"""Results of assemblies as plain values (the keys of the public format) and as text."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.mobility import mobility
from assembly.kinematics.posture import Posture
from assembly.kinematics.verdict import posture_remarks
from assembly.linear.certificate import (
    ScrewBound,
    bound_screw,
    unproved,
    unproved_screw,
)
from assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    failure_status,
    solve_assembly,
)
from assembly.linear.load import massless
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference.reduction import FreeMotion
from assembly.linear.zone import zone_margin
from assembly.model.statuses import NOT_PROVED, UNSTABLE
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.report.beyond_linear import far_from_linear
from assembly.report.first_order import first_order_status, linearisation_of
from assembly.report.wrench_table import wrench_lines
from assembly.solvers.conic import SolverFailed
from forcefit.inputs.display import numbers, rounded, screw_text

_UNSTABLE = "the potential falls along a motion, as beyond a critical load"


def zone_of(posture: Posture) -> dict[str, Any]:
    """Margins of (21), compliant joints held and free, as plain values."""
    rigid, free = zone_margin(posture, "rigid"), zone_margin(posture, "free")
    unproved_parts = "; ".join(filter(None, (rigid.unproved, free.unproved)))
    return {
        "status": NOT_PROVED if unproved_parts else "ok",
        "assemblable": rigid.assemblable,
        "assemblable_free": free.assemblable,
        "margin": _finite(rigid.margin),
        "margin_free": _finite(free.margin),
        "margin_bound": _finite(rigid.bound),
        "margin_free_bound": _finite(free.bound),
    } | ({"reason": unproved_parts} if unproved_parts else {})


def _finite(value: float) -> float | None:
    """Null where no factor assembles."""
    return None if np.isinf(value) else value


def zone_text(zone: dict[str, Any]) -> str:
    """Margins for people: one line, and a second where they are not proved."""
    line = (
        f"zone margin: {_factor(zone['margin'])} compliant joints rigid, "
        f"{_factor(zone['margin_free'])} free (assembles rigidly up to 1)"
    )
    return f"{line}\n{status_line(zone)}" if zone.get("reason") else line


def solution_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> dict[str, Any]:
    """Results of ``assembly solve`` as plain values.

    Args:
        posture: of the robot.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The keys of the public format.  ``status`` is ``"ok"``; or ``"not proved"``,
        with the solution and the gap of its certificate as ``reason``; or
        ``"singular"``, with the solution at first order, which decides nothing there,
        and that of finite motions in ``reason``; or the kind of failure, and the
        solution is then null.
    """
    robot = posture.robot
    names = [f.name for f in robot.frames]
    results: dict[str, Any] = {
        "robot": robot.name,
        "status": "ok",
        "pose": posture.pose(),
        "joints": dict(zip(names, posture.coordinates.tolist(), strict=True)),
        "nominal_mismatch": posture.mismatch,
        "mobility": vars(mobility(posture)),
        "remarks": [
            *robot.remarks,
            *posture_remarks(posture),
            *massless(robot, gravity),
        ],
        "load": np.zeros(6) if load is None else np.asarray(load),
        "gravity": np.zeros(3) if gravity is None else np.asarray(gravity),
    }
    empty = {"energy": None, "platform_screw": None, "frames": None, "closures": None}
    try:
        results["zone"] = zone_of(posture)
        assembly = solve_assembly(posture, load, gravity=gravity)
        bound = bound_screw(assembly)
        unproved_parts = filter(None, (
            results["zone"].get("reason"),
            unproved(assembly) or "; ".join(unproved_screw(assembly, bound)),
        ))  # fmt: skip
        linearisation, finite = linearisation_of(assembly, gravity)
        forced = robot.errors.any() or results["load"].any() or gravity is not None
        return (
            results
            | _assembly_results(assembly, bound)
            | {"linearisation_error": linearisation, "worst_error": worst(assembly)}
            | proof_status("; ".join(unproved_parts))
            # a robot without errors or loads stands there all the same
            | (first_order_status(assembly, linearisation, finite) if forced else {})
        )
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        status = failure_status(error)
        return results | empty | {"status": status, "reason": str(error)}


def proof_status(reason: str) -> dict[str, str]:
    """Status and reason of a solution with an incomplete proof; empty otherwise."""
    return {"status": NOT_PROVED, "reason": reason} if reason else {}


def _assembly_results(assembly: Assembly, bound: ScrewBound) -> dict[str, Any]:
    """Results of a solved assembly."""
    certificate = {
        "closure_residual": assembly.closure_residual(),
        "reference_length": assembly.linearisation.size,
        "clearance_excess": assembly.clearance_excess(),
        "duality_gap": assembly.duality_gap(),
        "relative_gap": assembly.relative_gap(),
    } | {f"screw_{name}": value for name, value in vars(bound).items()}
    return {
        **_screws_and_wrenches(assembly),
        "certificate": certificate,
        "method": assembly.method,
        "ranks": assembly.ranks,
    }


def _screws_and_wrenches(assembly: Assembly | ExactAssembly) -> dict[str, Any]:
    """Energy, pose error, screws and wrenches of every frame and closure."""
    robot = assembly.posture.robot
    frames = {
        f.name: {
            "clearance": assembly.clearance_screws[i],
            "link": assembly.link_screws[i],
            "joint": assembly.joint_screws[i],
            "wrench": assembly.tip_wrenches[i],
            "joint_wrench": assembly.joint_wrenches[i],
        }
        for i, f in enumerate(robot.frames)
    }
    if isinstance(assembly, Assembly):
        for f, start in zip(robot.frames, assembly.start_wrenches, strict=True):
            if np.isfinite(start).all():
                frames[f.name]["start_wrench"] = start
    closures = [
        {"frames": list(pair), "wrench": assembly.closure_wrenches[k]}
        for k, pair in enumerate(robot.closures)
    ]
    return {
        "energy": assembly.energy,
        "potential": assembly.potential,
        "platform_screw": assembly.platform_screw,
        "frames": frames,
        "closures": closures,
    }


def exact_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    progress: Callable[[int, int], None] = lambda done, most: None,
) -> dict[str, Any]:
    """Results of ``assembly solve --state exact`` as plain values.

    Args:
        posture: of the robot.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        progress: of :func:`assembly.exact.exact.solve_exact`.

    Returns:
        The keys of ``assembly solve`` for finite motions; ``status`` as there, or
        ``"unstable"`` where the potential falls along a motion.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose()
    }  # fmt: skip
    try:
        assembly = solve_exact(posture, load, gravity=gravity, progress=progress)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    certificate = {
        "closure_residual": assembly.closure_residual(),
        "reference_length": assembly.linear.linearisation.size,
        "clearance_excess": assembly.clearance_excess(),
        "stationarity": assembly.stationarity,
        "iterations": assembly.iterations,
    }
    linear = {
        "energy": assembly.linear.energy,
        "platform_screw": assembly.linear.platform_screw,
    }
    loaded = assembly.load.any() or gravity is not None
    if loaded and not exact_tangent(assembly).stable:
        results |= {"status": UNSTABLE, "reason": _UNSTABLE}
    return results | {
        **_screws_and_wrenches(assembly),
        "certificate": certificate,
        "remarks": far_from_linear(assembly),
        "linear": linear,
        "linearisation_error": vars(assembly.linearisation_error),
    }


def exact_text(results: dict[str, Any]) -> str:
    """An exact solution for people: a few lines."""
    lines = [f"{results['robot']} at {numbers(results['pose'].values())} [m, rad]"]
    if results["status"] != "ok":
        lines.append(status_line(results))
    if "certificate" not in results:
        return "\n".join(lines)
    certificate = results["certificate"]
    return "\n".join([
        *lines,
        f"energy: {results['energy']:.6g} J with finite motions",
        f"platform error: {screw_text(results['platform_screw'])}",
        _linearisation_text(results["linearisation_error"]),
        f"closures hold to {certificate['closure_residual']:.1e}, balance to "
        f"{certificate['stationarity']:.1e}; {certificate['iterations']} steps",
        *results["remarks"],
    ])  # fmt: skip


def _linearisation_text(error: dict[str, Any]) -> str:
    """The linearisation error for people."""
    if error.get("status", "ok") != "ok":
        return f"linearisation error: unknown, {error['status']}"
    rotation, translation = (
        rounded(scale * float(np.linalg.norm(error[part])))
        for part, scale in (("rotation", 1e3), ("translation", 1e6))
    )
    return (
        f"linearisation error: {rotation:.3g} mrad, {translation:.3g} um, energy "
        f"{rounded(100 * error['relative_energy']):+.3g} %"
    )


def solution_text(results: dict[str, Any]) -> str:
    """A solution for people: a few lines.

    Args:
        results: of :func:`solution_of`.

    Returns:
        Text without colours.
    """
    lines = [f"{results['robot']} at {numbers(results['pose'].values())} [m, rad]"]
    lines += remark_lines(results["remarks"])
    if "zone" in results:
        lines.append(zone_text(results["zone"]))
    if results["status"] != "ok":
        lines.append(status_line(results))
    if results["energy"] is None:
        return "\n".join(lines)
    certificate = results["certificate"]
    lines += [
        f"energy: {results['energy']:.6g} J",
        f"platform error: {screw_text(results['platform_screw'])}",
        _linearisation_text(results["linearisation_error"]),
        f"certificate: closure residual {certificate['closure_residual']:.1e}, "
        f"clearance excess {certificate['clearance_excess']:.1e}, "
        f"gap {certificate['duality_gap']:.1e} J "
        f"({certificate['relative_gap']:.1e} relative)",
        _screw_bound_text(certificate, results["worst_error"]),
        *wrench_lines(results["frames"], results["closures"]),
    ]
    return "\n".join(lines)


def status_line(results: dict[str, Any]) -> str:
    """Status and reason of a result that is not in order."""
    status, reason = results["status"], results["reason"]
    return reason if reason.startswith(status) else f"{status}: {reason}"


def remark_lines(remarks: Sequence[str]) -> list[str]:
    """Remarks on defaults of a robot's file, a line each."""
    return [f"note: {remark}" for remark in remarks]


def worst(assembly: Assembly) -> dict[str, Any] | None:
    """Certified bounds of the largest pose error, assumption ``frozen`` of (27).

    Args:
        assembly: at least energy.

    Returns:
        ``rotation`` [rad] and ``translation`` [m]: at most these; None where nothing
        is proved.
    """
    try:
        bound = bound_pose_error(assembly, "frozen")
    except (FreeMotion, SolverFailed):
        return None
    return {
        "assumption": "frozen", "rotation": float(bound.rotation_error[1]),
        "translation": float(bound.translation_error[1]),
    }  # fmt: skip


def _screw_bound_text(bound: dict[str, Any], largest: dict[str, Any] | None) -> str:
    """How well the screw is known, and the certified largest error with clearances."""
    turn, shift = 1e3 * bound["screw_rotation_error"], bound["screw_translation_error"]
    text = f"platform error proved to {turn:.1e} mrad, {1e6 * shift:.1e} um"
    loose = 1e3 * bound["screw_rotation_open"], 1e6 * bound["screw_translation_open"]
    if max(loose) <= 1e-9:
        return text
    text += "; at the same energy clearances leave it open: "
    if largest is None or not np.isfinite(largest["rotation"] + largest["translation"]):
        return text + "without bound"
    turn, shift = largest["rotation"], largest["translation"]
    return (
        f"{text}at most {1e3 * turn:.3g} mrad, {1e6 * shift:.4g} um from nominal "
        "(certified, assumption frozen of assembly error)"
    )


def _factor(value: float | None) -> str:
    """A margin, or that there is none."""
    return "none" if value is None else f"{value:.4g}"
