"""Tetrahedral meshes of links.

The mesher pytetwild runs in a separate process with a time limit. It meshes a
simplified surface (:mod:`forcefit.stiffness.surface.decimate`). The boundary of the
mesh deviates from this surface by at most a tolerance, the envelope. Every boundary
triangle is then assigned to a patch of the surface, and its corners are moved onto the
exact shape of the patch. Because pytetwild is slow and not reproducible, meshes are
stored in a cache.
"""

import hashlib
import io
import subprocess
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.cache_folder import cache_folder
from forcefit.inputs.packages import need
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import whole_file
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed, fit_to_patches
from forcefit.stiffness.mesh.solid import Solid
from forcefit.stiffness.surface.decimate import coarser_surface
from forcefit.stiffness.surface.interface import Interface, parse_interface
from forcefit.stiffness.surface.patches import Patches, find_patches
from forcefit.stiffness.surface.surface import Surface, read_surface

__all__ = ["Interface", "Solid", "mesh_solid", "parse_interface", "read_surface"]

_WORKER = Path(__file__).with_name("mesh_worker.py")
# library that makes meshes reproducible; it requires the GNU C++ library
_SAME_NUMBERS = Path(__file__).with_name("same_random_numbers.so")
# version of the format of stored meshes
_FORMAT = 4


def mesh_solid(
    surface: Surface,
    base: Interface,
    tip: Interface,
    *,
    edge: float | None = None,
    envelope: float = 5e-4,
    time_limit: float = 300.0,
    cache: Path | str | None = None,
    patches: Patches | None = None,
) -> Solid:
    """Mesh a surface with tetrahedra, or read the mesh from the cache.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.
        edge: [m] requested edge length. The default is a twentieth of the diagonal of
            the bounding box.
        envelope: [-] largest deviation of the mesh from the simplified surface, divided
            by the diagonal of the bounding box. The simplified surface may deviate from
            the given surface by the same amount.
        time_limit: [s] time limit of the mesher.
        cache: folder in which meshes are stored. The default is the user's cache
            folder.
        patches: patches of the surface. They are computed if None.

    Returns:
        The solid.

    Raises:
        BadInput: no part of the surface is on an interface.
        MeshFailed: the mesher exceeded its time limit or produced no mesh.
    """
    patches = patches or find_patches(surface, base, tip)
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
    """Read a stored mesh, or return None if the file is missing or damaged."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            points, cells = stored["points"], stored["cells"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None
    proper = points.ndim == 2 and cells.ndim == 2 and np.isfinite(points).all()
    return (points, cells) if proper and (cells < len(points)).all() else None


def _to_cache(path: Path, points: NDArray, cells: NDArray) -> None:
    """Store a mesh, unless the disk is full or read-only."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part, part.open("wb") as file:
            np.savez_compressed(file, points=points, cells=cells)
    except (OSError, BadInput):
        return


def _tetrahedralize(
    surface: Surface, edge: float, envelope: float, time_limit: float
) -> tuple[NDArray, NDArray]:
    """Run the mesher in a separate process."""
    need("pytetwild")
    with tempfile.TemporaryDirectory(prefix="forcefit-") as folder:
        given, made = Path(folder, "surface.npz"), Path(folder, "mesh.npz")
        points, triangles = coarser_surface(surface, envelope * surface.diagonal)
        np.savez(given, points=points, triangles=triangles, settings=[edge, envelope])
        # with -P, modules are not imported from the current folder
        command = [sys.executable, "-P", str(_WORKER), str(given), str(made)]
        if _SAME_NUMBERS.exists():
            command.append(str(_SAME_NUMBERS))
        try:
            # the mesher writes a file to the current folder
            run = subprocess.run(
                command,
                timeout=time_limit,
                capture_output=True,
                check=False,
                cwd=folder,
            )
        except subprocess.TimeoutExpired:
            raise MeshFailed(
                f"{surface.name}: the mesh was not finished within {time_limit:g} s; "
                "use a coarser surface or a longer time limit"
            ) from None
        mesh = _from_cache(made)
    if mesh is None or len(mesh[1]) == 0:
        last = run.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise MeshFailed(
            f"{surface.name}: the mesh generator ended without a mesh: {' '.join(last)}"
        )
    return mesh
