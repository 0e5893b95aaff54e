"""Cache for the finite-element solutions of mesh links."""

import os
import subprocess
import sys
import time
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from forcefit.assembly.files import solved_links, stored_solutions
from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.model.robot import Frame, MeshLink
from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.beam_surfaces import shape_surface

BAR = {"length": 0.08, "width": 0.02, "height": 0.02}
# prints the number of finite-element solutions and a hash of the compliances
PROCESS = """
import hashlib, sys
from forcefit.assembly.files import solved_links
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.model.links import link_compliances
runs, usual = [], solved_links._solve
solved_links._solve = lambda *given: (runs.append(1), usual(*given))[1]
C = link_compliances(load_robot(sys.argv[1]))
print(len(runs), hashlib.sha256(C.tobytes()).hexdigest())
"""
ROBOT = """
name = "one"
platform = "tool"
[[frame]]
name = "tool"
parent = "base"
translation = [0.08, 0, 0]
link = { mesh = { surface = "bar.stl", base = "z=0", tip = "z=0.08" }, \
young = 6e10, poisson = 0.3, density = 2700 }
"""


@pytest.fixture(scope="module")
def surface(tmp_path_factory):
    """Return the surface file of a square bar of 20 x 20 x 80 mm."""
    pyvista = pytest.importorskip("pyvista")
    bar = shape_surface("rectangle", BAR)
    path = tmp_path_factory.mktemp("surface") / "bar.stl"
    pyvista.PolyData.from_regular_faces(bar.points, bar.triangles).save(path)
    return path


@pytest.fixture(scope="module")
def solved_once(surface, tmp_path_factory):
    """Return a cache folder with one solution, and this solution."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FORCEFIT_CACHE", str(folder))
        patch.setattr(solved_links, "_SOLVED", {})
        solved = solved_link(frame(surface))
    return folder, solved.solution


@pytest.fixture
def cache(solved_once, tmp_path, monkeypatch):
    """Return a copy of the cache folder, without solutions in memory."""
    folder = tmp_path / "cache"
    folder.mkdir()
    for file in solved_once[0].iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    monkeypatch.setenv("FORCEFIT_CACHE", str(folder))
    monkeypatch.setattr(solved_links, "_SOLVED", {})
    return folder


@pytest.fixture
def runs(solved_once, monkeypatch):
    """Return a list of finite-element calls, which return the known solution."""
    runs = []

    def solve(frame, link, digest, options):
        runs.append((link, options))
        return replace(solved_once[1], young=link.young, digest=digest)

    monkeypatch.setattr(solved_links, "_solve", solve)
    return runs


def frame(surface, **changes):
    link = MeshLink(surface, "z=0", "z=0.08", 6e10, 0.3, 2700.0)
    place = {"translation": np.array([0.08, 0.0, 0.0])}
    return Frame("tool", "base", **place, link=replace(link, **changes))


def stored_file(folder):
    (file,) = folder.glob("link-*.npz")
    return file


def assert_same(one, other):
    """Check that two solutions are bit-identical and have the same types."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other, strict=True)
        # the order of summation depends on strides
        assert one.size == 0 or one.strides == other.strides
    elif is_dataclass(one):
        for field in fields(one):
            if field.name != "_mesh":
                assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, list | tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_same(*pair)
    else:
        assert one == other


def test_cached_solution_is_bit_identical(surface, solved_once, cache, runs):
    again = solved_link(frame(surface))
    assert not runs
    assert again.solution is not solved_once[1]
    assert_same(again.solution, solved_once[1])


def test_moved_or_rotated_mesh_is_not_solved_again(surface, cache, tmp_path, runs):
    """The solution is stored in mesh axes."""
    copy = tmp_path / "other.STL"
    copy.write_bytes(surface.read_bytes())
    turned = {"up": (1.0, 0.0, 0.0), "frame_up": (0.0, 0.0, 1.0)}
    solved_link(frame(copy, **turned))
    solved_link(frame(surface, axis=(0.0, 0.0, 1.0)))
    assert not runs


CHANGES = {
    "young": {"young": 7e10},
    "poisson": {"poisson": 0.31},
    "density": {"density": 2800.0},
    "no density": {"density": None},
    "interface": {"interface": "distributing"},
    "base": {"base": {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}},
    "unit": {"unit": "mm"},
    "parts": {"parts": ("z=0..0.04/young=2e11,poisson=0.3",)},
}


@pytest.mark.parametrize("change", CHANGES)
def test_changed_link_is_solved_again(surface, cache, runs, change):
    solved_link(frame(surface, **CHANGES[change]))
    assert len(runs) == 1
    assert len(list(cache.glob("link-*.npz"))) == 2


def test_link_is_solved_again_for_changed_surface_or_program(
    surface, cache, tmp_path, runs, monkeypatch
):
    other = tmp_path / "bar.stl"
    # the header of a binary STL file does not contain triangles
    other.write_bytes(b"another header".ljust(80) + surface.read_bytes()[80:])
    solved_link(frame(other))
    assert len(runs) == 1
    solved_link(frame(surface), accuracy=0.004)
    assert len(runs) == 2
    solved_link(frame(surface))
    assert len(runs) == 2
    monkeypatch.setattr(solved_links, "_SOLVED", {})
    monkeypatch.setattr(stored_solutions, "_program", lambda: "another")
    solved_link(frame(surface))
    assert len(runs) == 3


def damaged(content):
    middle = len(content) // 2
    return {
        "cut short": content[:middle],
        "empty": b"",
        "a flipped bit": content[:middle] + bytes([content[middle] ^ 1])
        + content[middle + 1 :],
        "text": b"not an archive",
        "a matrix": b"\x93NUMPY\x01\x00",
    }  # fmt: skip


@pytest.mark.parametrize("damage", damaged(b" "))
def test_damaged_cached_solution_is_replaced(surface, solved_once, cache, runs, damage):
    file = stored_file(cache)
    whole = file.read_bytes()
    file.write_bytes(damaged(whole)[damage])
    again = solved_link(frame(surface))
    assert len(runs) == 1
    assert_same(again.solution, solved_once[1])
    solved_links._SOLVED.clear()
    solved_link(frame(surface))
    assert len(runs) == 1  # the damaged file was replaced
    assert [f.name for f in cache.iterdir() if f.name.startswith("link-")] == [
        file.name
    ]


def test_cached_solution_of_another_link_is_not_used(surface, cache, runs):
    file = stored_file(cache)
    solved_link(frame(surface, young=7e10))
    (other,) = set(cache.glob("link-*.npz")) - {file}
    other.replace(file)
    solved_links._SOLVED.clear()
    assert solved_link(frame(surface)).solution.young == 6e10
    assert len(runs) == 2


def test_solution_does_not_depend_on_unwritable_cache_folder(
    surface, solved_once, cache, runs, monkeypatch
):
    def refuse(*given, **named):
        raise OSError(28, "no space left")

    monkeypatch.setenv("FORCEFIT_CACHE", str(cache / "full"))
    monkeypatch.setattr(stored_solutions, "locked_file", refuse)
    monkeypatch.setattr(stored_solutions, "whole_file", refuse)
    assert_same(solved_link(frame(surface)).solution, solved_once[1])
    solved_links._SOLVED.clear()
    monkeypatch.setattr(stored_solutions, "cache_folder", lambda: None)
    assert_same(solved_link(frame(surface)).solution, solved_once[1])
    assert len(runs) == 2


def test_unused_cached_solutions_are_deleted(surface, cache, runs):
    file = stored_file(cache)
    months_ago = time.time() - 100 * 86_400
    mesh = cache / "mesh-of-old.npz"
    for old in (cache / "link-of-old.npz", file, mesh):
        old.touch()
        os.utime(old, (months_ago, months_ago))
    solved_link(frame(surface))  # reading the file changes its time of use
    assert not runs
    assert time.time() - file.stat().st_mtime < 86_400
    solved_link(frame(surface, young=7e10))
    kept = {path.name for path in cache.glob("link-*")}
    assert file.name in kept
    assert len(kept) == 2
    assert mesh.exists()


def test_invalid_links_are_not_cached(surface, cache):
    before = {file.name for file in cache.iterdir()}
    for _ in range(2):
        with pytest.raises(BadInput, match="no face"):
            solved_link(frame(surface, tip="z=0.09"))
    assert {file.name for file in cache.iterdir()} == before


def run_processes(folder, cache, count):
    """Load a robot in several processes.

    Return the number of finite-element solutions in each process, and the hashes of the
    compliances.
    """
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PROCESS, str(folder / "one.toml")],
            stdout=subprocess.PIPE, text=True,
        )
        for _ in range(count)
    ]  # fmt: skip
    said = [process.communicate(timeout=120)[0].split() for process in started]
    return [int(words[0]) for words in said], {words[1] for words in said}


@pytest.mark.slow
def test_concurrent_processes_solve_a_link_once(surface, tmp_path, monkeypatch):
    (tmp_path / "one.toml").write_text(ROBOT)
    (tmp_path / "bar.stl").write_bytes(surface.read_bytes())
    monkeypatch.setenv("FORCEFIT_CACHE", str(tmp_path / "cache"))
    runs, digests = run_processes(tmp_path, tmp_path / "cache", 2)
    assert sum(runs) == 1
    later, again = run_processes(tmp_path, tmp_path / "cache", 1)
    assert later == [0]
    assert again == digests
    assert len(digests) == 1
    names = [file.name for file in (tmp_path / "cache").iterdir()]
    assert not [name for name in names if not name.endswith(".npz")]
