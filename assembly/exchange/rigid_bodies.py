"""Masses and moments of inertia for the import and export of robots."""

from dataclasses import replace
from typing import Any

import numpy as np

from forcefit.assembly.exchange.mechanism import Body, Mechanism
from forcefit.assembly.exchange.xml_file import counted
from forcefit.assembly.model.inertia import (
    MassProperties,
    inertia_fault,
    joined_bodies,
    point_inertia,
)
from forcefit.assembly.model.robot import BASE, BeamLink, Frame, Robot, beam_axis
from forcefit.stiffness.beam.sections import declared_section


def mass_keys(body: Body) -> dict[str, Any]:
    """Return the mass and moments of inertia of a body as keys of a frame."""
    if not body.mass and not body.inertia.any():
        return {}
    return {
        "mass": body.mass, "centre_of_mass": body.centre, "inertia": body.inertia
    }  # fmt: skip


def with_possible_moments(mechanism: Mechanism) -> Mechanism:
    """Set physically impossible moments of inertia to zero."""
    bodies = {
        name: replace(body, inertia=np.zeros((3, 3)))
        for name, body in mechanism.bodies.items()
        if body.inertia.any() and inertia_fault(body.inertia)
    }  # fmt: skip
    lines = counted("physically impossible moments of inertia", list(bodies))
    return replace(
        mechanism, bodies={**mechanism.bodies, **bodies},
        left_out=(*mechanism.left_out, *lines),
    )  # fmt: skip


def lumped_body(name: str, frames: list[Frame]) -> Body:
    """Combine the masses of frames, with beams as slender rods, in one rigid body."""
    parts: list[MassProperties] = []
    for frame in frames:
        T = Robot("", frame.name, (replace(frame, parent=BASE),)).fixed_transforms[0]
        R = T[:3, :3]
        if frame.mass or frame.inertia.any():
            centre = R @ frame.centre_of_mass + T[:3, 3]
            parts.append((frame.mass, centre, R @ frame.inertia @ R.T))
        link = frame.link
        if isinstance(link, BeamLink) and link.density:
            length, axis = beam_axis(frame)
            span = R @ axis * length
            area = declared_section(link.section, link.poisson).area
            mass = link.density * area * length
            # moment of inertia of a slender rod about its centre: m L^2 / 12
            parts.append((mass, T[:3, 3] - span / 2, point_inertia(mass / 12, span)))
    return Body(name, *joined_bodies(parts))
