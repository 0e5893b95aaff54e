"""Areas and second moments against sums of rectangles, torsion against the series."""

import math

import pytest

from stiffness.beam.sections import declared_section, i_section

NU = 0.3


def composed(*parts):
    """Area, I_y, I_z of rectangles: width (y), height (z), centre y and z; Steiner."""
    area = sum(b * h for b, h, _, _ in parts)
    I_y = sum(b * h**3 / 12 + b * h * z**2 for b, h, _, z in parts)
    I_z = sum(h * b**3 / 12 + b * h * y**2 for b, h, y, _ in parts)
    return area, I_y, I_z


def test_an_i_is_its_web_and_two_flanges():
    section = i_section(0.06, 0.1, 0.006, 0.008, NU)
    middle = (0.1 - 0.008) / 2
    area, I_y, I_z = composed(
        (0.006, 0.1 - 2 * 0.008, 0.0, 0.0),
        (0.06, 0.008, 0.0, middle),
        (0.06, 0.008, 0.0, -middle),
    )
    assert section.area == pytest.approx(area, rel=1e-12)
    assert section.I_y == pytest.approx(I_y, rel=1e-12)
    assert section.I_z == pytest.approx(I_z, rel=1e-12)
    # an open thin wall: a third of length times thickness cubed
    assert section.J == pytest.approx(
        (2 * 0.06 * 0.008**3 + 0.092 * 0.006**3) / 3, rel=1e-12
    )


def test_a_box_is_its_four_walls():
    box = declared_section({"width": 0.06, "height": 0.1, "wall": 0.004}, NU)
    area, I_y, I_z = composed(
        (0.06, 0.004, 0.0, 0.048), (0.06, 0.004, 0.0, -0.048),
        (0.004, 0.092, 0.028, 0.0), (0.004, 0.092, -0.028, 0.0),
    )  # fmt: skip
    assert box.area == pytest.approx(area, rel=1e-12)
    assert box.I_y == pytest.approx(I_y, rel=1e-12)
    assert box.I_z == pytest.approx(I_z, rel=1e-12)
    # Bredt: 4 A^2 t / length of the wall's middle line, and the open wall's share
    b, h, t = 0.056, 0.096, 0.004
    bredt = 4 * (b * h) ** 2 * t / (2 * (b + h))
    assert box.J == pytest.approx(bredt + 2 * (b + h) * t**3 / 3, rel=1e-12)


@pytest.mark.parametrize(("width", "height"), [(0.02, 0.02), (0.02, 0.05), (0.1, 0.01)])
def test_a_rectangle_twists_by_the_series_of_saint_venant(width, height):
    """16 a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / 2 b) / n^5), n odd; halves."""
    rectangle = declared_section({"width": width, "height": height}, NU)
    a, b = max(width, height) / 2, min(width, height) / 2
    tail = sum(math.tanh(n * math.pi * a / (2 * b)) / n**5 for n in range(1, 2001, 2))
    J = 16 * a * b**3 * (1 / 3 - 64 * b / (math.pi**5 * a) * tail)
    assert rectangle.J == pytest.approx(J, rel=1e-9)
    area, I_y, I_z = composed((width, height, 0.0, 0.0))
    assert (rectangle.area, rectangle.I_y, rectangle.I_z) == pytest.approx(
        (area, I_y, I_z), rel=1e-12
    )
