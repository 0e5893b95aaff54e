"""Surfaces to tetrahedra, with exact interfaces and curved faces kept curved.

Pytetwild makes the tetrahedra, in a separate process with a time limit, from a surface
with fewer triangles (:mod:`stiffness.surface.decimate`).  The mesh's boundary follows
the surface to within an envelope only, so every boundary triangle is then assigned to a
patch of the surface, and the nodes are projected onto the patches' exact shapes.
Meshes are kept in a cache by the content they were made from: pytetwild is slow, and
never makes the same mesh twice.
"""

import hashlib
import io
import subprocess
import sys
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.cache_folder import cache_folder
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import whole_file
from forcefit.native.libraries import load_library
from stiffness.surface.decimate import coarser_surface, euler_characteristic
from stiffness.surface.interface import Interface, parse_interface
from stiffness.surface.patches import Patches, find_patches
from stiffness.surface.primitives import Shape, project
from stiffness.surface.surface import Surface, read_surface

__all__ = ["Interface", "Solid", "mesh_solid", "parse_interface", "read_surface"]

FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])  # outward
_WORKER = Path(__file__).with_name("mesh_worker.py")
_SAME_NUMBERS = "stiffness/mesh/same_random_numbers.cpp"  # makes meshes reproducible
_FORMAT = 3  # of the cached meshes; raised when what they hold changes


class MeshFailed(BadInput):
    """The mesher gave nothing usable for a surface that is in order."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A link as tetrahedra with straight edges, and what its boundary stands for.

    Attributes:
        points: (n, 3) [m] corners, on the exact shapes where those are known.
        cells: (t, 4) corners of tetrahedra, of positive volume.
        faces: (f, 3) corners of boundary triangles, outward.
        patch: (f,) number of each face's patch; 0 is the base interface, 1 the tip.
        shapes: of the patches; None leaves a patch's nodes where they are.
    """

    points: NDArray
    cells: NDArray
    faces: NDArray
    patch: NDArray
    shapes: tuple[Shape | None, ...]

    __repr__, _repr_html_ = short_repr, html_table

    def volumes(self) -> NDArray:
        """(t,) [m^3] of the straight tetrahedra."""
        a, b, c, d = np.moveaxis(self.points[self.cells], 1, 0)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6


def mesh_solid(
    surface: Surface,
    base: Interface,
    tip: Interface,
    *,
    edge: float | None = None,
    envelope: float = 5e-4,
    time_limit: float = 300.0,
    cache: Path | str | None = None,
) -> Solid:
    """Tetrahedra of a surface, from the cache if they were made before.

    Args:
        surface: of the link.
        base: the held interface.
        tip: the loaded interface.
        edge: [m] wanted length of edges; a 20th of the diagonal if absent.
        envelope: [1] share of the diagonal by which the mesher may leave a surface
            that has fewer triangles than this one and leaves it by as much.
        time_limit: [s] for the mesher.
        cache: folder; that of :func:`forcefit.inputs.cache_folder.cache_folder` if
            absent.

    Returns:
        The solid.

    Raises:
        BadInput: an interface has no part of the surface.
        MeshFailed: the mesher ran out of time or gave nothing.
    """
    patches = find_patches(surface, base, tip)
    edge = surface.diagonal / 20 if edge is None else edge
    key = f"{_FORMAT} {surface.digest()} {edge / surface.diagonal:.4e} {envelope:.4e}"
    name = hashlib.sha256(key.encode()).hexdigest()[:32]
    folder = cache_folder() if cache is None else Path(cache)
    path = None if folder is None else folder / f"mesh-{name}.npz"
    mesh = None if path is None else _from_cache(path)
    if mesh is None:
        mesh = _tetrahedralize(surface, edge, envelope, time_limit)
        if path is not None:
            _to_cache(path, *mesh)
    return fit_to_patches(*mesh, surface, patches)


def _from_cache(path: Path) -> tuple[NDArray, NDArray] | None:
    """Points and cells of a cached mesh; None if absent or damaged."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            points, cells = stored["points"], stored["cells"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    proper = points.ndim == 2 and cells.ndim == 2 and np.isfinite(points).all()
    return (points, cells) if proper and (cells < len(points)).all() else None


def _to_cache(path: Path, points: NDArray, cells: NDArray) -> None:
    """Write a mesh whole or not at all; a full or read-only disk is no error."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part, part.open("wb") as file:
            np.savez_compressed(file, points=points, cells=cells)
    except (OSError, BadInput):
        return


def _tetrahedralize(
    surface: Surface, edge: float, envelope: float, time_limit: float
) -> tuple[NDArray, NDArray]:
    """Run the mesher in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="forcefit-") as folder:
        given, made = Path(folder, "surface.npz"), Path(folder, "mesh.npz")
        points, triangles = coarser_surface(surface, envelope * surface.diagonal)
        np.savez(given, points=points, triangles=triangles, settings=[edge, envelope])
        # -P: our modules' names are not to be taken for others'
        command = [sys.executable, "-P", str(_WORKER), str(given), str(made)]
        if (library := load_library(_SAME_NUMBERS)) is not None:
            command.append(library._name)
        try:
            # the mesher leaves a file in the folder it runs in
            run = subprocess.run(
                command,
                timeout=time_limit,
                capture_output=True,
                check=False,
                cwd=folder,
            )
        except subprocess.TimeoutExpired:
            raise MeshFailed(
                f"{surface.name}: no mesh after {time_limit:g} s; the surface may be "
                "finer than the part needs, or the time limit too short"
            ) from None
        mesh = _from_cache(made)
    if mesh is None or len(mesh[1]) == 0:
        last = run.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise MeshFailed(f"{surface.name}: the mesher gave nothing {' '.join(last)}")
    return mesh


def fit_to_patches(
    points: NDArray, cells: NDArray, surface: Surface, patches: Patches
) -> Solid:
    """Assign boundary triangles to patches; project corners onto the exact shapes.

    Args:
        points: (n, 3) [m].
        cells: (t, 4) tetrahedra of either orientation.
        surface: what they were made from.
        patches: its patches and shapes.

    Returns:
        The solid; moves of corners that would invert a tetrahedron are shortened.

    Raises:
        MeshFailed: the mesh is not the part: its volume is off by more than 2 %, it has
            other holes, or an interface has no face.
    """
    points, cells = _positive_cells(points, cells)
    faces = boundary_faces(cells)
    patch = _nearest_patch(points, faces, surface, patches)
    solid = Solid(points, cells, faces, patch, patches.shapes)
    solid = moved_onto_shapes(solid)
    volume = float(solid.volumes().sum())
    if abs(volume / surface.volume - 1) > 0.02:
        raise MeshFailed(
            f"{surface.name}: the mesh has {volume:.6g} m^3, the surface encloses "
            f"{surface.volume:.6g}"
        )
    # a hole in a thin wall changes the volume little and the stiffness much
    holes, expected = (euler_characteristic(f) for f in (faces, surface.triangles))
    if holes != expected:
        raise MeshFailed(
            f"{surface.name}: the mesh has other holes than the surface: Euler "
            f"characteristic {holes}, expected {expected}"
        )
    for number, name in enumerate(("base", "tip")):
        if not (patch == number).any():
            raise MeshFailed(f"{surface.name}: no face of the mesh on the {name}")
    return solid


def _positive_cells(points: NDArray, cells: NDArray) -> tuple[NDArray, NDArray]:
    """Points that are used, and cells turned to positive volume."""
    used, cells = np.unique(cells, return_inverse=True)
    points, cells = points[used], cells.reshape(-1, 4)
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    turned = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return points, cells


def boundary_faces(cells: NDArray) -> NDArray:
    """Faces that belong to one tetrahedron only.

    Args:
        cells: (t, 4) of positive volume.

    Returns:
        (f, 3) outward.
    """
    faces = cells[:, FACES].reshape(-1, 3)
    key = np.sort(faces, axis=1)
    order = np.lexsort(key.T)
    same = (key[order][1:] == key[order][:-1]).all(axis=1)
    alone = np.ones(len(faces), dtype=bool)
    alone[order[1:][same]] = alone[order[:-1][same]] = False
    return faces[alone]


def _nearest_patch(
    points: NDArray, faces: NDArray, surface: Surface, patches: Patches
) -> NDArray:
    """Patch of each boundary face: the nearest one of about the same normal."""
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    outward = surface.normals()
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-300)[:, None]
    center = corners.mean(axis=1)
    size = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    best, patch = np.full(len(faces), np.inf), np.zeros(len(faces), dtype=int)
    for weight in (0.0, 0.4, 0.8):
        for k in range(3 if weight else 1):
            sample = center + weight * (corners[:, k] - center)
            cell, near = mesh.find_closest_cell(sample, return_closest_point=True)
            apart = np.linalg.norm(near - sample, axis=1) / size
            bend = 1 - np.einsum("ij,ij->i", normals, outward[cell])
            score = bend + apart + 0.05 * weight
            better = score < best
            best[better], patch[better] = score[better], patches.patch[cell[better]]
    return patch


def node_patches(
    nodes: int, members: NDArray, patch: NDArray
) -> list[tuple[tuple[int, ...], NDArray]]:
    """Nodes grouped by the set of patches they lie on.

    Args:
        nodes: how many there are.
        members: (f, k) nodes of each boundary face.
        patch: (f,) the faces' patches.

    Returns:
        Pairs of a set of patches and the nodes that lie on exactly those.
    """
    pairs = np.column_stack([members.ravel(), np.repeat(patch, members.shape[1])])
    pairs = np.unique(pairs, axis=0)
    starts = np.flatnonzero(np.r_[True, pairs[1:, 0] != pairs[:-1, 0]])
    groups: dict[tuple[int, ...], list[int]] = {}
    for low, high in zip(starts, np.r_[starts[1:], len(pairs)], strict=True):
        key = tuple(int(p) for p in pairs[low:high, 1])
        groups.setdefault(key, []).append(int(pairs[low, 0]))
    return [(key, np.array(group)) for key, group in groups.items()]


def on_shapes(
    points: NDArray,
    groups: list[tuple[tuple[int, ...], NDArray]],
    shapes: tuple[Shape | None, ...],
    reach: float,
) -> NDArray:
    """Points moved onto the shapes of their patches.

    Args:
        points: (n, 3) [m].
        groups: which points lie on which patches.
        shapes: of the patches.
        reach: [m] a point is never moved further than this.

    Returns:
        (n, 3) [m].
    """
    moved = points.copy()
    for key, group in groups:
        known = tuple(shape for p in key if (shape := shapes[p]) is not None)
        if known:
            target = project(points[group], known)
            near = np.linalg.norm(target - points[group], axis=1) <= reach
            moved[group[near]] = target[near]
    return moved


def moved_onto_shapes(solid: Solid) -> Solid:
    """Corners projected onto their shapes; moves that invert tetrahedra are shortened.

    Args:
        solid: whose corners may be off the shapes of their patches.

    Returns:
        The solid with its corners moved.
    """
    groups = node_patches(len(solid.points), solid.faces, solid.patch)
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    target = on_shapes(solid.points, groups, solid.shapes, 0.01 * size)
    share = np.ones(len(target))
    before = solid.volumes()
    for _ in range(12):
        points = solid.points + share[:, None] * (target - solid.points)
        moved = Solid(points, solid.cells, solid.faces, solid.patch, solid.shapes)
        bad = moved.volumes() < 0.1 * before
        if not bad.any():
            break
        share[np.unique(solid.cells[bad])] *= 0.5
    return moved
