"""One element at a time: volumes, gradients and stiffness by a rule of their own."""

import numpy as np
import pytest

from stiffness.fem.elements import (
    Elements,
    assemble,
    integration,
    isoparametric,
    lame,
    node_gradients,
    triangle_areas,
    triangle_rule,
)
from stiffness.mesh.lagrange import face_nodes, lattice, shape_functions
from tests.solids_for_tests import bar_solid, box_solid

LAM, MU = lame(60e9, 0.3)
ORDERS = pytest.mark.parametrize("order", [2, 3])


def collapsed_rule(points=6):
    """Gauss's rule on a cube, squeezed to the tetrahedron (Duffy); exact to 9."""
    x, w = np.polynomial.legendre.leggauss(points)
    x, w = (1 + x) / 2, w / 2
    a, b, c = (v.ravel() for v in np.meshgrid(x, x, x, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() * (1 - a) ** 2 * (1 - b)
    L = [a, (1 - a) * b, (1 - a) * (1 - b) * c]
    return np.column_stack([1 - sum(L), *L]), weight


def one_element(rng, order, bend):
    """A tetrahedron whose lattice's points are all shifted by some share."""
    corners = np.array([[0.1, 0, 0], [1, 0.2, 0], [0, 0.9, 0.1], [0.3, 0.2, 0.8]])
    nodes = lattice(order) / order @ corners
    nodes += bend * rng.uniform(-1, 1, nodes.shape)
    return Elements(
        order, nodes, np.arange(len(nodes))[None], face_nodes(order), np.zeros(4, int),
        np.zeros(4, int), np.array([bend > 0]),
    )  # fmt: skip


@ORDERS
def test_a_crooked_elements_volume_is_exact(rng, order):
    """The Jacobian's determinant is a polynomial of three times the degree less one."""
    L, weights = collapsed_rule()
    _, dN = shape_functions(order, L)
    for bend in (0.0, 0.03):
        mesh = one_element(rng, order, bend)
        det = np.linalg.det(np.einsum("qai,ax->qix", dN, mesh.nodes))
        volume = sum(chunk.w.sum() for chunk in integration(mesh))
        assert volume == pytest.approx(abs(weights @ det), rel=1e-10)


@ORDERS
def test_a_straight_elements_stiffness_is_its_energys_second_derivative(rng, order):
    """lam tr e tr e' + 2 mu e : e' of every two unit displacements, point by point."""
    mesh = one_element(rng, order, 0.0)
    L, weights = collapsed_rule()
    _, dN = shape_functions(order, L)
    corners = mesh.nodes[:4]
    J = (corners[1:] - corners[0]).T
    G = dN @ np.linalg.inv(J)
    count = len(mesh.nodes)
    slope = np.zeros((len(L), count, 3, 3, 3))  # point, node, its direction, tensor
    for k in range(3):
        slope[:, :, k, k] = G
    strain = (slope + slope.swapaxes(3, 4)).reshape(len(L), 3 * count, 3, 3) / 2
    trace = np.trace(strain, axis1=2, axis2=3)
    w = weights * abs(np.linalg.det(J))
    K = LAM * np.einsum("q,qa,qb->ab", w, trace, trace)
    K += 2 * MU * np.einsum("q,qaij,qbij->ab", w, strain, strain, optimize=True)
    upper = assemble(mesh, np.array([LAM]), np.array([MU])).toarray()
    np.testing.assert_allclose(upper, np.triu(K), atol=1e-10 * np.abs(K).max())


@ORDERS
@pytest.mark.parametrize("bend", [0.0, 0.03])
def test_gradients_at_nodes_are_those_of_any_field_of_the_element(rng, order, bend):
    """Of a crooked one of linear fields, of a straight one of its own degree's."""
    mesh = one_element(rng, order, bend)
    ((part, G),) = node_gradients(mesh)
    assert part.tolist() == [0]
    slope = rng.normal(size=(3, 3))
    field = mesh.nodes @ slope.T
    np.testing.assert_allclose(
        np.einsum("qax,ai->qix", G[0], field), [slope] * len(field), atol=1e-9
    )
    if not bend:
        x, y, z = mesh.nodes.T
        value, exact = x * y + y**2, [y, x + 2 * y, 0 * z]
        if order == 3:
            value, exact = x * y * z + y**2, [y * z, x * z + 2 * y, x * y]
        np.testing.assert_allclose(
            G[0].swapaxes(1, 2) @ value, np.transpose(exact), atol=1e-9
        )


@ORDERS
def test_some_elements_are_integrated_over_as_all_are(rng, order):
    """Straight or curved, each once; a share of the volume."""
    mesh = isoparametric(bar_solid(2, 2, 0.04, 0.1), order)
    assert 0 < mesh.curved.sum() < len(mesh.curved)
    each = np.full(len(mesh.cells), np.nan)
    for chunk in integration(mesh):
        assert np.isnan(each[chunk.part]).all()
        each[chunk.part] = chunk.w.sum(axis=1)
    assert np.pi * 0.04**2 * 0.1 == pytest.approx(each.sum(), rel=1e-3)
    some = rng.random(len(each)) < 0.5
    seen = np.zeros(len(each), dtype=bool)
    for chunk in integration(mesh, some):
        seen[chunk.part] = True
        np.testing.assert_allclose(chunk.w.sum(axis=1), each[chunk.part])
        np.testing.assert_allclose(chunk.N, shape_functions(order, chunk.L)[0])
        assert chunk.weights.sum() == pytest.approx(1 / 6)
    np.testing.assert_array_equal(seen, some)


@ORDERS
def test_a_boundary_triangle_belongs_to_its_element_and_patch(order):
    """All its nodes are its owner's, on the plane of its end or on the side."""
    mesh = isoparametric(box_solid((2, 1, 2), (0.2, 0.1, 0.3)), order)
    assert len(mesh.faces) == 2 * 2 * (2 * 1 + 2 * 2 + 1 * 2)
    for face, owner in zip(mesh.faces, mesh.owner, strict=True):
        assert set(face) <= set(mesh.cells[owner])
    height = mesh.nodes[mesh.faces][..., 2]
    np.testing.assert_allclose(height[mesh.patch == 0], 0, atol=1e-15)
    np.testing.assert_allclose(height[mesh.patch == 1], 0.3)
    assert (np.ptp(height[mesh.patch == 2], axis=1) > 0.1).all()
    assert not mesh.curved.any()
    N, area = triangle_areas(mesh, mesh.faces[mesh.patch == 1])
    assert area.sum() == pytest.approx(0.02)
    assert (area > 0).all()
    np.testing.assert_allclose(N, triangle_rule(order)[0])


@ORDERS
def test_a_triangles_rule_integrates_products_of_shape_functions(order):
    """Their mass matrix is that of a collapsed rule of Gauss."""
    N, dN, weights = triangle_rule(order)
    x, w = np.polynomial.legendre.leggauss(6)
    x, w = (1 + x) / 2, w / 2
    a, b = (v.ravel() for v in np.meshgrid(x, x, indexing="ij"))
    weight = np.outer(w, w).ravel() * (1 - a)
    L = np.column_stack([1 - a - (1 - a) * b, a, (1 - a) * b])
    M, dM = shape_functions(order, L)
    mass = np.einsum("q,qa,qb->ab", weight, M, M)
    np.testing.assert_allclose(
        np.einsum("q,qa,qb->ab", weights, N, N), mass, atol=1e-12
    )
    slopes = np.einsum("q,qai,qbj->abij", weight, dM, dM)
    found = np.einsum("q,qai,qbj->abij", weights, dN, dN)
    np.testing.assert_allclose(found, slopes, atol=1e-11)
