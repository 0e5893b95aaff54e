"""Reader of STEP files, which uses gmsh.

A damaged file can crash gmsh. These functions therefore run in a separate process
(:mod:`forcefit.stiffness.surface.surface_worker`).
"""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.packages import naming_packages
from forcefit.inputs.table import BadInput, nearest, quoted

_FACETS = 48  # number of facets around a circle
# the overlap of two solids is ignored if its ratio to the volume of a solid is smaller
_TOUCHING = 1e-6
_ALL, _AND = "*", "+"  # name of all solids; sign between the names of several solids


def read_solids(path: Path) -> tuple[list[str], list[float], list[list[float]]]:
    """Read the names, volumes and bounding boxes of the solids in a STEP file.

    Args:
        path: path of the file.

    Returns:
        Names of the solids; volumes [m^3]; and lower and upper corners of the bounding
        boxes [m].

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
    """Yield the gmsh model of a STEP file in metres."""
    try:
        with naming_packages(f"{path}: STEP", "export the surface as STL"):
            import gmsh

        gmsh.initialize(interruptible=False)
    except BadInput:
        raise
    except Exception as error:  # the library of gmsh may be missing
        raise BadInput(
            f"{path}: STEP files require the package gmsh, which cannot be loaded: "
            f"{error}"
        ) from None
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", _FACETS)
        try:
            gmsh.open(str(path))
        # gmsh has no specific exception class
        except Exception as error:
            raise BadInput(f"{path}: not a readable STEP file") from error
        yield gmsh.model
    finally:
        gmsh.finalize()


@dataclass(frozen=True, eq=False)
class StepTriangles:
    """Triangles of selected solids.

    Attributes:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.
        sides: (m, 2) index in ``names`` of the solid on each side of a triangle, or -1.
        names: names of the solids; empty if the file contains faces without a solid.
        overlaps: descriptions of pairs of solids that overlap.
    """

    points: NDArray
    triangles: NDArray
    sides: NDArray
    names: tuple[str, ...]
    overlaps: tuple[str, ...] = ()


def read_step(path: Path, solid: str) -> StepTriangles:
    """Triangulate solids in a STEP file.

    Args:
        path: path of the file.
        solid: name of a solid, ``one+other`` for several solids, or ``*`` for all
            solids. It may be empty if the file contains a single solid.

    Returns:
        The triangles in metres, including those between two solids.

    Raises:
        BadInput: the file cannot be read, the solid does not exist, solids do not
            touch, or gmsh is not installed.
    """
    with _gmsh_model(path) as model:
        chosen = chosen_solids(model, path, solid)
        names, overlaps = tuple(chosen), tuple[str, ...]()
        if len(chosen) > 1:
            owners, overlaps = _fragments(model, path, chosen)
        else:
            owners = dict.fromkeys(chosen.values(), 0)
        sides_of = sides(model, owners)
        model.mesh.generate(2)
        tags, points, _ = model.mesh.getNodes()
        corners = {t: model.mesh.getElementsByType(2, t)[1] for t in sides_of}
    used, faces = np.unique(
        np.concatenate([*corners.values(), []]).astype(np.int64), return_inverse=True
    )
    index = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    index[tags.astype(np.int64)] = np.arange(len(tags))
    return StepTriangles(
        points=points.reshape(-1, 3)[index[used]],
        triangles=faces.reshape(-1, 3),
        sides=np.repeat(
            np.reshape(list(sides_of.values()), (-1, 2)),
            [len(c) // 3 for c in corners.values()],
            axis=0,
        ),
        names=names,
        overlaps=overlaps,
    )


def _solids(model: Any) -> dict[str, int]:
    """Return the tags of the solids by name."""
    solids = dict[str, int]()
    for _, tag in model.getEntities(3):
        own = model.getEntityName(3, tag).rpartition("/")[2] or f"solid{tag}"
        solids[own if own not in solids else f"{own}-{tag}"] = tag
    return solids


def chosen_solids(model: Any, path: Path, solid: str) -> dict[str, int]:
    """Return the selected solids of a model.

    Args:
        model: gmsh model of the file.
        path: path of the file, for error messages.
        solid: names of solids, see :func:`read_step`.

    Returns:
        Tags of the solids by name; empty if the file contains faces without a solid.

    Raises:
        BadInput: a solid does not exist, or the name is empty and there are several
            solids.
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
            f"{path}: found {len(solids)} solids ({names}), expected the name of one "
            f"solid, as in {path.name}#{next(iter(solids))}, or {path.name}#{_ALL} for "
            f"all solids as one part; the command forcefit stiffness fea {path.name} "
            "--part list lists the solids"
        )
    if not solid:
        return solids
    return {n: solids[n] for n in ([solid] if solid in solids else several)}


def sides(model: Any, owners: Mapping[int, int]) -> dict[int, tuple[int, int]]:
    """Find the solids on both sides of each face.

    Args:
        model: gmsh model of the file.
        owners: number of the solid to which each volume of gmsh belongs.

    Returns:
        Dictionary from face tags to the numbers of both solids, or -1 for no solid.
    """
    found: dict[int, list[int]] = {}
    for volume, owner in owners.items():
        for _, face in model.getBoundary([(3, volume)], oriented=False):
            found.setdefault(face, []).append(owner)
    if not owners:
        return {tag: (-1, -1) for _, tag in model.getEntities(2)}
    both = {face: (solids[0], [*solids, -1][1]) for face, solids in found.items()}
    return {face: pair for face, pair in both.items() if pair[0] != pair[1]}


def _fragments(
    model: Any, path: Path, chosen: Mapping[str, int]
) -> tuple[dict[int, int], tuple[str, ...]]:
    """Split solids at common faces, and return their volumes and overlaps."""
    solids, names = [(3, tag) for tag in chosen.values()], list(chosen)
    volume = [float(model.occ.getMass(*solid)) for solid in solids]
    _, made = model.occ.fragment(solids[:1], solids[1:])
    model.occ.synchronize()
    owners: dict[int, int] = {}
    overlaps = []
    for number, parts in enumerate(made):
        for _, tag in parts:
            other = owners.setdefault(tag, number)
            common = 0.0 if other == number else float(model.occ.getMass(3, tag))
            if common > _TOUCHING * min(volume[other], volume[number]):
                overlaps.append(
                    f"solids {quoted(names[other])} and {quoted(names[number])} "
                    f"overlap in a volume of {common:.4g} m^3"
                )
    bodies = _bodies(model, list(owners))
    if bodies != 1:
        raise BadInput(
            f"{path}: {len(chosen)} solids form {bodies} separate bodies, expected one "
            "body; the solids of a link must touch"
        )
    return owners, tuple(overlaps)


def _bodies(model: Any, volumes: list[int]) -> int:
    """Count the connected bodies of volumes with common faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    pairs = [
        (number, face)
        for number, tag in enumerate(volumes)
        for _, face in model.getBoundary([(3, tag)], oriented=False)
    ]
    rows, faces = np.array(pairs).T
    shape = (len(volumes), int(faces.max()) + 1)
    on = coo_array((np.ones(len(rows)), (rows, faces)), shape).tocsr()
    return int(connected_components(on @ on.T, directed=False)[0])
