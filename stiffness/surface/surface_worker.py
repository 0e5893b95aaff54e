"""Program that reads a surface file with VTK, meshio or gmsh.

``python -m forcefit.stiffness.surface.surface_worker triangles|solids FILE READ.npz
[SOLID]``

This program is run by :mod:`forcefit.stiffness.surface.surface_files`, because a
damaged file can crash the process that reads it.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.packages import naming_packages
from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.obj_file import read_obj
from forcefit.stiffness.surface.step_file import read_solids, read_step


def main(wanted: str, path: Path, made: Path, solid: str = "") -> None:
    """Read a file, and write its data or an error message.

    Args:
        wanted: ``"triangles"``, or ``"solids"`` for a list of the solids in a STEP
            file.
        path: path of an existing file.
        made: output file. For triangles, it contains ``points``, (n, 3), and ``faces``,
            (m, 3), and for a STEP file also the attributes of
            :class:`forcefit.stiffness.surface.step_file.StepTriangles`. For solids, it
            contains ``names``, (n,), ``volumes``, (n,), and ``boxes``, (n, 6). For an
            invalid file, it contains the error message ``refused``.
        solid: name of one of several solids in a STEP file.
    """
    _limit_memory()
    try:
        with naming_packages(f"{path}: {path.suffix[1:].upper()}"):
            arrays = _solids(path) if wanted == "solids" else _triangles(path, solid)
    except BadInput as error:
        arrays = {"refused": np.array(str(error))}
    np.savez(made, **arrays)


def _solids(path: Path) -> dict[str, Any]:
    """Read the names, volumes and bounding boxes of the solids in a STEP file."""
    names, volumes, boxes = read_solids(path)
    return {
        "names": np.array(names, dtype=str),
        "volumes": np.array(volumes),
        "boxes": np.array(boxes),
    }


def _triangles(path: Path, solid: str) -> dict[str, Any]:
    """Read the points and the triangles of a file, and the solids of a STEP file."""
    if path.suffix.lower() in {".step", ".stp"}:
        step = read_step(path, solid)
        return {
            "points": step.points,
            "faces": step.triangles,
            "sides": step.sides,
            "names": np.array(step.names, dtype=str),
            "overlaps": np.array(step.overlaps, dtype=str),
        }
    read = {".msh": _msh, ".obj": _obj}.get(path.suffix.lower(), _with_vtk)
    points, faces = read(path)
    return {"points": np.asarray(points, dtype=float), "faces": np.asarray(faces)}


def _limit_memory() -> None:
    """Limit the memory of this process."""
    try:
        import os
        import resource

        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard == resource.RLIM_INFINITY or hard > memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
    except (ImportError, ValueError, OSError):
        return  # this operating system cannot limit the memory


def _with_vtk(path: Path) -> tuple[NDArray, NDArray]:
    """Read a surface from a PLY, VTK or VTP file with VTK."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    return _boundary(path, pyvista.read(path))


def _obj(path: Path) -> tuple[NDArray, NDArray]:
    """Read a surface from an OBJ file, and split polygons into triangles."""
    import pyvista

    points, faces = read_obj(path)
    if not faces:
        return points, np.empty((0, 3))
    flat = np.concatenate([[len(face), *face] for face in faces])
    return _boundary(path, pyvista.PolyData(points, faces=flat))


def _check_points(path: Path, mesh: Any) -> None:
    """Reject cells with unknown points, which would crash VTK."""
    import pyvista
    from vtkmodules.util.numpy_support import vtk_to_numpy

    cells = []
    if isinstance(mesh, pyvista.PolyData):
        cells = [mesh.GetVerts(), mesh.GetLines(), mesh.GetPolys(), mesh.GetStrips()]
    elif isinstance(mesh, pyvista.UnstructuredGrid):
        cells = [mesh.GetCells()]
    for some in cells:
        used = vtk_to_numpy(some.GetConnectivityArray())
        wrong = used[(used < 0) | (used >= mesh.n_points)]
        if len(wrong):
            raise BadInput(
                f"{path}: found point {wrong[0] + 1} in a cell, expected points 1 to "
                f"{mesh.n_points}"
            )


def _volume(mesh: Any) -> Any:
    """Return the cells with a volume, or all cells if none has a volume.

    Gmsh writes tetrahedra and the triangles of the surface into the same file.
    """
    kinds, first = np.unique(mesh.celltypes, return_index=True)
    solid = [
        kind
        for kind, i in zip(kinds, first.tolist(), strict=True)
        if mesh.GetCell(i).GetCellDimension() == 3
    ]
    if len(solid) in (0, len(kinds)):
        return mesh
    return mesh.extract_cells(np.isin(mesh.celltypes, solid))


def _boundary(path: Path, mesh: Any) -> tuple[NDArray, NDArray]:
    """Extract the triangles of a mesh, or of the boundary of its volume."""
    import pyvista

    _check_points(path, mesh)
    if isinstance(mesh, pyvista.UnstructuredGrid):
        mesh = _volume(mesh)
    if not isinstance(mesh, pyvista.PolyData):
        mesh = mesh.extract_surface(algorithm="dataset_surface")
    mesh = mesh.triangulate()
    faces = mesh.regular_faces if mesh.n_cells else np.empty((0, 3))
    return np.asarray(mesh.points), np.asarray(faces)


def _msh(path: Path) -> tuple[NDArray, NDArray]:
    """Read the surface, or the boundary of the volume, from an MSH file of gmsh."""
    import meshio
    import pyvista

    mesh = meshio.read(path, "gmsh")
    blocks = [b for b in mesh.cells if b.dim == 2] or [
        b for b in mesh.cells if b.dim == 3
    ]
    if not blocks:
        raise BadInput(f"{path}: the file contains neither triangles nor tetrahedra")
    cells = [(b.type, b.data) for b in blocks]
    return _boundary(path, pyvista.from_meshio(meshio.Mesh(mesh.points, cells)))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), *sys.argv[4:])
