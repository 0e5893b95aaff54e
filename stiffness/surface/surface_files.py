"""Readers of surface files."""

import io
from collections.abc import Generator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest, quoted

STEP = (".step", ".stp")
_FACETS = 48  # of a full circle, in STEP
_ALL, _AND = "*", "+"  # all solids of a STEP file, several, as one


def named_solid(path: Path | str) -> tuple[Path, str]:
    """A surface file, and which of the solids of a STEP file is meant.

    Args:
        path: of a file, or ``part.step#name``; ``part.step#one+other`` or
            ``part.step#*`` of several solids as one.

    Returns:
        The file, and the name; empty where none is given.
    """
    file, mark, name = str(path).rpartition("#")
    if mark and Path(file).suffix.lower() in STEP:
        return Path(file), name
    return Path(path), ""


def read_triangles(path: Path | str, solid: str = "") -> tuple[NDArray, NDArray]:
    """Points and triangles of a surface file, in the file's unit; STEP in metres.

    Args:
        path: an existing file of a known kind.
        solid: of a STEP file with several, by its name.

    Returns:
        (n, 3) points and (m, 3) indices of points.

    Raises:
        BadInput: the content is not what the name says, or the package that reads it
            is not installed.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    read = {".msh": _msh}.get(suffix, _with_vtk)
    if suffix in STEP:
        read = partial(_step, solid=solid)
    try:
        points, faces = read(path)
    except BadInput:
        raise
    except (Exception, SystemExit) as error:  # any error of a third-party reader
        raise BadInput(f"{path}: not a readable {suffix[1:].upper()} file") from error
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise BadInput(f"{path}: holds no triangles, or is not {suffix[1:].upper()}")
    return np.array(points, dtype=float), faces.astype(np.int64)


def _with_vtk(path: Path) -> tuple[NDArray, NDArray]:
    """What VTK reads: STL, OBJ, PLY, VTK, VTP."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    return _boundary(path, pyvista.read(path))


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

    # meshio prints an empty line, and its errors before it leaves the program
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        mesh = meshio.read(path, "gmsh")
    blocks = [b for b in mesh.cells if b.dim == 2] or [
        b for b in mesh.cells if b.dim == 3
    ]
    if not blocks:
        raise BadInput(f"{path}: holds neither triangles nor tetrahedra")
    cells = [(b.type, b.data) for b in blocks]
    return _boundary(path, pyvista.from_meshio(meshio.Mesh(mesh.points, cells)))


@dataclass(frozen=True)
class StepSolid:
    """A solid of a STEP file.

    Attributes:
        name: as ``part.step#name`` takes it.
        volume: [m^3].
        low: (3,) [m] the bounding box's lower corner.
        high: (3,) [m] its upper one.
    """

    name: str
    volume: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def step_solids(path: Path | str) -> list[StepSolid]:
    """List the solids of a STEP file.

    Args:
        path: of the file.

    Returns:
        The solids in the file's order, in metres by its own unit.

    Raises:
        BadInput: the file cannot be read, holds no solid, or gmsh is not installed.
    """
    path = Path(path)
    with _gmsh_model(path) as model:
        solids = _solids(model)
        boxes = {name: model.getBoundingBox(3, tag) for name, tag in solids.items()}
        volumes = {n: float(model.occ.getMass(3, tag)) for n, tag in solids.items()}
    if not solids:
        raise BadInput(f"{path}: found no solid, expected one or more")
    return [
        StepSolid(name, volumes[name], tuple(box[:3]), tuple(box[3:]))
        for name, box in boxes.items()
    ]


@contextmanager
def _gmsh_model(path: Path) -> Generator[Any, None, None]:
    """Gmsh's model of a STEP file, in metres."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        reason = "" if isinstance(error, ImportError) else f" ({error})"
        raise BadInput(
            f"{path}: STEP needs the package gmsh{reason}; install forcefit[gmsh], or "
            "export the surface as STL"
        ) from None
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _FACETS)
        try:
            gmsh.open(str(path))
        except Exception as error:  # gmsh has no class of its own for what it refuses
            raise BadInput(f"{path}: not a readable STEP file") from error
        yield gmsh.model
    finally:
        gmsh.finalize()


def _step(path: Path, solid: str) -> tuple[NDArray, NDArray]:
    """A solid of a STEP file cut into fine triangles, in metres by its own unit."""
    with _gmsh_model(path) as model:
        sides = _sides(model, path, solid)
        model.mesh.generate(2)
        tags, points, _ = model.mesh.getNodes()
        corners = np.concatenate([
            model.mesh.getElementsByType(2, side)[1] for side in sides
        ])
    used, faces = np.unique(corners.astype(np.int64), return_inverse=True)
    index = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    return points.reshape(-1, 3)[index[used]], faces.reshape(-1, 3)


def _solids(model: Any) -> dict[str, int]:
    """Tags of a model's solids by name."""
    solids = dict[str, int]()
    for _, tag in model.getEntities(3):
        own = model.getEntityName(3, tag).rpartition("/")[2] or f"solid{tag}"
        solids[own if own not in solids else f"{own}-{tag}"] = tag
    return solids


def _sides(model: Any, path: Path, solid: str) -> list[int]:
    """Faces of the solid that is meant, which must be named if there are several."""
    solids = _solids(model)
    several = list(solids) if solid == _ALL else solid.split(_AND)
    unknown = [] if solid in solids else [n for n in several if n not in solids]
    if solid and unknown:
        hint = nearest(unknown[0], solids)
        raise BadInput(f"{path}: no solid {quoted(unknown[0])}{hint}")
    if not solid and len(solids) > 1:
        names = ", ".join(list(solids)[:20])
        raise BadInput(
            f"{path}: found {len(solids)} solids ({names}), expected which one, such "
            f"as {path.name}#{next(iter(solids))}, or {path.name}#{_ALL} for all of "
            f"them as one; forcefit stiffness solids {path.name} lists them"
        )
    if not solid:  # one, or faces that belong to none
        return [tag for _, tag in model.getEntities(2)]
    chosen = [solids[solid]] if solid in solids else [solids[n] for n in several]
    if len(chosen) > 1:
        chosen = _fused(model, path, chosen)
    return [tag for _, tag in model.getBoundary([(3, chosen[0])], oriented=False)]


def _fused(model: Any, path: Path, tags: list[int]) -> list[int]:
    """The one solid that several become when they are united."""
    solids = [(3, tag) for tag in tags]
    united, _ = model.occ.fuse(solids[:1], solids[1:])
    model.occ.synchronize()
    volumes = [tag for dimension, tag in united if dimension == 3]
    if len(volumes) != 1:
        raise BadInput(
            f"{path}: {len(tags)} solids unite to {len(volumes)} bodies, expected one: "
            "solids of one link must touch"
        )
    return volumes
