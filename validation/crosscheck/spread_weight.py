"""Compute the energy of weight between the ends of beams.

In the virtual-joint model, the weight of a beam is replaced by half of its force at
each end, and by the end moments of a beam clamped at both ends
(:func:`forcefit.assembly.linear.load.weights`).  The displacements of the ends are then
exact, but the energy between the ends is missing.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.robot import BeamLink, beam_axis
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.sections import Section, declared_section


@dataclass(frozen=True, eq=False)
class HeavyBeam:
    """A beam that is loaded by its weight.

    Attributes:
        index: index of the beam's frame.
        link: the beam, with its material.
        section: constants of its cross-section.
        length: [m] length of the beam.
        line: (3,) [m] vector from start to tip, base axes.
        weight: (3,) [N/m] weight per unit length, in the cross-section axes x, y, z.
        total: (3,) [N] weight of the beam, base axes.
    """

    index: int
    link: BeamLink
    section: Section
    length: float
    line: NDArray
    weight: NDArray
    total: NDArray


def heavy_beams(posture: Posture, gravity: ArrayLike) -> Iterator[HeavyBeam]:
    """Yield all beams of a robot that have a density.

    Args:
        posture: the robot's configuration.
        gravity: (3,) [m/s^2] gravity in base axes.

    Yields:
        Each beam with its weight.
    """
    g = np.asarray(gravity, dtype=float)
    for index, frame in enumerate(posture.robot.frames):
        link = frame.link
        if not isinstance(link, BeamLink) or link.density is None:
            continue
        length, axis = beam_axis(frame)
        section = declared_section(link.section, link.poisson)
        R = posture.transforms[index, :3, :3]
        q = link.density * section.area * g
        own = (R @ section_axes(axis, link.up)).T @ q
        yield HeavyBeam(
            index=index,
            link=link,
            section=section,
            length=length,
            line=R @ (length * axis),
            weight=own,
            total=q * length,
        )


def energy_between_ends(
    posture: Posture, gravity: ArrayLike, pieces: float = np.inf
) -> float:
    """Return the energy of beams clamped at both ends under their own weight.

    For the weight across a beam, the energy is q^2 L^5 / 1440 EI in bending and q^2 L^3
    / 24 GA in shear.  For the weight along the beam, the energy is q^2 L^3 / 24 EA.

    Args:
        posture: the robot's configuration.
        gravity: (3,) [m/s^2] gravity in base axes.
        pieces: number of equal elements of each beam.  The weight of an element is
            replaced by forces and moments at its ends, and the energy between these
            ends is omitted.

    Returns:
        Sum over all beams with a density [J].

    Sources:
        Timoshenko & Gere, Mechanics of Materials: beam with built-in ends under a
        uniform load, M = q (6 L x - 6 x^2 - L^2) / 12, V = q (L / 2 - x).
    """
    total = 0.0
    for beam in heavy_beams(posture, gravity):
        link, section, L = beam.link, beam.section, beam.length
        E, G = link.young, link.young / (2 * (1 + link.poisson))
        x, y, z = beam.weight**2
        bending = (z / section.I_y + y / section.I_z) * L**5 / (1440 * E)
        slip = x / (E * section.area)
        if link.theory == "timoshenko":
            slip += (y / section.shear_y + z / section.shear_z) / (G * section.area)
        total += bending * (1 - pieces**-4.0) + slip * L**3 / 24 * (1 - pieces**-2.0)
    return total
