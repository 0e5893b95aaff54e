"""Tests of Lagrange polynomials on tetrahedra."""

from math import prod

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import isoparametric
from forcefit.stiffness.mesh.lagrange import lattice, shape_functions
from tests.solids_for_tests import box_solid

ORDERS = (1, 2, 3)
CORNERS = (3, 4)


def inside(rng, corners, count=20):
    return rng.dirichlet(np.ones(corners), size=count)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", ORDERS)
def test_shape_functions_are_one_at_one_node_and_zero_at_others(degree, corners):
    N, _ = shape_functions(degree, lattice(degree, corners) / degree)
    np.testing.assert_allclose(N, np.eye(len(N)), atol=1e-15)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", ORDERS)
def test_shape_functions_represent_every_polynomial_of_their_degree(
    rng, degree, corners
):
    """The sum of the functions is one, and the sum of their derivatives is zero."""
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
def test_derivatives_of_shape_functions_equal_central_differences(rng, degree, corners):
    """The error of a central difference is at most 27 / 6 times the squared step of
    1e-5."""
    L, step = inside(rng, corners), 1e-5
    _, dN = shape_functions(degree, L)
    for k in range(1, corners):
        moved = np.zeros(corners)
        moved[k], moved[0] = step, -step
        ahead, back = (shape_functions(degree, L + s * moved)[0] for s in (1, -1))
        difference = (ahead - back) / (2 * step)
        np.testing.assert_allclose(dN[:, :, k - 1], difference, atol=1e-8)


@pytest.mark.parametrize("order", [2, 3])
def test_shared_node_has_the_same_position_in_every_element(order):
    """This includes any order of the corners."""
    solid = box_solid((2, 3, 2), (0.1, 0.2, 0.3))
    mesh = isoparametric(solid, order)
    assert len(mesh.nodes) == prod(order * n + 1 for n in (2, 3, 2))
    corners = np.sort(solid.cells, axis=1)
    own = np.einsum("nk,tkx->tnx", lattice(order) / order, solid.points[corners])
    np.testing.assert_allclose(mesh.nodes[mesh.cells], own, atol=1e-15)
