"""Tests of the recognition of the shapes of a shaft."""

import pytest

from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.primitives import Cone, Plane, Torus
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import shouldered_shaft


@pytest.mark.parametrize(("around", "rows"), [(36, 6), (48, 8), (48, 12)])
def test_shoulder_and_fillet_of_a_shaft_are_recognised(around, rows):
    """The radii are 15 and 10 mm, and the fillet radius is 2 mm."""
    points, triangles = shouldered_shaft(0.015, 0.010, 0.002, around, rows)
    surface = check_surface(points, triangles, "shaft")
    patches = find_patches(surface, *map(parse_interface, ("z=0", "z=0.12")))
    kinds = sorted(type(shape).__name__ for shape in patches.shapes)
    assert kinds == ["Cone", "Cone", "Plane", "Plane", "Plane", "Torus"]
    for number, shape in enumerate(patches.shapes):
        corners = surface.points[surface.triangles[patches.patch == number]]
        low, high = corners[..., 2].min(), corners[..., 2].max()
        if isinstance(shape, Torus):
            assert (shape.radius, shape.tube) == pytest.approx((0.012, 0.002), rel=1e-6)
            assert (low, high) == pytest.approx((0.05, 0.052), abs=1e-9)
        elif isinstance(shape, Cone):
            radius = 0.015 if low < 0.05 else 0.010
            assert (shape.radius, shape.slope) == pytest.approx((radius, 0), abs=1e-9)
        else:
            assert isinstance(shape, Plane)
            assert high - low < 1e-9


def test_fillet_is_found_among_many_congruent_facets():
    """There are 48 congruent facets around the shaft."""
    step = (0.0322355, 0.0772355)
    points, triangles = shouldered_shaft(0.0134315, 0.01, 0.002402, 48, 8, step, 0.005)
    surface = check_surface(points, triangles, "shaft")
    patches = find_patches(surface, *map(parse_interface, ("z=0", f"z={step[1]}")))
    kinds = sorted(type(shape).__name__ for shape in patches.shapes)
    assert kinds == ["Cone", "Cone", "Plane", "Plane", "Plane", "Torus"]
    (torus,) = (shape for shape in patches.shapes if isinstance(shape, Torus))
    assert (torus.radius, torus.tube) == pytest.approx((0.012402, 0.002402), rel=1e-6)
