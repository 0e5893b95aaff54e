r"""Peak von Mises stress in a straight beam under a tip wrench and its own weight.

========  ==========================================================  ======
symbol    meaning                                                     unit
========  ==========================================================  ======
x y z     axes of the beam: x from base to tip, z up                  -
N V       force on a section along x, and along y and z               N
M         moment on a section, about x (torsion), y and z             N m
W         weight of the beam, uniform along its length                N
s         distance of a section from the tip                          m
sigma     normal stress along x                                       Pa
tau       shear stress along y and along z                            Pa
========  ==========================================================  ======

In a section sigma = N / A + M_y z / I_y - M_z y / I_z. Without weight, N, V and the
torsional moment are constant along the beam, and the bending moments are linear in x.
The von Mises stress of a fibre, sqrt(sigma^2 + 3 tau^2), is then convex in x, so its
maximum is at the base or at the tip. With weight, forces increase as s W / L and
moments as s^2 / 2 (e_x x W) / L. The stress is then evaluated in 31 more sections and
at the extrema of both bending moments.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.sections import Section, declared_section

# number of fibres around a round section, which limits the relative error of the peak
# to 4e-5
_AROUND = 360
# number of fibres along each side of a rectangle, which limits the relative error of
# the peak of a parabola to 1e-3
_ACROSS = 33
_CHUNK = 2048  # number of sections in a batch, whose stresses occupy 54 MB
# number of sections of a beam with weight, which limits the relative error of the peak
# of a parabola to 1e-3
_ALONG = 33
_SHAPES = "radius and optionally inner_radius, or width, height and optionally wall"


def peak_beam_stress(
    section: Mapping[str, float],
    length: float,
    wrench: ArrayLike,
    weight: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[NDArray, NDArray]:
    """Compute the peak von Mises stress of a straight beam and its position.

    The stress is evaluated in the sections at the base and at the tip. For a beam with
    weight, it is also evaluated in sections between them. The points in each section
    are

    - 360 points on the outer circle of a round bar or tube,
    - a grid of 33 x 33 points in a solid rectangle, and
    - 33 points along each outer side of a hollow rectangle.

    The local stresses at the clamped ends and in the inner corners of a hollow
    rectangle are neglected.

    Args:
        section: dimensions [m] by name: ``radius`` and optionally ``inner_radius``, or
            ``width`` (along y), ``height`` (along z) and optionally ``wall``.
        length: [m] length of the beam, >= 0.
        wrench: (..., 6) [N m, N] wrench at the tip, in the axes of the beam.
        weight: (3,) or (..., 3) [N] weight, in the axes of the beam. It is distributed
            uniformly along the length.

    Returns:
        Peak stress, (...) [Pa], and its position relative to the base, (..., 3) [m], in
        the axes of the beam.

    Raises:
        BadInput: the outline of the section is unknown, or the section, the length or
            the wrench is invalid.

    Sources:
        Timoshenko & Gere, *Mechanics of Materials*, for bending and for the shear
        stress V Q / (I b); Timoshenko & Goodier, *Theory of Elasticity*, section 109,
        for torsion of a rectangle; Bredt (1896) for torsion of a hollow rectangle.

    Example:
        Under a transverse tip force, the peak stress is at the base:

        >>> bar = {"radius": 0.04}
        >>> stress, where = peak_beam_stress(bar, 0.452, [0, 0, 0, 0, 0, 1e3])
        >>> print(f"{stress / 1e6:.3f} MPa at x = {where[0]:g} m")
        8.992 MPa at x = 0 m
    """
    w = np.asarray(wrench, dtype=float)
    if w.shape[-1:] != (6,) or not np.isfinite(w).all():
        raise BadInput(
            f"peak_beam_stress: wrench has shape {w.shape}, expected (..., 6) of "
            "finite numbers"
        )
    if not (math.isfinite(length) and length >= 0):
        raise BadInput(f"peak_beam_stress: length = {length:g} must be >= 0")
    fibres, influence = section_stress(section)
    flat = w.reshape(-1, 6)
    W = np.broadcast_to(np.asarray(weight, dtype=float), (*w.shape[:-1], 3))
    W = W.reshape(-1, 3)
    from_tip = _sections(flat, W, length)
    stress, fibre = np.zeros(len(flat)), np.zeros(len(flat), dtype=int)
    place = np.zeros(len(flat))
    step = max(1, _CHUNK // from_tip.shape[1])
    for first in range(0, len(flat), step):
        part = slice(first, first + step)
        s = from_tip[part]
        forces = _on_sections(flat[part], W[part], s, length)
        sigma, shear = _stresses(influence, forces.reshape(-1, 6))
        values = np.sqrt(sigma**2 + shear).reshape(len(s), -1)
        worst = values.argmax(axis=1)
        at, fibre[part] = np.divmod(worst, len(fibres))
        rows = np.arange(len(s))
        stress[part], place[part] = values[rows, worst], length - s[rows, at]
    where = np.column_stack([place, fibres[fibre]])
    return stress.reshape(w.shape[:-1]), where.reshape(*w.shape[:-1], 3)


def _sections(wrench: NDArray, weight: NDArray, length: float) -> NDArray:
    """Return the distances of the evaluated sections from the tip, (n, k) [m]."""
    ends = np.broadcast_to([length, 0.0], (len(wrench), 2))
    if not weight.any():
        return ends
    between = np.linspace(0, length, _ALONG)[1:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        # a bending moment is extremal where the corresponding shear force is zero
        share = -wrench[:, 4:] / weight[:, 1:]
    extrema = length * np.clip(np.nan_to_num(share), 0, 1)
    between = np.broadcast_to(between, (len(wrench), len(between)))
    return np.hstack([ends, extrema, between])


def _on_sections(
    wrench: NDArray, weight: NDArray, s: NDArray, length: float
) -> NDArray:
    """Return the moments and forces on sections, (n, k, 6) [N m, N]."""
    on = np.repeat(wrench[:, None], s.shape[1], axis=1)
    share = s / length if length else np.zeros_like(s)
    # The moment is the distance from the tip times the mean force, which includes half
    # of the weight between tip and section.
    middle = wrench[:, None, 3:] + share[..., None] * weight[:, None] / 2
    on[..., 1] -= s * middle[..., 2]
    on[..., 2] += s * middle[..., 1]
    on[..., 3:] += share[..., None] * weight[:, None]
    return on


def _stresses(influence: NDArray, forces: NDArray) -> tuple[NDArray, NDArray]:
    """Return sigma [Pa] and 3 tau^2 [Pa^2] of each fibre, both (n, p)."""
    sigma, tau_y, tau_z = (forces @ influence[:, k].T for k in range(3))
    return sigma, 3 * (tau_y**2 + tau_z**2)


def section_stress(section: Mapping[str, float]) -> tuple[NDArray, NDArray]:
    """Return the fibres of a section and their stresses under unit loads.

    Args:
        section: see :func:`peak_beam_stress`.

    Returns:
        Coordinates y and z of the fibres, (p, 2) [m]; and sigma, tau along y and tau
        along z for unit moments about x, y, z and unit forces along x, y, z, (p, 3, 6)
        [1/m^3, 1/m^2].

    Raises:
        BadInput: the outline of the section is unknown, or the section is invalid.
    """
    if "area" in section:
        raise BadInput(
            "stress: found a section given by area, I_y, I_z, J, whose outline "
            f"is unknown; expected {_SHAPES}"
        )
    known = {"radius", "inner_radius", "width", "height", "wall"}
    if not {"radius"} <= set(section) <= {"radius", "inner_radius"} and not (
        {"width", "height"} <= set(section) <= known - {"radius", "inner_radius"}
    ):
        raise BadInput(
            f"stress: found a section of {', '.join(section) or 'nothing'}; "
            f"expected {_SHAPES}"
        )
    # the value of Poisson's ratio affects only the shear factors, which are not used
    constants = declared_section(section, nu=0.3)
    if "radius" in section:
        return _round(constants, section["radius"], section.get("inner_radius", 0.0))
    width, height = section["width"], section["height"]
    if "wall" in section:
        return _hollow(constants, width, height, section["wall"])
    return _rectangle(constants, width, height)


def _bending(section: Section, y: NDArray, z: NDArray) -> NDArray:
    """Return the normal stresses due to unit loads, (p, 3, 6)."""
    influence = np.zeros((len(y), 3, 6))
    influence[:, 0, 1] = z / section.I_y
    influence[:, 0, 2] = -y / section.I_z
    influence[:, 0, 3] = 1 / section.area
    return influence


def _round(section: Section, radius: float, hole: float) -> tuple[NDArray, NDArray]:
    """Return the fibres on the outer circle and their stresses under unit loads."""
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    along = np.column_stack([-out[:, 1], out[:, 0]])
    influence = _bending(section, *(radius * out.T))
    influence[:, 1:, 0] = along * radius / section.J
    # V Q / (I b) at the neutral axis is 4/3 of the mean in a bar, and 2 in a thin tube
    peak = 4 / 3 * (radius**2 + radius * hole + hole**2) / (radius**2 + hole**2)
    # the stress varies with the sine of the angle between V and the radius
    influence[:, 1:, 4:] = peak / section.area * along[:, :, None] * along[:, None, :]
    return radius * out, influence


def _rectangle(
    section: Section, width: float, height: float
) -> tuple[NDArray, NDArray]:
    """Return a grid of fibres over a rectangle and their stresses under unit loads."""
    share = np.linspace(-0.5, 0.5, _ACROSS)
    y, z = (v.ravel() for v in np.meshgrid(width * share, height * share))
    influence = _bending(section, y, z)
    if width <= height:
        tau_y, tau_z = _torsion(y, z, width / 2, height / 2)
    else:  # rotate by 90 degrees about x, so that the short side is along z
        tau_z, minus_tau_y = _torsion(z, -y, height / 2, width / 2)
        tau_y = -minus_tau_y
    influence[:, 1, 0], influence[:, 2, 0] = tau_y / section.J, tau_z / section.J
    influence[:, 1, 4] = 1.5 / section.area * (1 - (2 * y / width) ** 2)
    influence[:, 2, 5] = 1.5 / section.area * (1 - (2 * z / height) ** 2)
    return np.column_stack([y, z]), influence


def _torsion(p: NDArray, q: NDArray, a: float, b: float) -> tuple[NDArray, NDArray]:
    """Return the torsional shear stresses along p and q, divided by G theta [m]."""
    along_p, along_q = np.zeros_like(p), 2 * p
    # The terms decrease as exp(-n pi (b - |q|) / 2a), and as 1 / n^2 on the short
    # sides.
    for n in range(1, 400, 2):
        k = n * np.pi / (2 * a)
        factor = 16 * a / np.pi**2 / n**2 * (-1) ** ((n - 1) // 2)
        fall = np.exp(k * (np.abs(q) - b)) / (1 + np.exp(-2 * k * b))
        again = np.exp(-2 * k * np.abs(q))
        along_p -= factor * np.sign(q) * fall * (1 - again) * np.cos(k * p)
        along_q -= factor * fall * (1 + again) * np.sin(k * p)
    return along_p, along_q


def _hollow(
    section: Section, width: float, height: float, wall: float
) -> tuple[NDArray, NDArray]:
    """Return the fibres on the outer sides and their stresses under unit loads."""
    share = np.linspace(-0.5, 0.5, _ACROSS)
    places, influences = [], []
    for turns in range(4):
        # The stresses are computed for the right side of the section, which is rotated
        # by multiples of 90 degrees.
        across, up = (width, height) if turns % 2 == 0 else (height, width)
        second = section.I_y if turns % 2 == 0 else section.I_z
        out = np.round([np.cos(turns * np.pi / 2), np.sin(turns * np.pi / 2)])
        along = np.array([-out[1], out[0]])
        where = across / 2 * out + up * share[:, None] * along
        influence = _bending(section, *where.T)
        b, h = across - wall, up - wall
        around = 2 * (b + h)
        # torsional shear stress by Bredt's formula, plus the torsional shear stress at
        # the face of an open wall
        twist = 2 * b * h / around / section.J + wall / section.J
        # V Q / (I b), where Q is the first moment of the flange and of the wall beyond
        # the point about the neutral axis
        inside = np.minimum(np.abs(up * share), up / 2 - wall)
        flange = across * (up**2 - (up - 2 * wall) ** 2) / 8
        Q = flange + wall * ((up / 2 - wall) ** 2 - inside**2)
        parallel = Q / (second * 2 * wall)
        # The shear flow of a force normal to this side is zero in the middle of the
        # side.
        other = section.I_z if turns % 2 == 0 else section.I_y
        crossing = -b / 2 * (up * share) / other
        flow = parallel[:, None] * along + crossing[:, None] * out
        influence[:, 1:, 0] = twist * along
        influence[:, 1:, 4:] = along[:, None] * flow[:, None, :]
        places.append(where)
        influences.append(influence)
    return np.concatenate(places), np.concatenate(influences)
