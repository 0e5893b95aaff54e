"""Recognition of planes, cones, spheres and tori in a surface of triangles.

Between sharp edges, a surface consists of one shape or of several tangent shapes.
Shapes are fitted to a few facets around a facet, the seed. A shape is accepted if
connected facets are on the shape and if they are facets of a curved surface. The second
condition is necessary because the corners of a few flat faces can also be on a circle.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.primitives import (
    Cone,
    Shape,
    Torus,
    fit_cone,
    fit_plane,
    fit_sphere,
    fit_torus,
)
from forcefit.stiffness.surface.triangle_graph import SHARP, TriangleGraph

# maximum numbers of seed facets without a recognised shape in a part: for planes and
# cones, and for all shapes
_MISSES = (60, 20)
# largest relative difference between the areas of congruent facets
_CONGRUENT = 1e-6
_CONE = 10  # smallest number of points that determine a cone
# slope below which a cone is a cylinder, which is determined by seven points
_CYLINDER = 1e-4
_FEW = 12  # smallest number of facets around a surface of revolution
_STEP = 2e-3  # [rad] smallest difference between two distinct angles
_MANY = 5  # smallest number of distinct angles of points on a circle
# smallest ratio of the widths of equally wide facets
_EVEN = 0.75
# A face is flat if the distance between its edges and the smooth surface, relative to
# the median of the part, is larger.
_LIFT = 4.0
# An edge is a ruling of a cone if its distance from the smooth surface, relative to the
# median of the part, is larger.
_RULING = 2.0
# An edge is straight if its distance from the smooth surface, relative to the median of
# the part, is smaller.
_NO_LIFT = 0.01


def recognise(graph: TriangleGraph, part: NDArray) -> list[tuple[NDArray, Shape]]:
    """Recognise the shapes of a part of a surface.

    Args:
        graph: triangle graph of the surface.
        part: (k,) triangles of the part between sharp edges.

    Returns:
        Triangles and shape of each patch of the part. The shape of a patch is a flat
        face or a smooth surface through its facets if no shape is recognised.
    """
    shape = fitted_shape(graph, part)
    if shape is not None and graph.fits(shape, part).all():
        return [(part, shape)]
    found: list[tuple[NDArray, Shape]] = []
    lifts = _Lifts(graph, part)
    for strips, most in zip((True, False), _MISSES, strict=True):
        found += _pieces(graph, lifts, part, strips, most)
        part = np.setdiff1d(part, np.concatenate([part[:0], *(p for p, _ in found)]))
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[part] = True
    for piece in graph.smooth_parts(inside):
        shape = fitted_shape(graph, piece)
        if shape is not None and graph.fits(shape, piece).all():
            found.append((piece, shape))
        else:
            found += _flat_or_lifted(graph, piece)
    return found


class _Lifts:
    """Distances from edges to a single smooth curved surface through all facets."""

    def __init__(self, graph: TriangleGraph, part: NDArray) -> None:
        self._facets = graph.lifted(part)
        self._place = np.zeros(len(graph.points), dtype=int)
        corners = np.unique(graph.triangles[part])
        self._place[corners] = np.arange(len(corners))
        self._usual = max(float(np.median(self._facets.lifts())), 1e-300)

    def share(self, edges: NDArray) -> float:
        """Return the median lift of given edges over the median lift of all edges."""
        own = self._facets.edge_lifts(self._place[edges])
        return float(np.median(own)) / self._usual


def fitted_shape(graph: TriangleGraph, part: NDArray, kinds: int = 4) -> Shape | None:
    """Find the simplest shape with the given facets.

    Args:
        graph: triangle graph of the surface.
        part: (k,) triangles.
        kinds: number of kinds of shapes to fit, in the order plane, cone, sphere,
            torus.

    Returns:
        The shape, or None if no shape fits or there are too few corners.
    """
    points = graph.points[np.unique(graph.triangles[part])]
    normals = graph.normals[part]
    # a shape is first fitted to at most about 50 corners
    few = points[:: max(1, len(points) // 50)]
    tries: list[tuple[Callable[[NDArray, NDArray], Shape], int]] = [
        (fit_plane, 3),
        (fit_cone, 7),
        (fit_sphere, 9),  # the eight corners of a four-sided frustum are on a sphere
        (fit_torus, 12),
    ]
    for fit, least in tries[:kinds]:
        if len(points) < least:
            break
        if len(few) < len(points) and not _lies_on(fit(few, normals), few, graph):
            continue
        shape = fit(points, normals)
        if _lies_on(shape, points, graph):
            straight = not isinstance(shape, Cone) or abs(shape.slope) < _CYLINDER
            if len(points) < _CONE and not straight:
                return None
            return shape if _is_faceted(shape, points) else None
    return None


def _lies_on(shape: Shape, points: NDArray, graph: TriangleGraph) -> bool:
    """Return whether points are on a shape within a tolerance."""
    return bool(np.abs(shape.signed(points)[0]).max() < graph.tolerance)


def _is_faceted(shape: Shape, points: NDArray) -> bool:
    """Return whether points on a shape are corners of facets of a curved surface."""
    # The corners of two adjacent flat faces, or of three symmetric flat faces, are
    # always on a circle. Therefore, many facets or three equally wide facets are
    # required.
    if not isinstance(shape, Cone | Torus):
        return True
    offset = points - shape.point
    along = offset @ shape.axis
    across = offset - along[:, None] * shape.axis
    distance = np.linalg.norm(across, axis=1)
    first = across[int(np.argmax(distance))]
    first = first / max(float(np.linalg.norm(first)), 1e-300)
    second = np.cross(shape.axis, first)
    around = np.arctan2(across @ second, across @ first)
    if not _even(around):
        return False
    if isinstance(shape, Cone):
        return True
    return _even(np.arctan2(along, distance - shape.radius))


def _even(angles: NDArray) -> bool:
    """Return whether angles belong to many facets or to three equally wide facets."""
    angles = np.sort(angles)
    gaps = np.diff(np.r_[angles, angles[0] + 2 * np.pi])
    if gaps[-1] > _STEP:  # the largest gap between angles is outside the arc
        widest = int(np.argmax(gaps))
        outside = gaps[widest] > 1.5 * np.sort(gaps)[-2]
        gaps = np.delete(gaps, widest) if outside else gaps
    gaps = gaps[gaps > _STEP]
    if len(gaps) >= _MANY:
        return True
    return len(gaps) >= 3 and int((gaps > _EVEN * gaps.max()).sum()) >= 3


def _pieces(
    graph: TriangleGraph, lifts: _Lifts, part: NDArray, strips: bool, most: int
) -> list[tuple[NDArray, Shape]]:
    """Find parts on planes, cones, spheres and tori, or only on planes and cones."""
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[part] = True
    waiting, flat = inside.copy(), graph.flat_faces(part)
    area = np.bincount(flat, weights=np.where(inside, graph.areas, 0.0))[flat]
    order = area if strips else _evenness(graph, inside, flat, area)
    found: list[tuple[NDArray, Shape]] = []
    misses, missed = 0, list[int]()
    while waiting.any() and misses < most and graph.tries > 0:
        graph.tries -= 1
        seed = int(np.argmax(np.where(waiting, order, -np.inf)))
        waiting[inside & (flat == flat[seed])] = False
        shapes = _shapes_around(graph, inside, flat, seed, strips)
        for piece, _ in shapes:
            waiting[piece] = False
        shapes = [s for s in shapes if _is_proper(graph, lifts, *s)]
        misses += not shapes
        if not shapes and not strips:
            missed.append(seed)
            if misses == most and (kinds := _kinds(missed, order, area)) is not None:
                # facets that are congruent to seeds without a recognised shape are
                # tried last
                order, misses, missed = np.where(kinds, order - 2.0, order), 0, []
        if shapes:
            best = max(shapes, key=lambda s: float(graph.areas[s[0]].sum()))
            found.append(best)
            inside[best[0]] = False
    return found


def _kinds(missed: list[int], order: NDArray, area: NDArray) -> NDArray | None:
    """Return facets similar to seeds without a shape, or None if these seeds differ."""
    kinds = np.zeros(len(order), dtype=bool)
    count = 0
    for seed in missed:
        if not kinds[seed]:
            same = np.abs(order - order[seed]) < _CONGRUENT * np.abs(order[seed])
            kinds |= same & (np.abs(area - area[seed]) < _CONGRUENT * area[seed])
            kinds[seed] = True
            count += 1
    return kinds if 4 * count <= len(missed) else None


def _evenness(
    graph: TriangleGraph, inside: NDArray, flat: NDArray, area: NDArray
) -> NDArray:
    """Return the smallest ratio of the areas of each face and its neighbours, (m,)."""
    touch = inside[graph.left] & inside[graph.right] & (graph.cosine > SHARP)
    left, right = graph.left[touch], graph.right[touch]
    ratio = np.minimum(area[left], area[right]) / np.maximum(area[left], area[right])
    for _ in range(2):
        least = np.ones(len(flat))
        for side in (left, right):
            np.minimum.at(least, flat[side], ratio)
        even = least[flat]
        ratio = np.minimum(even[left], even[right])
    return even


def _shapes_around(
    graph: TriangleGraph, inside: NDArray, flat: NDArray, seed: int, strips: bool
) -> list[tuple[NDArray, Shape]]:
    """Fit shapes to facets around a seed, and find the facets on each shape."""
    part = np.flatnonzero(inside)
    if strips:
        near = [ring(graph, inside, flat, seed, 0), _chain(graph, inside, flat, seed)]
    else:
        near = [ring(graph, inside, flat, seed, count) for count in (2, 4)]
    found = []
    for members in near:
        shape = fitted_shape(graph, members, 2 if strips else 4)
        if shape is None:
            continue
        on = np.zeros_like(inside)
        on[part] = graph.fits(shape, part)
        label = graph.connected_parts(on, SHARP)
        found.append((np.flatnonzero(on & on[seed] & (label == label[seed])), shape))
    return found


def _is_proper(
    graph: TriangleGraph, lifts: _Lifts, piece: NDArray, shape: Shape
) -> bool:
    """Return whether a shape is not merely a part of a different curved shape."""
    # two coplanar triangles can be a single facet of a different shape
    straight = not isinstance(shape, Cone) or _is_straight(graph, lifts, piece, shape)
    return len(piece) > 2 and straight


def _is_straight(
    graph: TriangleGraph, lifts: _Lifts, piece: NDArray, shape: Cone
) -> bool:
    """Return whether the rulings of a cone are straight lines on the exact surface."""
    # two rings of corners on any surface of revolution are on a cone
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[piece] = True
    both = np.flatnonzero(inside[graph.left] & inside[graph.right])
    middles = graph.points[graph.ends[both]].mean(axis=1)
    rulings = both[np.abs(shape.signed(middles)[0]) < graph.tolerance]
    along = (graph.points[np.unique(graph.ends[rulings])] - shape.point) @ shape.axis
    along = np.sort(along)
    rings = 1 + int((np.diff(along) > 10 * graph.tolerance).sum())
    if rings > 2:
        return True
    share = lifts.share(graph.ends[rulings]) if len(rulings) else 0.0
    return not _NO_LIFT < share < _RULING


def ring(
    graph: TriangleGraph, inside: NDArray, flat: NDArray, seed: int, rings: int
) -> NDArray:
    """Return the flat face of a seed and the faces around it.

    Args:
        graph: triangle graph of the surface.
        inside: (m,) bool, True for triangles that can be included.
        flat: (m,) number of the flat face of each triangle.
        seed: a triangle.
        rings: number of rings of adjacent faces.

    Returns:
        (k,) triangles of the faces.
    """
    members = inside & (flat == flat[seed])
    touch = inside[graph.left] & inside[graph.right] & (graph.cosine > SHARP)
    left, right = graph.left[touch], graph.right[touch]
    for _ in range(rings):
        grown = np.r_[right[members[left]], left[members[right]]]
        members = members | (inside & np.isin(flat, flat[grown]))
    return np.flatnonzero(members)


def _chain(graph: TriangleGraph, inside: NDArray, flat: NDArray, seed: int) -> NDArray:
    """Return the flat face of a seed and two faces on each side of it."""
    # the facets of a cylinder or cone are adjacent at long edges
    touch = inside[graph.left] & inside[graph.right] & (graph.cosine > SHARP)
    left, right = flat[graph.left[touch]], flat[graph.right[touch]]
    length = np.linalg.norm(np.diff(graph.points[graph.ends[touch]], axis=1), axis=2)
    length = length[:, 0]
    chain = [int(flat[seed])]
    for side in (0, 1):
        face = int(flat[seed])
        for _ in range(2):
            other = np.where(left == face, right, np.where(right == face, left, -1))
            common = np.bincount(other[other >= 0], weights=length[other >= 0])
            common[[f for f in chain if f < len(common)]] = 0.0
            if not common.any():
                break
            face = int(np.argmax(common))
            chain = [*chain, face] if side == 0 else [face, *chain]
    return np.flatnonzero(inside & np.isin(flat, chain))


def _flat_or_lifted(graph: TriangleGraph, part: NDArray) -> list[tuple[NDArray, Shape]]:
    """Divide a part of unknown shape into flat faces and smooth surfaces."""
    # The facets of a curved surface have similar lifts, because CAD programs use a
    # tolerance. A facet with a much larger lift is a flat face next to a fillet.
    flat = graph.flat_faces(part)
    faces = np.unique(flat[part])
    if len(faces) < _FEW:
        chosen = faces
    else:
        lifts = graph.lifted(part).lifts()
        highest = np.array([lifts[flat[part] == face].max() for face in faces])
        chosen = faces[highest > _LIFT * np.median(highest)]
    found: list[tuple[NDArray, Shape]] = []
    for face in chosen:
        members = part[flat[part] == face]
        corners = graph.points[np.unique(graph.triangles[members])]
        found.append((members, fit_plane(corners, graph.normals[members])))
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[part[~np.isin(flat[part], chosen)]] = True
    for piece in graph.smooth_parts(inside):
        shape = fitted_shape(graph, piece)
        whole = shape is not None and graph.fits(shape, piece).all()
        found.append((piece, shape if shape and whole else graph.lifted(piece)))
    return found
