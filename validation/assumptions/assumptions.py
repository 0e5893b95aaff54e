"""All assumptions of ``validity.py`` at one posture, as a table."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.energy import CannotAssemble
from assembly.linear.reduction import FreeMotion
from assembly.model.robot import BeamLink, beam_axis
from assembly.solvers.conic import SolverFailed
from stiffness.mesh.mesh import MeshFailed
from validation.assumptions.platform_cost import (
    NoSolids,
    PlatformCost,
    platform_cost,
    platform_cost_table,
    platform_cost_text,
)
from validation.assumptions.round_bars import bar_compliance, bar_stiffness
from validation.assumptions.validity import (
    ENERGY_LIMIT,
    POSITION_LIMIT,
    Cost,
    bush_cost,
    closure_cost,
    link_cost,
    pieces_cost,
    spread_cost,
)
from validation.crosscheck.spread_weight import energy_between_ends
from validation.multibody.simulation import without_clearance

_NOT_MESHED = "not meshed; --solids does, in minutes"
NOTHING = "nothing to compare: without errors and load neither model moves"


def assumption_costs(
    posture: Posture,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    solids: bool = False,
) -> dict[str, Cost | str]:
    """Costs of all assumptions at one posture.

    Closures are compared without clearances, where the pose is unique.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes; none if absent.
        solids: whether beams of full round section are meshed, which takes minutes.

    Returns:
        By assumption its cost, or why it is not known.
    """
    tight = replace(posture, robot=without_clearance(posture.robot))
    computed: dict[str, Callable[[], Cost]] = {
        "linear closures": lambda: closure_cost(tight, load),
        "beams, not solids": lambda: _solid_cost(posture, load, solids),
        "weight at the links' ends": lambda: _weight_cost(posture, gravity, load),
        "disc and cone, not two bushes": lambda: bush_cost(posture, load),
        "one spring a beam": lambda: _pieces_cost(tight, load, gravity),
    }
    costs: dict[str, Cost | str] = {}
    for name, compute in computed.items():
        try:
            cost = compute()
            costs[name] = cost if cost.known else NOTHING
        except (CannotAssemble, FreeMotion, SolverFailed, _NotApplicable) as error:
            costs[name] = str(error)
    return costs


class _NotApplicable(Exception):
    """An assumption that the robot does not make, or that is not computed."""


def _pieces_cost(
    posture: Posture, load: ArrayLike | None, gravity: ArrayLike | None
) -> Cost:
    """Of beams that are one spring."""
    if not any(isinstance(frame.link, BeamLink) for frame in posture.robot.frames):
        raise _NotApplicable("no beam")
    if load is None and gravity is None and not posture.robot.errors.any():
        raise _NotApplicable(NOTHING)
    return pieces_cost(posture, load, gravity)


def _weight_cost(
    posture: Posture, gravity: ArrayLike | None, load: ArrayLike | None
) -> Cost:
    """Of weights at the links' ends."""
    if gravity is None or not energy_between_ends(posture, gravity):
        raise _NotApplicable("no gravity, or no beam with a density")
    return spread_cost(posture, gravity, load)


def _solid_cost(posture: Posture, load: ArrayLike | None, solids: bool) -> Cost:
    """Of round beams against solids."""
    compliances: dict[tuple[float, float], NDArray] = {}
    stiffness = {}
    for frame in posture.robot.frames:
        link = frame.link
        if not isinstance(link, BeamLink) or set(link.section) != {"radius"}:
            continue
        if not solids:
            raise _NotApplicable(_NOT_MESHED)
        key = (beam_axis(frame)[0] / link.section["radius"], link.poisson)
        key = (round(key[0], 6), key[1])
        if key not in compliances:
            compliances[key] = bar_compliance(*key)
        stiffness[frame.name] = bar_stiffness(frame, compliances[key])
    if not stiffness:
        raise _NotApplicable("no beam of full round section")
    return link_cost(posture, stiffness, load)


def stiffness_cost(posture: Posture, solids: bool = False) -> PlatformCost | str:
    """What links as beams, acting at their ends, cost the platform's stiffness.

    Args:
        posture: where the robot stands.
        solids: whether links are meshed.

    Returns:
        The cost, or why it is not known.

    Raises:
        BadInput: a surface or an interface is not usable.
    """
    if not solids:
        return _NOT_MESHED
    try:
        return platform_cost(posture)
    except (FreeMotion, MeshFailed, NoSolids) as error:
        return str(error)


def costs_table(
    posture: Posture, costs: Mapping[str, Cost | str], platform: PlatformCost | str
) -> dict[str, Any]:
    """Costs for machines: [rad], [m], [-]; where not known, the reason."""
    rows: dict[str, dict[str, Any]] = {}
    for name, cost in costs.items():
        if isinstance(cost, Cost):
            values = {k: v for k, v in vars(cost).items() if v is not None}
            rows[name] = {**values, "matters": cost.matters}
        else:
            rows[name] = {"reason": cost}
    limits = {"position": POSITION_LIMIT, "energy": ENERGY_LIMIT}
    robot = posture.robot.name
    stiffness: dict[str, Any] = {"reason": platform}
    if isinstance(platform, PlatformCost):
        stiffness = platform_cost_table(platform)
    return {
        "robot": robot, "pose": posture.pose(), "limits": limits, "costs": rows,
        "platform": stiffness,
    }  # fmt: skip


def costs_text(
    posture: Posture, costs: Mapping[str, Cost | str], platform: PlatformCost | str
) -> str:
    """Costs for people, one line each."""
    lines = [f"{posture.robot.name}: what assumptions cost"]
    for name, cost in costs.items():
        if isinstance(cost, str):
            lines.append(f"{name:>30}: {cost}")
            continue
        mark = "  beyond 20 um or 1 %" if cost.matters else ""
        lines.append(
            f"{name:>30}: {1e6 * cost.position:8.3g} um  {1e6 * cost.rotation:8.3g} "
            f"urad  {_energy_text(cost.energy)}{mark}"
            + (f"; {cost.pieces} pieces leave less" if mark and cost.pieces else "")
        )
    if isinstance(platform, PlatformCost):
        lines.append(platform_cost_text(platform))
    else:
        lines.append(f"{'stiffness by solids':>30}: {platform}")
    return "\n".join(lines)


def _energy_text(share: float) -> str:
    """A relative difference of energies; without any there is none."""
    if math.isnan(share):
        return "no energy is stored"
    return f"{100 * share:8.3g} % of the energy"
