"""Tetrahedra: refined, fitted to shapes, cached, refused when they are not the part."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from stiffness.fem.quality import element_quality
from stiffness.mesh import mesh as mesh_module
from stiffness.mesh.fit_to_patches import MeshFailed, fit_to_patches
from stiffness.mesh.mesh import mesh_solid
from stiffness.mesh.refine import refine
from stiffness.mesh.solid import boundary_faces
from stiffness.surface.decimate import coarser_surface, euler_characteristic
from stiffness.surface.interface import parse_interface
from stiffness.surface.patches import find_patches
from stiffness.surface.surface import check_surface, read_surface
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, bar, bar_solid, box_solid


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def kuhn_cube(n):
    """A cube of side 0.1 m, no mesher needed."""
    return box_solid((n, n, n), (0.1, 0.1, 0.1))


def test_boundary_faces_look_outward():
    cube = kuhn_cube(2)
    assert len(cube.faces) == 48
    a, b, c = np.moveaxis(cube.points[cube.faces], 1, 0)
    normal = np.cross(b - a, c - a) / 2
    center = cube.points[cube.faces].mean(axis=1)
    assert np.einsum("ij,ij->", normal, center) / 3 == pytest.approx(1e-3)


def test_refining_keeps_the_volume_the_boundary_and_the_fit(rng):
    """Every edge of the finer mesh is whole: its boundary is closed again."""
    cube = kuhn_cube(2)
    finer = refine(cube, rng.integers(0, 4, len(cube.cells)))
    solid = finer.solid
    assert len(solid.cells) > 2 * len(cube.cells)
    assert solid.volumes().min() > 0
    per_parent = np.bincount(finer.parent, solid.volumes())
    np.testing.assert_allclose(per_parent, cube.volumes(), rtol=1e-12)
    key = np.sort(boundary_faces(solid.cells), axis=1)
    kept = np.sort(solid.faces, axis=1)
    assert set(map(tuple, key)) == set(map(tuple, kept))
    assert element_quality(solid).min() > 0.3 * element_quality(cube).min()
    for number, height in ((0, 0.0), (1, 0.1)):
        on = solid.points[solid.faces[solid.patch == number]]
        np.testing.assert_allclose(on[..., 2], height, atol=1e-15)


def test_refining_halves_as_often_as_asked():
    cube = kuhn_cube(1)
    asked = np.array([3, 0, 0, 0, 0, 0])
    finer = refine(cube, asked)
    volumes = finer.solid.volumes()[finer.parent == 0]
    assert volumes.max() <= cube.volumes()[0] / 8 * (1 + 1e-12)


@pytest.mark.slow
def test_a_meshed_bar_has_exact_interfaces_and_a_round_side(tmp_path):
    """24 facets: the polygon lacks 1.1 % of area; the corners lie on the circle."""
    base, tip = parse_interface("z=0"), parse_interface("z=0.1")
    solid = mesh_solid(bar(facets=24), base, tip, edge=0.02, cache=tmp_path)
    assert solid.volumes().min() > 0
    for number, height in ((0, 0.0), (1, 0.1)):
        corners = solid.points[solid.faces[solid.patch == number]]
        np.testing.assert_allclose(corners[..., 2], height, atol=1e-12)
    side = solid.points[solid.faces[solid.patch == 2]]
    np.testing.assert_allclose(np.hypot(side[..., 0], side[..., 1]), 0.02, rtol=1e-9)
    # a second time it comes from the cache, so it is the same to the bit
    again = mesh_solid(bar(facets=24), base, tip, edge=0.02, cache=tmp_path)
    np.testing.assert_array_equal(again.points, solid.points)
    assert [p.suffix for p in tmp_path.iterdir()] == [".npz"]


def test_a_damaged_cache_file_is_made_anew(tmp_path, monkeypatch):
    def fake(surface, edge, envelope, time_limit):
        cube = kuhn_cube(2)
        return cube.points, cube.cells

    monkeypatch.setattr(mesh_module, "_tetrahedralize", fake)
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    mesh_solid(surface, *faces, cache=tmp_path)
    (kept,) = tmp_path.iterdir()
    whole = kept.read_bytes()
    for content in (b"", whole[: len(whole) // 2], b"rubbish"):
        kept.write_bytes(content)
        solid = mesh_solid(surface, *faces, cache=tmp_path)
        assert solid.volumes().sum() == pytest.approx(1e-3)
        assert len(kept.read_bytes()) == len(whole)


@pytest.mark.parametrize(
    ("points", "cells"),
    [
        ("flat", "whole"), ("whole", "flat"), ("not a number", "whole"),
        ("one too few", "whole"), ("whole", "none"),
    ],
)  # fmt: skip
def test_a_cached_mesh_that_cannot_be_one_is_made_anew(
    tmp_path, monkeypatch, points, cells
):
    """Arrays of another shape, numbers that are none, corners of no point."""
    cube, made = kuhn_cube(2), []

    def fake(*given):
        made.append(given)
        return cube.points, cube.cells

    wrong = {
        "flat": lambda array: array.ravel(),
        "whole": lambda array: array,
        "not a number": lambda array: np.where(array == array.max(), np.nan, array),
        "one too few": lambda array: array[: cube.cells.max()],
    }
    monkeypatch.setattr(mesh_module, "_tetrahedralize", fake)
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    mesh_solid(surface, *faces, cache=tmp_path)
    mesh_solid(surface, *faces, cache=tmp_path)
    assert len(made) == 1
    (kept,) = tmp_path.iterdir()
    arrays = {"points": wrong[points](cube.points)}
    if cells in wrong:
        arrays["cells"] = wrong[cells](cube.cells)
    np.savez(kept, **arrays)
    assert mesh_solid(surface, *faces, cache=tmp_path).volumes().min() > 0
    assert len(made) == 2


def test_every_edge_has_a_mesh_of_its_own_in_the_cache(tmp_path, monkeypatch):
    """Seventeen that differ by a thousandth: more than a hexadecimal digit can name."""
    cube = kuhn_cube(1)
    monkeypatch.setattr(
        mesh_module, "_tetrahedralize", lambda *_: (cube.points, cube.cells)
    )
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    for edge in 0.02 * (1 + 0.001 * np.arange(17)):
        mesh_solid(surface, *faces, edge=edge, cache=tmp_path)
    assert len(list(tmp_path.iterdir())) == 17


@pytest.mark.parametrize("words", ["first\nno inside", "no inside\n"])
def test_a_mesher_without_an_answer_is_reported_with_its_last_words(
    tmp_path, monkeypatch, words
):
    """A surface that it takes for no solid has no tetrahedra."""

    def mesher(command, **_):
        np.savez(command[4], points=CUBE, cells=np.zeros((0, 4), dtype=int))
        return subprocess.CompletedProcess(command, 0, b"", words.encode())

    monkeypatch.setattr(mesh_module.subprocess, "run", mesher)
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    with pytest.raises(MeshFailed, match=r"bar: the mesher gave nothing no inside$"):
        mesh_solid(bar(), *faces, cache=tmp_path)


def test_the_mesher_is_ended_when_its_time_is_up(tmp_path):
    """0.05 s is less than a Python process needs to start."""
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    with pytest.raises(MeshFailed, match=r"no mesh after 0.05 s"):
        mesh_solid(bar(), *faces, time_limit=0.05, cache=tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.skipif(
    not mesh_module._SAME_NUMBERS.exists(), reason="the C++ library is not GNU's"
)
def test_the_same_surface_gives_the_same_mesh(tmp_path):
    """Made twice, with caches of their own; and another where the edge is another."""
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    one, again, other = (
        mesh_solid(bar(), *faces, edge=edge, cache=tmp_path / str(number))
        for number, edge in enumerate((0.03, 0.03, 0.029))
    )
    assert np.array_equal(one.points, again.points)
    assert np.array_equal(one.cells, again.cells)
    assert not np.array_equal(one.cells, other.cells)


def test_a_mesh_that_is_not_the_part_is_refused(tmp_path, monkeypatch):
    cube = kuhn_cube(2)
    monkeypatch.setattr(
        mesh_module, "_tetrahedralize", lambda *_: (0.9 * cube.points, cube.cells)
    )
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    with pytest.raises(MeshFailed, match=r"the mesh has 0.000729 m\^3"):
        mesh_solid(surface, *faces, cache=tmp_path)


def test_a_mesh_with_a_breach_is_refused(tmp_path, monkeypatch):
    """One of 64 columns of the cube is missing: 1.6 % of the volume, and a way through.

    pytetwild left a breach like that in the wall of a 14 x 2 mm tube, 0.6 % of volume
    and 1 % of stiffness."""
    cube = kuhn_cube(8)
    place = np.floor(cube.points[cube.cells].mean(axis=1) / 0.0125)
    whole = ~((place[:, 0] == 3) & (place[:, 1] == 4))
    monkeypatch.setattr(
        mesh_module, "_tetrahedralize", lambda *_: (cube.points, cube.cells[whole])
    )
    surface = check_surface(CUBE, CUBE_TRIANGLES, "cube")
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    with pytest.raises(MeshFailed, match="characteristic 0, expected 2"):
        mesh_solid(surface, *faces, cache=tmp_path)


@pytest.mark.parametrize(
    ("name", "ways_through", "shells"),
    [("distal_plain", 0, 1), ("tube", 1, 1), ("delta_forearm", 0, 2)],
)
def test_eulers_characteristic_counts_shells_and_holes(name, ways_through, shells):
    """Two a shell, the forearm's cavity has one of its own, less two a hole."""
    surface = read_surface(Path(__file__).parents[3] / "meshes" / f"{name}.stl")
    characteristic = euler_characteristic(surface.triangles)
    assert characteristic == 2 * shells - 2 * ways_through


@pytest.mark.parametrize("name", ["distal_plain", "delta_forearm", "l_bracket"])
def test_the_mesher_gets_fewer_triangles_of_the_same_part(name):
    """Corners of the coarse surface near the part, as many holes, its volume to 1 %.

    The bracket has no triangle to spare and stays as it is."""
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
    # no corner is farther from the part than asked, by another road than the code's
    mesh = pv.PolyData.from_regular_faces(surface.points, surface.triangles)
    apart = pv.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"]
    assert np.abs(apart).max() < 4e-4


def test_a_surface_that_cannot_be_coarser_within_the_tolerance_is_kept():
    """A 32-gon of r = 20 mm: a corner less is 0.4 mm off, 0.1 mm are allowed."""
    surface = bar()
    points, triangles = coarser_surface(surface, 1e-4)
    assert triangles is surface.triangles
    assert points is surface.points


def test_a_mesher_that_dies_is_reported(tmp_path, monkeypatch):
    def dies(command, **_):
        return subprocess.CompletedProcess(command, 1, b"", b"first\nout of memory")

    monkeypatch.setattr(mesh_module.subprocess, "run", dies)
    faces = parse_interface("z=0"), parse_interface("z=0.1")
    with pytest.raises(MeshFailed, match="gave nothing out of memory"):
        mesh_solid(bar(), *faces, cache=tmp_path)


def test_faces_of_a_mesh_belong_to_the_patches_that_they_lie_on():
    """The ends' faces look along the bar, the side's across; its corners are on it."""
    surface, ends = bar(), (parse_interface("z=0"), parse_interface("z=0.1"))
    made = bar_solid(5, 4, 0.02, 0.1)
    solid = fit_to_patches(
        made.points * [0.98, 0.98, 1.0], made.cells[:, [0, 2, 1, 3]],
        surface, find_patches(surface, *ends),
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
