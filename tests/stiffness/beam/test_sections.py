"""Tests of the constants of beam sections."""

import math

import pytest
from numpy.polynomial import Polynomial

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.sections import (
    box_section,
    check_section,
    declared_section,
    i_section,
    rectangular_section,
)

NU = 0.3


def composed(*parts):
    """Return area, I_y and I_z of a section that consists of rectangles. A rectangle is
    given by width, height, and y and z of its centre."""
    area = sum(b * h for b, h, _, _ in parts)
    I_y = sum(b * h**3 / 12 + b * h * z**2 for b, h, _, z in parts)
    I_z = sum(h * b**3 / 12 + b * h * y**2 for b, h, y, _ in parts)
    return area, I_y, I_z


def test_constants_of_an_i_section_equal_sums_over_web_and_flanges():
    section = i_section(0.06, 0.1, 0.006, 0.008, NU)
    middle = (0.1 - 0.008) / 2
    expected = composed(
        (0.006, 0.1 - 2 * 0.008, 0.0, 0.0),
        (0.06, 0.008, 0.0, middle),
        (0.06, 0.008, 0.0, -middle),
    )
    assert (section.area, section.I_y, section.I_z) == pytest.approx(
        expected, rel=1e-12
    )
    # an open thin wall has J = length times thickness^3 / 3
    J = (2 * 0.06 * 0.008**3 + 0.092 * 0.006**3) / 3
    assert section.J == pytest.approx(J, rel=1e-12)


def test_constants_of_a_box_section_equal_sums_over_its_four_walls():
    box = declared_section({"width": 0.06, "height": 0.1, "wall": 0.004}, NU)
    expected = composed(
        (0.06, 0.004, 0.0, 0.048), (0.06, 0.004, 0.0, -0.048),
        (0.004, 0.092, 0.028, 0.0), (0.004, 0.092, -0.028, 0.0),
    )  # fmt: skip
    assert (box.area, box.I_y, box.I_z) == pytest.approx(expected, rel=1e-12)
    # Bredt's formula 4 A^2 t / length, plus the torsion constant of an open wall
    b, h, t = 0.056, 0.096, 0.004
    bredt = 4 * (b * h) ** 2 * t / (2 * (b + h))
    assert box.J == pytest.approx(bredt + 2 * (b + h) * t**3 / 3, rel=1e-12)


@pytest.mark.parametrize(("width", "height"), [(0.02, 0.02), (0.02, 0.05), (0.1, 0.01)])
def test_torsion_constant_of_a_rectangle_equals_saint_venants_series(width, height):
    """The series is 16 a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / 2 b) / n^5) over
    odd n, where 2 a and 2 b are the sides."""
    rectangle = declared_section({"width": width, "height": height}, NU)
    a, b = max(width, height) / 2, min(width, height) / 2
    tail = sum(math.tanh(n * math.pi * a / (2 * b)) / n**5 for n in range(1, 2001, 2))
    J = 16 * a * b**3 * (1 / 3 - 64 * b / (math.pi**5 * a) * tail)
    assert rectangle.J == pytest.approx(J, rel=1e-9)
    found = rectangle.area, rectangle.I_y, rectangle.I_z
    assert found == pytest.approx(composed((width, height, 0.0, 0.0)), rel=1e-12)


def test_section_check_rejects_implausible_sizes():
    check_section("link", {"radius": 1.0, "inner_radius": 0.0})
    for size in (1e-41, 1e41, math.nan):
        with pytest.raises(BadInput, match="expected 0 or a size from"):
            check_section("link", {"radius": size})


@pytest.mark.parametrize(
    ("nu", "factor"), [(0.0, 5 / 6), (0.3, 130 / 153), (-0.5, 10 / 13)]
)
def test_shear_factor_of_a_rectangle_equals_cowpers_formula(nu, factor):
    """Cowper's factor is 10 (1 + nu) / (12 + 11 nu), and does not depend on the
    sides."""
    for sides in ((0.1, 0.3), (0.3, 0.1), (1.0, 1.0)):
        section = rectangular_section(*sides, nu)
        assert (section.shear_y, section.shear_z) == pytest.approx((factor, factor))


def thin_shear_factor(h, b, web, flange, webs, nu):
    """Return the shear factor of thin walls by Cowper's integral.

    The factor is 2 (1 + nu) I / (nu / 2 (I_y - I) - A / I times the integral of x (chi
    + x y^2)). The function chi is zero at x = 0, and its derivative along a wall is -2
    (1 + nu) I tau - n_x (nu x^2 / 2 + (1 - nu / 2) y^2) - n_y (2 + nu) x y. Webs are
    along x: two at y = b / 2 and y = -b / 2, or one at y = 0.
    """
    s, up = Polynomial([0.0, 1.0]), h / 2
    y = b / 2 if webs == 2 else 0.0
    area = webs * web * h + 2 * flange * b
    second = webs * web * h**3 / 12 + 2 * flange * b * up**2
    other = webs * web * h * y**2 + 2 * flange * b**3 / 12
    # shear flow that enters each web from one or both halves of a flange
    gathered = up * flange * b / webs
    tau = gathered / web + (up**2 - s**2) / 2
    slope = -2 * (1 + nu) * tau - nu * s**2 / 2 - (1 - nu / 2) * y**2
    chi = slope.integ()
    corner = chi(up)
    total = webs * 2 * web * (s * (chi + s * y**2)).integ()(up)
    # shear stress in the flange as a function of the distance from the web
    tau = up * (b / 2 - s) if webs == 1 else -up * s
    chi = (-2 * (1 + nu) * tau - (2 + nu) * up * s).integ()
    chi = chi + (corner - chi(y))
    total += 4 * flange * (up * (chi + up * s**2)).integ()(b / 2)
    return 2 * (1 + nu) * second / (nu / 2 * (other - second) - area / second * total)


@pytest.mark.parametrize("nu", [0.0, 0.3, -0.4])
@pytest.mark.parametrize(("b", "h"), [(0.06, 0.1), (0.2, 0.05), (0.1, 0.1)])
def test_shear_factors_of_thin_sections_equal_cowpers_integral(b, h, nu):
    """For a force normal to its web, an I-section consists of two rectangles."""
    wall, web, flange = 0.002, 0.003, 0.005
    box = box_section(b + wall, h + wall, wall, nu)
    across, along = (
        thin_shear_factor(*sides, wall, wall, 2, nu) for sides in ((b, h), (h, b))
    )
    assert (box.shear_y, box.shear_z) == pytest.approx((across, along), rel=1e-9)
    beam = i_section(b, h + flange, web, flange, nu)
    expected = thin_shear_factor(h, b, web, flange, 1, nu)
    assert beam.shear_z == pytest.approx(expected, rel=1e-9)
    share = 2 * b * flange / (2 * b * flange + (h - flange) * web)
    rectangle = rectangular_section(1.0, 1.0, nu).shear_y
    assert beam.shear_y == pytest.approx(share * rectangle, rel=1e-12)
