"""Compute the errors caused by the assumptions of ``validity.py`` at one posture."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble
from forcefit.assembly.linear.load import driven
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.given_load import Load, given_load
from forcefit.assembly.model.robot import BeamLink
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed
from forcefit.validation.assumptions.platform_cost import (
    NoSolids,
    PlatformCosts,
    platform_costs,
)
from forcefit.validation.assumptions.solid_links import solid_link
from forcefit.validation.assumptions.validity import (
    Cost,
    bush_cost,
    closure_cost,
    link_cost,
    pieces_cost,
    spread_cost,
)
from forcefit.validation.crosscheck.spread_weight import energy_between_ends
from forcefit.validation.multibody.simulation import without_clearance

_NOT_MESHED = "not computed, because it needs meshes of the links; add --solids"
NOTHING = "nothing to compare: without errors and loads, neither model deforms"


def assumption_costs(
    posture: Posture,
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    solids: bool = False,
) -> dict[str, Cost | str]:
    """Return the error that each modelling assumption causes at one posture.

    The error of linearised closures is computed without clearances, so that the
    platform pose is unique.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, in base axes, or a
            mapping from component to value such as ``{"fz": -50}``.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        solids: whether to compare beams with solid finite elements.

    Returns:
        Mapping from each assumption to its error, or to the reason why it is unknown.
    """
    load = None if load is None else given_load(load)
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
    """Exception raised if the error of an assumption is unknown."""


def _pieces_cost(
    posture: Posture, load: ArrayLike | None, gravity: ArrayLike | None
) -> Cost:
    """Return the error of replacing each beam by a single spring."""
    if not any(isinstance(frame.link, BeamLink) for frame in posture.robot.frames):
        raise _NotApplicable("no beam")
    unloaded = load is None and gravity is None and not driven(posture.robot)
    if unloaded and not posture.robot.errors.any():
        raise _NotApplicable(NOTHING)
    return pieces_cost(posture, load, gravity)


def _weight_cost(
    posture: Posture, gravity: ArrayLike | None, load: ArrayLike | None
) -> Cost:
    """Return the error of replacing the weight of a link by loads at its ends."""
    if gravity is None or not energy_between_ends(posture, gravity):
        raise _NotApplicable("there is no gravity, or no beam has a density")
    return spread_cost(posture, gravity, load)


def _solid_cost(posture: Posture, load: ArrayLike | None, solids: bool) -> Cost:
    """Return the error of beam theory, compared with solid finite elements."""
    beams = [f for f in posture.robot.frames if isinstance(f.link, BeamLink)]
    if beams and not solids:
        raise _NotApplicable(_NOT_MESHED)
    meshed = {frame.name: solid_link(frame) for frame in beams}
    stiffness = {name: s.condensed for name, s in meshed.items() if s is not None}
    if not stiffness:
        raise _NotApplicable("no beam has a known cross-section")
    return link_cost(posture, stiffness, load)


def stiffness_costs(
    postures: Sequence[Posture], solids: bool = False
) -> PlatformCosts | str:
    """Return the errors in platform stiffness caused by beam theory.

    Args:
        postures: one or more configurations of a robot.
        solids: whether to mesh the links.

    Returns:
        The errors, or the reason why they are unknown.

    Raises:
        BadInput: a surface or an interface cannot be used.
    """
    if not solids:
        return _NOT_MESHED
    try:
        return platform_costs(postures)
    except (FreeMotion, MeshFailed, NoSolids) as error:
        return str(error)
