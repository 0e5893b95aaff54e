"""Tests of the recognition of tangent shapes and flat faces."""

import numpy as np
import pytest

from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.primitives import Cone, Plane, Torus
from forcefit.stiffness.surface.surface import check_surface
from forcefit.stiffness.surface.true_surface import TrueSurface
from tests.solids_for_tests import fillet_profile, rounded_block

ENDS = parse_interface("x=-0.1"), parse_interface("x=0.1")


def filleted_plate(fillet=0.006, corner=0.025, steps=6):
    """Return a plate of 200 x 300 x 12 mm with rounded corners and a fillet around its
    base.
    """
    profile = fillet_profile(fillet, 0.012, steps)
    return rounded_block((0.1, 0.15), corner, profile, 2 * steps)


def volume_of(fillet=0.006, corner=0.025):
    """Return the volume of the plate by integration of its area over the height
    [m^3]."""

    def area(inset):
        a, b, r = 0.2 - 2 * inset, 0.3 - 2 * inset, corner - inset
        return a * b - (4 - np.pi) * r**2

    z = np.linspace(0, fillet, 20001)
    inset = fillet - np.sqrt(fillet**2 - (fillet - z) ** 2)
    return float(np.trapezoid(area(inset), z) + area(0.0) * (0.012 - fillet))


def revolved(radius, height, facets, closed=False):
    """Return a surface of revolution about z from the radii and heights of rings of
    points. It has flat ends, or the last ring is connected to the first ring."""
    angle = 2 * np.pi * np.arange(facets) / facets
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rings = [r * circle + [0, 0, z] for r, z in zip(radius, height, strict=True)]
    i, j = np.arange(facets), (np.arange(facets) + 1) % facets
    triangles = []
    for k in range(len(rings) - (not closed)):
        a, b = k * facets, (k + 1) % len(rings) * facets
        triangles += [np.column_stack([i + a, j + a, j + b])]
        triangles += [np.column_stack([i + a, j + b, i + b])]
    if not closed:
        count, last = len(rings) * facets, (len(rings) - 1) * facets
        rings += [np.array([[0, 0, height[0]], [0, 0, height[-1]]])]
        triangles += [np.column_stack([0 * i + count, j, i])]
        triangles += [np.column_stack([0 * i + count + 1, i + last, j + last])]
    return check_surface(np.concatenate(rings), np.concatenate(triangles), "revolved")


def prism(outline, height):
    """Return a prism along z with a convex outline."""
    count = len(outline)
    points = [np.insert(outline, 2, z, axis=1) for z in (0, height)]
    points += [np.insert(outline.mean(axis=0), 2, z)[None] for z in (0, height)]
    i, j = np.arange(count), (np.arange(count) + 1) % count
    triangles = np.concatenate([
        np.column_stack([i, j, j + count]), np.column_stack([i, j + count, i + count]),
        np.column_stack([0 * i + 2 * count, j, i]),
        np.column_stack([0 * i + 2 * count + 1, i + count, j + count]),
    ])  # fmt: skip
    return check_surface(np.concatenate(points), triangles, "prism")


@pytest.mark.parametrize("fillet", [0.002, 0.006])
@pytest.mark.parametrize("steps", [4, 6])
def test_fillets_of_a_rounded_plate_are_recognised_as_cylinders_and_tori(fillet, steps):
    """There are four tori, four horizontal cylinders and four vertical cylinders."""
    patches = find_patches(filleted_plate(fillet, 0.025, steps), *ENDS)
    kinds = [type(shape) for shape in patches.shapes]
    assert (kinds.count(Plane), kinds.count(Cone), kinds.count(Torus)) == (6, 8, 4)
    radii = sorted(s.radius for s in patches.shapes if isinstance(s, Cone))
    assert radii == pytest.approx([fillet] * 4 + [0.025] * 4, rel=1e-6)
    for shape in patches.shapes:
        if isinstance(shape, Torus):
            assert (shape.radius, shape.tube) == pytest.approx((0.025 - fillet, fillet))


def test_volume_of_a_filleted_plate_is_that_of_its_recognised_shapes():
    """The error of the volume of the facets is 0.1 %."""
    surface = filleted_plate()
    true = TrueSurface(surface, find_patches(surface, *ENDS))
    assert surface.volume < 0.9995 * volume_of()
    assert true.volume == pytest.approx(volume_of(), rel=2e-6)
    assert true.unsure_volume == 0.0


@pytest.mark.parametrize("flat", [0.02, 0.03, 0.036])
def test_flat_chamfers_are_not_recognised_as_a_cylinder(flat):
    """The four corners of two chamfers and a flat top are on a circle."""
    low = 0.02 - np.tan(np.radians(20)) * (0.04 - flat) / 2
    surface = prism(np.array([
        [-0.02, -0.02], [0.02, -0.02], [0.02, low],
        [flat / 2, 0.02], [-flat / 2, 0.02], [-0.02, low],
    ]), 0.1)  # fmt: skip
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    patches = find_patches(surface, *faces)
    assert all(isinstance(shape, Plane) for shape in patches.shapes)
    assert len(patches.shapes) == 8


def test_flat_side_between_fillets_remains_flat():
    """The side consists of two triangles and has tangent fillets on three edges."""
    surface = filleted_plate()
    true = TrueSurface(surface, find_patches(surface, *ENDS))
    middle = np.array([[0.01, 0.15, 0.009], [0.0, -0.15, 0.008]])
    outward = np.array([[0, 1.0, 0], [0, -1.0, 0]])
    assert true.outside(middle, outward) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_cylinders_next_to_a_hump_are_recognised_separately():
    """The radius of the bar is 10 mm, and between z = 30 mm and z = 70 mm it is 10 + 4
    sin^2 mm. The error of the volume is less than its uncertainty.
    """
    share = np.linspace(0, 1, 13)
    r = np.r_[0.01, 0.01 + 0.004 * np.sin(np.pi * share) ** 2, 0.01]
    surface = revolved(r, np.r_[0.0, 0.03 + 0.04 * share, 0.1], 40)
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    patches = find_patches(surface, *faces)
    true = TrueSurface(surface, patches)
    share = np.linspace(0, 1, 200001)
    hump = np.trapezoid((0.01 + 0.004 * np.sin(np.pi * share) ** 2) ** 2, 0.04 * share)
    volume = np.pi * (0.01**2 * 0.06 + hump)
    assert surface.volume / volume - 1 == pytest.approx(-0.0044, abs=2e-4)
    assert abs(true.volume - volume) < true.unsure_volume
    radii = [s.radius for s in patches.shapes if isinstance(s, Cone)]
    assert radii.count(pytest.approx(0.01, rel=1e-9)) == 2
