"""Tests of curved elements."""

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import (
    integration,
    isoparametric,
    lame,
    triangle_areas,
)
from forcefit.stiffness.fem.error_indicator import geometry_errors
from forcefit.stiffness.mesh.curved_elements import curved_elements, refine_inverted
from forcefit.stiffness.mesh.edge_grading import layered, split_joining_edges
from forcefit.stiffness.mesh.lagrange import lattice, shape_functions
from forcefit.stiffness.mesh.solid import Solid, boundary_faces
from forcefit.stiffness.surface.primitives import Plane, Sphere
from tests.solids_for_tests import bar_solid, box_cells, outward

HALF = 0.5  # tangent of half the angle between opposite planes
SOLID_ANGLE = 4 * np.arcsin(HALF**2 / (1 + HALF**2))


def shell(counts, inner, outer):
    """Return the part of a spherical shell between four planes through its centre.
    Patch 0 is the inner sphere, and patch 1 is the outer sphere.
    """
    unit, cells = box_cells(counts)
    s, t, u = unit.T
    way = np.column_stack([HALF * (2 * s - 1), HALF * (2 * t - 1), np.ones(len(s))])
    way /= np.linalg.norm(way, axis=1)[:, None]
    points = way * (inner + u * (outer - inner))[:, None]
    cells = outward(points, cells)
    faces = boundary_faces(cells)
    patch = np.zeros(len(faces), dtype=int)
    sides = [(2, 0, 0), (2, 1, 1), (0, 0, 2), (0, 1, 3), (1, 0, 4), (1, 1, 5)]
    for axis, value, number in sides:
        patch[(np.abs(unit[faces][:, :, axis] - value) < 1e-9).all(axis=1)] = number
    zero = np.zeros(3)
    planes = [
        Plane(zero, np.array(n) / np.linalg.norm(n))
        for n in ((-1, 0, -HALF), (1, 0, -HALF), (0, -1, -HALF), (0, 1, -HALF))
    ]
    shapes = Sphere(zero, inner), Sphere(zero, outer), *planes
    return Solid(points, cells, faces, patch, shapes)


def layers_of_bar(rings, layers, order):
    held = (0, 1)
    solid = split_joining_edges(bar_solid(rings, layers, 0.04, 0.2), held)
    return isoparametric(solid, order), isoparametric(
        solid, order, layered(solid, held)
    )


def side_errors(mesh):
    """Return the distances of nodes from a cylinder divided by its radius."""
    nodes = mesh.nodes[np.unique(mesh.faces[mesh.patch == 2])]
    return np.abs(np.hypot(*nodes[:, :2].T) / 0.04 - 1)


def test_distance_of_curved_elements_from_a_cylinder_is_of_fourth_order():
    """The order is the same with and without layers."""
    errors = {rings: layers_of_bar(rings, 2 * rings, 3) for rings in (2, 4)}
    for k in range(2):
        coarse, fine = (side_errors(errors[rings][k]).max() for rings in (2, 4))
        assert coarse < 1e-3
        assert coarse / fine > 0.9 * 2**4
    for mesh in errors[4]:
        on = np.unique(mesh.faces[mesh.patch <= 1])
        height = mesh.nodes[on, 2]
        np.testing.assert_allclose(height, np.where(height > 0.1, 0.2, 0), atol=1e-15)


def volume(mesh):
    return sum(chunk.w.sum() for chunk in integration(mesh))


def test_volume_of_a_round_bar_converges_with_the_sixth_power():
    """The error of quadratic elements decreases with the fourth power."""
    exact = np.pi * 0.04**2 * 0.2
    for order, power, least in ((2, 4, 1e-5), (3, 6, 1e-7)):
        error = [
            volume(isoparametric(bar_solid(n, 2 * n, 0.04, 0.2), order)) / exact - 1
            for n in (2, 4)
        ]
        assert np.log2(error[0] / error[1]) > power - 0.2
        assert abs(error[1]) < least


@pytest.mark.parametrize("order", [2, 3])
def test_layers_do_not_change_volume_and_area_of_curved_elements(order):
    """Elements are divided in their reference coordinates."""
    whole, cut = layers_of_bar(2, 4, order)
    assert len(cut.cells) > len(whole.cells)
    assert volume(cut) == pytest.approx(volume(whole), rel=1e-12)
    area = [triangle_areas(m, m.faces)[1].sum() for m in (whole, cut)]
    assert area[1] == pytest.approx(area[0], rel=1e-6)


def shell_volume(inner, outer):
    return SOLID_ANGLE * (outer**3 - inner**3) / 3


def test_volume_of_a_sphere_converges_with_the_sixth_power():
    """The part of a shell has a concave and a convex face."""
    error = []
    for n in (1, 2, 4):
        mesh = isoparametric(shell((n, n, n), 0.6, 1.0))
        error.append(abs(volume(mesh) / shell_volume(0.6, 1.0) - 1))
    assert np.log2(error[1] / error[2]) > 5.7
    assert error[2] < 1e-6


@pytest.mark.parametrize(("number", "sign"), [(0, 1), (1, -1)])
def test_geometry_error_equals_energy_density_times_missing_volume(number, sign):
    """The strain is constant. The radius of a face is increased by a factor of 1 +
    1e-4.
    """
    solid = shell((3, 3, 2), 0.6, 1.0)
    mesh = isoparametric(solid)
    lam, mu = lame(60e9, 0.3)
    A = np.array([[1.0, 0.2, 0], [0.2, -0.5, 0.3], [0, 0.3, 0.4]])
    density = lam * np.trace(A) ** 2 + 2 * mu * (A**2).sum()
    ones = np.ones(len(mesh.cells))
    field = (mesh.nodes @ A)[:, :, None]
    errors, radius = [], solid.shapes[number].radius
    for excess in (0, 1e-4):
        shapes = list(solid.shapes)
        shapes[number] = Sphere(np.zeros(3), radius * (1 + excess))
        each = geometry_errors(mesh, shapes, field, lam * ones, mu * ones)
        errors.append(each[mesh.patch == number].sum() / density)
    taken = sign * SOLID_ANGLE * radius**3 * 1e-4
    assert errors[1] - errors[0] == pytest.approx(taken, rel=1e-5)
    # the error of the mesh is smaller by a factor of 100
    assert abs(errors[0]) < 0.02 * abs(taken)


THIN = [((2, 2, 1), 0.95), ((4, 4, 1), 0.96), ((5, 5, 1), 0.965), ((8, 8, 1), 0.99)]


@pytest.mark.parametrize(("counts", "inner"), THIN)
@pytest.mark.parametrize("order", [2, 3])
def test_elements_of_thin_walls_are_not_inverted(counts, inner, order):
    """Curved faces whose height is a quarter of the wall thickness would invert
    elements. These elements are straightened."""
    solid = shell(counts, inner, 1.0)
    bent = curved_elements(solid, order)
    assert bent.inverted.any()
    corners = solid.points[bent.cells[:, :4]]
    hand = np.sign(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    _, dN = shape_functions(order, lattice(order) / order)
    J = np.einsum("qai,tax->tqix", dN, bent.nodes[bent.cells])
    assert (np.linalg.det(J) * hand[:, None] > 0).all()
    # corners are not moved
    np.testing.assert_array_equal(bent.nodes[: len(solid.points)], solid.points)


@pytest.mark.parametrize(("counts", "inner"), THIN[1:3])
def test_refining_inverted_elements_more_than_halves_the_volume_error(counts, inner):
    solid = shell(counts, inner, 1.0)
    error = [
        abs(volume(isoparametric(s)) / shell_volume(inner, 1.0) - 1)
        for s in (solid, refine_inverted(solid, 3))
    ]
    assert error[1] < error[0] / 2
