"""Surfaces of links: reader, checks and repairs."""

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, describe, nearest
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.surface.filled_solids import FilledSolids
from forcefit.stiffness.surface.surface_files import STEP, named_solid, read_triangles

UNITS = {"m": 1.0, "dm": 0.1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
UNITS |= {"in": 0.0254, "inch": 0.0254, "ft": 0.3048}
FORMATS = (".stl", ".obj", ".ply", ".vtk", ".vtp", ".msh", ".step", ".stp")
# [m] largest accepted diagonal of the bounding box
_LARGEST_LINK = 20.0
_SMALLEST_LINK = 1e-3  # [m] smallest accepted diagonal of the bounding box
_STATED = "stated in the file"
# largest accepted mean number of points near each point, which limits the memory
_CROWD = 100


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed surface of triangles, counterclockwise as seen from outside.

    Attributes:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.
        name: name of the file, for error messages.
        repairs: descriptions of the repairs.
        solids: solids of a STEP file with several solids, otherwise None.
    """

    points: NDArray
    triangles: NDArray
    name: str
    repairs: tuple[str, ...] = ()
    solids: FilledSolids | None = None

    __repr__, _repr_html_ = short_repr, html_table

    def normals(self) -> NDArray:
        """Return the area vectors of the triangles, (m, 3) [m^2]."""
        return area_vectors(self.points, self.triangles)

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        return signed_volume(self.points, self.triangles)

    @property
    def area(self) -> float:
        """Total area [m^2]."""
        return float(np.linalg.norm(self.normals(), axis=1).sum())

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    def digest(self) -> str:
        """Return a hash of the points and the triangles."""
        content = hashlib.sha256(np.ascontiguousarray(self.points).tobytes())
        content.update(np.ascontiguousarray(self.triangles, dtype=np.int64).tobytes())
        return content.hexdigest()


def area_vectors(points: NDArray, triangles: NDArray) -> NDArray:
    """Compute the area vectors of triangles.

    Args:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.

    Returns:
        (m, 3) [m^2] normals, whose lengths are the areas.
    """
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.cross(b - a, c - a) / 2


def signed_volume(points: NDArray, triangles: NDArray) -> float:
    """Compute the volume inside a closed surface, negative for inward normals.

    Args:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.

    Returns:
        [m^3] volume.
    """
    origin = points.mean(axis=0)
    a, b, c = np.moveaxis(points[triangles] - origin, 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def directed_edges(triangles: NDArray) -> NDArray:
    """Return the directed edges of triangles.

    Args:
        triangles: (m, 3) indices of points.

    Returns:
        (3 m, 2) indices of points. Each triangle has three consecutive edges.
    """
    return triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def read_surface(path: Path | str, unit: str = "m") -> Surface:
    """Read the surface of a link from a file, check it and repair it.

    Args:
        path: STL, OBJ, PLY, VTK, VTP or MSH file, or STEP file if gmsh is installed.
            ``part.step#name`` selects a solid in a STEP file.
        unit: unit of length in the file: m, cm, mm, um or inch. It is not used for STEP
            files, which contain their unit.

    Returns:
        The closed surface in metres.

    Raises:
        BadInput: the file cannot be read or does not contain a closed surface of
            plausible size.
    """
    if unit not in UNITS:
        raise BadInput(f"unit: found {describe(unit)}{nearest(str(unit), UNITS)}")
    file, solid = named_solid(path)
    points, triangles, solids = _read_triangles(file, solid)
    scale = UNITS[unit]
    if file.suffix.lower() in STEP:
        scale, unit = 1.0, _STATED
    surface = check_surface(points * scale, triangles, str(path), unit)
    return replace(surface, solids=solids)


def _read_triangles(
    path: Path, solid: str
) -> tuple[NDArray, NDArray, FilledSolids | None]:
    """Read the points, the triangles and the solids of a file."""
    if path.suffix.lower() not in FORMATS:
        hint = nearest(path.suffix, FORMATS)
        raise BadInput(f"{path}: unknown kind of surface file{hint}")
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise BadInput(f"{path}: the file is empty")
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from None
    return read_triangles(path, solid)


def check_surface(
    points: NDArray, triangles: NDArray, name: str, unit: str = "m"
) -> Surface:
    """Check and repair a triangulated surface.

    Args:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.
        name: name of the surface, for error messages.
        unit: unit of length in the file, for error messages.

    Returns:
        The surface. Equal points are merged, triangles with zero area are removed, and
        normals point outward.

    Raises:
        BadInput: the surface is empty, open, not finite, self-intersecting or of
            implausible size, consists of several bodies, or has an edge of more than
            two triangles.
    """
    if len(triangles) == 0:
        raise BadInput(f"{name}: contains no triangles")
    if triangles.min() < 0 or triangles.max() >= len(points):
        raise BadInput(f"{name}: a triangle has a corner that is not among the points")
    _check_coordinates(points, triangles, name, unit)
    points, triangles, repairs = _merge(points, triangles, name)
    if len(triangles) < 4:
        raise BadInput(
            f"{name}: found {len(triangles)} triangles with an area, expected at least "
            "4 for a closed surface"
        )
    _check_closed(points, triangles, name)
    triangles, turned = _orient(points, triangles, name)
    from forcefit.stiffness.surface.intersections import crossing_triangles

    crossing = crossing_triangles(points, triangles)
    if len(crossing):
        where = points[triangles[crossing[0]]].reshape(-1, 3).mean(axis=0)
        raise BadInput(
            f"{name}: the surface intersects itself at {len(crossing)} pairs of "
            f"triangles, the first near {_place(where)}; unite the parts before meshing"
        )
    return Surface(points, triangles, name, (*repairs, *turned))


def _place(point: NDArray) -> str:
    """Format the coordinates of a point for an error message."""
    return "(" + ", ".join(f"{v:.4g}" for v in point) + ") m"


def _check_coordinates(
    points: NDArray, triangles: NDArray, name: str, unit: str
) -> None:
    """Check that coordinates are finite and that the size is plausible."""
    used = points[np.unique(triangles)]
    wrong = ~np.isfinite(used).all(axis=1)
    if wrong.any():
        raise BadInput(
            f"{name}: the coordinates of {wrong.sum()} vertices are not finite"
        )
    size = math.hypot(*np.ptp(used, axis=0))
    if not _SMALLEST_LINK <= size <= _LARGEST_LINK:
        hint = "mm" if size > _LARGEST_LINK and unit in {"m", _STATED} else "m"
        raise BadInput(
            f'{name}: the size of the part is {size:.4g} m with unit = "{unit}"; is '
            f'the unit of the file "{hint}"?'
        )


def _merge(
    points: NDArray, triangles: NDArray, name: str
) -> tuple[NDArray, NDArray, list[str]]:
    """Merge equal points, and remove triangles with zero area."""
    repairs = []
    used, triangles = np.unique(triangles, return_inverse=True)
    points, triangles = points[used], triangles.reshape(-1, 3)
    points, index = np.unique(points, axis=0, return_inverse=True)
    triangles = index.reshape(-1)[triangles]
    from scipy.spatial import cKDTree

    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    tree, near = cKDTree(points), 1e-7 * size
    # a list of all pairs would need too much memory
    if tree.count_neighbors(tree, near) > _CROWD * len(points):
        raise BadInput(
            f"{name}: most of its {len(points)} vertices are less than "
            f"{near:.2g} m apart in a part of {size:.4g} m; check the unit and "
            "the file"
        )
    pairs = tree.query_pairs(near, output_type="ndarray")
    if len(pairs):
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        shape = (len(points), len(points))
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape)
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        points, triangles = points[first], label[triangles]
        repairs.append(f"{len(pairs)} pairs of nearly equal vertices merged")
    a, b, c = triangles.T
    flat = (a == b) | (b == c) | (c == a)
    if flat.any():
        repairs.append(f"{flat.sum()} triangles without an area removed")
    return points, triangles[~flat], repairs


def _check_closed(points: NDArray, triangles: NDArray, name: str) -> None:
    """Check that every edge belongs to exactly two triangles."""
    edges = np.sort(directed_edges(triangles), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    if (count == 1).any():
        where = points[edges[count == 1][0]].mean(axis=0)
        raise BadInput(
            f"{name}: the surface is open: {(count == 1).sum()} edges belong to only "
            f"one triangle, the first near {_place(where)}; close the surface before "
            "meshing"
        )
    if (count > 2).any():
        where = points[edges[count > 2][0]].mean(axis=0)
        raise BadInput(
            f"{name}: {(count > 2).sum()} edges are shared by more than two triangles, "
            f"the first near {_place(where)}; expected two triangles at each edge"
        )


def _encloses(points: NDArray, outer: NDArray, inner: NDArray) -> bool:
    """Return whether a shell is inside another shell."""
    a, b = points[inner].reshape(-1, 3), points[outer].reshape(-1, 3)
    in_box = (a.min(axis=0) >= b.min(axis=0)) & (a.max(axis=0) <= b.max(axis=0))
    return bool(in_box.all()) and _inside(a[0], points, outer)


def _orient(
    points: NDArray, triangles: NDArray, name: str
) -> tuple[NDArray, list[str]]:
    """Orient all triangles outward, and reject several bodies."""
    triangles, shell, flipped = orient_shells(triangles)
    repairs = (
        [f"{flipped} triangles reoriented to agree with their neighbours"]
        if flipped
        else []
    )
    shells = [triangles[shell == k] for k in range(shell.max() + 1)]
    volumes = np.array([signed_volume(points, part) for part in shells])
    main = int(np.argmax(np.abs(volumes)))
    if abs(volumes[main]) < 1e-12 * np.linalg.norm(np.ptp(points, axis=0)) ** 3:
        raise BadInput(f"{name}: the surface encloses no volume")
    for k, part in enumerate(shells):
        cavity = k != main
        if cavity and not _encloses(points, shells[main], part):
            raise BadInput(
                f"{name}: found {len(shells)} separate bodies, the second near "
                f"{_place(points[part].reshape(-1, 3).mean(axis=0))}; expected one body"
            )
        if (volumes[k] < 0) != cavity:
            shells[k] = part[:, ::-1]
            what = "a cavity was" if cavity else "the surface was"
            repairs.append(f"{what} inside out and has been reoriented")
    return np.concatenate(shells), repairs


def orient_shells(triangles: NDArray) -> tuple[NDArray, NDArray, int]:
    """Orient the triangles of each closed shell consistently.

    Args:
        triangles: (m, 3) indices of points.

    Returns:
        The triangles; the shell of each triangle, (m,); and the number of reversed
        triangles.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    count = len(triangles)
    directed = directed_edges(triangles)
    owner = np.repeat(np.arange(count), 3)
    order = np.lexsort(np.sort(directed, axis=1).T)
    first, second = order[::2], order[1::2]  # every edge belongs to two triangles
    left, right = owner[first], owner[second]
    # two triangles with the same direction of their common edge have different
    # orientations
    same = directed[first, 0] == directed[second, 0]
    ends = (np.r_[left, right], np.r_[right, left])
    graph = coo_array((np.r_[same, same] + 1.0, ends), (count, count)).tocsr()
    shells, shell = connected_components(graph, directed=False)
    flip = np.zeros(count, dtype=bool)
    for k in range(shells):
        start = int(np.flatnonzero(shell == k)[0])
        visit, parent = breadth_first_order(graph, start, directed=False)
        disagree = np.zeros(count, dtype=bool)
        link = np.asarray(graph[visit[1:], parent[visit[1:]]]).ravel()
        disagree[visit[1:]] = link % 2 == 0
        for i in visit[1:]:
            flip[i] = flip[parent[i]] ^ disagree[i]
        members = shell == k
        if flip[members].sum() * 2 > members.sum():
            flip[members] = ~flip[members]
    turned = np.where(flip[:, None], triangles[:, ::-1], triangles)
    return turned, shell, int(flip.sum())


def _inside(point: NDArray, points: NDArray, triangles: NDArray) -> bool:
    """Return whether a point is inside a closed surface."""
    a, b, c = np.moveaxis(points[triangles] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    bottom = la * lb * lc + (
        np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return bool(abs(np.sum(2 * np.arctan2(top, bottom))) > 2 * np.pi)
