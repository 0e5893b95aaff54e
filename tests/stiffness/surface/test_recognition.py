"""Shapes that meet tangentially, and flat faces."""

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
    """200 x 300 x 12 mm, a fillet around its foot, which meets the round corners."""
    profile = fillet_profile(fillet, 0.012, steps)
    return rounded_block((0.1, 0.15), corner, profile, 2 * steps)


def volume_of(fillet=0.006, corner=0.025):
    """[m^3] of the plate: outline's area integrated over the height."""

    def area(inset):
        a, b, r = 0.2 - 2 * inset, 0.3 - 2 * inset, corner - inset
        return a * b - (4 - np.pi) * r**2

    z = np.linspace(0, fillet, 20001)
    inset = fillet - np.sqrt(fillet**2 - (fillet - z) ** 2)
    return float(np.trapezoid(area(inset), z) + area(0.0) * (0.012 - fillet))


@pytest.mark.parametrize("fillet", [0.002, 0.006])
@pytest.mark.parametrize("steps", [4, 6])
def test_fillets_of_a_rounded_plate_are_recognised_as_cylinders_and_tori(fillet, steps):
    """Four of each, and four upright cylinders, with the radii of the plate."""
    patches = find_patches(filleted_plate(fillet, 0.025, steps), *ENDS)
    kinds = [type(shape) for shape in patches.shapes]
    assert (kinds.count(Plane), kinds.count(Cone), kinds.count(Torus)) == (6, 8, 4)
    radii = sorted(s.radius for s in patches.shapes if isinstance(s, Cone))
    assert radii == pytest.approx([fillet] * 4 + [0.025] * 4, rel=1e-6)
    for shape in patches.shapes:
        if isinstance(shape, Torus):
            assert (shape.radius, shape.tube) == pytest.approx((0.025 - fillet, fillet))


def test_volume_of_a_filleted_plate_is_that_of_its_recognised_shapes():
    """The reference is the integral over the height; the facets lack 0.1 % of it."""
    surface = filleted_plate()
    true = TrueSurface(surface, find_patches(surface, *ENDS))
    assert surface.volume < 0.9995 * volume_of()
    assert true.volume == pytest.approx(volume_of(), rel=2e-6)
    assert true.unsure_volume == 0.0


def chamfered(width, flat, drop):
    """A bar along z whose top has two flat chamfers: four corners are on a circle."""
    half = width / 2
    outline = np.array([
        [-half, -half], [half, -half], [half, half - drop],
        [flat / 2, half], [-flat / 2, half], [-half, half - drop],
    ])  # fmt: skip
    count = len(outline)
    points = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (0, 0.1)])
    i, j = np.arange(count), (np.arange(count) + 1) % count
    fan = np.arange(1, count - 1)
    triangles = np.concatenate([
        np.column_stack([i, j, j + count]), np.column_stack([i, j + count, i + count]),
        np.column_stack([0 * fan, fan + 1, fan]),
        np.column_stack([0 * fan, fan, fan + 1]) + count,
    ])  # fmt: skip
    return check_surface(points, triangles, "chamfered bar")


@pytest.mark.parametrize("flat", [0.02, 0.03, 0.036])
def test_flat_chamfers_are_not_recognised_as_a_cylinder(flat):
    """Chamfers of 20 degrees on both sides of a flat top."""
    drop = np.tan(np.radians(20)) * (0.04 - flat) / 2
    surface = chamfered(0.04, flat, drop)
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    patches = find_patches(surface, *faces)
    assert all(isinstance(shape, Plane) for shape in patches.shapes)
    assert len(patches.shapes) == 8


def test_flat_side_between_fillets_remains_flat():
    """The side consists of two triangles, 150 x 6 mm,
    and meets fillets on three edges."""
    surface = filleted_plate()
    true = TrueSurface(surface, find_patches(surface, *ENDS))
    middle = np.array([[0.01, 0.15, 0.009], [0.0, -0.15, 0.008]])
    outward = np.array([[0, 1.0, 0], [0, -1.0, 0]])
    assert true.outside(middle, outward) == pytest.approx(0.0, abs=1e-12)


def domed_bar():
    """A bar along z with a hump r = 10 + 4 sin^2 mm over z = 30 .. 70 mm."""
    share = np.linspace(0, 1, 13)
    r = np.r_[0.01, 0.01 + 0.004 * np.sin(np.pi * share) ** 2, 0.01]
    z = np.r_[0.0, 0.03 + 0.04 * share, 0.1]
    angle = 2 * np.pi * np.arange(40) / 40
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rings = np.concatenate([a * circle + [0, 0, b] for a, b in zip(r, z, strict=True)])
    i, j = np.arange(40), (np.arange(40) + 1) % 40
    triangles = []
    for a in 40 * np.arange(len(r) - 1):
        triangles += [np.column_stack([i + a, j + a, j + a + 40])]
        triangles += [np.column_stack([i + a, j + a + 40, i + a + 40])]
    last = len(rings) - 40
    triangles += [np.column_stack([0 * i + len(rings), j, i])]
    triangles += [np.column_stack([0 * i + len(rings) + 1, i + last, j + last])]
    points = np.concatenate([rings, [[0, 0, 0], [0, 0, 0.1]]])
    return check_surface(points, np.concatenate(triangles), "domed bar")


@pytest.mark.slow
def test_cylinders_next_to_a_hump_are_recognised_separately():
    """The facets lack 0.44 % of the integral of pi r^2.

    The smoothed surface lacks less than its stated uncertainty, and the long cylinders
    are no part of the hump.
    """
    surface = domed_bar()
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
