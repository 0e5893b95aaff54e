"""Test of the reduction of triangles."""

import numpy as np
import pytest

from forcefit.stiffness.surface.decimate import coarser_surface
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import box_solid


def fine_cube(unit, bump=0.0):
    """Return a cube with 10 x 10 squares on each side, and a bump on one of them."""
    solid = box_solid((10, 10, 10), (0.1, 0.1, 0.1))
    used, triangles = np.unique(solid.faces, return_inverse=True)
    points = solid.points[used]
    points[np.linalg.norm(points - [0.05, 0.05, 0.1], axis=1) < 1e-9, 2] += bump
    return check_surface(unit * points, triangles.reshape(-1, 3), "cube")


@pytest.mark.parametrize("unit", [0.02, 100.0])
def test_decimation_preserves_a_bump_above_the_tolerance(unit):
    """The height of the bump is 0.8 mm, and the tolerance is 0.1 mm."""
    surface = fine_cube(unit, 8e-4)
    points, triangles = coarser_surface(surface, 1e-4 * unit)
    assert len(triangles) < len(surface.triangles)
    tip = unit * np.array([0.05, 0.05, 0.1008])
    assert np.linalg.norm(points - tip, axis=1).min() < 3e-4 * unit
    assert points[:, 2].max() == pytest.approx(0.1008 * unit, abs=1e-4 * unit)
