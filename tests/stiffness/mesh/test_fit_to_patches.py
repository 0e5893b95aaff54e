"""Tests of the assignment of meshes to the patches of a surface."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed, fit_to_patches
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import Patches, find_patches
from forcefit.stiffness.surface.primitives import Plane
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, box_solid

Z = np.array([0.0, 0, 1])


SURFACE = check_surface(CUBE, CUBE_TRIANGLES, "cube")
ENDS = parse_interface("z=0"), parse_interface("z=0.1")


@pytest.mark.parametrize("stretch", [0.979, 1.021])
def test_mesh_with_a_wrong_volume_is_rejected(stretch):
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1 * stretch))
    words = "the volume of the mesh is 0.00.* inside the surface"
    with pytest.raises(MeshFailed, match=words):
        fit_to_patches(made.points, made.cells, SURFACE, find_patches(SURFACE, *ENDS))


@pytest.mark.parametrize(("other", "missing"), [(1, "base"), (0, "tip"), (2, "base")])
def test_mesh_without_a_face_on_an_interface_is_rejected(other, missing):
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1))
    far = Plane(50 * Z, Z)  # no corner is near this plane
    patches = Patches(np.full(len(CUBE_TRIANGLES), other), (far, far, far))
    with pytest.raises(BadInput, match=f"no face of the mesh on the {missing}"):
        fit_to_patches(made.points, made.cells, SURFACE, patches)


def test_fit_reorients_inverted_tetrahedra_and_removes_unused_points():
    """The solid is far from the origin."""
    far = np.array([3.0, -2.0, 1.0])
    rng = np.random.default_rng(7)
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1))
    place = np.sort(rng.choice(40, len(made.points), replace=False))
    points = rng.normal(size=(40, 3))
    points[place] = made.points + far
    cells = place[made.cells]
    turned = rng.random(len(cells)) < 0.5
    cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    surface = check_surface(CUBE + far, CUBE_TRIANGLES, "cube")
    ends = parse_interface("z=1"), parse_interface("z=1.1")
    solid = fit_to_patches(points, cells, surface, find_patches(surface, *ends))
    assert len(solid.points) == len(made.points)
    np.testing.assert_allclose(solid.volumes(), 1e-3 / 48, rtol=1e-9)
    corners = solid.points[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    flux = np.einsum("fi,fi->", normals, corners.mean(axis=1)) / 3
    assert flux == pytest.approx(1e-3)
