"""Platform stiffness and its contributions, as a dictionary and as text."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import (
    CannotAssemble,
    failure_status,
    solve_assembly,
)
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.statuses import FREE_MOTION, UNSTABLE
from forcefit.assembly.platform_stiffness.active_set import contacts
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import (
    Side,
    in_contact,
    without_clearance,
)
from forcefit.assembly.platform_stiffness.matrices import PlatformStiffness
from forcefit.assembly.platform_stiffness.platform_stiffness import State
from forcefit.assembly.report.beyond_linear import far_from_linear
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.results.display import listing, numbers, rounded
from forcefit.results.text import lines_of, table_lines, value_text
from forcefit.stiffness.screws import SCREW, WRENCH

DIRECTIONS = tuple(name.lower() for name in SCREW)
# names of the loading and the unloading direction in the JSON output
_SIDES: dict[Side, str] = {"loading": "holding", "unloading": "letting go"}
_KINDS = {"link": "links", "joint": "joints", "clearance": "clearances"}
_SHOWN = 12  # number of contributions in tables and charts


def stiffness_of(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0),
    state: State = "nominal",
    length: float | None = None,
    direction: ArrayLike | None = None,
) -> dict[str, Any]:
    """Compute the platform stiffness as a dictionary.

    Args:
        posture: posture of the robot.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        at: (3,) [m] reference point of screws and wrenches, in platform axes.
        state: ``"nominal"``, ``"contact"`` or ``"exact"``.
        length: [m] characteristic length by which rotations are multiplied; None for
            the length of the longest body.
        direction: (6,) unit screw in base axes for an additional stiffness, or None.

    Returns:
        The keys of the JSON output. ``status`` is ``"ok"``, ``"free motion"``,
        ``"unstable"``, or the reason why there is no equilibrium.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose(),
        "load": np.zeros(6) if load is None else np.asarray(load),
        "gravity": np.zeros(3) if gravity is None else np.asarray(gravity),
    }  # fmt: skip
    try:
        platform, sides, remarks = _tangents(posture, load, gravity, state)
        if remarks is not None:
            results["remarks"] = remarks
        point = platform[:3, 3] + platform[:3, :3] @ np.asarray(at, dtype=float)
        values = [stiffness_values(side, point, length) for side in sides]
        results |= values[0] | {"status": _status(sides[0])}
        if sides[0].free_text:
            results["reason"] = sides[0].free_text
        if direction is not None:
            results["direction"] = _along(sides[0].at(point, length), direction)
        if state != "nominal":
            results["letting_go"] = values[1] if len(values) > 1 else None
        elif virtual_clearances(posture):
            results["contact"] = _in_contact(posture, load, gravity, point, length)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        results |= {"status": failure_status(error), "reason": str(error)}
    return results


def _tangents(
    posture: Posture, load: Any, gravity: Any, state: State
) -> tuple[NDArray, list[PlatformStiffness], list[str] | None]:
    """Return the platform pose, one or two tangent stiffnesses, and remarks."""
    if state == "nominal":
        return posture.platform, [without_clearance(posture)], None
    if state == "contact":
        linear = solve_assembly(posture, load, gravity=gravity)
        sides = [in_contact(linear)]
        if contacts(linear)[1].any():
            sides.append(in_contact(linear, "unloading"))
        return posture.platform, sides, None
    equilibrium = solve_exact(posture, load, gravity=gravity)
    sides = [exact_tangent(equilibrium)]
    away = exact_tangent(equilibrium, "unloading")
    if away.free.shape[1] > sides[0].free.shape[1]:
        sides.append(away)
    return equilibrium.placement.platform, sides, far_from_linear(equilibrium)


def _along(answer: PlatformStiffness, direction: ArrayLike) -> dict[str, Any]:
    """Return the stiffness and its contributions along a screw."""
    way = np.asarray(direction, dtype=float)
    free, blocked = answer.along(way)
    return {
        "direction": way, "free": free, "blocked": blocked,
        "shares": _share_values(answer, way),
    }  # fmt: skip


def virtual_clearances(posture: Posture) -> bool:
    """Return whether the robot has joint clearances."""
    return any(frame.clearance is not None for frame in posture.robot.frames)


def _in_contact(
    posture: Posture, load: Any, gravity: Any, point: NDArray, length: float | None
) -> list[dict[str, Any]]:
    """Return the tangent stiffness of problem (22), or two at a contact change."""
    assembly = solve_assembly(posture, load, gravity=gravity)
    pressed, touching = contacts(assembly)
    sides: list[Side] = ["loading"]
    if touching.any():
        sides.append("unloading")
    return [
        {
            "side": _SIDES[side],
            "contacts": int(pressed.sum()),
            "touching": int(touching.sum()),
        }
        | stiffness_values(in_contact(assembly, side), point, length)
        for side in sides
    ]


def _status(stiffness: PlatformStiffness) -> str:
    """Return the status for a stiffness."""
    if not stiffness.stable:
        return UNSTABLE
    return FREE_MOTION if stiffness.free.shape[1] else "ok"


def stiffness_values(
    platform: PlatformStiffness, point: NDArray, length: float | None = None
) -> dict[str, Any]:
    """Convert a platform stiffness to a dictionary.

    Args:
        platform: stiffness of the platform at a posture.
        point: (3,) [m] reference point in base axes.
        length: [m] characteristic length by which rotations are multiplied.

    Returns:
        Matrices, free motions, eigenscrews, and contributions to the compliance.
    """
    platform = platform.at(point, length)
    eigen = platform.eigen
    return {
        "state": platform.state,
        "point": platform.point,
        "compliance": platform.compliance,
        "stiffness": platform.stiffness,
        "free_motions": platform.free.T,
        "rigid_wrenches": platform.rigid.T,
        "characteristic_length": platform.length,
        "eigen": [
            {"stiffness": float(value), "screw": screw, "pitch": float(pitch)}
            for value, screw, pitch in zip(
                eigen.values, eigen.screws.T, eigen.pitches, strict=True
            )
        ],
        "condition": eigen.condition,
        "centre": platform.centre,
        "along": {
            name: dict(zip(("free", "blocked"), platform.along(axis), strict=True))
            for name, axis in zip(DIRECTIONS, np.eye(6), strict=True)
        },
        "shares": {
            name: _share_values(platform, axis)
            for name, axis in zip(DIRECTIONS, np.eye(6), strict=True)
        },
    }


def _share_values(stiffness: PlatformStiffness, axis: NDArray) -> dict[str, Any]:
    """Return the contributions to the compliance along a screw."""
    table: dict[str, Any] = {"links": {}, "joints": {}}
    for part, share in stiffness.shares(axis).items():
        if part.kind in _KINDS:
            table.setdefault(_KINDS[part.kind], {})[part.frame] = share
        else:
            table["forces"] = share
    return table


def share_rows(shares: dict[str, dict[str, Any]]) -> dict[str, list[float]]:
    """Return the contributions to the compliance along six axes, in descending order.

    Args:
        shares: contributions from :func:`stiffness_values`.

    Returns:
        Six values for each name, such as ``"leg1.distal link"``.
    """
    rows: dict[str, list[float]] = {}
    for k, name in enumerate(DIRECTIONS):
        for kind, word in _KINDS.items():
            for frame, share in shares[name].get(word, {}).items():
                rows.setdefault(f"{frame} {kind}", [np.nan] * 6)[k] = share
        if "forces" in shares[name]:
            rows.setdefault("internal forces and loads", [np.nan] * 6)[k] = shares[
                name
            ]["forces"]
    return dict(
        sorted(rows.items(), key=lambda row: -np.nan_to_num(np.abs(row[1])).max())
    )


def stiffness_text(results: dict[str, Any]) -> str:
    """Format the results of :func:`stiffness_of` as text."""
    about = lines_of(results, "pose status reason")
    lines = [listing(results["robot"], about, results.get("remarks", ()))]
    if "compliance" not in results:
        return lines[0]
    lines += [*_state_lines(results), *_share_lines(results["shares"])]
    if "direction" in results:
        lines += _direction_lines(results["direction"])
    for side in results.get("contact", ()):
        word = next(name for name, old in _SIDES.items() if old == side["side"])
        closed = f"{side['contacts']} closed clearances, {word}:"
        lines += ["", closed, *_state_lines(side)]
    if results.get("letting_go"):
        lines += ["", "unloading of clearances that touch their bound without a force:"]
        lines += _state_lines(results["letting_go"])
    return "\n".join(lines)


def _state_lines(values: dict[str, Any]) -> list[str]:
    """Format the results for one state as lines of text."""
    K = np.asarray(values["stiffness"])
    size = np.sqrt(np.abs(np.nan_to_num(np.diag(K))))
    K = np.where(np.abs(K) < 1e-10 * np.outer(size, size), 0.0, K)
    rows = dict(zip(WRENCH, np.where(np.isfinite(K), K, np.nan).tolist(), strict=True))
    eigen = " ".join(f"{one['stiffness']:.4g}" for one in values["eigen"])
    point = f"{value_text('point', values['point'])}, base axes"
    about = lines_of(values, "state") | {"reference point": point} | {
        f"free motion {k}": numbers(screw)
        for k, screw in enumerate(values["free_motions"], 1)
    } | {
        f"rigid wrench {k}": numbers(wrench)
        for k, wrench in enumerate(values["rigid_wrenches"], 1)
    }  # fmt: skip
    about["eigenstiffnesses"] = (
        f"{eigen} N/m, angles times {values['characteristic_length']:.4g} m"
    )
    if np.isfinite(values["centre"]).all():
        centre = value_text("centre", values["centre"])
        about["centre of stiffness"] = f"{centre}, base axes"
    units = "[N m/rad, N/rad, N m/m, N/m]; - in rigid directions"
    details = listing("", about).split("\n")[1:]
    return [f"stiffness K_C {units}", *table_lines(("", *SCREW), rows), *details]


def _share_lines(shares: dict[str, dict[str, Any]]) -> list[str]:
    """Format the contributions to the compliance in per cent."""
    rows = {
        name: [rounded(100 * value) for value in row]
        for name, row in largest_rows(share_rows(shares)).items()
    }
    head = "contributions to the compliance along each direction [%]"
    return ["", head, *table_lines(("part", *DIRECTIONS), rows, digits=3)]


def _direction_lines(along: dict[str, Any]) -> list[str]:
    """Format the stiffness along a screw and its main contributions."""
    parts = sorted(
        (-share, f"{frame} {kind}")
        for kind, word in _KINDS.items()
        for frame, share in along["shares"].get(word, {}).items()
    )
    most = ", ".join(f"{name} {-100 * share:.3g} %" for share, name in parts[:3])
    unit = "N m/rad" if np.any(along["direction"][:3]) else "N/m"
    return [
        f"along {numbers(along['direction'])}: {along['free']:.5g} {unit}; with all "
        f"other directions fixed: {along['blocked']:.5g} {unit}; {most}"
    ]


def largest_rows(rows: dict[str, list[float]]) -> dict[str, list[float]]:
    """Return the largest contributions and the sum of all others.

    Args:
        rows: result of :func:`share_rows`.

    Returns:
        At most 13 rows.
    """
    names = list(rows)
    if len(names) <= _SHOWN + 1:
        return rows
    rest = np.sum([rows[name] for name in names[_SHOWN:]], axis=0)
    first = {name: rows[name] for name in names[:_SHOWN]}
    return first | {f"{len(names) - _SHOWN} others": rest.tolist()}
