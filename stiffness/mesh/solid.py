"""Straight tetrahedra of a link."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.mesh.lagrange import EDGES
from forcefit.stiffness.surface.primitives import Shape, project
from forcefit.stiffness.surface.true_surface import TrueSurface

# corners of each face, counterclockwise as seen from outside
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


@dataclass(frozen=True, eq=False)
class Solid:
    """Straight tetrahedra of a link, and the exact shapes of its boundary.

    Attributes:
        points: (n, 3) [m] positions of the corners. Boundary corners are on the exact
            shapes.
        cells: (t, 4) corners of tetrahedra with positive volume.
        faces: (f, 3) corners of the boundary triangles, counterclockwise as seen from
            outside.
        patch: (f,) patch number of each boundary triangle. Patch 0 is the base
            interface, and patch 1 is the tip interface.
        shapes: exact shape of each patch; None if the shape is unknown.
        walls: wall through the common line of an interface and a tangent patch, for
            each such pair of patches, see
            :mod:`forcefit.stiffness.surface.smooth_outline`.
        surface: exact surface of the part; None if it is not needed.
        inner: (k, 3) corners of triangles between regions inside the link.
        inner_patch: (k,) index in ``shapes`` of the shape on which each inner triangle
            is.
        region: (t,) number of the region of each tetrahedron, see
            :mod:`forcefit.stiffness.mesh.regions`; None if no elements were split.
    """

    points: NDArray
    cells: NDArray
    faces: NDArray
    patch: NDArray
    shapes: tuple[Shape | None, ...]
    walls: Mapping[tuple[int, int], Shape] = field(default_factory=dict)
    surface: TrueSurface | None = None
    inner: NDArray = field(default_factory=lambda: np.zeros((0, 3), dtype=int))
    inner_patch: NDArray = field(default_factory=lambda: np.zeros(0, dtype=int))
    region: NDArray | None = None

    __repr__, _repr_html_ = short_repr, html_table

    def volumes(self) -> NDArray:
        """Return the volumes of the tetrahedra, (t,) [m^3]."""
        a, b, c, d = np.moveaxis(self.points[self.cells], 1, 0)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6


def meeting_shapes(
    solid: Solid, key: tuple[int, ...], points: NDArray
) -> tuple[Shape, ...]:
    """Return the shapes on which given corners must be.

    Args:
        solid: straight tetrahedra.
        key: patches of the corners; empty for inner corners.
        points: (n, 3) [m] positions of the corners.

    Returns:
        The shapes. For two tangent patches, one of the shapes is replaced by the wall
        through their common line.
    """
    return _meeting_shapes(key, solid.shapes, solid.walls, points) if key else ()


def corner_groups(solid: Solid) -> list[tuple[tuple[int, ...], NDArray]]:
    """Group the boundary corners by their shapes.

    Args:
        solid: straight tetrahedra.

    Returns:
        Groups as in :func:`node_patches`, for boundary faces and for faces between
        regions.
    """
    faces = np.concatenate([solid.faces, solid.inner])
    patch = np.r_[solid.patch, solid.inner_patch]
    return node_patches(len(solid.points), faces, patch)


def _meeting_shapes(
    key: tuple[int, ...],
    shapes: tuple[Shape | None, ...],
    walls: Mapping[tuple[int, int], Shape],
    points: NDArray,
) -> tuple[Shape, ...]:
    """Return the shapes that intersect in the common points of several patches."""
    # the common line of tangent shapes is poorly determined, so one shape is replaced
    # by the wall
    standing = {pair: wall for pair, wall in walls.items() if set(pair) <= set(key)}
    replaced = {other for _, other in standing}
    known = [s for p in key if p not in replaced and (s := shapes[p]) is not None]
    if standing:
        facing = shapes[min(standing)[0]]
        known = [s for s in known if s is facing or not _tangent(facing, s, points)]
    return (*known, *standing.values())


def _tangent(one: Shape | None, other: Shape, points: NDArray) -> bool:
    """Return whether two shapes have the same normals at given points."""
    if one is None:
        return False
    along = np.einsum("ni,ni->n", one.signed(points)[1], other.signed(points)[1])
    return bool(np.abs(along).min() > 0.95)


def element_quality(solid: Solid) -> NDArray:
    """Compute the quality of tetrahedra.

    Args:
        solid: straight tetrahedra.

    Returns:
        (t,) [-] quality: 1 for a regular tetrahedron, 0 for a flat tetrahedron, and < 0
        for an inverted tetrahedron.
    """
    return tetrahedra_quality(solid.points[solid.cells])


def tetrahedra_quality(corners: NDArray) -> NDArray:
    """Compute the quality of tetrahedra.

    Args:
        corners: (t, 4, 3) [m] positions of the corners of each tetrahedron.

    Returns:
        (t,) [-] quality: 6 sqrt(2) times the volume, divided by the cube of the root
        mean square of the edge lengths.
    """
    i, j = EDGES.T
    mean_square = np.sum((corners[:, i] - corners[:, j]) ** 2, axis=2).mean(axis=1)
    a, b, c = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.asarray(6 * np.sqrt(2) * volume / np.maximum(mean_square, 1e-300) ** 1.5)


def boundary_faces(cells: NDArray) -> NDArray:
    """Find the boundary faces of tetrahedra.

    Args:
        cells: (t, 4) corners of tetrahedra with positive volume.

    Returns:
        (f, 3) corners of the faces, counterclockwise as seen from outside.
    """
    faces = cells[:, FACES].reshape(-1, 3)
    key = np.sort(faces, axis=1)
    order = np.lexsort(key.T)
    same = (key[order][1:] == key[order][:-1]).all(axis=1)
    alone = np.ones(len(faces), dtype=bool)
    alone[order[1:][same]] = alone[order[:-1][same]] = False
    return faces[alone]


def node_patches(
    nodes: int, members: NDArray, patch: NDArray
) -> list[tuple[tuple[int, ...], NDArray]]:
    """Group nodes by the patches on which they are.

    Args:
        nodes: number of nodes.
        members: (f, k) indices of the nodes of each boundary face.
        patch: (f,) patch number of each boundary face.

    Returns:
        Pairs of a set of patches and the nodes on these patches but on no other patch.
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
    walls: Mapping[tuple[int, int], Shape] | None = None,
) -> NDArray:
    """Move points onto the shapes of their patches.

    Args:
        points: (n, 3) [m] points.
        groups: indices of the points by their patches, from :func:`node_patches`.
        shapes: shapes of the patches.
        reach: [m] largest accepted displacement of a point.
        walls: walls as in :class:`Solid`, or None.

    Returns:
        (n, 3) [m] new positions.
    """
    moved = points.copy()
    for key, group in groups:
        known = _meeting_shapes(key, shapes, walls or {}, points[group])
        if known:
            target = project(points[group], known)
            near = np.linalg.norm(target - points[group], axis=1) <= reach
            moved[group[near]] = target[near]
    return moved


def corners_on_shapes(solid: Solid) -> NDArray:
    """Compute the positions of the corners of a solid on its shapes.

    Args:
        solid: straight tetrahedra.

    Returns:
        (n, 3) [m] positions. A boundary corner is not moved if its distance from its
        shapes exceeds a hundredth of the size of the part.
    """
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    groups = corner_groups(solid)
    return on_shapes(solid.points, groups, solid.shapes, 0.01 * size, solid.walls)


def moved_onto_shapes(solid: Solid) -> Solid:
    """Move corners onto their shapes, as far as no tetrahedron becomes inverted.

    Args:
        solid: straight tetrahedra.

    Returns:
        The solid with the moved corners.
    """
    target = corners_on_shapes(solid)
    share = np.ones(len(target))
    before = solid.volumes()
    for _ in range(12):
        points = solid.points + share[:, None] * (target - solid.points)
        moved = replace(solid, points=points)
        bad = moved.volumes() < 0.1 * before
        if not bad.any():
            break
        share[np.unique(solid.cells[bad])] *= 0.5
    while (bad := moved.volumes() <= 0).any() and (share[solid.cells[bad]] > 0).any():
        share[np.unique(solid.cells[bad])] = 0.0
        points = solid.points + share[:, None] * (target - solid.points)
        moved = replace(solid, points=points)
    return moved
