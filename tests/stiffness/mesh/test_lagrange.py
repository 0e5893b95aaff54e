"""Polynomials on tetrahedra: values on the lattice, derivatives, numbers."""

from math import prod

import numpy as np
import pytest

from stiffness.fem.elements import isoparametric
from stiffness.mesh.lagrange import lattice, numbered, shape_functions
from stiffness.mesh.solid import Solid
from tests.solids_for_tests import bar_solid, box_solid

ORDERS = (1, 2, 3)
CORNERS = (3, 4)


def inside(rng, corners, count=20):
    return rng.dirichlet(np.ones(corners), size=count)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", ORDERS)
def test_shape_functions_are_one_at_their_point_and_zero_at_the_others(degree, corners):
    N, _ = shape_functions(degree, lattice(degree, corners) / degree)
    np.testing.assert_allclose(N, np.eye(len(N)), atol=1e-15)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", ORDERS)
def test_shape_functions_hold_every_polynomial_of_their_degree(rng, degree, corners):
    """They sum to one, and their derivatives to zero."""
    L = inside(rng, corners)
    N, dN = shape_functions(degree, L)
    np.testing.assert_allclose(N.sum(axis=1), 1, rtol=1e-13)
    np.testing.assert_allclose(dN.sum(axis=1), 0, atol=1e-12)
    nodes = lattice(degree, corners)[:, 1:] / degree
    for power in lattice(degree, corners)[:, 1:]:
        exact = (L[:, 1:] ** power).prod(axis=1)
        np.testing.assert_allclose(N @ (nodes**power).prod(axis=1), exact, atol=1e-13)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", ORDERS)
def test_derivatives_are_those_of_central_differences(rng, degree, corners):
    """Of a cubic they are off by the step squared over 6 times its third derivative,
    which is at most 27: 1e-9 at a step of 1e-5."""
    L, step = inside(rng, corners), 1e-5
    _, dN = shape_functions(degree, L)
    for k in range(1, corners):
        moved = np.zeros(corners)
        moved[k], moved[0] = step, -step
        ahead, back = (shape_functions(degree, L + s * moved)[0] for s in (1, -1))
        difference = (ahead - back) / (2 * step)
        np.testing.assert_allclose(dN[:, :, k - 1], difference, atol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
def test_elements_share_the_nodes_of_what_they_share_and_no_others(order):
    """Any two elements with k common corners: a lattice of k corners in common."""
    cells = np.sort(box_solid((2, 2, 1), (1.0, 1.0, 1.0)).cells, axis=1)
    numbers, count = numbered(cells, order)
    assert set(numbers.ravel()) == set(range(count))
    np.testing.assert_array_equal(numbers[:, :4], cells)
    for i in range(len(cells)):
        for j in range(i):
            common = len(np.intersect1d(cells[i], cells[j]))
            expected = len(lattice(order, common)) if common else 0
            assert len(np.intersect1d(numbers[i], numbers[j])) == expected


@pytest.mark.parametrize("order", [2, 3])
def test_a_shared_node_has_one_place(order):
    """Every element computes the same place for it, in any order; and the
    grid of a box has as many nodes as its finer grid."""
    solid = box_solid((2, 3, 2), (0.1, 0.2, 0.3))
    mesh = isoparametric(solid, order)
    assert len(mesh.nodes) == prod(order * n + 1 for n in (2, 3, 2))
    corners = np.sort(solid.cells, axis=1)
    own = np.einsum("nk,tkx->tnx", lattice(order) / order, solid.points[corners])
    np.testing.assert_allclose(mesh.nodes[mesh.cells], own, atol=1e-15)


def test_the_numbers_of_the_corners_do_not_matter(rng):
    """Renumbered corners give the same places, in other orders."""
    solid = bar_solid(1, 2, 0.02, 0.06)
    name = rng.permutation(len(solid.points))
    points = np.empty_like(solid.points)
    points[name] = solid.points
    other = Solid(
        points, name[solid.cells], name[solid.faces], solid.patch, solid.shapes
    )
    one, two = (isoparametric(s, 3) for s in (solid, other))
    assert len(one.nodes) == len(two.nodes)
    gap = np.linalg.norm(one.nodes[:, None] - two.nodes[None], axis=2).min(axis=1)
    assert gap.max() < 1e-12
