"""Tests of tetrahedral meshes and their cache."""

import io
import subprocess
from pathlib import Path

import numpy as np
import pytest

from forcefit.stiffness.mesh import mesh as mesh_module
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed, fit_to_patches
from forcefit.stiffness.mesh.mesh import mesh_solid
from forcefit.stiffness.surface.decimate import coarser_surface, euler_characteristic
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.surface import check_surface, read_surface
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, bar, bar_solid, box_solid

FACES = parse_interface("z=0"), parse_interface("z=0.1")


def kuhn_cube(n):
    """Return a mesh of a cube with a side of 0.1 m."""
    return box_solid((n, n, n), (0.1, 0.1, 0.1))


@pytest.mark.slow
def test_meshed_bar_has_flat_ends_and_corners_on_its_cylinder(tmp_path):
    """A second call returns the same mesh from the cache."""
    solid = mesh_solid(bar(facets=24), *FACES, edge=0.02, cache=tmp_path)
    assert solid.volumes().min() > 0
    for number, height in ((0, 0.0), (1, 0.1)):
        corners = solid.points[solid.faces[solid.patch == number]]
        np.testing.assert_allclose(corners[..., 2], height, atol=1e-12)
    side = solid.points[solid.faces[solid.patch == 2]]
    np.testing.assert_allclose(np.hypot(side[..., 0], side[..., 1]), 0.02, rtol=1e-9)
    # the mesh from the cache is bit-identical
    again = mesh_solid(bar(facets=24), *FACES, edge=0.02, cache=tmp_path)
    np.testing.assert_array_equal(again.points, solid.points)
    assert [p.suffix for p in tmp_path.iterdir()] == [".npz"]


def npz(**arrays):
    """Return the content of a file in the cache."""
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


MADE = kuhn_cube(2)
NO_NUMBER = np.where(MADE.points == MADE.points.max(), np.nan, MADE.points)
DAMAGED = {
    "empty": b"", "rubbish": b"rubbish",
    "cut": npz(points=MADE.points, cells=MADE.cells)[:900],
    "flat points": npz(points=MADE.points.ravel(), cells=MADE.cells),
    "flat cells": npz(points=MADE.points, cells=MADE.cells.ravel()),
    "not a number": npz(points=NO_NUMBER, cells=MADE.cells),
    "corners of no point": npz(points=MADE.points[:-1], cells=MADE.cells),
    "no cells": npz(points=MADE.points),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGED)
def test_damaged_mesh_in_the_cache_is_replaced(tmp_path, monkeypatch, damage):
    monkeypatch.setattr(
        mesh_module, "_tetrahedralize", lambda *_: (MADE.points, MADE.cells)
    )
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    mesh_solid(surface, *FACES, cache=tmp_path)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(DAMAGED[damage])
    solid = mesh_solid(surface, *FACES, cache=tmp_path)
    assert solid.volumes().sum() == pytest.approx(1e-3)
    assert len(kept.read_bytes()) == len(whole)


@pytest.mark.parametrize(
    ("status", "words", "told"),
    [(0, "first\nno inside", "no inside"), (0, "no inside\n", "no inside"),
     (1, "first\nout of memory", "out of memory")],
)  # fmt: skip
def test_failed_mesher_is_reported_with_its_last_output(
    tmp_path, monkeypatch, status, words, told
):
    """The mesher returns no mesh, or it crashes."""

    def mesher(command, **_):
        if status == 0:
            np.savez(command[4], points=CUBE, cells=np.zeros((0, 4), dtype=int))
        return subprocess.CompletedProcess(command, status, b"", words.encode())

    monkeypatch.setattr(mesh_module.subprocess, "run", mesher)
    with pytest.raises(
        MeshFailed, match=f"bar: the mesh generator ended without a mesh: {told}$"
    ):
        mesh_solid(bar(), *FACES, cache=tmp_path)


def test_mesher_is_stopped_at_its_time_limit(tmp_path):
    """The time limit is less than the start-up time of a Python process."""
    with pytest.raises(MeshFailed, match=r"not finished within 0.05 s"):
        mesh_solid(bar(), *FACES, time_limit=0.05, cache=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(
    not mesh_module._SAME_NUMBERS.exists(), reason="the C++ library is not GNU's"
)
def test_same_surface_has_the_same_mesh_in_every_cache(tmp_path):
    """A different edge length results in a different mesh."""
    one, again, other = (
        mesh_solid(bar(), *FACES, edge=edge, cache=tmp_path / str(number))
        for number, edge in enumerate((0.03, 0.03, 0.029))
    )
    assert np.array_equal(one.points, again.points)
    assert np.array_equal(one.cells, again.cells)
    assert not np.array_equal(one.cells, other.cells)


def test_mesh_with_a_missing_column_is_rejected(tmp_path, monkeypatch):
    """The missing column has 1.6 % of the volume of the cube."""
    cube = kuhn_cube(8)
    place = np.floor(cube.points[cube.cells].mean(axis=1) / 0.0125)
    whole = ~((place[:, 0] == 3) & (place[:, 1] == 4))
    monkeypatch.setattr(
        mesh_module, "_tetrahedralize", lambda *_: (cube.points, cube.cells[whole])
    )
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    with pytest.raises(MeshFailed, match="characteristic 0, expected 2"):
        mesh_solid(surface, *FACES, cache=tmp_path)


@pytest.mark.parametrize("name", ["distal_plain", "delta_forearm", "l_bracket"])
def test_coarser_surface_has_fewer_triangles_and_the_same_volume(name):
    """The numbers of holes are equal. All triangles of the bracket are necessary."""
    import pyvista as pv

    surface = read_surface(Path(__file__).parents[3] / "meshes" / f"{name}.stl")
    points, triangles = coarser_surface(surface, 4e-4)
    if name == "l_bracket":
        assert triangles is surface.triangles
        return
    assert len(triangles) < 0.6 * len(surface.triangles)
    coarse = check_surface(points, triangles, "coarse")
    assert coarse.repairs == ()
    assert coarse.volume == pytest.approx(surface.volume, rel=0.01)
    ways = euler_characteristic(surface.triangles)
    assert euler_characteristic(coarse.triangles) == ways
    # the distances of the corners are computed by VTK
    mesh = pv.PolyData.from_regular_faces(surface.points, surface.triangles)
    apart = pv.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"]
    assert np.abs(apart).max() < 4e-4


def test_boundary_faces_are_assigned_to_their_patches():
    """Normals at the ends are along the axis of the bar, and normals at the side are
    radial."""
    surface = bar()
    made = bar_solid(5, 4, 0.02, 0.1)
    solid = fit_to_patches(
        made.points * [0.98, 0.98, 1.0], made.cells[:, [0, 2, 1, 3]],
        surface, find_patches(surface, *FACES),
    )  # fmt: skip
    corners = solid.points[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = normals[:, 2] / np.linalg.norm(normals, axis=1)
    for patch, height, expected in ((0, 0.0, -1.0), (1, 0.1, 1.0)):
        there = solid.patch == patch
        assert np.abs(corners[there][..., 2] - height).max() < 1e-12
        assert along[there] == pytest.approx(expected)
    side = corners[solid.patch > 1]
    assert np.hypot(side[..., 0], side[..., 1]) == pytest.approx(0.02)
    assert np.abs(along[solid.patch > 1]).max() < 1e-9
    assert (solid.volumes() > 0).all()
