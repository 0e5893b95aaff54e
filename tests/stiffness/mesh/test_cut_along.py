"""Tests of interfaces without a sharp edge."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.link import scaled
from forcefit.stiffness.mesh.cut_along import cut_along
from forcefit.stiffness.mesh.mesh import mesh_solid
from forcefit.stiffness.mesh.solid import boundary_faces
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.primitives import Plane
from forcefit.stiffness.surface.smooth_outline import smooth_outline
from tests.solids_for_tests import box_solid, rounded_block

Z = np.array([0.0, 0, 1])


def area_of(solid, patch):
    """Return the area of a patch [m^2]."""
    corners = solid.points[solid.faces[solid.patch == patch]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.linalg.norm(across, axis=1).sum() / 2


@pytest.mark.parametrize("edge", [0.37, 0.5, 0.52, 0.601])
def test_face_split_along_a_line_has_the_exact_area(edge):
    """The bottom of a unit box is divided into two patches at x = edge."""
    box = box_solid((4, 3, 3), (1.0, 1.0, 1.0))
    middle = box.points[box.faces].mean(axis=1)
    beyond = (box.patch == 0) & (middle[:, 0] > edge)
    shapes = (*box.shapes, Plane(np.zeros(3), Z))
    solid = replace(box, patch=np.where(beyond, 3, box.patch), shapes=shapes)
    line = np.array([[edge, 1.0, 0], [edge, 0.0, 0]])
    # counterclockwise about the normal -z
    outline = smooth_outline(line, np.array([[0, 1]]), -Z[None], (0, 3))
    wall = {outline.patches: outline.wall}
    cut = cut_along(replace(solid, walls=wall), outline)
    assert area_of(cut, 0) + area_of(cut, 3) == pytest.approx(1.0)
    moved = np.abs(cut.points[np.unique(cut.faces[cut.patch == 0])][:, 0]).max() - edge
    # corners near the line are not moved here
    assert area_of(cut, 0) == pytest.approx(edge, abs=0.01)
    assert abs(moved) < 0.01
    assert cut.volumes().sum() == pytest.approx(1.0)
    assert (cut.volumes() > 0).all()
    np.testing.assert_array_equal(
        np.unique(np.sort(boundary_faces(cut.cells), axis=1), axis=0),
        np.unique(np.sort(cut.faces, axis=1), axis=0),
    )


BLOCK = rounded_block((0.06, 0.03), 0.02, [(0.0, 0.0), (0.0, 0.02)], 18)
FLAT_ENDS = parse_interface("x=-0.06"), parse_interface("x=0.06")


def test_interface_without_a_sharp_edge_has_the_exact_area(tmp_path):
    """The block has 120 x 60 x 20 mm and corners with a radius of 20 mm. Its flat ends
    have 20 x 20 mm."""
    solid = mesh_solid(BLOCK, *FLAT_ENDS, edge=0.014, envelope=1e-3, cache=tmp_path)
    for patch, x in ((0, -0.06), (1, 0.06)):
        corners = solid.points[np.unique(solid.faces[solid.patch == patch])]
        assert area_of(solid, patch) == pytest.approx(4e-4, rel=1e-9)
        assert np.abs(corners[:, 1]).max() == pytest.approx(0.01, rel=1e-9)
        np.testing.assert_allclose(corners[:, 0], x, rtol=1e-12)


@pytest.mark.slow
def test_stiffness_of_a_rounded_block_is_symmetric_and_below_an_upper_bound(tmp_path):
    """Entries of K are zero because of symmetry planes. The upper bound on K_RZ is 119
    142 N m/rad, computed by another program.
    """
    options = FemOptions(0.02, cache=tmp_path)
    link = solve_link(BLOCK, *FLAT_ENDS, [Material(7e10, 0.3)], options=options).link
    K = link.stiffness
    assert link.mesh["reached"]
    assert K[2, 2] < 119_142
    assert K[2, 2] > 0.95 * 119_142
    share = scaled(K, K)
    allowed = np.eye(6, dtype=bool)
    allowed[1, 5] = allowed[5, 1] = allowed[2, 4] = allowed[4, 2] = True
    assert np.abs(share[~allowed]).max() < 1e-3
