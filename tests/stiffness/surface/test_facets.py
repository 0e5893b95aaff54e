"""Tests of smooth surfaces through facets."""

import numpy as np
import pytest

from forcefit.stiffness.surface.facets import Facets
from tests.solids_for_tests import cylinder


def side(radius, facets):
    """Return the side of a round bar."""
    points, triangles = cylinder(radius, 0.2 * radius, facets)
    return Facets(points[:-2], triangles[: 2 * facets])


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_error_of_lifted_facets_is_of_fourth_order(radius):
    """For a half-angle a, the error of a flat facet is a^2 / 2 times the radius."""
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
