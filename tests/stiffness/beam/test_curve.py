"""Tests of curved and tapered beams."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.curve import (
    Piece,
    arc_piece,
    curve_compliance,
    curve_length,
    straight_piece,
)
from forcefit.stiffness.beam.sections import (
    Section,
    box_section,
    i_section,
    rectangular_section,
    round_section,
)
from forcefit.stiffness.fem.condensation import condense
from forcefit.stiffness.fem.elements import isoparametric, lame
from forcefit.stiffness.link import inverted
from forcefit.stiffness.screws import rotation_matrix, screw_map
from tests.solids_for_tests import bar_solid, box_solid, masked_solid
from tests.stiffness.beam.test_beam import assert_same

E, NU = 60e9, 0.3
G = E / (2 * (1 + NU))
BAR = round_section(0.01, NU)
CROOKED = Section(1.2e-3, 4e-8, 9e-8, 7e-8, 0.8, 0.6)


def test_compliance_of_a_straight_segment_equals_that_of_a_beam(rng):
    axis, up = rng.normal(size=3), rng.normal(size=3)
    C = curve_compliance([straight_piece([0, 0, 0], axis, CROOKED, up)], E, NU)
    length = np.linalg.norm(axis)
    assert_same(C, beam_compliance(length, CROOKED, E, NU, axis=axis, up=up), 1e-13)


def test_compliance_of_an_l_shape_equals_that_of_two_beams_in_series():
    first = beam_compliance(0.2, CROOKED, E, NU, axis=[0, 0, 1], up=[0, 1, 0])
    second = beam_compliance(0.15, CROOKED, E, NU, axis=[1, 0, 0], up=[0, 1, 0])
    A = screw_map([-0.15, 0, 0])
    corner, tip = [0, 0, 0.2], [0.15, 0, 0.2]
    ends = ([0, 0, 0], corner), (corner, tip)
    pieces = [straight_piece(*pair, CROOKED, [0, 1, 0]) for pair in ends]
    assert_same(curve_compliance(pieces, E, NU), A @ first @ A.T + second, 1e-13)


def test_compliance_of_a_quarter_circle_equals_castiglianos_solution():
    """The arc is clamped at (R, 0) and loaded at (0, R). The compliances are

    x: (3 pi/4 - 2) R^3/EI + pi R/4EA;  y: pi R^3/4EI + pi R/4EA;
    z: pi R^3/4EI + (3 pi/4 - 2) R^3/GJ.
    """
    R, EI, EA, GJ = 0.5, E * BAR.I_y, E * BAR.area, G * BAR.J
    arc = arc_piece([R, 0, 0], [0, 0, 0], [0, 0, math.pi / 2], BAR)
    C = curve_compliance([arc], E, NU, theory="euler")
    q = math.pi / 4
    assert C[3, 3] == pytest.approx((3 * q - 2) * R**3 / EI + q * R / EA, rel=1e-12)
    assert C[4, 4] == pytest.approx(q * R**3 / EI + q * R / EA, rel=1e-12)
    assert C[5, 5] == pytest.approx(q * R**3 / EI + (3 * q - 2) * R**3 / GJ, rel=1e-12)


def test_compliance_of_a_cone_equals_closed_forms():
    """The axial compliance is L / (E pi r0 r1), and the torsional compliance is 2 L
    (r0^2 + r0 r1 + r1^2) / (3 pi G r0^3 r1^3)."""
    L, r0, r1 = 0.35, 0.045, 0.025
    cone = straight_piece(
        [0, 0, 0], [0, 0, L], lambda t: round_section(r0 + (r1 - r0) * t, NU)
    )
    C = curve_compliance([cone], E, NU)
    assert C[5, 5] == pytest.approx(L / (E * math.pi * r0 * r1), rel=1e-10)
    twist = 2 * L * (r0**2 + r0 * r1 + r1**2) / (3 * math.pi * G * (r0 * r1) ** 3)
    assert C[2, 2] == pytest.approx(twist, rel=1e-10)

    def bent(x):
        s = round_section(r0 + (r1 - r0) * x / L, NU)
        return (L - x) ** 2 / (E * s.I_y) + 1 / (G * s.area * s.shear_y)

    assert C[3, 3] == pytest.approx(quad(bent, 0, L, epsrel=1e-12)[0], rel=1e-9)


def line(start=0.0, section=BAR):
    """Return a straight segment of 1 m along x."""
    return straight_piece([start, 0, 0], [start + 1, 0, 0], section)


def stepped(t):
    """Return a section that changes abruptly at a third of the length."""
    return BAR if t < 1 / 3 else CROOKED


@pytest.mark.parametrize(("call", "message"), [
    (lambda: curve_compliance([], E, NU), "no pieces"),
    (lambda: curve_compliance([line(), line(1.1)], E, NU), "starts 0.1 m from the"),
    (lambda: straight_piece([0, 0, 0], [0, 0, 0], BAR), "is zero"),
    (lambda: arc_piece([1, 0, 0], [0, 0, 0], [1, 0, 0], BAR), "not normal to the"),
    (lambda: curve_compliance([line()], E, NU, theory="eulr"), '"euler"?'),
    (
        lambda: curve_compliance([line(section=stepped)], E, NU),
        "divide the pieces at points where the section changes abruptly",
    ),
    (lambda: box_section(0.1, 0.1, 0.05, NU), "expected less than half"),
    (lambda: i_section(0.1, 0.1, 0.2, 0.01, NU), "expected web < width"),
    (lambda: i_section(0.1, math.nan, 0.01, 0.01, NU), "height = nan"),
])  # fmt: skip
def test_invalid_curve_or_section_is_rejected(call, message):
    with pytest.raises(BadInput) as caught:
        call()
    assert message in str(caught.value)


def measured_section(solid, center=(0, 0), lengths=(0.15, 0.25)):
    """Return the torsion constant and the shear area of a bar by finite elements. They
    follow from the difference of the compliances at two lengths, in which the end
    effects cancel.
    """
    C = []
    for length in lengths:
        mesh = isoparametric(solid(length))
        lam, mu = (np.full(len(mesh.cells), v) for v in lame(E, NU))
        centers = np.array([[*center, 0], [*center, length]])
        K = condense(mesh, lam, mu, centers, "distributing-both").stiffness
        C.append(np.diag(inverted(K)))
    step, cubes = lengths[1] - lengths[0], lengths[1] ** 3 - lengths[0] ** 3
    grown = C[1] - C[0]
    bending = cubes / (3 * step) * grown[0]
    return step / (G * grown[2]), step / (G * (grown[4] - bending))


def test_shear_factor_of_a_round_bar_agrees_with_hutchinson():
    """Hutchinson's factor (2001) is 6 (1 + nu)^2 / (7 + 12 nu + 4 nu^2).

    It is 0.9252 at nu = 0.3, and Cowper's factor is 0.8864.
    """
    J, shear_area = measured_section(lambda L: bar_solid(2, round(40 * L), 0.04, L))
    factor = 6 * (1 + NU) ** 2 / (7 + 12 * NU + 4 * NU**2)
    section = round_section(0.04, NU)
    assert shear_area / section.area == pytest.approx(factor, rel=1e-4)
    assert J == pytest.approx(section.J, rel=1e-5)
    assert section.shear_y == pytest.approx(0.8864, abs=1e-4)


def test_torsion_constant_of_a_square_agrees_with_finite_elements():
    """The size of the elements is a quarter of the width."""
    J, _ = measured_section(
        lambda L: box_solid((4, 4, round(40 * L)), (0.04, 0.04, L)), (0.02, 0.02)
    )
    assert J == pytest.approx(rectangular_section(0.04, 0.04, NU).J, rel=2e-4)


def test_torsion_constant_of_a_thin_box_agrees_with_finite_elements():
    """Bredt's formula neglects the corners, which contribute 3.5 % of J here."""
    wall = 0.06 / 12

    def solid(length):
        return masked_solid(
            (12, 12, round(20 * length)), (0.06, 0.06, length),
            lambda c: (np.abs(c[:, :2] - 0.03) > 0.03 - wall).any(axis=1),
        )  # fmt: skip

    J, _ = measured_section(solid, (0.03, 0.03))
    section = box_section(0.06, 0.06, wall, NU)
    assert J / section.J == pytest.approx(1.035, abs=0.002)


def test_rotation_of_a_curve_rotates_its_compliance(rng):
    R = rotation_matrix(rng.normal(size=3))
    turn = np.array([0.3, -0.4, 0.2])
    spoke = np.cross(turn, [1, 2, 3.0]) / 5
    plain = curve_compliance([arc_piece(spoke, [0, 0, 0], turn, CROOKED)], E, NU)
    rotated = arc_piece(R @ spoke, [0, 0, 0], R @ turn, CROOKED)
    A = np.kron(np.eye(2), R)
    assert_same(curve_compliance([rotated], E, NU), A @ plain @ A.T, 1e-12)


@pytest.mark.parametrize("away", [(0.0, 0.0, 0.0), (0.7, -0.3, 0.5)])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e2])
def test_dividing_a_curve_does_not_change_compliance_and_length(away, size):
    """An arc is divided into two arcs, and a bar into two bars."""
    o, turn = np.array(away) * size, np.array([0.0, 0.6, 0.0])
    centre, corner = o + [0, 0, 0.2 * size], o + [-0.3 * size, 0, 0]
    half = arc_piece(o, centre, turn / 2, CROOKED)
    middle = half.place(1.0)
    end = arc_piece(o, centre, turn, CROOKED).place(1.0)
    assert np.linalg.norm(end - centre) == pytest.approx(0.2 * size)

    def leg(start, end):
        return straight_piece(start, end, CROOKED, [0, 1, 0])

    one = [leg(corner, o), arc_piece(o, centre, turn, CROOKED)]
    cut = [leg(corner, (corner + o) / 2), leg((corner + o) / 2, o), half]
    cut.append(arc_piece(middle, centre, turn / 2, CROOKED))
    assert_same(curve_compliance(cut, E, NU), curve_compliance(one, E, NU), 1e-9)
    for pieces in (one, cut):
        assert curve_length(pieces) == pytest.approx((0.3 + 0.2 * 0.6) * size)


def test_curve_length_of_a_parabola_equals_its_closed_form():
    """The length of y = x^2 from 0 to 1 is sqrt(5) / 2 + asinh(2) / 4."""
    parabola = Piece(
        place=lambda t: np.array([t, t**2, 0.0]),
        tangent=lambda t: np.array([1.0, 2 * t, 0.0]),
        section=lambda t: BAR,
    )
    expected = math.sqrt(5) / 2 + math.asinh(2) / 4
    assert curve_length([parabola]) == pytest.approx(expected, rel=1e-8)
    line = straight_piece([1, 1, 0], [1, 1, 3], BAR)
    assert curve_length([parabola, line]) == pytest.approx(expected + 3, rel=1e-8)
