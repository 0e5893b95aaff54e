"""Results of an assembly as a dictionary and as text."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.verdict import posture_remarks
from forcefit.assembly.linear.certificate import (
    ScrewBound,
    bound_screw,
    unproved,
    unproved_screw,
)
from forcefit.assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    failure_status,
    solve_assembly,
)
from forcefit.assembly.linear.load import massless
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.contact_closures import contact_closures
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import NOT_PROVED, UNSTABLE
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.report.beyond_linear import far_from_linear
from forcefit.assembly.report.first_order import first_order_status, linearisation_of
from forcefit.assembly.report.mobility import mobility_lines, mobility_of
from forcefit.assembly.report.wrench_table import wrench_lines
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.results.display import listing
from forcefit.results.text import lines_of, value_text

# keys of a certificate
_PROOF = (
    "closure_residual clearance_excess duality_gap relative_gap stationarity iterations"
)
# keys of margins
_ZONE = (
    "zone.assemblable zone.margin zone.assemblable_free zone.margin_free zone.status "
    "zone.reason"
)
_UNSTABLE = (
    "the equilibrium is unstable, because the potential energy decreases along a "
    "motion; the load may exceed a critical load"
)


def zone_of(posture: Posture) -> dict[str, Any]:
    """Compute the margins of problem (21) for rigid and for free compliant joints."""
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
    """Return a margin, or None if it is infinite."""
    return None if np.isinf(value) else value


def zone_text(results: dict[str, Any]) -> str:
    """Format the margins as text.

    Args:
        results: dictionary with ``robot``, ``pose`` and ``zone``, the result of
            :func:`zone_of`.

    Returns:
        The text.
    """
    return listing(results["robot"], lines_of(results, f"pose {_ZONE}"))


def solution_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> dict[str, Any]:
    """Compute the results of ``assembly solve`` as a dictionary.

    Args:
        posture: posture of the robot.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        The keys of the JSON output. ``status`` is ``"ok"``, ``"not proved"``
        (incomplete certificate), ``"singular"`` (invalid first-order solution) or the
        type of failure. ``reason`` contains details.
    """
    robot = posture.robot
    names = [f.name for f in robot.frames]
    results: dict[str, Any] = {
        "robot": robot.name,
        "status": "ok",
        "pose": posture.pose(),
        "joints": dict(zip(names, posture.coordinates.tolist(), strict=True)),
        **_joint_frames(robot),
        "nominal_mismatch": posture.mismatch,
        "mobility": mobility_of(posture),
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
            # The nominal posture is a solution without errors and loads.
            | (first_order_status(assembly, linearisation, finite) if forced else {})
        )
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        status = failure_status(error)
        return results | empty | {"status": status, "reason": str(error)}


def proof_status(reason: str) -> dict[str, str]:
    """Return status and reason if a certificate is incomplete."""
    return {"status": NOT_PROVED, "reason": reason} if reason else {}


def _assembly_results(assembly: Assembly, bound: ScrewBound) -> dict[str, Any]:
    """Return the results of a minimum-energy solution."""
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
    """Return energy and pose error, and screws and wrenches of frames and closures."""
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
    of_contacts = contact_closures(robot)
    closures = [
        {"frames": list(pair), "wrench": assembly.closure_wrenches[k]}
        for k, pair in enumerate(robot.closures) if not of_contacts[k]
    ]  # fmt: skip
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
    """Compute the results of ``assembly solve --state exact`` as a dictionary.

    Args:
        posture: posture of the robot.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        progress: argument of :func:`forcefit.assembly.exact.exact.solve_exact`.

    Returns:
        The keys of the JSON output. ``status`` may be ``"unstable"`` in addition to the
        values in :func:`solution_of`.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose(),
        "mobility": mobility_of(posture),
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
    loaded = assembly.load.any() or assembly.loads.drives.any()
    if (loaded or gravity is not None) and not exact_tangent(assembly).stable:
        results |= {"status": UNSTABLE, "reason": _UNSTABLE}
    return results | {
        **_screws_and_wrenches(assembly),
        "certificate": certificate,
        "remarks": far_from_linear(assembly),
        "linear": linear,
        "linearisation_error": vars(assembly.linearisation_error),
    }


def exact_text(results: dict[str, Any]) -> str:
    """Format an exact solution as text."""
    return listing(
        results["robot"],
        lines_of(results, "pose")
        | mobility_lines(results["mobility"])
        | lines_of(results, "status reason energy platform_screw")
        | _linearisation_lines(results)
        | lines_of(results.get("certificate", {}), _PROOF),
        results.get("remarks", ()),
    )


def _joint_frames(robot: Robot) -> dict[str, dict[str, str]]:
    """Return the main frames of joints that consist of several frames."""
    frames = {name: joint.main for name, joint in robot.joints.items()}
    return {"joint_frames": frames} if frames else {}


def solution_text(results: dict[str, Any]) -> str:
    """Format a solution as text.

    Args:
        results: result of :func:`solution_of`.

    Returns:
        The text.
    """
    solved = results["energy"] is not None
    lines = lines_of(results, "pose") | mobility_lines(results["mobility"])
    lines |= lines_of(results, f"{_ZONE} status reason")
    if solved:
        lines |= lines_of(results, "energy platform_screw reading")
        lines |= _linearisation_lines(results) | _bound_lines(results)
        lines |= lines_of(results["certificate"], _PROOF)
    text = listing(results["robot"], lines, results["remarks"])
    if not solved:
        return text
    joints = results.get("joint_frames", {})
    tables = wrench_lines(results["frames"], results["closures"], joints)
    return "\n".join([text, *tables])


def _linearisation_lines(results: dict[str, Any]) -> dict[str, str]:
    """Format the linearisation error as lines of text."""
    error = results.get("linearisation_error", {})
    if "rotation" not in error:
        words = "linearisation error"
        return {words: f"unknown, {error['status']}"} if "status" in error else {}
    sizes = {
        f"linearisation_{part}": float(np.linalg.norm(error[part]))
        for part in ("rotation", "translation")
    } | {"linearisation_energy": error["relative_energy"]}
    # round-off errors of rotation [rad], translation [m] and relative energy
    least = (1e-12, 1e-15, 1e-11)
    for name, small in zip(sizes, least, strict=True):
        sizes[name] = sizes[name] if abs(sizes[name]) >= small else 0.0
    return lines_of(sizes, " ".join(sizes))


def _bound_lines(results: dict[str, Any]) -> dict[str, str]:
    """Format the error bound on the platform screw as lines of text."""
    bound, largest = results["certificate"], results["worst_error"]
    lines = lines_of(bound, "screw_rotation_error screw_translation_error")
    if (
        max(bound["screw_rotation_open"], 1e3 * bound["screw_translation_open"])
        <= 1e-12
    ):
        return lines
    lines |= lines_of(bound, "screw_rotation_open screw_translation_open")
    if largest is None or not np.isfinite([*largest.values()][1:]).any():
        return lines | {"certified largest error": "without bound"}
    sizes = ("rotation", "translation")
    known = ", ".join(value_text(size, largest[size]) for size in sizes)
    return lines | {"certified largest error": f"{known}, assumption frozen of (27)"}


def status_line(results: dict[str, Any]) -> str:
    """Format status and reason of a result as a line of text."""
    status, reason = results["status"], results["reason"]
    return reason if reason.startswith(status) else f"{status}: {reason}"


def worst(assembly: Assembly) -> dict[str, Any] | None:
    """Compute pose error bounds for the assumption ``frozen``.

    Args:
        assembly: minimum-energy assembly.

    Returns:
        Upper bounds ``rotation`` [rad] and ``translation`` [m], or None without a
        proof.
    """
    try:
        bound = bound_pose_error(assembly, "frozen")
    except (FreeMotion, SolverFailed):
        return None
    return {
        "assumption": "frozen", "rotation": float(bound.rotation_error[1]),
        "translation": float(bound.translation_error[1]),
    }  # fmt: skip
