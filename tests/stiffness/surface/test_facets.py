"""Lifted facets: weights of corners, unit normals, fourth-order accuracy."""

import numpy as np
import pytest

from forcefit.stiffness.surface.facets import Facets
from tests.solids_for_tests import cylinder


def side(radius, facets):
    """A round bar's side, without its ends."""
    points, triangles = cylinder(radius, 0.2 * radius, facets)
    return Facets(points[:-2], triangles[: 2 * facets])


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_lifted_facets_deviate_by_the_fourth_power_of_the_angle(radius):
    """A flat facet of half-angle a deviates by a^2 / 2 of the radius,
    a lifted one by a^4."""
    facets, a = 24, np.pi / 24
    patch = side(radius, facets)
    spokes = patch.points[:, :2] / radius
    np.testing.assert_allclose(patch.normals[:, :2], spokes, atol=1e-12)
    middle = 2 * np.pi * (np.arange(facets) + 0.5) / facets
    points = np.column_stack([np.cos(middle), np.sin(middle), 0.08 + 0 * middle])
    for lift in (0.0, 0.05, -0.05):
        lifted = radius * points * [1 + lift, 1 + lift, 1]
        distances, gradients = patch.signed(lifted)
        np.testing.assert_allclose(distances / radius, lift, atol=a**4)
        np.testing.assert_allclose(np.linalg.norm(gradients, axis=1), 1, rtol=1e-12)
        np.testing.assert_allclose(gradients[:, :2], points[:, :2], atol=a**2)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_single_facet_has_the_normals_and_distances_of_its_plane(size):
    """Also at narrow corners."""
    corners = size * np.array([[0.0, 0, 2], [1, 0, 2], [0.05, 0.1, 2]])
    facet = Facets(corners, np.array([[0, 1, 2]]))
    np.testing.assert_allclose(facet.normals, [[0, 0, 1]] * 3, atol=1e-12)
    inside = np.einsum("pc,ci->pi", [[0.2, 0.3, 0.5], [0.8, 0.1, 0.1]], corners)
    for lift in (0.1, -0.1):
        distances, gradients = facet.signed(inside + [0, 0, lift * size])
        np.testing.assert_allclose(distances / size, lift, atol=1e-6)
        np.testing.assert_allclose(gradients, [[0, 0, 1]] * 2, atol=1e-12)
