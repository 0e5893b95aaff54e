"""Tests of nodal stresses."""

from types import SimpleNamespace

import numpy as np

from forcefit.stiffness.fem.elements import isoparametric
from forcefit.stiffness.fem.error_indicator import VOIGT
from forcefit.stiffness.fem.stress import _nodal_stresses, von_mises
from forcefit.stiffness.fem.stress_error import nodes_by_material
from forcefit.stiffness.screws import rotation_matrix
from tests.solids_for_tests import box_solid


def tensor(six):
    """Return the stress tensor from xx yy zz yz xz xy, (..., 3, 3)."""
    x, y, z, yz, xz, xy = np.moveaxis(np.asarray(six), -1, 0)
    rows = [[x, xy, xz], [xy, y, yz], [xz, yz, z]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def test_von_mises_stress_equals_norm_of_deviatoric_stress(rng):
    """The stress is sqrt(3/2 s : s), where s is the deviatoric stress."""
    six = rng.normal(size=(20, 6))
    whole = tensor(six)
    mean = np.trace(whole, axis1=1, axis2=2)[:, None, None] / 3
    s = whole - mean * np.eye(3)
    expected = np.sqrt(1.5 * (s**2).sum(axis=(1, 2)))
    np.testing.assert_allclose(von_mises(six), expected, rtol=1e-12)
    R = rotation_matrix(rng.normal(size=3))
    turned = (R @ whole @ R.T)[:, VOIGT[:, 0], VOIGT[:, 1]]
    np.testing.assert_allclose(von_mises(turned), expected, rtol=1e-12)


def test_nodal_stresses_are_not_averaged_between_materials():
    """Two materials have the same strain."""
    mesh = isoparametric(box_solid((1, 1, 2), (1.0, 1.0, 2.0)), 2)
    high = mesh.nodes[mesh.cells[:, :4]].mean(axis=1)[:, 2] > 1
    field = np.zeros((len(mesh.nodes), 3, 6))
    field[:, 0, 5] = mesh.nodes[:, 1]  # shear strain with the stress mu in xy
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
