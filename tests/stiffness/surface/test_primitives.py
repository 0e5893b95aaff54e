"""Tests of planes, cones, spheres and tori."""

import numpy as np
import pytest

from forcefit.stiffness.screws import rotation_matrix
from forcefit.stiffness.surface.primitives import (
    Cone,
    Plane,
    Sphere,
    Torus,
    fit_plane,
    project,
)

AXIS = rotation_matrix([0.4, -0.3, 0.2])[:, 2]
CENTER = np.array([3.0, -2.0, 5.0])


def ring_points(radius, along, count=12):
    """Return points on circles around an axis, (count, 3) for each radius."""
    u, v = np.linalg.svd(AXIS[None])[2][1:]
    angle = 2 * np.pi * np.arange(count) / count
    spokes = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v
    rings = [CENTER + a * AXIS + r * spokes for r, a in zip(radius, along, strict=True)]
    return np.concatenate(rings)


ANGLES = 2 * np.pi * np.arange(8) / 8
CASES = {
    "plane": (Plane(CENTER, AXIS), ring_points([1.0, 2.0], [0.0, 0.0])),
    "cone": (
        Cone(CENTER, AXIS, 2.0, 0.5),
        ring_points([1.5, 2.0, 2.5], [-1.0, 0.0, 1.0]),
    ),
    "sphere": (Sphere(CENTER, 2.0), ring_points([1.2, 2.0], [1.6, 0.0])),
    "torus": (
        Torus(CENTER, AXIS, 2.0, 0.5),
        ring_points(2 + 0.5 * np.cos(ANGLES), 0.5 * np.sin(ANGLES)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_signed_distance_equals_the_offset_along_the_normal(name):
    """The distance is positive outside the shape and negative inside."""
    shape, points = CASES[name]
    distances, normals = shape.signed(points)
    np.testing.assert_allclose(distances, 0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-14)
    for lift in (0.1, -0.1):
        away, same = shape.signed(points + lift * normals)
        np.testing.assert_allclose(away, lift, rtol=1e-12)
        np.testing.assert_allclose(same, normals, atol=1e-13)


@pytest.mark.parametrize("sign", [1, -1])
def test_normal_of_a_fitted_plane_has_the_direction_of_its_facets(sign):
    points = CASES["plane"][1]
    tilted = AXIS + 0.3 * np.linalg.svd(AXIS[None])[2][1]
    tilted /= np.linalg.norm(tilted)
    fitted = fit_plane(points, sign * tilted[None])
    np.testing.assert_allclose(fitted.normal, sign * AXIS, atol=1e-14)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_projection_onto_two_shapes_is_on_their_common_line(unit):
    """Newton's method converges to machine precision."""
    sphere = Sphere(unit * CENTER, 2.0 * unit)
    cylinder = Cone(unit * (CENTER + [0.3, 0.0, 0.0]), AXIS, 1.0 * unit)
    points = ring_points([1.3, 0.9], [1.6, -1.9])
    found = project(unit * points, (sphere, cylinder))
    for shape in (sphere, cylinder):
        np.testing.assert_allclose(shape.signed(found)[0] / unit, 0, atol=1e-12)
    # the displacement is at most twice the distance from the shapes
    away = [np.abs(s.signed(unit * points)[0]) for s in (sphere, cylinder)]
    moved = np.linalg.norm(found - unit * points, axis=1)
    assert (moved < 2 * np.max(away, axis=0) + 0.2 * unit).all()
