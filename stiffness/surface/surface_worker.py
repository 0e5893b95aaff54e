"""The readers that may end their process: VTK, meshio and gmsh on a file of a user.

``python -m stiffness.surface.surface_worker FILE READ.npz [SOLID]``

:func:`stiffness.surface.surface_files.read_triangles` runs this in a process of its
own; a damaged file ends that one alone.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest, quoted
from stiffness.surface.obj_file import read_obj

_FACETS = 48  # of a full circle, in STEP


def main(path: Path, made: Path, solid: str = "") -> None:
    """Read a file and write its points and triangles, or why it is refused.

    Args:
        path: of an existing file.
        made: ``points`` (n, 3) and ``faces`` (m, 3); or ``refused``, one line.
        solid: of a STEP file with several, by its name.
    """
    _limit_memory()
    read = {".msh": _msh, ".obj": _obj}.get(path.suffix.lower(), _with_vtk)
    try:
        if path.suffix.lower() in {".step", ".stp"}:
            points, faces = _step(path, solid)
        else:
            points, faces = read(path)
    except BadInput as error:
        np.savez(made, refused=str(error))
        return
    np.savez(made, points=np.asarray(points, dtype=float), faces=np.asarray(faces))


def _limit_memory() -> None:
    """Let a file that states a size beyond the memory fail here, and nothing else."""
    try:
        import os
        import resource

        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard == resource.RLIM_INFINITY or hard > memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, hard))
    except (ImportError, ValueError, OSError):
        return  # no such limit on this system


def _with_vtk(path: Path) -> tuple[NDArray, NDArray]:
    """What VTK reads: PLY, VTK, VTP."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    return _boundary(path, pyvista.read(path))


def _obj(path: Path) -> tuple[NDArray, NDArray]:
    """An OBJ file; VTK cuts its polygons into triangles, concave ones too."""
    import pyvista

    points, faces = read_obj(path)
    if not faces:
        return points, np.empty((0, 3))
    flat = np.concatenate([[len(face), *face] for face in faces])
    return _boundary(path, pyvista.PolyData(points, faces=flat))


def _check_points(path: Path, mesh: Any) -> None:
    """Refuse cells of points that are not there: VTK's filters die of them."""
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
                f"{path}: found a cell of point {wrong[0] + 1}, expected 1 to "
                f"{mesh.n_points}"
            )


def _boundary(path: Path, mesh: Any) -> tuple[NDArray, NDArray]:
    """Points and triangles of a VTK mesh, the boundary of its volume if it has one."""
    import pyvista

    _check_points(path, mesh)
    if not isinstance(mesh, pyvista.PolyData):
        mesh = mesh.extract_surface(algorithm="dataset_surface")
    mesh = mesh.triangulate()
    faces = mesh.regular_faces if mesh.n_cells else np.empty((0, 3))
    return np.asarray(mesh.points), np.asarray(faces)


def _msh(path: Path) -> tuple[NDArray, NDArray]:
    """Gmsh's MSH 2.2 and 4.1: its surface elements, else the volume's boundary."""
    import meshio
    import pyvista

    mesh = meshio.read(path, "gmsh")
    blocks = [b for b in mesh.cells if b.dim == 2] or [
        b for b in mesh.cells if b.dim == 3
    ]
    if not blocks:
        raise BadInput(f"{path}: holds neither triangles nor tetrahedra")
    cells = [(b.type, b.data) for b in blocks]
    return _boundary(path, pyvista.from_meshio(meshio.Mesh(mesh.points, cells)))


def _step(path: Path, solid: str) -> tuple[NDArray, NDArray]:
    """A solid of a STEP file cut into fine triangles, in metres by its own unit."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        reason = "" if isinstance(error, ImportError) else f" ({error})"
        raise BadInput(
            f"{path}: STEP needs the package gmsh{reason}; install forcefit[gmsh], or "
            "export the surface as STL"
        ) from None
    try:
        gmsh.initialize(interruptible=False)
    except Exception as error:  # its Python file without its library
        raise BadInput(
            f"{path}: STEP needs the package gmsh, which does not start: {error}"
        ) from None
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _FACETS)
        gmsh.open(str(path))
        sides = _sides(gmsh.model, path, solid)
        gmsh.model.mesh.generate(2)
        tags, points, _ = gmsh.model.mesh.getNodes()
        corners = np.concatenate([
            gmsh.model.mesh.getElementsByType(2, side)[1] for side in sides
        ])
    finally:
        gmsh.finalize()
    used, faces = np.unique(corners.astype(np.int64), return_inverse=True)
    index = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    return points.reshape(-1, 3)[index[used]], faces.reshape(-1, 3)


def _sides(model: Any, path: Path, solid: str) -> list[int]:
    """Faces of the solid that is meant, which must be named if there are several."""
    solids = dict[str, int]()
    for _, tag in model.getEntities(3):
        own = model.getEntityName(3, tag).rpartition("/")[2] or f"solid{tag}"
        solids[own if own not in solids else f"{own}-{tag}"] = tag
    if solid and solid not in solids:
        raise BadInput(f"{path}: no solid {quoted(solid)}{nearest(solid, solids)}")
    if not solid and len(solids) > 1:
        names = ", ".join(list(solids)[:20])
        raise BadInput(
            f"{path}: found {len(solids)} solids ({names}), expected which one, such "
            f"as {path.name}#{next(iter(solids))}"
        )
    if not solid:  # one, or faces that belong to none
        return [tag for _, tag in model.getEntities(2)]
    return [tag for _, tag in model.getBoundary([(3, solids[solid])], oriented=False)]


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
