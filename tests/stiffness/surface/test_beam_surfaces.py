"""Tests of the surfaces and the beams of link shapes."""

import math

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.beam_surfaces import (
    check_shape,
    shape_beam,
    shape_surface,
)

NU = 0.3
# area of a polygon with 64 corners in a unit circle
GON = 64 / 2 * math.sin(2 * math.pi / 64)
R, S, L = 0.03, 0.02, 0.2
AREAS = {
    "round": ({"radius": R}, GON * R**2),
    "tube": ({"radius": R, "inner_radius": S}, GON * (R**2 - S**2)),
    # volume of a frustum
    "cone": ({"radius": R, "tip_radius": S}, GON * (R**2 + R * S + S**2) / 3),
    "rectangle": ({"width": R, "height": S}, R * S),
    "box": (
        {"width": R, "height": S, "wall": 0.45 * S},
        R * S - (R - 0.9 * S) * 0.1 * S,
    ),
}


@pytest.mark.parametrize("shape", AREAS)
def test_surface_of_a_shape_encloses_its_volume_between_its_ends(shape):
    """The width is along x, the height along y, and the base at z = 0."""
    lengths, area = AREAS[shape]
    surface = shape_surface(shape, lengths | {"length": L})
    assert surface.volume == pytest.approx(area * L, rel=1e-12)
    assert surface.repairs == ()
    low, high = surface.points.min(axis=0), surface.points.max(axis=0)
    wide, high_up = lengths.get("width", 2 * R), lengths.get("height", 2 * R)
    np.testing.assert_allclose(low, [-wide / 2, -high_up / 2, 0], atol=1e-15)
    np.testing.assert_allclose(high, [wide / 2, high_up / 2, L], atol=1e-15)


@pytest.mark.parametrize("shape", AREAS)
def test_beam_of_a_shape_has_the_ends_and_area_of_the_shape(shape):
    """Circles are polygons with 64 corners in the surface."""
    lengths, area = AREAS[shape]
    (piece,) = shape_beam(shape, lengths | {"length": L}, NU)
    np.testing.assert_array_equal(piece.place(0.0), [0, 0, 0])
    np.testing.assert_allclose(piece.place(1.0), [0, 0, L])
    assert piece.up is not None
    np.testing.assert_array_equal(piece.up(0.5), [0, 1, 0])
    round_ones = math.pi / GON if "radius" in lengths else 1.0
    # Simpson's rule is exact for a cone's area
    areas = [piece.section(t).area for t in (0.0, 0.5, 1.0)]
    mean = areas @ np.array([1, 4, 1]) / 6
    assert mean == pytest.approx(round_ones * area, rel=1e-12)
    if shape == "cone":
        expected = [math.pi * R**2, math.pi * S**2]
        assert [areas[0], areas[2]] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("shape", "lengths", "words"), [
    ("rund", {}, 'shape: unknown "rund"; did you mean "round"?'),
    ("round", {"length": L, "radus": R}, 'round: unknown length "radus"; did you'),
    ("round", {"length": L}, "round: radius: missing, expected a length > 0 [m]"),
    ("round", {"length": 0.0, "radius": R}, "round: length: found 0, expected"),
    ("round", {"length": -L, "radius": R}, "round: length: found -0.2, expected"),
    ("round", {"length": math.inf, "radius": R}, "round: length: found inf"),
    ("round", {"length": math.nan, "radius": R}, "round: length: found nan"),
    ("cone", {"length": L, "radius": R, "tip_radius": 0.0}, "tip_radius: found 0"),
    ("tube", {"length": L, "radius": R, "inner_radius": 1.1 * R}, "inner_radius < "),
    ("box", {"length": L, "width": R, "height": S, "wall": 0.6 * S}, "is no hole"),
    ("box", {"length": L, "width": S, "height": R, "wall": 0.5 * S}, "is no hole"),
])  # fmt: skip
def test_wrong_shape_is_rejected(shape, lengths, words):
    for call in (check_shape, shape_surface, lambda s, v: shape_beam(s, v, NU)):
        with pytest.raises(BadInput) as caught:
            call(shape, lengths)
        assert words in str(caught.value)
