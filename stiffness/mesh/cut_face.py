"""Splitting of a mesh along a plane or a curved face inside a link.

First, tetrahedra that are too large to follow a curved face are bisected. Corners near
the face are then moved onto the face, and edges that still cross the face are split.
Edges that pass the border of the face at a small distance are also split.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.lagrange import FACES
from forcefit.stiffness.mesh.refine import edge_code, edges_of, refine, split_edges
from forcefit.stiffness.mesh.solid import (
    Solid,
    corner_groups,
    meeting_shapes,
    moved_onto_shapes,
)
from forcefit.stiffness.mesh.split_crossing import one_of_each, split_crossing
from forcefit.stiffness.surface.facets import Facets
from forcefit.stiffness.surface.primitives import Plane, Shape, project

# largest distance from the face at which a corner is moved onto the face, relative to
# the shortest edge at the corner
_NEAR = 0.3
_REACH = 0.005  # largest displacement of a corner, relative to the size of the part
# smallest accepted ratio of the volumes of a tetrahedron after and before its corners
# are moved
_LEAST = 0.2
# distance below which a corner is on the face, relative to the size of the part
ON_FACE = 1e-6
# cosine of the largest angle between the normals of a curved face at the ends of an
# edge
_TURN = np.cos(np.radians(35.0))
_PASSES = 12  # maximum number of passes to bisect large tetrahedra
_HALVINGS = 12  # number of bisections to locate where an edge crosses a curved face


@dataclass(frozen=True, eq=False)
class CutFace:
    """A face inside a link, at which elements are split.

    Attributes:
        shape: shape of the face.
        facets: facets that bound the face; None if the face is the whole shape.
    """

    shape: Shape
    facets: Facets | None = None

    def is_near(self, points: NDArray, reach: NDArray) -> NDArray:
        """Return whether each point is near the face.

        Args:
            points: (n, 3) [m] points.
            reach: (n,) [m] distance below which each point is near the face.

        Returns:
            (n,) bool, True for a point near the face.
        """
        near = np.abs(self.shape.signed(points)[0]) <= reach
        if self.facets is not None and near.any():
            near[near] = self.facets.distance(points[near]) <= reach[near]
        return near


def faces_inside(cells: NDArray) -> tuple[NDArray, NDArray]:
    """Find the faces between two tetrahedra.

    Args:
        cells: (t, 4) corners of the tetrahedra.

    Returns:
        Corners of each face, (f, 3), and its two tetrahedra, (f, 2).
    """
    faces = np.sort(cells[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T)
    same = np.flatnonzero((faces[order][1:] == faces[order][:-1]).all(axis=1))
    owners = np.column_stack([order[same], order[same + 1]]) // len(FACES)
    return faces[order[same]], owners


def face_code(corners: NDArray, points: int) -> NDArray:
    """Return a number that identifies each triangle, whatever the order of its corners.

    Args:
        corners: (..., 3) corners of triangles.
        points: number of points in the mesh.

    Returns:
        (...) numbers.
    """
    total = np.int64(points)
    a, b, c = np.moveaxis(np.sort(corners, axis=-1), -1, 0)
    return np.asarray((a * total + b) * total + c)


def cut(solid: Solid, face: CutFace) -> Solid:
    """Split a mesh along a face.

    Args:
        solid: straight tetrahedra.
        face: face inside the solid.

    Returns:
        The split solid. Its ``inner`` triangles include those on the face.
    """
    if not isinstance(face.shape, Plane):
        solid = _resolved(solid, face)
    solid, on = _onto(solid, face)

    def crossing(finer: Solid, on: NDArray, ends: NDArray) -> tuple[NDArray, NDArray]:
        return _crossing(finer, face, on, ends)

    return _with_cut(*split_crossing(solid, on, crossing), face)


def without_chords(solid: Solid) -> Solid:
    """Split edges inside the solid that have both ends on a curved face.

    Args:
        solid: straight tetrahedra.

    Returns:
        The solid without such edges. Otherwise, a tetrahedron with two faces on the
        curved face would become flat.
    """
    for number in np.unique(solid.inner_patch):
        if isinstance(solid.shapes[number], Plane):
            continue
        for _ in range(_PASSES):
            ends, of_cell = edges_of(solid.cells, len(solid.points))
            inner = solid.inner[solid.inner_patch == number]
            on = np.zeros(len(solid.points), dtype=bool)
            on[inner] = True
            sides = np.sort(inner[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
            code = edge_code(ends, len(on))
            chord = on[ends].all(axis=1) & ~np.isin(code, edge_code(sides, len(on)))
            if not chord.any():
                break
            split = one_of_each(chord, of_cell)
            solid, _ = split_edges(solid, ends, of_cell, split)
    return solid


def _resolved(solid: Solid, face: CutFace) -> Solid:
    """Bisect tetrahedra that are too large to follow a curved face."""
    for _ in range(_PASSES):
        ends, of_cell = edges_of(solid.cells, len(solid.points))
        start, end = solid.points[ends].swapaxes(0, 1)
        length = np.linalg.norm(end - start, axis=1)
        (low, first), (high, last) = map(face.shape.signed, (start, end))
        touching = np.minimum(np.abs(low), np.abs(high)) < length
        turning = touching & (np.einsum("ei,ei->e", first, last) < _TURN)
        middle = (start + end) / 2
        across = face.shape.signed(middle)[0]
        same_side = low * high >= 0
        turning |= same_side & (across * (low + high) < 0) & (
            np.abs(across) > 0.05 * length
        )  # fmt: skip
        turning[turning] = face.is_near(middle[turning], length[turning])
        if not turning.any():
            break
        wanted = turning[of_cell].any(axis=1)
        solid = refine(solid, wanted.astype(int)).solid
    return solid


def _crossing(
    solid: Solid, face: CutFace, on: NDArray, ends: NDArray
) -> tuple[NDArray, NDArray]:
    """Return which edges cross the face, and at which fraction, both (e,)."""
    value = np.where(on, 0.0, face.shape.signed(solid.points)[0])
    low, high = value[ends].T
    across = low * high < 0
    share = np.full(len(ends), 0.5)
    if not across.any():
        return across, share
    start, end = solid.points[ends[across]].swapaxes(0, 1)
    found = _share_of_crossing(face.shape, start, end, low[across], high[across])
    share[across] = found
    if face.facets is not None:
        # only edges near the face are evaluated
        _, of_cell = edges_of(solid.cells, len(solid.points))
        length = np.linalg.norm(np.diff(solid.points[ends], axis=1)[:, 0], axis=1)
        reach = np.zeros(len(ends))
        longest = length[of_cell].max(axis=1)
        for k in range(6):
            np.maximum.at(reach, of_cell[:, k], longest)
        places = start + found[:, None] * (end - start)
        across[across] = face.is_near(places, reach[across])
    return across, share


def _share_of_crossing(
    shape: Shape, start: NDArray, end: NDArray, low: NDArray, high: NDArray
) -> NDArray:
    """Find the fraction of each edge at which the edge crosses a shape, (e,)."""
    left, right = np.zeros(len(low)), np.ones(len(low))
    for _ in range(0 if isinstance(shape, Plane) else _HALVINGS):
        middle = (left + right) / 2
        value = shape.signed(start + middle[:, None] * (end - start))[0]
        before = value * low > 0
        left, low = np.where(before, middle, left), np.where(before, value, low)
        right, high = np.where(before, right, middle), np.where(before, high, value)
    part = np.divide(low, low - high, out=np.full_like(low, 0.5), where=low != high)
    return np.asarray(left + part * (right - left))


def _with_cut(solid: Solid, on: NDArray, face: CutFace) -> Solid:
    """Add the triangles on a face to the ``inner`` triangles of a solid."""
    number, count = len(solid.shapes), len(solid.points)
    solid = replace(solid, shapes=(*solid.shapes, face.shape))
    faces, owners = faces_inside(solid.cells)
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    known = face_code(solid.inner, count)
    for _ in range(2):  # other corners can be on the face after a move
        value = face.shape.signed(solid.points)[0]
        on |= np.abs(value) < ON_FACE * size
        side = np.sign(np.where(on, 0.0, value)[solid.cells].sum(axis=1))
        new = on[faces].all(axis=1) & (side[owners].prod(axis=1) < 0)
        new &= ~np.isin(face_code(faces, count), known)
        known = np.r_[known, face_code(faces[new], count)]
        inner = np.concatenate([solid.inner, faces[new]])
        patch = np.r_[solid.inner_patch, np.full(int(new.sum()), number)]
        solid = moved_onto_shapes(replace(solid, inner=inner, inner_patch=patch))
    return solid


def _onto(solid: Solid, face: CutFace) -> tuple[Solid, NDArray]:
    """Move corners near a face onto the face, and find the corners on it."""
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    height = np.abs(face.shape.signed(solid.points)[0])
    ends, _ = edges_of(solid.cells, len(solid.points))
    start, end = solid.points[ends].swapaxes(0, 1)
    length = np.linalg.norm(end - start, axis=1)
    reach, longest = np.full(len(solid.points), _REACH * size), 0 * height
    for k in (0, 1):
        np.minimum.at(reach, ends[:, k], _NEAR * length)
        np.maximum.at(longest, ends[:, k], length)
    near = height < reach
    near[near] = face.is_near(solid.points[near], longest[near])
    # corners slightly beyond the border of the face are moved too
    near |= height < ON_FACE * size
    target, on = _targets(solid, face.shape, near, reach, ON_FACE * size)
    already, before = on & (height < ON_FACE * size), solid.volumes()
    while True:
        moved = replace(solid, points=np.where(on[:, None], target, solid.points))
        bad = np.unique(solid.cells[moved.volumes() < _LEAST * before])
        if not (on[bad] & ~already[bad]).any():
            return moved, on
        on[bad] &= already[bad]


def _targets(
    solid: Solid, shape: Shape, near: NDArray, reach: NDArray, close: float
) -> tuple[NDArray, NDArray]:
    """Return target positions, (n, 3) [m], and which corners can be moved, (n,)."""
    # corners on the boundary or on other inner faces stay on their shapes
    target, on = solid.points.copy(), np.zeros(len(near), dtype=bool)
    free = near.copy()
    groups = [(key, group[near[group]]) for key, group in corner_groups(solid)]
    for _, group in groups:
        free[group] = False
    for key, group in [*groups, ((), np.flatnonzero(free))]:
        if not len(group):
            continue
        known = meeting_shapes(solid, key, solid.points[group])
        fixed = any(solid.shapes[number] is None for number in key)
        place = solid.points[group] if fixed else project(
            solid.points[group], (*known, shape)
        )  # fmt: skip
        off = np.max([np.abs(s.signed(place)[0]) for s in (*known, shape)], axis=0)
        moved = np.linalg.norm(place - solid.points[group], axis=1)
        good = (off < close) & (moved <= np.maximum(3 * reach[group], close))
        target[group[good]], on[group[good]] = place[good], True
    return target, on
