"""Tests of the refinement by bisection."""

import numpy as np
import pytest

from forcefit.stiffness.fem.quality import element_quality
from forcefit.stiffness.mesh.refine import refine
from forcefit.stiffness.mesh.solid import Solid, boundary_faces
from tests.solids_for_tests import bar_solid, box_solid


def crooked(rng):
    """Return a mesh of a box with random shifts of all corners."""
    solid = box_solid((2, 2, 2), (1.0, 1.0, 1.0))
    points = solid.points + 0.05 * rng.uniform(-1, 1, solid.points.shape)
    return Solid(points, solid.cells, solid.faces, solid.patch, (None,) * 3)


@pytest.mark.parametrize("solid", [crooked(np.random.default_rng(1)),
                                   bar_solid(2, 4, 0.02, 0.1)])  # fmt: skip
def test_refined_boundary_faces_stay_on_their_patch(solid):
    """On patches of unknown shape, the sum of area vectors does not change."""
    asked = np.random.default_rng(2).integers(1, 4, len(solid.cells))
    finer = refine(solid, asked).solid
    assert finer.volumes().min() > 0
    assert element_quality(finer).min() > 0.3 * element_quality(solid).min()
    faces = {tuple(np.roll(f, -int(np.argmin(f)))) for f in finer.faces}
    expected = boundary_faces(finer.cells)
    assert faces == {tuple(np.roll(f, -int(np.argmin(f)))) for f in expected}

    def total(solid, patch):
        a, b, c = np.moveaxis(solid.points[solid.faces[solid.patch == patch]], 1, 0)
        return np.cross(b - a, c - a).sum(axis=0) / 2

    for patch in (0, 1, 2):
        before, after = total(solid, patch), total(finer, patch)
        if solid.shapes[2] is None:
            np.testing.assert_allclose(after, before, atol=1e-12)
        elif patch < 2:
            assert after @ before > (1 - 1e-9) * before @ before
        else:
            side = finer.points[finer.faces[finer.patch == 2]][..., :2]
            np.testing.assert_allclose(np.linalg.norm(side, axis=2), 0.02, rtol=1e-9)
    assert sum(total(finer, patch) for patch in (0, 1, 2)) == pytest.approx(
        0, abs=1e-12
    )


@pytest.mark.parametrize("halvings", [0, 1, 2, 4])
def test_tetrahedra_are_bisected_as_often_as_requested(rng, halvings):
    """Other tetrahedra are bisected only for a conforming mesh."""
    solid = crooked(rng)
    asked = np.zeros(len(solid.cells), dtype=int)
    asked[7] = halvings
    finer = refine(solid, asked)
    volumes = finer.solid.volumes()
    own = volumes[finer.parent == 7] / solid.volumes()[7]
    assert own.sum() == pytest.approx(1)
    assert own.max() <= 0.5**halvings * (1 + 1e-9)
    steps = -np.log2(volumes / solid.volumes()[finer.parent])
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    if halvings == 0:
        assert finer.solid.cells is solid.cells
        assert len(finer.parent) == len(solid.cells)
    assert asked[7] == halvings
