"""Models with an assumption added or removed, for ``docs/validity.md``."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.load import loads_on_frames, weights
from forcefit.assembly.linear.reference.energy import solve_with
from forcefit.assembly.linear.reference.zone import margin_with
from forcefit.assembly.linear.zone import Compliant
from forcefit.assembly.model.robot import BeamLink, Robot, beam_axis
from forcefit.validation.assumptions.bushes import bush_joints
from forcefit.validation.assumptions.validity import Cost, cost_between
from forcefit.validation.crosscheck.spread_weight import (
    energy_between_ends,
    heavy_beams,
)


def with_bars(robot: Robot, slenderness: float, density: float | None = None) -> Robot:
    """Return a robot with round bars instead of beams.

    Args:
        robot: robot with beams.
        slenderness: [-] ratio of length to radius.
        density: [kg/m^3] density of the bars, by default the density of the beams.

    Returns:
        The robot.
    """
    links: dict[str, BeamLink] = {}
    for frame in robot.frames:
        link = frame.link
        if isinstance(link, BeamLink):
            section: Mapping[str, float]
            section = {"radius": beam_axis(frame)[0] / slenderness}
            heavy = link.density if density is None else density
            links[frame.name] = replace(link, section=section, density=heavy)
    return robot.with_links({**links})


def bush_margin(posture: Posture, compliant: Compliant = "rigid") -> float:
    """Return the margin of a robot whose pins have two bushes.

    Args:
        posture: configuration of the robot.
        compliant: ``"rigid"`` or ``"free"``, as for
            ``forcefit.assembly.linear.zone.zone_margin``.

    Returns:
        The smallest factor of all clearances for which the robot can be assembled, or
        inf.

    Raises:
        SolverFailed: the cone solver found no solution.
    """
    joints = bush_joints(virtual_joints(posture.robot, False, compliant == "free"))
    return margin_with(linearise(posture), joints)[0]


def half_weights(posture: Posture, gravity: ArrayLike) -> tuple[NDArray, NDArray]:
    """Return loads that consist of half the weight of each beam at both ends.

    Args:
        posture: configuration of a robot with n frames.
        gravity: (3,) [m/s^2] gravity vector in base axes.

    Returns:
        ``bodies`` and ``carried`` (n, 6) [N m, N] of
        :func:`forcefit.assembly.linear.load.loads_on_frames`.
    """
    own, carried = weights(posture, gravity)
    for beam in heavy_beams(posture, gravity):
        clamp = np.cross(beam.line, beam.total) / 12
        own[beam.index, :3] += clamp
        parent = posture.robot.parents[beam.index]
        if parent >= 0:
            carried[parent, :3] -= clamp
    return own, carried


def halves_cost(
    posture: Posture, gravity: ArrayLike, load: ArrayLike | None = None
) -> Cost:
    """Return the error that :func:`half_weights` causes.

    Args:
        posture: configuration of the robot.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The error compared with distributed weights.

    Raises:
        CannotAssemble: the robot cannot be assembled.
        SolverFailed: no solution was found.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    own, carried = half_weights(posture, gravity)
    halves = solve_with(
        linearise(posture),
        virtual_joints(posture.robot),
        wrench,
        loads_on_frames(posture, wrench, own, carried),
    )
    ends = solve_assembly(posture, load, gravity=gravity)
    return cost_between(halves, ends, energy_between_ends(posture, gravity))
