"""Condensation to the interfaces: rigid motions, energies, number of unknowns."""

import numpy as np
import pytest

from forcefit.stiffness.fem.condensation import (
    KINDS,
    Condensed,
    _distributed_loads,
    condense,
    rigid_motions,
)
from forcefit.stiffness.fem.elements import assemble, isoparametric, triangle_areas
from forcefit.stiffness.link import scaled
from tests.solids_for_tests import bar_solid, box_solid, constants

SIZE = np.array([0.05, 0.08, 0.2])
CENTERS = np.array([[0.02, 0.05, 0.01], [0.03, 0.02, 0.23]])


@pytest.mark.parametrize("order", [2, 3])
def test_mean_motion_of_an_interface_is_the_least_squares_rigid_motion(rng, order):
    """Fitted at the integration points of its area, for any displacement field."""
    mesh = isoparametric(bar_solid(1, 2, 0.04, 0.1), order)
    field = rng.normal(size=(len(mesh.nodes), 3))
    mean = np.einsum("nik,ni->k", _distributed_loads(mesh, 1, CENTERS[1]), field)
    faces = mesh.faces[mesh.patch == 1]
    N, area = triangle_areas(mesh, faces)
    root = np.sqrt(area).reshape(-1, 1, 1)
    places, moved = (
        np.einsum("qa,tax->tqx", N, v[faces]).reshape(-1, 3)
        for v in (mesh.nodes, field)
    )
    A = (root * rigid_motions(places, CENTERS[1])).reshape(-1, 6)
    expected = np.linalg.lstsq(A, (root[:, 0] * moved).ravel())[0]
    np.testing.assert_allclose(scaled_screw(mean), scaled_screw(expected), rtol=1e-8)


def scaled_screw(screw):
    """Scale rotations by the rim's radius, 40 mm."""
    return screw * [0.04, 0.04, 0.04, 1, 1, 1]


@pytest.mark.parametrize("kind", KINDS)
def test_condensed_stiffness_equals_twice_the_energy_of_its_fields(kind):
    """K from the whole assembled matrix; the base rests,
    the tip's mean motion is the screw, and forces act at the interfaces alone."""
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
        # relative to the base, whose mean motion carries the tip along
        carried = np.eye(6)
        x, y, z = CENTERS[1] - CENTERS[0]
        carried[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        means[1] -= carried @ means[0]
    else:
        base = np.unique(mesh.faces[mesh.patch == 0])
        assert np.abs(solution.fields[base]).max() == 0
    np.testing.assert_allclose(means[1], np.eye(6), atol=1e-8)


def test_number_of_unknowns_excludes_held_interfaces():
    """The nodes of a quadratic 2 by 4 by 4 grid:
    without base and tip, without the base, and without six supports."""
    mesh = isoparametric(box_solid((1, 2, 2), SIZE), 2)
    layer, count = 3 * 5, 3 * 5 * 5
    unknowns, kinds = [], []
    for kind in KINDS:
        solution = condense(mesh, *constants(mesh), CENTERS, kind)
        unknowns.append(solution.unknowns)
        kinds.append(solution.kind)
    assert unknowns == [3 * (count - 2 * layer), 3 * (count - layer), 3 * count - 6]
    assert tuple(kinds) == KINDS
    assert Condensed(np.eye(6), np.zeros((1, 3, 6)), 0).kind == "rigid"
