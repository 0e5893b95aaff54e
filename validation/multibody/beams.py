"""Compute axes and section stiffness of simulated beams.

Apart from cross-section constants, this module is independent of
:mod:`forcefit.assembly.model.links`.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BeamLink, Frame
from forcefit.stiffness.beam.sections import declared_section
from forcefit.validation.multibody.motion import turned


def beam_span(frame: Frame, link: BeamLink) -> tuple[float, NDArray]:
    """Return the length [m] and the direction (3,) of a beam, in frame axes."""
    if link.length is not None and link.axis is not None:
        return link.length, np.array(link.axis)
    x = turned(frame.rotation).T @ frame.translation
    return float(np.linalg.norm(x)), x


def beam_axes(x: NDArray, up: Sequence[float] | None) -> NDArray:
    """Return the axes of a beam as columns, in the order along, across and up."""
    x = x / np.linalg.norm(x)
    if up is None:
        up = (0.0, 0.0, 1.0) if math.hypot(x[0], x[2]) < 1e-9 else (0.0, 1.0, 0.0)
    y = np.cross(up, x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def element_stiffness(link: BeamLink, step: float) -> NDArray:
    """Return EA, GA_y, GA_z, GJ, EI_y and EI_z of beam elements of a given length.

    Beam elements with constant strain neglect the bending deflection step^3 / 12 EI.
    The shear stiffness is reduced to compensate for this.  The tip deflection of a
    cantilever is then exact for any number of elements.

    Args:
        link: the beam.
        step: [m] length of an element.

    Returns:
        Diagonal stiffness matrix, (6, 6) [N, N m^2].
    """
    section = declared_section(link.section, link.poisson)
    E, G = link.young, link.young / (2 * (1 + link.poisson))
    bending = E * np.array([section.I_y, section.I_z])
    shear = step**2 / (12 * bending[::-1])  # a force along y bends the beam about z
    if link.theory == "timoshenko":
        shares = np.array([section.shear_y, section.shear_z])
        shear = shear + 1 / (G * section.area * shares)
    return np.diag([E * section.area, *(1 / shear), G * section.J, *bending])
