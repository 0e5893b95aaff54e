"""Test of the matrices of a link with two moving ends."""

import numpy as np
import pytest

from forcefit.stiffness.fem.condensation import rigid_motions
from forcefit.stiffness.fem.elements import assemble
from forcefit.stiffness.fem.fea import Budget, FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.two_ends import two_ends


@pytest.mark.parametrize("interface", ["rigid", "distributing"])
def test_stiffness_of_both_ends_equals_the_schur_complement(interface):
    """The reference is computed by elimination of all inner nodes."""
    options = FemOptions(0.5, interface, Budget(levels=1))
    solved = solve_bar({"width": 0.3, "height": 0.4}, Material(1.0, 0.3, 2.0), options)
    mesh, constants = solved.level.mesh, solved.level.material
    upper = assemble(mesh, constants[:, 0], constants[:, 1]).toarray()
    K = upper + np.triu(upper, 1).T
    held = np.zeros((len(mesh.nodes), 3, 12))
    ends = np.zeros(len(mesh.nodes), dtype=bool)
    for side, center in enumerate(solved.centers):
        nodes = np.unique(mesh.faces[mesh.patch == side])
        motions = rigid_motions(mesh.nodes[nodes], center)
        held[nodes, :, 6 * side : 6 * side + 6] = motions
        ends[nodes] = True
    ends, flat = np.repeat(ends, 3), held.reshape(-1, 12)
    flat[~ends] = np.linalg.solve(
        K[np.ix_(~ends, ~ends)], -K[np.ix_(~ends, ends)] @ flat[ends]
    )
    expected = flat.T @ K @ flat
    size = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    both = two_ends(solved)
    np.testing.assert_allclose(both.stiffness / size, expected / size, atol=1e-9)
    # a rigid motion causes no force, and its mass is that of the bar
    whole = np.vstack([np.eye(6), np.eye(6)])
    # displacement of the tip due to a rotation
    whole[9:12, :3] = [[0, 1, 0], [-1, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(both.stiffness @ whole / size[:, :6], 0.0, atol=1e-9)
    shifts = whole[:, 3:]
    np.testing.assert_allclose(
        shifts.T @ both.mass @ shifts, 2.0 * 0.3 * 0.4 * np.eye(3), atol=1e-9
    )
