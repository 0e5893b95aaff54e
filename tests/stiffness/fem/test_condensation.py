"""Tests of the condensation onto two interfaces."""

import numpy as np
import pytest

from forcefit.stiffness.fem.condensation import KINDS, _distributed_loads, condense
from forcefit.stiffness.fem.elements import assemble, isoparametric
from forcefit.stiffness.link import scaled
from tests.solids_for_tests import box_solid, constants

SIZE = np.array([0.05, 0.08, 0.2])
CENTERS = np.array([[0.02, 0.05, 0.01], [0.03, 0.02, 0.23]])


@pytest.mark.parametrize("kind", KINDS)
def test_condensed_stiffness_equals_twice_the_energy_of_its_fields(kind):
    """The energy is computed with the complete stiffness matrix. The mean motion of the
    tip is the screw, and forces act only on the interfaces.
    """
    mesh = isoparametric(box_solid((1, 2, 2), SIZE), 2)
    solution = condense(mesh, *constants(mesh), CENTERS, kind)
    upper = assemble(mesh, *constants(mesh)).toarray()
    whole = upper + np.triu(upper, 1).T
    flat = solution.fields.reshape(-1, 6)
    K = solution.stiffness
    forces = (whole @ flat).reshape(-1, 3, 6)
    away = np.ones(len(mesh.nodes), dtype=bool)
    away[np.unique(mesh.faces[mesh.patch <= 1])] = False
    assert np.abs(forces[away]).max() < 1e-9 * np.abs(forces).max()
    assert np.abs(scaled(flat.T @ whole @ flat - K, K)).max() < 1e-9
    means = [
        np.einsum(
            "nik,nil->kl", _distributed_loads(mesh, k, CENTERS[k]), solution.fields
        )
        for k in (0, 1)
    ]
    if kind == "distributing-both":
        # motion of the tip relative to the mean motion of the base
        carried = np.eye(6)
        x, y, z = CENTERS[1] - CENTERS[0]
        carried[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        means[1] -= carried @ means[0]
    else:
        base = np.unique(mesh.faces[mesh.patch == 0])
        assert np.abs(solution.fields[base]).max() == 0
    np.testing.assert_allclose(means[1], np.eye(6), atol=1e-8)
