"""Stresses at nodes: exact for linear fields, the same in turned axes."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import (
    Elements,
    isoparametric,
    lame,
    node_gradients,
)
from forcefit.stiffness.fem.error_indicator import VOIGT
from forcefit.stiffness.fem.stress import (
    _nodal_stresses,
    stress_influence,
    von_mises,
)
from forcefit.stiffness.fem.stress_error import nodes_by_material
from forcefit.stiffness.mesh.lagrange import face_nodes, lattice
from forcefit.stiffness.screws import rotation_matrix
from tests.solids_for_tests import box_solid


def tensor(six):
    """(..., 3, 3) of xx yy zz yz xz xy."""
    x, y, z, yz, xz, xy = np.moveaxis(np.asarray(six), -1, 0)
    rows = [[x, xy, xz], [xy, y, yz], [xz, yz, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def test_von_mises_stress_equals_the_deviators_norm_in_any_axes(rng):
    """sqrt(3/2 s : s), where s is the deviator, also of the rotated tensor."""
    six = rng.normal(size=(20, 6))
    whole = tensor(six)
    mean = np.trace(whole, axis1=1, axis2=2)[:, None, None] / 3
    s = whole - mean * np.eye(3)
    expected = np.sqrt(1.5 * (s**2).sum(axis=(1, 2)))
    np.testing.assert_allclose(von_mises(six), expected, rtol=1e-12)
    R = rotation_matrix(rng.normal(size=3))
    turned = (R @ whole @ R.T)[:, VOIGT[:, 0], VOIGT[:, 1]]
    np.testing.assert_allclose(von_mises(turned), expected, rtol=1e-12)


def test_nodal_stress_at_a_material_boundary_is_that_of_each_material():
    """Two materials under one strain: the stress is 3 or 7, without an average."""
    mesh = isoparametric(box_solid((1, 1, 2), (1.0, 1.0, 2.0)), 2)
    high = mesh.nodes[mesh.cells[:, :4]].mean(axis=1)[:, 2] > 1
    field = np.zeros((len(mesh.nodes), 3, 6))
    field[:, 0, 5] = mesh.nodes[:, 1]  # a shear strain: stress mu in xy
    level = SimpleNamespace(
        mesh=mesh, solution=SimpleNamespace(fields=field),
        material=np.column_stack([0 * high, np.where(high, 7.0, 3.0), 0 * high]),
    )  # fmt: skip
    found = _nodal_stresses(level)
    _, node = nodes_by_material(level)
    on_seam = np.flatnonzero(mesh.nodes[:, 2] == 1)
    assert len(found) == len(mesh.nodes) + len(on_seam)
    for seam in on_seam:
        np.testing.assert_allclose(np.sort(found[node == seam, 5, 5]), [3.0, 7.0])
    other = np.where(mesh.nodes[node, 2] > 1, 7.0, 3.0)
    away = mesh.nodes[node, 2] != 1
    np.testing.assert_allclose(found[away, 5, 5], other[away])
    found[:, 5, 5] = 0.0
    np.testing.assert_allclose(found, 0.0, atol=1e-12)


def box_of_stress(tip_scale=1.0):
    """A column of 0.3 by 0.4 by 1 m whose upper end is wider, and a made-up link."""
    solid = box_solid((1, 1, 4), (0.3, 0.4, 1.0))
    wider = 1 + (tip_scale - 1) * (solid.points[:, 2:] == 1.0)
    points = solid.points * np.hstack([wider, wider, np.ones_like(wider)])
    solid = type(solid)(points, solid.cells, solid.faces, solid.patch, (None,) * 3)
    mesh = isoparametric(solid, 2)
    lam, mu = lame(1.0, 0.25)
    field = np.zeros((len(mesh.nodes), 3, 6))
    field[:, 2, 5] = mesh.nodes[:, 2]
    level = SimpleNamespace(
        mesh=mesh, solid=solid,
        solution=SimpleNamespace(
            fields=field, stiffness=np.diag([1.0, 1, 1, 1, 1, 0.2])
        ),
        material=np.tile([lam, mu, 0.0], (len(mesh.cells), 1)),
    )  # fmt: skip
    return SimpleNamespace(level=level)


@pytest.mark.parametrize("scale", [1.0, 1.5, 0.5])
def test_stresses_near_the_interfaces_are_excluded(scale):
    """A stretch of 1 along z has the stresses lam and lam + 2 mu,
    times five for a unit force."""
    solved = box_of_stress(scale)
    stress = stress_influence(solved)
    assert stress.away == pytest.approx(0.25 * max(scale, 1.0), rel=1e-9)
    height = stress.places[:, 2]
    assert height.min() >= stress.away * (1 - 1e-9)
    assert height.max() <= (1 - stress.away) * (1 + 1e-9)
    expected = 5 * np.array([0.4, 0.4, 1.2, 0, 0, 0])
    np.testing.assert_allclose(
        stress.stresses([0, 0, 0, 0, 0, 1.0]), [expected] * len(height), atol=1e-9
    )
    assert np.abs(stress.influence[:, :5]).max() < 1e-12


def one_element(rng, order, bend):
    """A tetrahedron whose lattice's points are all shifted by some share."""
    corners = np.array([[0.1, 0, 0], [1, 0.2, 0], [0, 0.9, 0.1], [0.3, 0.2, 0.8]])
    nodes = lattice(order) / order @ corners
    nodes += bend * rng.uniform(-1, 1, nodes.shape)
    return Elements(
        order, nodes, np.arange(len(nodes))[None], face_nodes(order), np.zeros(4, int),
        np.zeros(4, int), np.array([bend > 0]),
    )  # fmt: skip


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("bend", [0.0, 0.03])
def test_nodal_gradients_of_fields_within_the_elements_space_are_exact(
    rng, order, bend
):
    """Linear fields on a distorted element;
    polynomials of its degree on a straight one."""
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
