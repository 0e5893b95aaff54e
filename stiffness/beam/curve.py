r"""Compliance of tapered and curved beams, by integration along the curve.

The compliance of a cantilever is the integral of the compliances of its slices, each
expressed at the tip:

    C = integral A(s) c(s) A(s)^T ds,   A(s) = screw_map(p(s) - tip, R(s)).

Here c(s) = diag(1/GJ, 1/EI_y, 1/EI_z, 1/EA, 1/GA_y, 1/GA_z) is the compliance per unit
length in the section's axes R(s). The formula is accurate if the radius of curvature is
large compared with the section. Warping at corners of the curve is neglected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.table import BadInput, describe, nearest
from forcefit.stiffness.beam.beam import THEORIES, section_axes, unit_vector
from forcefit.stiffness.beam.sections import Section, check_material
from forcefit.stiffness.screws import rotation_matrix, screw_map

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_MOST_PARTS = 128


@dataclass(frozen=True, eq=False)
class Piece:
    """A smooth segment of a beam, parametrised by t from 0 to 1.

    Attributes:
        place: function of t that returns the position, (3,) [m].
        tangent: function of t that returns the derivative of the position with respect
            to t, (3,) [m].
        section: function of t that returns the section.
        up: function of t that returns a vector in the direction of the section's z
            axis, (3,). If None, the default of
            :func:`forcefit.stiffness.beam.beam.section_axes` is used.
    """

    place: Callable[[float], NDArray]
    tangent: Callable[[float], NDArray]
    section: Callable[[float], Section]
    up: Callable[[float], NDArray] | None = None


def straight_piece(
    start: ArrayLike,
    end: ArrayLike,
    section: Section | Callable[[float], Section],
    up: ArrayLike | None = None,
) -> Piece:
    """Create a straight segment, which is tapered if its section depends on t.

    Args:
        start: (3,) [m] position of the start.
        end: (3,) [m] position of the end.
        section: constant section, or function of t that returns the section.
        up: (3,) vector in the direction of the section's z axis.

    Returns:
        The segment.

    Raises:
        BadInput: the ends coincide or are not finite.
    """
    p, q = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    unit_vector("piece: vector from start to end", q - p)
    fixed = None if up is None else unit_vector("up", up)
    return Piece(
        place=lambda t: p + t * (q - p),
        tangent=lambda t: q - p,
        section=_as_function(section),
        up=None if fixed is None else lambda t: fixed,
    )


def arc_piece(
    start: ArrayLike,
    center: ArrayLike,
    turn: ArrayLike,
    section: Section | Callable[[float], Section],
) -> Piece:
    """Create a segment along a circular arc, with the section's z along the arc's axis.

    Args:
        start: (3,) [m] position of the start.
        center: (3,) [m] centre of the circle.
        turn: (3,) [rad] rotation vector from the start to the end of the arc.
        section: constant section, or function of t that returns the section.

    Returns:
        The segment.

    Raises:
        BadInput: the rotation is zero, or its axis is not normal to the radius.
    """
    p, c = np.asarray(start, dtype=float), np.asarray(center, dtype=float)
    angle = np.asarray(turn, dtype=float)
    axis = unit_vector("turn", angle)
    spoke = p - c
    if abs(spoke @ axis) > 1e-9 * np.linalg.norm(spoke):
        raise BadInput(
            "arc: found a rotation axis that is not normal to the radius, expected a "
            "normal axis"
        )
    return Piece(
        place=lambda t: c + rotation_matrix(t * angle) @ spoke,
        tangent=lambda t: np.cross(angle, rotation_matrix(t * angle) @ spoke),
        section=_as_function(section),
        up=lambda t: axis,
    )


def _as_function(
    section: Section | Callable[[float], Section],
) -> Callable[[float], Section]:
    """Convert a section to a function of t."""
    return (lambda t: section) if isinstance(section, Section) else section


def curve_compliance(
    pieces: Sequence[Piece],
    E: float,
    nu: float,
    *,
    theory: str = "timoshenko",
    tolerance: float = 1e-10,
) -> NDArray:
    """Compute the tip compliance of a beam along a curve.

    Args:
        pieces: segments from base to tip, each of which starts where the previous one
            ends.
        E: [Pa] Young's modulus, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5).
        theory: ``"timoshenko"``, or ``"euler"`` to neglect shear.
        tolerance: [1] largest integration error of an entry C_ij, divided by sqrt(C_ii
            C_jj).

    Returns:
        Compliance at the end of the last segment, (6, 6) [rad/(N m) .. m/N], symmetric
        and positive definite, in the axes of the segments.

    Raises:
        BadInput: no segment is given, consecutive segments do not share a point, an
            argument is out of range, or a section changes too abruptly.

    Example:
        An L-shaped beam consists of two bars. A force at its end, parallel to the first
        bar, bends both bars:

        >>> from forcefit.stiffness.beam.sections import round_section
        >>> bar = round_section(0.01, nu=0.3)
        >>> L = [straight_piece([0, 0, 0], [0.2, 0, 0], bar),
        ...      straight_piece([0.2, 0, 0], [0.2, 0.2, 0], bar)]
        >>> C = curve_compliance(L, E=210e9, nu=0.3)
        >>> print(f"{C[3, 3] * 1e6:.3f} um/N along x")
        6.479 um/N along x
    """
    check_material("curve_compliance", E, nu)
    if theory not in THEORIES:
        raise BadInput(
            f"curve_compliance: theory = {describe(theory)}{nearest(theory, THEORIES)}"
        )
    if not pieces:
        raise BadInput("curve_compliance: found no pieces, expected at least one")
    _check_joined(pieces)
    tip = pieces[-1].place(1.0)

    def slices(parts: int) -> NDArray:
        return sum(
            (_integral(piece, tip, E, nu, theory, parts) for piece in pieces),
            start=np.zeros((6, 6)),
        )

    parts, C = 2, slices(1)
    while parts <= _MOST_PARTS:
        finer = slices(parts)
        scale = np.sqrt(np.outer(np.diag(finer), np.diag(finer)))
        if np.all(np.abs(finer - C) <= tolerance * scale):
            return (finer + finer.T) / 2
        parts, C = 2 * parts, finer
    raise BadInput(
        "curve_compliance: the integral did not converge to a relative error of "
        f"{tolerance:g}; divide the pieces at points where the section changes abruptly"
    )


def curve_mass(
    pieces: Sequence[Piece], density: float
) -> tuple[float, NDArray, NDArray]:
    """Compute the mass, the centre of mass and the inertia of a beam along a curve.

    Args:
        pieces: segments from base to tip.
        density: [kg/m^3] density.

    Returns:
        Mass [kg]; centre of mass, (3,) [m]; and inertia about the centre of mass,
        (3, 3) [kg m^2]; in the axes of the segments.
    """
    mass, moment, second, own = 0.0, np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    for piece in pieces:
        for x, weight in zip(_POINTS, _WEIGHTS, strict=True):
            t = (x + 1) / 2
            section, tangent, place = piece.section(t), piece.tangent(t), piece.place(t)
            line = density * section.area * np.linalg.norm(tangent)
            mass += weight / 2 * line
            moment += weight / 2 * line * place
            second += weight / 2 * line * np.outer(place, place)
            R = section_axes(tangent, None if piece.up is None else piece.up(t))
            across = [section.I_y + section.I_z, section.I_y, section.I_z]
            own += weight / 2 * line / section.area * R @ np.diag(across) @ R.T
    centre = moment / mass
    second -= mass * np.outer(centre, centre)
    return float(mass), centre, own + np.trace(second) * np.eye(3) - second


def curve_length(pieces: Sequence[Piece]) -> float:
    """Compute the length of a beam along its curve.

    Args:
        pieces: segments from base to tip.

    Returns:
        Length [m].
    """
    speeds = [
        [np.linalg.norm(piece.tangent((x + 1) / 2)) for x in _POINTS]
        for piece in pieces
    ]
    return float(np.sum(np.array(speeds) @ _WEIGHTS) / 2)


def _check_joined(pieces: Sequence[Piece]) -> None:
    """Check that each segment starts where the previous segment ends."""
    for number, (one, next_one) in enumerate(
        zip(pieces[:-1], pieces[1:], strict=True), start=2
    ):
        gap = float(np.linalg.norm(next_one.place(0.0) - one.place(1.0)))
        size = float(np.linalg.norm(one.tangent(1.0)))
        if gap > 1e-6 * size:
            raise BadInput(
                f"curve_compliance: piece {number} starts {gap:.3g} m from the end of "
                "the previous piece; expected the same point"
            )


def _integral(
    piece: Piece, tip: NDArray, E: float, nu: float, theory: str, parts: int
) -> NDArray:
    """Integrate the compliance of a segment by Gauss quadrature."""
    G, shear = E / (2 * (1 + nu)), theory == "timoshenko"
    total = np.zeros((6, 6))
    for first in range(parts):
        for x, weight in zip(_POINTS, _WEIGHTS, strict=True):
            t = (first + (x + 1) / 2) / parts
            s, along = piece.section(t), piece.tangent(t)
            R = section_axes(along, None if piece.up is None else piece.up(t))
            A = screw_map(piece.place(t) - tip, R)
            c = np.array([
                1 / (G * s.J),
                1 / (E * s.I_y),
                1 / (E * s.I_z),
                1 / (E * s.area),
                shear / (G * s.area * s.shear_y),
                shear / (G * s.area * s.shear_z),
            ])
            total += weight / (2 * parts) * np.linalg.norm(along) * (A * c) @ A.T
    return total
