"""Tests of interfaces."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import refuse_common_edges
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES

POINT, UNIT = [1.0, 2.0, 3.0], [0, 0.6, 0.8]
FLAT = {"point": POINT, "normal": [0, 3, 4]}


@pytest.mark.parametrize(("text", "kind", "point", "direction", "radius"), [
    ("z=0.452", "plane", [0, 0, 0.452], [0, 0, 1], np.inf),
    (" x = -1e-3 ", "plane", [-1e-3, 0, 0], [1, 0, 0], np.inf),
    ("plane=1,2,3/0,3,4", "plane", POINT, UNIT, np.inf),
    ("bore=1,2,3/0,3,4/5", "bore", POINT, UNIT, 5.0),
    ("disc=1,2,3/0,3,4/0.02", "disc", POINT, UNIT, 0.02),
    ({"plane": FLAT}, "plane", POINT, UNIT, np.inf),
    ({"plane": FLAT, "radius": 1}, "disc", POINT, UNIT, 1.0),
    ({"bore": {"point": POINT, "axis": np.array([0, 3, 4]), "radius": 1e-9}},
     "bore", POINT, UNIT, 1e-9),
])  # fmt: skip
def test_interface_has_the_kind_point_and_direction_of_its_text(
    text, kind, point, direction, radius
):
    interface = parse_interface(text)
    assert (interface.kind, interface.radius) == (kind, radius)
    np.testing.assert_allclose(interface.point, point)
    np.testing.assert_allclose(interface.direction, direction)
    assert not interface.point.flags.writeable
    assert not interface.direction.flags.writeable


BORE = {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": 1}
REFUSED = [
    ("w=3", "found 'w=3', expected"), ("z=nan", "found 'z=nan'"), (3, "found 3"),
    ("plane=0,0,0.1", "found 'plane=0,0,0.1', expected"),
    ("plane=0,0/0,0,1", "found 'plane"), ("plane=0,0,1/0,0,1/2", "found 'plane"),
    ("bore=0,0,0/0,0,0/0.01", "bore direction is zero"),
    ("bore=0,0,0/0,1,0/-1", "bore: radius = -1 must be > 0"),
    ("bore=0,0/0,1,0/1", "found 'bore"),
    # distances from these interfaces would overflow
    ("bore=1e300,0,0/0,1,0/7", "found 1e+300, expected lengths of at most 1e"),
    ("disc=0,0,0/0,1,0/1e200", "found 1e+200, expected lengths of at most 1e"),
    ("z=-1e170", "found 1e+170, expected lengths of at most 1e"),
    ({"bor": {}}, 'unknown key "bor"'), ({"plane": [0, 0, 1]}, "found {"),
    ({"bore": BORE | {"point": [0, 0]}}, "point: found"),
    ({"bore": BORE | {"radius": np.inf}}, "bore.radius: found inf, expected a finite"),
    ({"plane": FLAT, "radius": "wide"}, "radius: found 'wide', expected a finite"),
    ({"bore": BORE, "radius": 1}, 'unknown key "radius"'),
    ({"bore": {"point": [0, 0, 0], "axis": [0, 1, 0]}}, "bore.radius: found nothing"),
    ({"bore": {"point": [0, 0, 0], "axes": [0, 1, 0]}}, 'did you mean "axis"'),
    ({"plane": {"point": [0, 0, 0], "norml": [0, 1, 0]}}, 'did you mean "normal"'),
    ({"plane": {"point": [0, 0, 0], "normal": [0, 1, 0], "radius": 1}},
     'plane: unknown key "radius"'),
    ({"plane": {"point": [0, 0, 0]}}, "normal: found nothing, expected 3 finite"),
    ({"plane": {"point": [0, 0, np.inf], "normal": [0, 0, 1]}}, "point: found"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_wrong_interface_is_rejected(text, message):
    with pytest.raises(BadInput) as caught:
        parse_interface(text, "--base")
    assert str(caught.value).startswith("--base: ")
    assert message in str(caught.value)


@pytest.mark.parametrize(("text", "written"), [
    ("z=0.452", "plane=0,0,0.452/0,0,1"),
    ("bore=1,2,3/0,3,4/0.5", "bore=1,2,3/0,0.6,0.8/0.5"),
    ("disc=1,2,3/0,3,4/0.5", "disc=1,2,3/0,0.6,0.8/0.5"),
])  # fmt: skip
def test_formatted_interface_is_parsed_as_the_same_interface(text, written):
    assert str(parse_interface(text)) == written
    assert str(parse_interface(written)) == written


def test_interface_distance_is_measured_from_the_plane_or_the_cylinder(rng):
    """Points are inside and outside the cylinder."""
    point, d = np.array([1.0, 2.0, 3.0]), np.array([0, 0.6, 0.8])
    u, v = np.array([1.0, 0, 0]), np.array([0, 0.8, -0.6])
    a, b = rng.normal(size=(2, 4, 5))
    angle = rng.uniform(0, 2 * np.pi, (4, 5))
    for text in ("plane=1,2,3/0,3,4", "disc=1,2,3/0,3,4/0.5"):
        places = point + a[..., None] * d + b[..., None] * u
        distance = parse_interface(text).distance(places)
        np.testing.assert_allclose(distance, np.abs(a), atol=1e-14)
    spokes = np.cos(angle)[..., None] * u + np.sin(angle)[..., None] * v
    places = point + a[..., None] * d + np.abs(b)[..., None] * spokes
    distance = parse_interface("bore=1,2,3/0,3,4/0.5").distance(places)
    np.testing.assert_allclose(distance, np.abs(np.abs(b) - 0.5), atol=1e-14)
    assert parse_interface("bore=1,2,3/0,3,4/0.5").distance(point) == pytest.approx(0.5)


def test_rigid_faces_with_a_common_edge_are_rejected():
    """The stiffness between two adjacent sides of a cube is infinite."""
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    one, other = parse_interface("y=0"), parse_interface("z=0.1")
    words = r"cube: base .* and tip .* have a common edge near"
    with pytest.raises(BadInput, match=words):
        refuse_common_edges(surface, one, other)
    refuse_common_edges(surface, one, parse_interface("y=0.1"))
