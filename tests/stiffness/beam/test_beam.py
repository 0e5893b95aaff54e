"""Tests of the compliance and the stiffness of beams."""

import math

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import Section, rectangular_section, round_section
from forcefit.stiffness.link import LinkStiffness, inverted, scaled, turn_link
from forcefit.stiffness.screws import rotation_matrix, screw_map

E, NU = 60e9, 0.3
SECTION = Section(1.2e-3, 4e-8, 9e-8, 7e-8, 0.8, 0.6)

# Stiffness of the IRSBot-2 link with L = 0.452 m, r = 0.04 m, E = 60 GPa, nu = 0.3:
# diagonal RX RY RZ TX TY TZ and the entry K[1, 5].
PAPER = {
    "euler": (
        [205304.89771587483, 1067585.4681225496, 1067585.4681225496]
        + [667240917.5765933, 15676425.348341927, 15676425.348341927],
        3542872.1287252754,
    ),
    "timoshenko": (
        [205304.89771587483, 1015962.1690558865, 1015962.1690558865]
        + [667240917.5765933, 14665709.962120155, 14665709.962120155],
        3314450.4514391553,
    ),
}


def assert_same(matrix, expected, tol):
    """Compare two matrices whose entries are divided by sqrt(K_ii K_jj)."""
    np.testing.assert_allclose(scaled(matrix - expected, expected), 0, atol=tol)


@pytest.mark.parametrize("theory", PAPER)
def test_stiffness_of_the_irsbot2_link_equals_reference_values(theory):
    diagonal, coupling = PAPER[theory]
    expected = np.diag(diagonal)
    expected[1, 5] = expected[5, 1] = coupling
    expected[2, 4] = expected[4, 2] = -coupling
    section = round_section(0.04, NU)
    K = inverted(beam_compliance(0.452, section, E, NU, theory=theory))
    assert_same(K, expected, 1e-12)


@pytest.mark.parametrize("cut", [0.1, 0.5, 0.9])
def test_two_beams_in_series_have_the_compliance_of_one_beam(cut, rng):
    """The sum C = A C1 A^T + C2 is exact, so results agree to machine precision."""
    axis, up = rng.normal(size=3), rng.normal(size=3)
    axis /= np.linalg.norm(axis)

    def beam(length):
        return beam_compliance(length, SECTION, E, NU, axis=axis, up=up)

    # the distance between the tips of the first segment and of the whole beam is (1 -
    # cut) * 0.7
    A = screw_map(-(1 - cut) * 0.7 * axis)
    assert_same(A @ beam(cut * 0.7) @ A.T + beam((1 - cut) * 0.7), beam(0.7), 1e-13)


def test_compliance_entries_equal_textbook_values():
    """Formulas of Gere: F L^3/3EI + F L/GA', F L^2/2EI, M L/EI, T L/GJ, F L/EA."""
    L, G = 0.5, E / (2 * (1 + NU))
    C = beam_compliance(L, SECTION, E, NU)
    s = SECTION
    assert C[0, 0] == pytest.approx(L / (G * s.J), rel=1e-14)
    assert C[3, 3] == pytest.approx(L / (E * s.area), rel=1e-14)
    # the default of up is y, so the section's z axis is the y axis of the result
    about_z = L**3 / (3 * E * s.I_y) + L / (G * s.area * s.shear_z)
    about_y = L**3 / (3 * E * s.I_z) + L / (G * s.area * s.shear_y)
    assert C[4, 4] == pytest.approx(about_z, rel=1e-14)
    assert C[5, 5] == pytest.approx(about_y, rel=1e-14)
    assert C[2, 4] == pytest.approx(L**2 / (2 * E * s.I_y), rel=1e-14)
    assert C[1, 5] == pytest.approx(-(L**2) / (2 * E * s.I_z), rel=1e-14)


def test_rotating_the_beam_rotates_its_compliance(rng):
    R = rotation_matrix(rng.normal(size=3))
    A = np.kron(np.eye(2), R)
    straight = beam_compliance(0.5, SECTION, E, NU, axis=[1, 0, 0], up=[0, 0, 1])
    turned = beam_compliance(0.5, SECTION, E, NU, axis=R[:, 0], up=R[:, 2])
    assert_same(turned, A @ straight @ A.T, 1e-13)


def test_section_height_is_along_the_up_direction():
    """A plate is stiffer under a force along its larger side."""
    plate = rectangular_section(width=0.01, height=0.1, nu=NU)
    C = beam_compliance(1.0, plate, E, NU, axis=[1, 0, 0], up=[0, 0, 1], theory="euler")
    assert C[5, 5] == pytest.approx(1 / (3 * E * 0.01 * 0.1**3 / 12), rel=1e-13)
    assert C[4, 4] == pytest.approx(C[5, 5] * 100, rel=1e-12)


def test_round_section_constants_equal_hand_calculation():
    bar, tube = round_section(2.0, 0.25), round_section(2.0, 0.25, 1.0)
    assert bar.area == pytest.approx(4 * math.pi)
    assert bar.I_y == bar.I_z == pytest.approx(4 * math.pi)
    assert bar.J == pytest.approx(8 * math.pi)
    assert bar.shear_y == pytest.approx(6 * 1.25 / (7 + 1.5))
    assert tube.area == pytest.approx(3 * math.pi)
    assert tube.I_z == pytest.approx(math.pi / 4 * 15)
    # Cowper's formula for m = 1/2: 6 * 1.25 * 1.5625 / (8.5 * 1.5625 + 23 * 0.25)
    assert tube.shear_z == pytest.approx(11.71875 / 19.03125)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: round_section(-1, NU), "radius = -1 must be finite and > 0"),
    (lambda: round_section(1, NU, 1), "inner_radius = 1 must lie between 0"),
    (lambda: round_section(1, 0.5), "nu = 0.5 must lie between -1.0 and 0.5"),
    (lambda: beam_compliance(math.nan, SECTION, E, NU), "length = nan"),
    (lambda: beam_compliance(1, SECTION, -E, NU), "E = -6e+10"),
    (lambda: beam_compliance(1, SECTION, E, NU, theory="eular"), '"euler"?'),
    (lambda: beam_compliance(1, SECTION, E, NU, axis=[0, 0, 0]), "axis is zero"),
    (lambda: beam_compliance(1, SECTION, E, NU, axis=[1, math.nan, 0]),
     "expected 3 finite numbers"),
    (lambda: beam_compliance(1, SECTION, E, NU, axis=[0, 0, 1], up=[0, 0, 2]),
     "lies along the axis"),
    (lambda: Section(1, 1, 1, 0, 1, 1), "section: J = 0 must be finite and > 0"),
    (lambda: beam_compliance(1, {"radus": 0.02}, E, NU), 'unknown "radus"; did you'),
    (lambda: beam_compliance(1, 0.02, E, NU),
     'section: found 0.02, expected {"radius": 0.02}'),
])  # fmt: skip
def test_invalid_beam_is_rejected(call, message):
    with pytest.raises(BadInput) as caught:
        call()
    assert message in str(caught.value)


def paper_link():
    C = beam_compliance(0.452, SECTION, E, NU)
    return LinkStiffness("Timoshenko beam", C, tip=[0.452, 0, 0], base=[0, 0, 0])


def test_rotating_a_link_does_not_change_its_energy(rng):
    link = paper_link()
    R = rotation_matrix(rng.normal(size=3))
    turned = turn_link(link, R)
    wrench = rng.normal(size=6)
    energy = wrench @ link.compliance @ wrench
    new = np.kron(np.eye(2), R) @ wrench
    assert new @ turned.compliance @ new == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(turned.tip, R @ link.tip, atol=1e-15)
    with pytest.raises(BadInput, match="not a rotation"):
        turn_link(link, np.diag([1, 1, -1]))


PARALLEL = np.eye(6)
PARALLEL[[0, 1], [1, 0]] = np.nextafter(1.0, 0.0)


@pytest.mark.parametrize(("C", "message"), [
    (np.eye(5), "compliance has shape (5, 5), expected (6, 6)"),
    (np.eye(6) + np.eye(6, k=1), "not symmetric: [0, 1] = 1.000000e+00 but"),
    (-np.eye(6), "not positive definite"),
    (np.ones((6, 6)), "not positive definite"),
    # the smallest eigenvalue is 1.1e-16, which is round-off
    (1e-9 * PARALLEL, "not positive definite"),
    (np.full((6, 6), math.nan), "expected (6, 6) of finite numbers"),
])  # fmt: skip
def test_invalid_compliance_is_rejected(C, message):
    with pytest.raises(BadInput) as caught:
        LinkStiffness("test", C, tip=[0, 0, 0], base=[0, 0, 0])
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("section", "moment"),
    [
        ({"radius": 0.02}, np.pi * 0.02**4 / 4),
        ({"radius": 0.02, "inner_radius": 0.015}, np.pi * (0.02**4 - 0.015**4) / 4),
        ({"width": 0.03, "height": 0.05}, 0.03 * 0.05**3 / 12),
    ],
)
def test_bending_of_a_section_given_by_dimensions_equals_textbook_value(
    section, moment
):
    """The deflection is F L^3 / (3 E I) along y, which is the default of ``up``."""
    C = beam_compliance(0.5, section, E=7e10, nu=0.33, theory="euler")
    assert C[4, 4] == pytest.approx(0.5**3 / (3 * 7e10 * moment), rel=1e-12)
