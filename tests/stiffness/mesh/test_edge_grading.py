"""Tests of layers along singular edges."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forcefit.stiffness.fem.elements import integration, isoparametric, triangle_areas
from forcefit.stiffness.mesh.edge_grading import (
    layered,
    singular_edges,
    split_joining_edges,
)
from forcefit.stiffness.mesh.lagrange import FACES
from forcefit.stiffness.mesh.refine import edges_of
from tests.solids_for_tests import masked_solid, with_plane_sides

SIZE = np.array([0.2, 0.2, 0.3])
CLAMPED = [(0, 1), (0,), ()]  # clamped patches: both ends, the base, none


def corner_post(counts=(2, 2, 3)):
    """Return an L-shaped bar with one re-entrant edge at x = y = 0.1."""
    return with_plane_sides(
        masked_solid(counts, SIZE, lambda c: (c[:, :2] < 0.1).any(axis=1))
    )


def on_outline(x):
    """Return whether points are on the outline of the L."""
    near = np.abs(x[..., :2] - 0.1) < 1e-9
    inner = near & (x[..., 1::-1] > 0.1 - 1e-9)
    outer = (np.abs(x[..., :2]) < 1e-9) | (np.abs(x[..., :2] - 0.2) < 1e-9)
    return (inner | outer).any(axis=-1)


@pytest.mark.parametrize("held", CLAMPED)
def test_singular_edges_of_an_l_shape_are_found(held):
    """There are eight edges around each clamped end, and three along the re-entrant
    edge."""
    solid = corner_post()
    edges = {tuple(edge) for edge in singular_edges(solid, held)}
    ends, _ = edges_of(solid.cells, len(solid.points))
    middle = solid.points[ends].mean(axis=1)
    heights = [(0.0, 0.3)[k] for k in held]
    clamped = on_outline(middle) & np.isin(np.round(middle[:, 2], 9), heights)
    inner = (np.abs(middle[:, :2] - 0.1) < 1e-9).all(axis=1)
    assert (clamped.sum(), inner.sum()) == (8 * len(heights), 3)
    assert edges == {tuple(edge) for edge in ends[clamped | inner]}


def check_layers(solid, held):
    """Check that parts are conforming and have the volume of their tetrahedra."""
    parts = layered(solid, held)
    mesh = isoparametric(solid, 2, parts)
    faces, count = np.unique(
        mesh.cells[:, :4][:, FACES].reshape(-1, 3), axis=0, return_counts=True
    )
    assert count.max() <= 2
    outer = {tuple(face) for face in faces[count == 1]}
    assert outer == {tuple(face) for face in mesh.faces[:, :3]}
    assert len(mesh.faces) == len(outer)
    whole = isoparametric(solid, 2)
    for patch in np.unique(solid.patch):
        area = [
            triangle_areas(m, m.faces[m.patch == patch])[1].sum() for m in (whole, mesh)
        ]
        assert area[1] == pytest.approx(area[0], rel=1e-12)
        places = mesh.nodes[mesh.faces[mesh.patch == patch]].reshape(-1, 3)
        assert np.abs(solid.shapes[patch].signed(places)[0]).max() < 1e-12
    # the volume of a tetrahedron is the sum of the volumes of its parts
    volume = np.zeros(len(solid.cells))
    for chunk in integration(mesh):
        np.add.at(volume, parts.parent[chunk.part], chunk.w.sum(axis=1))
    np.testing.assert_allclose(volume, solid.volumes(), rtol=1e-11)
    return mesh, parts


@settings(max_examples=25, deadline=None)
@given(
    kept=st.lists(st.booleans(), min_size=12, max_size=12).filter(any),
    held=st.sampled_from(CLAMPED),
)
def test_layers_in_any_union_of_boxes_are_conforming(kept, held):
    """The volume is preserved. Boxes may touch in an edge or a corner."""
    counts = np.array([3, 2, 2])

    def keep(centers):
        i, j, k = np.floor(centers / SIZE * counts).astype(int).T
        return np.array(kept)[4 * i + 2 * j + k]

    solid = split_joining_edges(
        with_plane_sides(masked_solid(counts, SIZE, keep)), held
    )
    share = sum(kept) / len(kept)
    assert solid.volumes().sum() == pytest.approx(share * SIZE.prod(), rel=1e-12)
    check_layers(solid, held)
