"""Tests of the reader of surfaces."""

import numpy as np
import pytest
from scipy import constants

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.surface import (
    UNITS,
    check_surface,
    read_surface,
    signed_volume,
)
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, bar, cylinder
from tests.stiffness.surface.test_stl_file import binary_of


@pytest.mark.parametrize("kind", ["stl", "ply", "obj", "vtk", "vtp"])
def test_every_file_format_has_the_same_surface(tmp_path, kind):
    """STL and PLY files have single precision."""
    pyvista = pytest.importorskip("pyvista")
    points, triangles = cylinder()
    path = tmp_path / f"bar.{kind}"
    pyvista.PolyData.from_regular_faces(points, triangles).save(path)
    surface = read_surface(path)
    assert surface.volume == pytest.approx(bar().volume, rel=1e-6)
    assert surface.repairs == ()
    assert len(surface.triangles) == len(triangles)


def test_surface_unit_scales_the_part_and_a_wrong_unit_is_rejected(tmp_path):
    points, triangles = cylinder()
    path = tmp_path / "bar.stl"
    path.write_bytes(binary_of(1000 * points[triangles]))
    assert read_surface(path, "mm").volume == pytest.approx(bar().volume, rel=1e-6)
    with pytest.raises(BadInput, match='is the unit of the file "mm"'):
        read_surface(path, "m")
    with pytest.raises(BadInput, match="unit: found 'mmm'; did you mean \"mm\""):
        read_surface(path, "mmm")


@pytest.mark.parametrize(("name", "content", "message"), [
    ("a.stl", b"", "the file is empty"),
    ("a.stl", b"no stl at all", "STL"),
    ("a.obj", b"no obj at all", "OBJ"),
    ("a.ply", b"ply\nrubbish", "PLY"),
    ("a.vtk", b"rubbish", "VTK"),
    ("a.xyz", b"1 2 3", "unknown kind of surface file"),
    ("absent/a.stl", None, "cannot be read"),
])  # fmt: skip
def test_wrong_surface_file_is_rejected(tmp_path, name, content, message):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput, match=message):
        read_surface(path)


def test_cavity_is_subtracted_from_the_volume_of_a_body():
    both = np.concatenate([CUBE_TRIANGLES, CUBE_TRIANGLES + 8])
    hollow = np.concatenate([CUBE, 0.5 * CUBE + 0.025])
    surface = check_surface(hollow, both, "cube")
    assert surface.volume == pytest.approx(1e-3 * (1 - 1 / 8))
    assert "cavity was inside out" in surface.repairs[0]


def test_nearly_equal_vertices_are_merged_and_reported(rng):
    """Every triangle has its own vertices, which are displaced by about 1e-10 m."""
    loose = CUBE[CUBE_TRIANGLES].reshape(-1, 3) + 1e-10 * rng.normal(size=(36, 3))
    surface = check_surface(loose, np.arange(36).reshape(-1, 3), "cube")
    assert len(surface.points) == 8
    assert "nearly equal vertices merged" in surface.repairs[0]


def test_units_of_length_equal_those_of_scipy():
    expected = {"m": 1.0, "dm": constants.deci, "cm": constants.centi,
                "mm": constants.milli, "um": constants.micro, "in": constants.inch,
                "inch": constants.inch, "ft": constants.foot}  # fmt: skip
    assert pytest.approx(expected, rel=1e-15) == UNITS


def test_signed_volume_does_not_change_far_from_the_origin():
    """The distance from the origin is 40 km, and the volume is 1 litre."""
    far = CUBE + np.array([1e4, -2e4, 3e4])
    for points, tolerance in ((CUBE, 1e-12), (far, 1e-8)):
        volume = signed_volume(points, CUBE_TRIANGLES)
        assert volume == pytest.approx(1e-3, rel=tolerance)
        inside_out = signed_volume(points, CUBE_TRIANGLES[:, ::-1])
        assert inside_out == pytest.approx(-volume, rel=tolerance)
