"""STEP files, read by gmsh: their solids, and one of them cut into fine triangles.

A damaged file can end gmsh together with its process, so these run in one of their own
(:mod:`stiffness.surface.surface_worker`).
"""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest, quoted

_FACETS = 48  # of a full circle
_ALL, _AND = "*", "+"  # all solids of a file, several, as one


def read_solids(path: Path) -> tuple[list[str], list[float], list[list[float]]]:
    """Read the names, volumes and bounding boxes of the solids of a STEP file.

    Args:
        path: of the file.

    Returns:
        Names; volumes [m^3]; lower and upper corner of each box [m].

    Raises:
        BadInput: the file cannot be read, or gmsh is not installed.
    """
    with _gmsh_model(path) as model:
        solids = _solids(model)
        boxes = [list(model.getBoundingBox(3, tag)) for tag in solids.values()]
        volumes = [float(model.occ.getMass(3, tag)) for tag in solids.values()]
    return list(solids), volumes, boxes


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
        try:
            gmsh.open(str(path))
        except Exception as error:  # gmsh has no class of its own for what it refuses
            raise BadInput(f"{path}: not a readable STEP file") from error
        yield gmsh.model
    finally:
        gmsh.finalize()


def read_step(path: Path, solid: str) -> tuple[NDArray, NDArray]:
    """Cut a solid of a STEP file into fine triangles, in metres by its own unit.

    Args:
        path: of the file.
        solid: its name, ``one+other`` of several or ``*`` of all as one; may be empty
            where the file holds one.

    Returns:
        (n, 3) points and (m, 3) indices of points.

    Raises:
        BadInput: the file cannot be read, no such solid, or gmsh is not installed.
    """
    with _gmsh_model(path) as model:
        of_solid = sides(model, path, solid)
        model.mesh.generate(2)
        tags, points, _ = model.mesh.getNodes()
        corners = np.concatenate([
            model.mesh.getElementsByType(2, side)[1] for side in of_solid
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


def sides(model: Any, path: Path, solid: str) -> list[int]:
    """Find the faces of the solid that is meant.

    Args:
        model: gmsh's, of the file.
        path: for messages.
        solid: as in :func:`read_step`; must be given where there are several.

    Returns:
        Tags of the faces.

    Raises:
        BadInput: no such solid, or which one is not said.
    """
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
