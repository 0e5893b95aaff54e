"""Tests of the mass properties of links."""

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import isoparametric
from forcefit.stiffness.fem.mass_properties import PointMass, mass_properties
from forcefit.stiffness.mesh.edge_grading import layered
from tests.solids_for_tests import box_solid

SIZE = np.array([0.1, 0.2, 0.4])


def box():
    solid = box_solid((1, 2, 2), SIZE)
    return isoparametric(solid, 3, layered(solid, (0, 1)))


def inertia_of_points(masses, places):
    """Return the inertia of points, the sum of m (x.x I - x x^T)."""
    centre = masses @ places / masses.sum()
    x = places - centre
    squares = np.einsum("i,ij,ij->", masses, x, x)
    return centre, squares * np.eye(3) - np.einsum("i,ij,ik->jk", masses, x, x)


def test_mass_properties_of_a_box_with_two_point_masses_follow_steiners_rule():
    mesh = box()
    density = np.full(len(mesh.cells), 2000.0)
    body = 2000.0 * SIZE.prod()
    x, y, z = SIZE**2
    own = body / 12 * np.diag([y + z, x + z, x + y])
    places = np.array([[0.3, -0.1, 0.2], [-0.2, 0.4, 0.5], SIZE / 2])
    masses = np.array([3.0, 5.0, body])
    points = [PointMass(m, p) for m, p in zip(masses[:2], places[:2], strict=True)]
    mass, centre, inertia = mass_properties(mesh, density, points)
    expected, about = inertia_of_points(masses, places)
    assert mass == pytest.approx(masses.sum())
    np.testing.assert_allclose(centre, expected, rtol=1e-10)
    np.testing.assert_allclose(inertia, about + own, rtol=1e-10, atol=1e-12)


def test_mass_of_a_link_without_density_equals_the_point_masses():
    mesh = box()
    nothing = np.zeros(len(mesh.cells))
    for points, place in (([], [0, 0, 0]), ([PointMass(2.0, SIZE)], SIZE)):
        mass, centre, inertia = mass_properties(mesh, nothing, points)
        assert mass == 2.0 * len(points)
        np.testing.assert_allclose(centre, place)
        np.testing.assert_allclose(inertia, 0.0, atol=1e-12)
