"""Tests of the quality measures of meshes."""

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import isoparametric
from forcefit.stiffness.fem.quality import dihedral_angles, element_quality, mesh_report
from forcefit.stiffness.mesh.solid import Solid
from tests.solids_for_tests import bar_solid, box_solid

REGULAR = np.array([[1.0, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]])
CORNER = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def one(points):
    faces = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    cells = np.array([[0, 1, 2, 3]])
    return Solid(points, cells, faces, np.zeros(4, dtype=int), (None,))


def test_angles_and_quality_of_known_tetrahedra_equal_hand_calculation():
    """In a regular tetrahedron, all angles are arccos(1/3). At the corner of a cube,
    three angles are 90 degrees, and three are arccos(1/sqrt(3)).
    """
    np.testing.assert_allclose(dihedral_angles(one(REGULAR)), np.arccos(1 / 3))
    assert element_quality(one(REGULAR))[0] == pytest.approx(1.0)
    expected = [np.pi / 2] * 3 + [np.arccos(1 / np.sqrt(3))] * 3
    np.testing.assert_allclose(dihedral_angles(one(CORNER))[0], expected)
    quality = element_quality(one(CORNER))[0]
    assert quality == pytest.approx(6 * np.sqrt(2) / 6 / 1.5**1.5)


def test_mesh_report_has_the_exact_volume_and_area_of_a_box_and_a_bar():
    """The values of a box are exact. The relative error of a bar is 1e-7."""
    box = box_solid((2, 3, 4), (0.1, 0.2, 0.3))
    report = mesh_report(box, isoparametric(box))
    assert report["elements"] == len(box.cells)
    assert report["volume"] == pytest.approx(6e-3, rel=1e-12)
    assert report["area"] == pytest.approx(0.22, rel=1e-12)
    assert report["closed"]
    assert 0 < report["smallest_angle"] < np.pi / 3 < report["largest_angle"]
    opened = Solid(box.points, box.cells, box.faces[1:], box.patch[1:], box.shapes)
    assert not mesh_report(opened, isoparametric(opened))["closed"]
    bar = bar_solid(3, 8, 0.04, 0.2)
    area = 2 * np.pi * 0.04 * (0.2 + 0.04)
    assert mesh_report(bar, isoparametric(bar))["area"] == pytest.approx(area, rel=1e-6)
