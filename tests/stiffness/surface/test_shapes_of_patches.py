"""Tests of the triangles on interfaces and the shapes of patches."""

import re

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches, triangles_on
from forcefit.stiffness.surface.primitives import Cone, Plane
from forcefit.stiffness.surface.surface import Surface, check_surface
from tests.solids_for_tests import bar, cylinder

FAR = np.array([[0.0, 0, 1], [0.6, 0, 1], [0, 0.8, 1]])  # not on any interface


def loose(*triangles, unit=1.0, shift=(0.0, 0.0, 0.0)):
    """Return a surface of given triangles and a distant triangle, so that the diagonal
    of the bounding box is sqrt 2.
    """
    corners = np.array([*triangles, FAR]).reshape(-1, 3) + shift
    return Surface(unit * corners, np.arange(len(corners)).reshape(-1, 3), "loose")


def tilted(angle, size):
    """Return a triangle at the origin whose normal is inclined to z."""
    c, s = size * np.cos(angle), size * np.sin(angle)
    return [[0, 0, 0], [c, 0, s], [0, size, 0]]


@pytest.mark.parametrize("unit", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("kind", ["plane=0,0,0/0,0,1", "disc=0,0,0/0,0,1/{}"])
def test_triangles_on_a_plane_are_found(unit, kind):
    """Corners are within 1e-5 of the diagonal from the plane, and normals within acos
    0.9 from its normal.
    """
    near = 1e-5 * np.sqrt(2)
    flat = np.array(tilted(0.0, 0.1))
    surface = loose(
        flat + [0, 0, 0.9 * near], flat - [0, 0, 0.9 * near], flat + [0, 0, 1.1 * near],
        flat + [[0, 0, 0], [0, 0, 0], [0, 0, 1.1 * near]], flat[::-1],
        tilted(np.arccos(0.91), near), tilted(np.arccos(0.89), near), unit=unit,
    )  # fmt: skip
    interface = parse_interface(kind.format(unit))
    assert triangles_on(surface, interface, "base").tolist() == [0, 1, 4, 5]


def around(radius, angle, tilt=0.0):
    """Return a triangle whose corners are on a cylinder about z. The angle between its
    normal and z is 90 degrees minus ``tilt``."""
    half = angle / 2
    sagitta = radius * (1 - np.cos(half))
    height = sagitta / np.tan(tilt) if tilt else radius
    c, s = radius * np.cos(half), radius * np.sin(half)
    return np.array([[c, -s, 0], [c, s, 0], [radius, 0, height]])


@pytest.mark.parametrize("unit", [0.01, 1.0, 100.0])
def test_triangles_on_a_bore_are_found(unit):
    """Corners are within 2e-3 of the radius from the cylinder, and normals at least 60
    degrees from the axis.
    """
    radius = 0.1
    on = around(radius, 0.5)
    out = on / radius
    outward = out * [1, 1, 0]
    surface = loose(
        on + 1.9e-4 * outward, on - 1.9e-4 * outward, on + 2.1e-4 * outward,
        on + 2.1e-4 * outward * [[1], [0], [0]], on[::-1],
        around(radius, 0.5, tilt=np.radians(29)),
        around(radius, 0.5, tilt=np.radians(31)), unit=unit,
    )  # fmt: skip
    bore = parse_interface(f"bore=0,0,0/0,0,1/{unit * radius}")
    assert triangles_on(surface, bore, "tip").tolist() == [0, 1, 4, 5]


def test_flat_end_whose_corners_lie_on_a_cylinder_is_not_a_bore():
    """All corners of the end of a square bar have the same distance from the y axis."""
    corners = [[-1, -1.5, 0], [1, -1.5, 0], [1, 1.5, 0], [-1, 1.5, 0]]
    end = np.array([[corners[i] for i in (0, 2, 1)], [corners[i] for i in (0, 3, 2)]])
    with pytest.raises(BadInput, match="no face of the surface lies on the base"):
        triangles_on(loose(*end), parse_interface("bore=0,0,0/0,1,0/1"), "base")


def spoke(low, high):
    """Return a flat triangle between two distances from the origin."""
    return [[low, 0, 0], [high, 0, 0], [low, 0.01, 0]]


@pytest.mark.parametrize("unit", [0.1, 1.0, 10.0])
def test_disc_interface_consists_of_the_triangles_within_its_radius(unit):
    """The tolerance of the radius is 0.2 %. A triangle from 1 % inside to 1 % outside
    is rejected.
    """
    radius, shift = 0.2, np.array([0.3, -0.1, 0.2])
    center = ",".join(map(str, unit * shift))
    disc = parse_interface(f"disc={center}/0,0,1/{unit * radius}")
    ends = [(0.1, 0.999), (0.5, 1.001), (0.98, 1.003), (0.995, 1.05), (1.2, 1.4)]
    fine = [spoke(low * radius, high * radius) for low, high in ends]
    surface = loose(*fine, unit=unit, shift=shift)
    assert triangles_on(surface, disc, "base").tolist() == [0, 1]
    for low, high in ((0.98, 1.009), (0.992, 1.02)):
        near = spoke(low * radius, high * radius)
        surface = loose(*fine, near, unit=unit, shift=shift)
        assert triangles_on(surface, disc, "tip").tolist() == [0, 1]
    across = spoke(0.98 * radius, 1.02 * radius)
    words = f"loose: the tip interface {disc} [m] crosses 1 triangles; the outline"
    with pytest.raises(BadInput, match=re.escape(words)):
        triangles_on(loose(*fine, across, unit=unit, shift=shift), disc, "tip")


def test_interface_outside_the_part_is_rejected_with_its_extent():
    words = "bar: no face of the surface lies on the tip interface {} [m]; "
    words += (
        "the extent of the part is x = -0.02 .. 0.02, y = -0.02 .. 0.02, z = 0 .. 0.1 m"
    )
    plane, disc = parse_interface("z=0.2"), parse_interface("disc=0,0,0.2/0,0,1/1")
    with pytest.raises(BadInput, match=re.escape(words.format(plane)) + "$"):
        triangles_on(bar(), plane, "tip")
    words += "; the outline of a disc must consist of edges of triangles"
    with pytest.raises(BadInput, match=re.escape(words.format(disc)) + "$"):
        triangles_on(bar(), disc, "tip")


# --- shapes --------------------------------------------------------------------------


def patches_of(points, triangles, top):
    surface = check_surface(points, triangles, "part")
    ends = parse_interface("z=0"), parse_interface(f"z={top}")
    return surface, find_patches(surface, *ends)


@pytest.mark.parametrize("unit", [0.02, 1.0, 100.0])
def test_edge_of_more_than_35_degrees_separates_two_patches(unit):
    """The angle between the sides of a prism is 36 degrees for ten sides, and 33
    degrees for eleven sides.
    """
    for sides, kind, count in ((10, Plane, 10), (11, Cone, 1)):
        points, triangles = cylinder(0.02 * unit, 0.1 * unit, sides)
        surface, patches = patches_of(points, triangles, 0.1 * unit)
        shapes = patches.shapes[2:]
        assert [type(shape) for shape in shapes] == [kind] * count
        members = np.bincount(patches.patch)
        assert members.tolist() == [sides, sides, *([2 * sides // count] * count)]
        assert (patches.patch >= 0).all()
