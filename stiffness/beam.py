"""Sections and straight beams in closed form.

========  ======================================================  =====
symbol    meaning                                                 unit
========  ======================================================  =====
x y z     section axes: x along the beam, from base to tip, z up  -
I_y I_z   second moments of area; I_y bends about y               m^4
J         Saint-Venant's torsion constant                         m^4
shear_*   factor on the area that resists a force along y, z      1
C         tip compliance, ``screw = C @ wrench``                  SI
========  ======================================================  =====
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffness.reading import BadInput, describe, nearest

THEORIES = ("timoshenko", "euler")


@dataclass(frozen=True)
class Section:
    """What a straight beam needs to know about its section.

    Attributes:
        area: [m^2].
        I_y: [m^4] second moment of area for bending about y (deflection along z).
        I_z: [m^4] the same about z.
        J: [m^4] torsion constant.
        shear_y: [1] share of the area that resists a force along y.
        shear_z: [1] the same along z.
    """

    area: float
    I_y: float
    I_z: float
    J: float
    shear_y: float
    shear_z: float

    def __post_init__(self) -> None:
        for item in fields(self):
            _check_positive("section", item.name, getattr(self, item.name))

    @property
    def size(self) -> float:
        """[m] twice the larger radius of gyration: the radius of a solid round bar."""
        return 2 * math.sqrt(max(self.I_y, self.I_z) / self.area)


def _check_positive(who: str, name: str, value: float) -> None:
    """Refuse anything but a finite positive number."""
    if not (math.isfinite(value) and value > 0):
        raise BadInput(f"{who}: {name} = {value:g} must be finite and > 0")


def check_material(who: str, E: float, nu: float) -> None:
    """Refuse elastic constants of no isotropic solid.

    Args:
        who: whose they are, for the message.
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.

    Raises:
        BadInput: E is not finite and positive, or nu not in (-1, 0.5).
    """
    _check_positive(who, "E", E)
    if not -1.0 < nu < 0.5:
        raise BadInput(f"{who}: nu = {nu:g} must lie between -1.0 and 0.5")


def round_section(radius: float, nu: float, inner_radius: float = 0.0) -> Section:
    """Section of a round bar or tube.

    Args:
        radius: [m] outer radius, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5); the shear factor depends on it.
        inner_radius: [m] of the hole, 0 for a solid bar, < radius.

    Returns:
        The section.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of its range.

    Sources:
        Cowper (1966), "The shear coefficient in Timoshenko's beam theory", for a circle
        and for a thick tube.
    """
    _check_positive("round_section", "radius", radius)
    if not 0.0 <= inner_radius < radius:
        raise BadInput(
            f"round_section: inner_radius = {inner_radius:g} must lie between 0 "
            f"and radius = {radius:g}"
        )
    check_material("round_section", 1.0, nu)
    m2 = (inner_radius / radius) ** 2
    area = math.pi * radius**2 * (1 - m2)
    second_moment = math.pi / 4 * radius**4 * (1 - m2**2)
    whole = (7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2
    shear = 6 * (1 + nu) * (1 + m2) ** 2 / whole
    return Section(area, second_moment, second_moment, 2 * second_moment, shear, shear)


def rectangular_section(width: float, height: float, nu: float) -> Section:
    """Section of a solid rectangular bar.

    Args:
        width: [m] along the section's y, > 0.
        height: [m] along the section's z, the ``up`` of the beam, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5); the shear factor depends on it.

    Returns:
        The section.

    Raises:
        BadInput: a dimension or Poisson's ratio is out of its range.

    Sources:
        Cowper (1966) for the shear factor; Timoshenko & Goodier, *Theory of
        Elasticity*, section 109, for Saint-Venant's torsion series.
    """
    _check_positive("rectangular_section", "width", width)
    _check_positive("rectangular_section", "height", height)
    check_material("rectangular_section", 1.0, nu)
    shear = 10 * (1 + nu) / (12 + 11 * nu)
    return Section(
        area=width * height,
        I_y=width * height**3 / 12,
        I_z=height * width**3 / 12,
        J=_rectangle_torsion(width, height),
        shear_y=shear,
        shear_z=shear,
    )


def declared_section(given: Mapping[str, float], nu: float) -> Section:
    """The section of a beam from the numbers that declare it.

    Args:
        given: ``radius`` and perhaps ``inner_radius``; or ``width`` and ``height`` and
            perhaps ``wall`` (a box) or ``web`` and ``flange`` (an I); or the attributes
            of a :class:`Section` [m, m^2, m^4].
        nu: [-] Poisson's ratio.

    Returns:
        The section.
    """
    if "radius" in given:
        return round_section(given["radius"], nu, given.get("inner_radius", 0.0))
    from stiffness.sections import box_section, i_section  # which needs Section

    if "wall" in given:
        return box_section(given["width"], given["height"], given["wall"], nu)
    if "web" in given:
        return i_section(
            given["width"], given["height"], given["web"], given["flange"], nu
        )
    if "width" in given:
        return rectangular_section(given["width"], given["height"], nu)
    return Section(**given)


def _rectangle_torsion(width: float, height: float) -> float:
    """Saint-Venant's series; the terms left out sum to less than 1e-16 of it."""
    long, short = max(width, height), min(width, height)
    odd = np.arange(1.0, 2001.0, 2.0)
    # tanh is 1 for all but the first few terms; their tail decays as n^-4
    tail = np.sum(np.tanh(odd * math.pi * long / (2 * short)) / odd**5)
    return long * short**3 / 3 * (1 - 192 / math.pi**5 * short / long * float(tail))


def beam_compliance(
    length: float,
    section: Section,
    E: float,
    nu: float,
    *,
    theory: str = "timoshenko",
    axis: ArrayLike = (1.0, 0.0, 0.0),
    up: ArrayLike | None = None,
) -> NDArray:
    r"""Tip compliance of a straight cantilever of constant section.

    The link is clamped at its base; the screw is read at its tip.  Bending, torsion,
    stretching and (Timoshenko) shear are included; warping restraint, taper and the
    local compliance of the end fittings are not: :func:`stiffness.fea.mesh_link` has
    them.

    Args:
        length: [m] from the clamped section to the tip, > 0.
        section: its constants.
        E: [Pa] Young's modulus, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5).
        theory: ``"timoshenko"``, or ``"euler"``, which leaves shear out.
        axis: (3,) any length, from base to tip, in the axes of the result.
        up: (3,) the section's z, in the same axes; what it has along the axis is
            dropped.  Default: y, unless the beam lies along y, then z.

    Returns:
        (6, 6) [rad/(N m), rad/N, m/(N m), m/N] symmetric positive definite.

    Raises:
        BadInput: an argument is out of its range.

    Sources:
        Timoshenko & Gere, *Mechanics of Materials*: cantilever under an end load.

    Example:
        A downward force of 100 N turns the tip about y:

        >>> section = round_section(0.04, nu=0.3)
        >>> C = beam_compliance(0.452, section, E=60e9, nu=0.3)
        >>> print(f"{C[1] @ [0, 0, 0, 0, 0, -100.0] * 1e6:.1f} urad")
        84.7 urad
    """
    _check_positive("beam_compliance", "length", length)
    check_material("beam_compliance", E, nu)
    if theory not in THEORIES:
        raise BadInput(
            f"beam_compliance: theory = {describe(theory)}{nearest(theory, THEORIES)}"
        )
    C = _compliance_in_section_axes(length, section, E, nu, theory == "timoshenko")
    R = np.kron(np.eye(2), section_axes(axis, up))
    return R @ C @ R.T


def _compliance_in_section_axes(
    length: float, section: Section, E: float, nu: float, shear: bool
) -> NDArray:
    """Tip compliance in the section's own x, y, z."""
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
    C[2, 4] = C[4, 2] = slope_z * length / 2  # fy turns the tip about +z
    C[1, 5] = C[5, 1] = -slope_y * length / 2  # fz turns the tip about -y
    return C


def section_axes(axis: ArrayLike, up: ArrayLike | None = None) -> NDArray:
    """Axes of a section, as columns x (along the beam), y, z (up).

    Args:
        axis: (3,) any length, from base to tip.
        up: (3,) the section's z, orthogonalised against the axis.  Default: y, unless
            the beam lies along y, then z.

    Returns:
        (3, 3) proper orthogonal.

    Raises:
        BadInput: a vector is not three finite numbers, is zero, or ``up`` lies along
            the axis.
    """
    x = unit_vector("axis", axis)
    if up is None:
        along_y = np.linalg.norm(np.cross(x, [0.0, 1.0, 0.0])) < 1e-9
        up = (0.0, 0.0, 1.0) if along_y else (0.0, 1.0, 0.0)
    z = unit_vector("up", up)
    across = z - (z @ x) * x
    if np.linalg.norm(across) < 1e-9:
        raise BadInput(f"up = {z.tolist()} lies along the axis {x.tolist()}")
    z = across / np.linalg.norm(across)
    return np.column_stack([x, np.cross(z, x), z])


def unit_vector(name: str, vector: ArrayLike) -> NDArray:
    """The direction of a vector given from outside.

    Args:
        name: for the message.
        vector: (3,) any length but zero.

    Returns:
        (3,) of length one.

    Raises:
        BadInput: it is not three finite numbers, or zero.
    """
    direction = np.asarray(vector, dtype=float)
    if direction.shape != (3,) or not np.isfinite(direction).all():
        raise BadInput(f"{name}: found {describe(vector)}, expected 3 finite numbers")
    length = np.linalg.norm(direction)
    if length == 0:
        raise BadInput(f"{name} is zero; expected a direction")
    return direction / length
