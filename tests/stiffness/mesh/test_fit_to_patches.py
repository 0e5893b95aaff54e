"""A mesh fitted to a surface's patches: which face is whose, moved how far, refused."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from stiffness.mesh.fit_to_patches import MeshFailed, fit_to_patches
from stiffness.mesh.solid import (
    Solid,
    boundary_faces,
    moved_onto_shapes,
    node_patches,
    on_shapes,
)
from stiffness.surface.interface import parse_interface
from stiffness.surface.patches import Patches, find_patches
from stiffness.surface.primitives import Plane
from stiffness.surface.surface import check_surface
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, box_solid

X, Z = np.array([1.0, 0, 0]), np.array([0.0, 0, 1])


def test_nodes_are_grouped_by_the_patches_of_their_faces():
    """Against a set for each node, filled face by face."""
    rng = np.random.default_rng(5)
    members = np.array([rng.choice(40, 3, replace=False) for _ in range(30)])
    patch = rng.integers(0, 4, len(members))
    sets = {}
    for face, number in zip(members, patch, strict=True):
        for node in face:
            sets.setdefault(int(node), set()).add(int(number))
    found = {
        int(node): set(key)
        for key, group in node_patches(40, members, patch)
        for node in group
    }
    assert found == sets
    keys = [key for key, _ in node_patches(40, members, patch)]
    assert len(keys) == len(set(keys))
    assert all(key == tuple(sorted(key)) for key in keys)


def test_points_within_reach_go_to_all_their_shapes_and_others_stay():
    """A point at a corner of two planes goes to their common line, of a patch without a
    shape nowhere."""
    points = np.array([
        [0.1, 0.2, 0.3],
        [0.1, 5.0, 3.0],
        [0.1, 0.2, 0.3],
        [0.3, 0, 0.4],
    ])
    shapes = (Plane(0 * X, X), Plane(0 * Z, Z), None)
    groups = [((0,), np.array([0, 1])), ((2,), np.array([2])), ((0, 1), np.array([3]))]
    moved = on_shapes(points, groups, shapes, 0.5 * (1 + 1e-9))
    expected = [[0.0, 0.2, 0.3], [0.0, 5.0, 3.0], points[2], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(moved, expected, atol=1e-14)
    moved = on_shapes(points, groups, shapes, 0.5 * (1 - 1e-9))
    np.testing.assert_allclose(moved[3], points[3])
    np.testing.assert_allclose(points[0], [0.1, 0.2, 0.3])


def test_a_face_of_one_tetrahedron_alone_is_on_the_boundary():
    """Counted one by one, in a box with some of its tetrahedra missing."""
    rng = np.random.default_rng(6)
    cells = box_solid((3, 3, 2), (1.0, 1.0, 1.0)).cells
    cells = cells[rng.random(len(cells)) < 0.7]
    count = Counter(frozenset(f) for cell in cells for f in combinations(cell, 3))
    faces = boundary_faces(cells)
    assert {frozenset(face) for face in faces} == {f for f, n in count.items() if n < 2}
    assert len(faces) == sum(n == 1 for n in count.values())


def thin(heights):
    """Tetrahedra side by side, of these heights on unit bases, patch 0."""
    points, cells = [], []
    for k, height in enumerate(heights):
        base = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, height]])
        points.append(base + [2 * k, 0, 0])
        cells.append(4 * k + np.arange(4))
    faces = np.array([cell[[0, 2, 1]] for cell in cells])
    return np.concatenate(points), np.array(cells), faces


@pytest.mark.parametrize(
    ("height", "share"),
    [
        (1.2, 1.0),  # a sixth of the volume is left
        (1.12, 1.0),  # a ninth
        (1.1, 0.5),  # a 11th would be
        (0.6, 0.5),  # a sixth is left of half the move
        (0.55, 0.25),
        (0.06, 0.5**5),
        (0.0006, 0.5**11),  # 0.0005 of the move is 0.8 of the height
    ],
)
def test_a_move_is_halved_until_a_tenth_of_the_volume_is_left(height, share):
    """Of the tetrahedra that it would fold alone: the other is as high as it may be."""
    lift = 0.01
    points, cells, faces = thin([height * lift, 1.0])
    plane = Plane(np.array([0, 0, lift]), Z)
    moved = moved_onto_shapes(Solid(points, cells, faces, np.zeros(2, int), (plane,)))
    base = moved.points[faces][..., 2]
    np.testing.assert_allclose(base[0], share * lift, rtol=1e-9)
    np.testing.assert_allclose(base[1], lift, rtol=1e-9)
    assert (moved.volumes() > 0).all()


SURFACE = check_surface(CUBE, CUBE_TRIANGLES, "cube")
ENDS = parse_interface("z=0"), parse_interface("z=0.1")


@pytest.mark.parametrize("stretch", [0.981, 0.984, 0.99, 1.01, 1.016, 1.019])
def test_a_corner_is_moved_by_a_hundredth_of_the_parts_size_at_most(stretch):
    """1.7 mm of a cube of 0.1 m: a mesh that is higher by more stays as it is."""
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1 * stretch))
    solid = fit_to_patches(
        made.points, made.cells, SURFACE, find_patches(SURFACE, *ENDS)
    )
    top = solid.points[solid.faces[solid.patch == 1]][..., 2]
    near = abs(stretch - 1) < 0.0173
    np.testing.assert_allclose(top, 0.1 if near else 0.1 * stretch, rtol=1e-12)


@pytest.mark.parametrize("stretch", [0.979, 1.021])
def test_a_mesh_of_another_volume_is_not_the_part(stretch):
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1 * stretch))
    with pytest.raises(MeshFailed, match="the mesh has 0.00.* the surface encloses"):
        fit_to_patches(made.points, made.cells, SURFACE, find_patches(SURFACE, *ENDS))


@pytest.mark.parametrize(("other", "missing"), [(1, "base"), (0, "tip"), (2, "base")])
def test_a_mesh_without_a_face_on_an_interface_is_refused(other, missing):
    made = box_solid((2, 2, 2), (0.1, 0.1, 0.1))
    far = Plane(50 * Z, Z)  # out of every corner's reach
    patches = Patches(np.full(len(CUBE_TRIANGLES), other), (far, far, far))
    with pytest.raises(BadInput, match=f"cube: no face of the mesh on the {missing}"):
        fit_to_patches(made.points, made.cells, SURFACE, patches)


def test_cells_of_either_orientation_and_points_of_no_cell_are_put_in_order():
    """The same solid as of cells that are all right, without the points; far from the
    origin."""
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
