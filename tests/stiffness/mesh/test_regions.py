"""Tests of regions of different materials."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.stiffness.fem.adaptive_step import (
    estimated_error,
    middle_stiffness,
    solve_level,
)
from forcefit.stiffness.fem.material import Material, regions_of
from forcefit.stiffness.fem.part_text import parse_part
from forcefit.stiffness.link import scaled
from forcefit.stiffness.mesh.regions import (
    cut_by_regions,
    material_edges,
    region_of_cells,
)
from tests.solids_for_tests import box_solid, with_plane_sides

E = 2e11
SIZE = np.array([0.03, 0.03, 0.05])
CENTERS = np.array([[0.015, 0.015, 0.0], [0.015, 0.015, 0.05]])


def block():
    """Return a mesh of a block of 30 x 30 x 50 mm. No corners are on the faces of the
    layer."""
    return with_plane_sides(box_solid((3, 3, 4), SIZE))


def layer(contrast):
    return parse_part("--part", f"z=0.02..0.027/young={E / contrast},poisson=0")


@pytest.mark.parametrize(("region", "size"), [
    ("z=0.02..0.027", (0.03, 0.03, 0.007)),
    ("x=0.011..0.02,z=0.02..0.0271", (0.009, 0.03, 0.0071)),
    pytest.param("x=0.004..0.0227,y=0.009..0.0203,z=0.013..0.0371",
                 (0.0187, 0.0113, 0.0241), marks=pytest.mark.slow),
])  # fmt: skip
def test_tetrahedra_are_split_along_the_faces_of_a_box(region, size):
    """The volume of the region is exact, and elements elsewhere do not change."""
    regions = regions_of([
        Material(E, 0.3),
        parse_part("--part", f"{region}/young=1e9,poisson=0.3"),
    ])
    cut = cut_by_regions(block(), regions)
    volumes, inside = cut.volumes(), region_of_cells(cut, regions) == 1
    assert (volumes > 0).all()
    assert volumes.sum() == pytest.approx(np.prod(SIZE), rel=1e-9)
    assert volumes[inside].sum() == pytest.approx(np.prod(size), rel=1e-9)


def test_boundary_edges_between_materials_are_found():
    """The edges form two squares around the block at the faces of the layer."""
    regions = regions_of([Material(E, 0.3), layer(10)])
    cut = cut_by_regions(block(), regions)
    start, end = cut.points[material_edges(cut, regions)].swapaxes(0, 1)
    assert np.linalg.norm(end - start, axis=1).sum() == pytest.approx(2 * 4 * 0.03)
    assert set(np.round(start[:, 2], 12)) == {0.02, 0.027}


@pytest.mark.parametrize("contrast", [0.01, 10, 1e4])
def test_material_layers_have_the_stiffness_of_springs_in_series(contrast):
    """With zero Poisson's ratio, the compliance is the sum of L / E A of the layers."""
    materials = [Material(E, 0.0), layer(contrast)]
    solid = cut_by_regions(block(), regions_of(materials))
    K = solve_level(solid, materials, CENTERS, "rigid").solution.stiffness
    expected = 0.03**2 / (0.043 / E + 0.007 * contrast / E)
    assert K[5, 5] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("contrast", [0.1, 10, 100])
def test_estimated_error_covers_a_material_boundary_inside_elements(contrast):
    """The layer is given without faces, so elements are not split."""
    jagged = replace(layer(contrast), faces=())
    materials = [Material(E, 0.0), jagged]
    level = solve_level(block(), materials, CENTERS, "rigid")
    history = [level.totals()]
    K, error = middle_stiffness(
        history[0][0], estimated_error(history)[0], history[0][2]
    )
    expected = 0.03**2 / (0.043 / E + 0.007 * contrast / E)
    off = abs(K[5, 5] / expected - 1)
    told = float(np.abs(scaled(error, K))[5, 5])
    assert off > 0.005
    assert told > off
