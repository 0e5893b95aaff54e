"""Compliance of straight beams in closed form.

========  ======================================================  =====
symbol    meaning                                                 unit
========  ======================================================  =====
x y z     section axes: x along the beam, from base to tip, z up  -
I_y I_z   second moments of area; I_y bends about y               m^4
J         Saint-Venant's torsion constant                         m^4
shear_*   shear area for a force along y or z, divided by area    1
C         tip compliance, ``screw = C @ wrench``                  SI
========  ======================================================  =====
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.errors import BadInput, describe, nearest
from forcefit.stiffness.beam.sections import (
    Section,
    check_material,
    check_positive,
    check_section,
    declared_section,
)
from forcefit.stiffness.screws import UNIT_VECTORS

THEORIES = ("timoshenko", "euler")


def beam_compliance(
    length: float,
    section: Section | Mapping[str, float],
    E: float,
    nu: float,
    *,
    theory: str = "timoshenko",
    axis: ArrayLike = (1.0, 0.0, 0.0),
    up: ArrayLike | None = None,
) -> NDArray:
    r"""Compute the tip compliance of a straight cantilever with a constant section.

    The beam is clamped at its base, and the screw refers to its tip. Bending, torsion,
    tension and shear are included. Restrained warping and the compliance of the end
    fittings are neglected. To include them, use
    :func:`forcefit.stiffness.fem.fea.mesh_link`.

    Args:
        length: [m] distance from the clamped section to the tip, > 0.
        section: dimensions of the cross-section [m] by name, such as ``{"radius":
            0.02}``. See :func:`forcefit.stiffness.beam.sections.declared_section` for
            the names.
        E: [Pa] Young's modulus, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5).
        theory: ``"timoshenko"``, or ``"euler"`` to neglect shear.
        axis: (3,) vector in the direction from base to tip.
        up: (3,) vector in the direction of the section's z axis. Its component along
            the beam is removed. The default is y, or z for a beam along y.

    Returns:
        Compliance, (6, 6) [rad/(N m), rad/N, m/(N m), m/N], symmetric and positive
        definite.

    Raises:
        BadInput: an argument is out of range.

    Sources:
        Timoshenko & Gere, *Mechanics of Materials*, for a cantilever with an end load.

    Example:
        A downward force of 100 N rotates the tip about y:

        >>> C = beam_compliance(0.452, {"radius": 0.04}, E=60e9, nu=0.3)
        >>> print(f"{C[1] @ [0, 0, 0, 0, 0, -100.0] * 1e6:.1f} urad")
        84.7 urad
    """
    check_positive("beam_compliance", "length", length)
    check_material("beam_compliance", E, nu)
    if theory not in THEORIES:
        raise BadInput(
            f"beam_compliance: theory = {describe(theory)}{nearest(theory, THEORIES)}"
        )
    if not isinstance(section, Section):
        if not isinstance(section, Mapping):
            found = describe(section)
            raise BadInput(
                f'beam_compliance: section: found {found}, expected {{"radius": 0.02}}'
            )
        check_section("beam_compliance: section", section)
        section = declared_section(section, nu)
    C = _compliance_in_section_axes(length, section, E, nu, theory == "timoshenko")
    R = np.kron(np.eye(2), section_axes(axis, up))
    return R @ C @ R.T


def _compliance_in_section_axes(
    length: float, section: Section, E: float, nu: float, shear: bool
) -> NDArray:
    """Compute the tip compliance in the section axes x, y, z."""
    G = E / (2 * (1 + nu))
    slope_y, slope_z = length / (E * section.I_y), length / (E * section.I_z)
    C = np.diag([
        length / (G * section.J),
        slope_y,
        slope_z,
        length / (E * section.area),
        slope_z * length**2 / 3,
        slope_y * length**2 / 3,
    ])
    if shear:
        C[4, 4] += length / (G * section.area * section.shear_y)
        C[5, 5] += length / (G * section.area * section.shear_z)
    C[2, 4] = C[4, 2] = slope_z * length / 2  # fy rotates the tip about +z
    C[1, 5] = C[5, 1] = -slope_y * length / 2  # fz rotates the tip about -y
    return C


def section_axes(axis: ArrayLike, up: ArrayLike | None = None) -> NDArray:
    """Return the axes of a section: x along the beam, and z up.

    Args:
        axis: (3,) vector in the direction from base to tip.
        up: (3,) vector in the direction of the section's z axis. Its component along
            the beam is removed. The default is y, or z for a beam along y.

    Returns:
        (3, 3) rotation matrix whose columns are the axes.

    Raises:
        BadInput: a vector is zero or not finite, or ``up`` is parallel to the beam.
    """
    x = unit_vector("axis", axis)
    if up is None:
        along_y = np.linalg.norm(np.cross(x, UNIT_VECTORS["y"])) < 1e-9
        up = UNIT_VECTORS["z" if along_y else "y"]
    z = unit_vector("up", up)
    across = z - (z @ x) * x
    if np.linalg.norm(across) < 1e-9:
        raise BadInput(f"up = {z.tolist()} lies along the axis {x.tolist()}")
    z = across / np.linalg.norm(across)
    return np.column_stack([x, np.cross(z, x), z])


def unit_vector(name: str, vector: ArrayLike) -> NDArray:
    """Normalise a vector to unit length.

    Args:
        name: name of the vector, for error messages.
        vector: (3,) nonzero vector.

    Returns:
        (3,) unit vector.

    Raises:
        BadInput: the vector is zero or does not consist of three finite numbers.
    """
    direction = np.asarray(vector, dtype=float)
    if direction.shape != (3,) or not np.isfinite(direction).all():
        raise BadInput(f"{name}: found {describe(vector)}, expected 3 finite numbers")
    length = np.linalg.norm(direction)
    if length == 0:
        raise BadInput(f"{name} is zero; expected a nonzero direction vector")
    return direction / length
