"""The kinds of file a surface comes in."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffness.reading import BadInput


def read_triangles(path: Path) -> tuple[NDArray, NDArray]:
    """Points and triangles of a surface file, in the file's unit.

    Args:
        path: an existing file of a known kind.

    Returns:
        (n, 3) points and (m, 3) indices of points.

    Raises:
        BadInput: the content is not what the name says.
    """
    suffix = path.suffix.lower()
    if suffix in {".msh", ".step", ".stp"}:
        return _read_with_gmsh(path)
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    try:
        mesh = pyvista.read(path)
        if not isinstance(mesh, pyvista.PolyData):
            mesh = mesh.extract_surface(algorithm="dataset_surface")
        mesh = mesh.triangulate()
        faces = np.asarray(mesh.regular_faces if mesh.n_cells else np.empty((0, 3)))
    except Exception as error:  # whatever a foreign reader makes of a broken file
        raise BadInput(f"{path}: not a readable {suffix[1:].upper()} file") from error
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise BadInput(f"{path}: holds no triangles, or is not {suffix[1:].upper()}")
    return np.array(mesh.points, dtype=float), faces.astype(np.int64)


def _read_with_gmsh(path: Path) -> tuple[NDArray, NDArray]:
    """MSH as it stands, STEP meshed finely; needs the optional package gmsh."""
    try:
        import gmsh
    except (ImportError, OSError):
        raise BadInput(
            f"{path}: reading {path.suffix} needs the package gmsh; install it, or "
            "export the surface as STL"
        ) from None
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        if path.suffix.lower() != ".msh":
            gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 48)
            gmsh.model.mesh.generate(2)
        tags, points, _ = gmsh.model.mesh.getNodes()
        corners = gmsh.model.mesh.getElementsByType(2)[1]
    except Exception as error:
        kind = path.suffix[1:].upper()
        raise BadInput(f"{path}: not a readable {kind} file") from error
    finally:
        gmsh.finalize()
    if len(corners) == 0:
        raise BadInput(f"{path}: holds no triangles")
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    return points.reshape(-1, 3), index[corners.astype(np.int64)].reshape(-1, 3)
