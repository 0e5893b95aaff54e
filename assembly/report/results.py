"""What an assembly tells machines (the keys of the public format) and people."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.certificate import unproved, unproved_screw
from assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from assembly.linear.mobility import mobility
from assembly.linear.pose_error import PoseError, bound_pose_error
from assembly.linear.reach import READINGS, reachable_screws
from assembly.linear.reduction import FreeMotion
from assembly.linear.screw_bound import ScrewBound, bound_screw
from assembly.linear.zone import zone_margin
from assembly.report.wrench_table import wrench_lines
from assembly.solvers.conic import SolverFailed
from forcefit.inputs.display import bracket, numbers, rounded, screw_text
from forcefit.inputs.table import BadInput


def zone_of(posture: Posture) -> dict[str, Any]:
    """Margins of (21) in both readings of compliant joints, as plain values."""
    rigid, free = zone_margin(posture, "rigid"), zone_margin(posture, "free")
    open_ = "; ".join(filter(None, (rigid.unproved, free.unproved)))
    return {
        "status": "not proved" if open_ else "ok",
        "assemblable": rigid.assemblable,
        "assemblable_free": free.assemblable,
        "margin": rigid.margin,
        "margin_free": free.margin,
        "margin_bound": rigid.bound,
        "margin_free_bound": free.bound,
    } | ({"reason": open_} if open_ else {})


def zone_text(zone: dict[str, Any]) -> str:
    """Margins for people: one line, and what of them is not proved."""
    line = (
        f"zone margin: {_factor(zone['margin'])} compliant joints rigid, "
        f"{_factor(zone['margin_free'])} free (assembles rigidly up to 1)"
    )
    return f"{line}\nnot proved: {zone['reason']}" if "reason" in zone else line


def solution_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> dict[str, Any]:
    """Everything ``assembly solve`` reports, as plain values.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The keys of the public format; ``status`` is ``"ok"``; or ``"not proved"``, with
        the answer and, as ``reason``, what its certificate leaves open; or says what
        could not be answered, and the answer is then null.
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
        "remarks": list(robot.remarks),
        "load": np.zeros(6) if load is None else np.asarray(load),
        "gravity": np.zeros(3) if gravity is None else np.asarray(gravity),
    }
    empty = {"energy": None, "platform_screw": None, "frames": None, "closures": None}
    try:
        results["zone"] = zone_of(posture)
        answer = solve_assembly(posture, load, gravity=gravity)
        bound = bound_screw(answer)
        open_ = filter(None, (
            results["zone"].get("reason"),
            unproved(answer) or "; ".join(unproved_screw(answer, bound)),
        ))  # fmt: skip
        return results | _answer(answer, bound, gravity) | _status("; ".join(open_))
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        status = failure_status(error)
        return results | empty | {"status": status, "reason": str(error)}


def _status(reason: str) -> dict[str, str]:
    """That an answer is proved, or what of it is not."""
    return {"status": "not proved", "reason": reason} if reason else {}


def _answer(
    answer: Assembly, bound: ScrewBound, gravity: ArrayLike | None
) -> dict[str, Any]:
    """The part that only a solved assembly has."""
    certificate = {
        "closure_residual": answer.closure_residual(),
        "reference_length": answer.linearisation.size,
        "clearance_excess": answer.clearance_excess(),
        "duality_gap": answer.duality_gap(),
        "relative_gap": answer.relative_gap(),
    } | {f"screw_{name}": value for name, value in vars(bound).items()}
    return {
        **_screws_and_wrenches(answer),
        "certificate": certificate,
        "ranks": answer.ranks,
        "linearisation_error": _linearisation_error(answer, gravity),
    }


def _screws_and_wrenches(answer: Assembly | ExactAssembly) -> dict[str, Any]:
    """Energy, pose error, and what happens at every frame and closure."""
    robot = answer.posture.robot
    frames = {
        f.name: {
            "clearance": answer.clearance_screws[i],
            "link": answer.link_screws[i],
            "joint": answer.joint_screws[i],
            "wrench": answer.wrenches[i],
            "joint_wrench": answer.joint_wrenches[i],
        }
        for i, f in enumerate(robot.frames)
    }
    closures = [
        {"frames": list(pair), "wrench": answer.closure_wrenches[k]}
        for k, pair in enumerate(robot.closures)
    ]
    return {
        "energy": answer.energy,
        "potential": answer.potential,
        "platform_screw": answer.platform_screw,
        "frames": frames,
        "closures": closures,
    }


def _linearisation_error(answer: Assembly, gravity: ArrayLike | None) -> dict[str, Any]:
    """What the linear closures cost here: linear minus exact, or why it is unknown."""
    try:
        exact = solve_exact(answer.posture, answer.load, answer, gravity=gravity)
    except SolverFailed as error:
        return {"status": str(error)}
    return {"status": "ok", **vars(exact.linearisation_error)}


def exact_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> dict[str, Any]:
    """Everything ``assembly exact`` reports, as plain values.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The keys of ``assembly solve`` for finite motions; ``status`` as there.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose()
    }  # fmt: skip
    try:
        answer = solve_exact(posture, load, gravity=gravity)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    certificate = {
        "closure_residual": answer.closure_residual(),
        "reference_length": answer.linear.linearisation.size,
        "clearance_excess": answer.clearance_excess(),
        "stationarity": answer.stationarity,
        "iterations": answer.iterations,
    }
    linear = {
        "energy": answer.linear.energy, "platform_screw": answer.linear.platform_screw
    }  # fmt: skip
    return results | {
        **_screws_and_wrenches(answer),
        "certificate": certificate,
        "linear": linear,
        "linearisation_error": vars(answer.linearisation_error),
    }


_STATUS = {
    CannotAssemble: "cannot assemble",
    FreeMotion: "no equilibrium",
    SolverFailed: "solver failed",
}


def failure_status(error: Exception) -> str:
    """The status of a posture without an answer.

    Args:
        error: :class:`CannotAssemble`, :class:`FreeMotion` or :class:`SolverFailed`.

    Returns:
        In a few words.
    """
    return next(said for kind, said in _STATUS.items() if isinstance(error, kind))


def exact_text(results: dict[str, Any]) -> str:
    """An exact solution for people: a few lines."""
    lines = [f"{results['robot']} at {numbers(results['pose'].values())} [m, rad]"]
    if results["status"] != "ok":
        return "\n".join([*lines, f"{results['status']}: {results['reason']}"])
    certificate = results["certificate"]
    return "\n".join([
        *lines,
        f"energy: {results['energy']:.6g} J with finite motions",
        f"platform error: {screw_text(results['platform_screw'])}",
        _linearisation_text(results["linearisation_error"]),
        f"closures hold to {certificate['closure_residual']:.1e}, balance to "
        f"{certificate['stationarity']:.1e}; {certificate['iterations']} steps",
    ])  # fmt: skip


def _linearisation_text(found: dict[str, Any]) -> str:
    """What the linear closures cost."""
    if found.get("status", "ok") != "ok":
        return f"linearisation error: unknown, {found['status']}"
    rotation, translation = (
        rounded(scale * float(np.linalg.norm(found[part])))
        for part, scale in (("rotation", 1e3), ("translation", 1e6))
    )
    return (
        f"linearisation error: {rotation:.3g} mrad, {translation:.3g} um, energy "
        f"{rounded(100 * found['relative_energy']):+.3g} %"
    )


def pose_error_of(
    posture: Posture,
    readings: Sequence[str] | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
    direction: ArrayLike | None = None,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Everything ``assembly error`` reports, as plain values.

    Args:
        posture: where the robot stands.
        readings: of problem (27); without any, all that are defined: ``budget`` is not
            under a load.
        point: (3,) [m] whose translation is asked for, platform axes.
        direction: (6,) along which the largest error is asked for too.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        options: of :func:`assembly.linear.pose_error.bound_pose_error`.

    Returns:
        The keys of the public format; ``status`` as in :func:`solution_of`.

    Raises:
        BadInput: reading ``budget`` is asked under a load.
    """
    loaded = bool(np.any(load) or np.any(gravity))
    if loaded and "budget" in (readings or ()):
        raise BadInput(
            "reading budget: found a load; expected frozen or free (the budget is a "
            "factor on the energy of closing alone)"
        )
    readings = readings or (READINGS[:2] if loaded else READINGS)
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
    offset = posture.platform[:3, :3] @ results["point"]
    try:
        answer = solve_assembly(posture, load, gravity=gravity)
        table: dict[str, Any] = {}
        open_ = []
        for name in readings:
            try:
                one = bound_pose_error(answer, name, offset=offset, **options)
            except FreeMotion as error:  # without their own springs, joints give way
                nothing = dict.fromkeys(("rotation", "translation"))
                table[name] = nothing | {"reason": str(error)}
                continue
            table[name] = _bounds(one)
            open_ += [f"{name}: {one.unproved}"] if one.unproved else []
            if direction is not None:
                along = _support(answer, name, offset, direction, **options)
                table[name]["along"] = along
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    certificate = {"relative_gap": answer.relative_gap()}
    return results | _status("; ".join(open_)) | {
        "energy": answer.energy, "platform_screw": answer.platform_screw,
        "error": table, "certificate": certificate,
    }  # fmt: skip


def _bounds(one: PoseError) -> dict[str, Any]:
    """Both brackets of a reading."""
    return {
        "rotation": _bracket(one.rotation_error, one.rotation_screw),
        "translation": _bracket(one.translation_error, one.translation_screw),
        "cuts": one.cuts,
    }


def _support(
    answer: Assembly, reading: str, offset: NDArray, direction: ArrayLike,
    energy_budget: float = 0.05, **_: float,
) -> dict[str, Any]:  # fmt: skip
    """Largest error along a direction: certified, attained, and the screw there."""
    reach = reachable_screws(answer, reading, energy_budget).at_point(offset)
    found = reach.support(direction)
    if found.height == np.inf:
        return _bracket((np.inf, np.inf), reach.centre)
    attained = float(np.asarray(direction) @ found.screw)
    return _bracket((attained, found.height), found.screw)


def _bracket(bounds: tuple[float, float], screw: NDArray) -> dict[str, Any]:
    """Two bounds, and the platform screw that attains the lower."""
    return {"lower": bounds[0], "upper": bounds[1], "platform_screw": screw}


def pose_error_text(results: dict[str, Any]) -> str:
    """Bounds for people: a line for each reading."""
    lines = [f"{results['robot']} at {numbers(results['pose'].values())} [m, rad]"]
    if results["status"] != "ok":
        lines.append(f"{results['status']}: {results['reason']}")
    for reading, found in (results["error"] or {}).items():
        if "reason" in found:
            lines.append(f"{reading:7s} no answer: {found['reason']}")
            continue
        lines.append(
            f"{reading:7s} rotation {_bounds_text(found['rotation'], 'mrad')}, "
            f"translation {_bounds_text(found['translation'], 'mm')}"
        )
        if "along" in found:
            unit = "mm" if np.any(results["direction"][3:]) else "mrad"
            lines.append(f"        along it {_bounds_text(found['along'], unit)}")
    return "\n".join(lines)


def _bounds_text(found: dict[str, Any], unit: str) -> str:
    """Two bounds, in thousandths of rad or m."""
    return bracket((found["lower"], found["upper"]), unit)


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
        lines.append(f"{results['status']}: {results['reason']}")
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
        _screw_bound_text(certificate),
        *wrench_lines(results["frames"], results["closures"]),
    ]
    return "\n".join(lines)


def remark_lines(remarks: Sequence[str]) -> list[str]:
    """What a robot's file leaves to a default, a line each."""
    return [f"note: {remark}" for remark in remarks]


def _screw_bound_text(bound: dict[str, Any]) -> str:
    """How far any platform screw of least energy may be from the one told."""
    halves = ("rotation", 1e3), ("translation", 1e6)
    (turn, shift), loose = (
        [scale * bound[f"screw_{half}_{kind}"] for half, scale in halves]
        for kind in ("error", "open")
    )
    text = f"platform error proved to {turn:.1e} mrad, {shift:.1e} um"
    if max(loose) > 1e-9:
        text += (
            "; at the same energy play leaves open up to "
            f"{loose[0]:.3g} mrad, {loose[1]:.3g} um"
        )
    return text


def _factor(value: float | None) -> str:
    """A margin, or that there is none."""
    return "none" if value is None else f"{value:.4g}"
