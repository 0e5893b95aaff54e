"""Tests of the materials of links."""

import numpy as np
import pytest

from forcefit.inputs.errors import BadInput
from forcefit.stiffness.fem.elements import isoparametric
from forcefit.stiffness.fem.material import Material, material_of_elements
from forcefit.stiffness.mesh.edge_grading import layered
from tests.solids_for_tests import box_solid


@pytest.mark.parametrize("density", [-1e-9, np.inf, np.nan])
def test_wrong_density_is_rejected(density):
    with pytest.raises(BadInput, match="density"):
        Material(2.1e11, 0.3, density)


def test_element_has_the_last_material_at_its_centre():
    """The centre of an element is the mean of its four corners."""
    solid = box_solid((2, 1, 3), np.array([0.1, 0.1, 0.1]))
    mesh = isoparametric(solid, 3, layered(solid, (0, 1)))
    asked = []

    def above(points):
        asked.append(points)
        return points[:, 2] > 0.05

    soft, stiff = Material(1e9, 0.25, 1000.0), Material(2e11, 0.0, 7800.0, where=above)
    table = material_of_elements(mesh, [soft, stiff])
    corners = mesh.nodes[mesh.cells][:, :4]
    np.testing.assert_allclose(asked[0], corners.sum(axis=1) / 4, atol=1e-15)
    high = corners[..., 2].sum(axis=1) > 0.2
    assert 0 < high.sum() < len(high)
    # Lame's constants are E nu / ((1 + nu) (1 - 2 nu)) and E / (2 (1 + nu))
    np.testing.assert_allclose(table[~high], [[4e8, 4e8, 1000]] * (~high).sum())
    np.testing.assert_allclose(table[high], [[0, 1e11, 7800]] * high.sum(), atol=1e-3)
    with pytest.raises(BadInput, match="expected a material of the whole link"):
        material_of_elements(mesh, [stiff, soft][:1])
    with pytest.raises(BadInput, match="at least one"):
        material_of_elements(mesh, [])
