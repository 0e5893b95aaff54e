"""Straight-edged tetrahedra of a link, with corners on the exact shapes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.mesh.lagrange import EDGES
from forcefit.stiffness.surface.primitives import Shape, project
from forcefit.stiffness.surface.true_surface import TrueSurface

# corners of each face, ordered so that the normal points outward
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


@dataclass(frozen=True, eq=False)
class Solid:
    """Straight-edged tetrahedra of a link, and the shapes of its boundary.

    Attributes:
        points: (n, 3) [m] corners; they are on the exact shapes as far as these are
        known.
        cells: (t, 4) corners of tetrahedra with positive volume.
        faces: (f, 3) corners of boundary triangles, in outward orientation.
        patch: (f,) number of each face's patch; 0 is the base interface, 1 the tip.
        shapes: shape of each patch; None if the shape is unknown, so that the nodes of
            the patch are not moved.
        walls: wall through the common line of an interface and a patch that continues
            it smoothly, for each such pair, see
            :mod:`forcefit.stiffness.surface.smooth_outline`.
        surface: surface that the mesh approximates; None if the shapes of the patches
            suffice.
        inner: (k, 3) corners of triangles inside the link, between regions.
        inner_patch: (k,) index of the shape of each inner triangle.
        region: (t,) region of each tetrahedron, see
            :mod:`forcefit.stiffness.mesh.regions`; None if the mesh was not cut.
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
        """Return the (t,) [m^3] volumes of the straight tetrahedra."""
        a, b, c, d = np.moveaxis(self.points[self.cells], 1, 0)
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6


def meeting_shapes(
    solid: Solid, key: tuple[int, ...], points: NDArray
) -> tuple[Shape, ...]:
    """Return the shapes on which corners of a solid must lie.

    Args:
        solid: straight tetrahedra.
        key: the patches of the corners; empty for inner corners.
        points: (n, 3) [m] positions of the corners.

    Returns:
        The shapes of the patches, or their substitutes where two patches meet smoothly.
    """
    return _meeting_shapes(key, solid.shapes, solid.walls, points) if key else ()


def corner_groups(solid: Solid) -> list[tuple[tuple[int, ...], NDArray]]:
    """Group the boundary corners by the shapes on which they must lie.

    Args:
        solid: straight tetrahedra.

    Returns:
        Groups as in :func:`node_patches`, for boundary faces and faces between regions.
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
    """Return the shapes that intersect in the points shared by several patches."""
    # tangent shapes determine their common line poorly, but the wall through it does
    standing = {pair: wall for pair, wall in walls.items() if set(pair) <= set(key)}
    replaced = {other for _, other in standing}
    known = [s for p in key if p not in replaced and (s := shapes[p]) is not None]
    if standing:
        facing = shapes[min(standing)[0]]
        known = [s for s in known if s is facing or not _tangent(facing, s, points)]
    return (*known, *standing.values())


def _tangent(one: Shape | None, other: Shape, points: NDArray) -> bool:
    """Check whether two shapes have the same normals at given points."""
    if one is None:
        return False
    along = np.einsum("ni,ni->n", one.signed(points)[1], other.signed(points)[1])
    return bool(np.abs(along).min() > 0.95)


def element_quality(solid: Solid) -> NDArray:
    """Compute the quality of tetrahedra.

    Args:
        solid: straight tetrahedra.

    Returns:
        (t,) [-] 1 for a regular tetrahedron, 0 for a flat one, negative for an inverted
        one.
    """
    return tetrahedra_quality(solid.points[solid.cells])


def tetrahedra_quality(corners: NDArray) -> NDArray:
    """Compute the quality of tetrahedra: 6 sqrt(2) volume over the cubed rms edge.

    Args:
        corners: (t, 4, 3) [m] positions of the corners.

    Returns:
        (t,) [1] quality.
    """
    i, j = EDGES.T
    mean_square = np.sum((corners[:, i] - corners[:, j]) ** 2, axis=2).mean(axis=1)
    a, b, c = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.asarray(6 * np.sqrt(2) * volume / np.maximum(mean_square, 1e-300) ** 1.5)


def boundary_faces(cells: NDArray) -> NDArray:
    """Find the faces that belong to a single tetrahedron.

    Args:
        cells: (t, 4) corners of tetrahedra with positive volume.

    Returns:
        (f, 3) corners of the faces, in outward orientation.
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
    """Group nodes by the set of patches on which they lie.

    Args:
        nodes: number of nodes.
        members: (f, k) nodes of each boundary face.
        patch: (f,) patch of each face.

    Returns:
        Pairs of a set of patches and the nodes on exactly these patches.
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
        groups: points by their patches.
        shapes: shapes of the patches.
        reach: [m] largest displacement of a point.
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
    """Project the corners of a solid onto its shapes.

    Args:
        solid: solid whose corners may be off the shapes of their patches.

    Returns:
        (n, 3) [m] positions. A boundary corner farther from its shapes than a hundredth
        of the part's size is not moved.
    """
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    groups = corner_groups(solid)
    return on_shapes(solid.points, groups, solid.shapes, 0.01 * size, solid.walls)


def moved_onto_shapes(solid: Solid) -> Solid:
    """Move corners onto their shapes, less so where tetrahedra would be inverted.

    Args:
        solid: solid whose corners may be off the shapes of their patches.

    Returns:
        The solid with moved corners.
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
