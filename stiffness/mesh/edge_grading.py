r"""Thin elements along edges at which the stress is singular.

At a distance r from a singular edge, strains are proportional to r^(a - 1) with a < 1.
Singular edges are re-entrant edges of the part, and edges between a clamped and a free
face. Elements of uniform size converge slowly at such edges. A layer of thin elements
along the edge removes most of the error.

A tetrahedron with one edge on a singular edge is divided into a wedge along this edge
and a second part. A tetrahedron with one corner on a singular edge is divided into a
small tetrahedron and a second part. The points of division are at the same fraction of
each edge, so that neighbours are divided at the same points. They are defined in the
coordinates of the curved element, so that the layer follows a curved edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.refine import (
    chosen_by_all,
    edge_code,
    edges_of,
    length_ranks,
    split_edges,
)
from forcefit.stiffness.mesh.regions import Region, material_edges
from forcefit.stiffness.mesh.solid import Solid, moved_onto_shapes

ENDS = (0, 1)  # patches of base and tip, at whose outlines the stress is singular
# ratio of layer thickness to element size; results are similar from 0.15 to 0.3
LAYER_SHARE = 0.25
# maximum number of passes to split edges; 3 to 12 suffice for the parts in meshes/
_PASSES = 100
# cosine of the smallest angle by which a re-entrant edge exceeds 180 degrees
_REENTRANT = np.cos(np.radians(35.0))
# edges that are divided in a tetrahedron with one or two corners on singular edges,
# which have the lowest corner numbers
_CUT_EDGES = {1: [[0, 1], [0, 2], [0, 3]], 2: [[0, 2], [0, 3], [1, 2], [1, 3]]}
# A divided tetrahedron consists of a small tetrahedron and a prism, or of two prisms.
# Corners have the numbers 0 to 3, and the points on divided edges have the next
# numbers. Each prism consists of three tetrahedra. The diagonal of each side starts at
# the point with the smallest number, so that neighbours have the same diagonal
# (Dompierre et al. 1999).
_PARTS = {
    1: np.array([[0, 4, 5, 6], [1, 3, 2, 6], [1, 6, 2, 5], [1, 6, 5, 4]]),
    2: np.array([
        [0, 4, 5, 7], [0, 4, 7, 6], [0, 6, 7, 1],
        [2, 4, 6, 7], [2, 4, 7, 5], [2, 5, 7, 3],
    ]),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts into which the tetrahedra of a solid are divided.

    Attributes:
        corners: (t, 4) corners of each part, in increasing order. The corners of the
            solid have the lowest numbers.
        places: (t, 4, 4) barycentric coordinates of the corners of each part in its
            tetrahedron, whose corners are in increasing order.
        parent: (t,) index of the tetrahedron that contains each part.
    """

    corners: NDArray
    places: NDArray
    parent: NDArray


def whole_elements(solid: Solid) -> Parts:
    """Return each tetrahedron of a solid as a single part."""
    count = len(solid.cells)
    places = np.broadcast_to(np.eye(4), (count, 4, 4))
    return Parts(np.sort(solid.cells, axis=1), places, np.arange(count))


def singular_edges(solid: Solid, held: tuple[int, ...]) -> NDArray:
    """Find the edges at which stresses are singular.

    Args:
        solid: straight tetrahedra.
        held: numbers of the patches that are clamped or loaded.

    Returns:
        (e, 2) corners of each edge. Singular edges are the outlines of the clamped or
        loaded patches, and edges with an inner angle above 215 degrees.
    """
    count = len(solid.points)
    pairs = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    code = edge_code(pairs, count).ravel()
    order = np.argsort(code, kind="stable")
    code, owner = code[order], order // 3
    # an edge that is common to two bodies has four faces, which can be paired in any
    # order
    code, left, right = code[::2], owner[::2], owner[1::2]
    border = solid.patch[left] != solid.patch[right]
    clamped = np.isin(solid.patch[left], held) | np.isin(solid.patch[right], held)
    corners = solid.points[solid.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    across = corners.mean(axis=1)[right] - corners.mean(axis=1)[left]
    reentrant = np.einsum("ij,ij->i", across, normal[left]) > 0
    reentrant &= np.einsum("ij,ij->i", normal[left], normal[right]) < _REENTRANT
    chosen = code[border & (clamped | reentrant)]
    return np.column_stack([chosen // count, chosen % count])


def graded_edges(
    solid: Solid, held: tuple[int, ...], regions: tuple[Region, ...]
) -> NDArray:
    """Find the singular edges, including those between two materials.

    Args:
        solid: straight tetrahedra.
        held: numbers of the patches that are clamped or loaded.
        regions: regions of the link.

    Returns:
        (e, 2) corners of each edge.
    """
    both = (singular_edges(solid, held), material_edges(solid, regions))
    return np.unique(np.concatenate(both), axis=0) if len(both[1]) else both[0]


def split_joining_edges(
    solid: Solid, held: tuple[int, ...], regions: tuple[Region, ...] = ()
) -> Solid:
    """Split edges that connect two singular edges.

    Args:
        solid: straight tetrahedra.
        held: numbers of the patches that are clamped or loaded.
        regions: regions of the link.

    Returns:
        The split solid. Nearly all of its tetrahedra have at most one corner or one
        edge on singular edges.
    """
    settled = False
    for _ in range(_PASSES):
        count = len(solid.points)
        singular = edge_code(graded_edges(solid, held, regions), count)
        touched = np.zeros(count, dtype=bool)
        touched[singular // count] = touched[singular % count] = True
        ends, of_cell = edges_of(solid.cells, count)
        joining = touched[ends].all(axis=1)
        rank = length_ranks(solid.points, ends)
        # if three singular edges form a triangle, the longest edge is split too
        triangle = joining[of_cell].sum(axis=1) > 2
        longest = np.where(joining, rank, -1)[of_cell].argmax(axis=1)
        longest = of_cell[np.arange(len(of_cell)), longest]
        joining &= ~np.isin(edge_code(ends, count), singular)
        triangle &= ~joining[of_cell].any(axis=1)
        joining[longest[triangle]] = True
        if not joining.any():
            if settled:
                return solid
            solid, settled = moved_onto_shapes(solid), True
            continue
        # an edge is split first if it is the longest edge to split in all adjacent
        # tetrahedra
        rank[~joining] = -1
        highest = rank[of_cell].max(axis=1)
        own = rank[of_cell] == np.maximum(highest, 0)[:, None]
        split = joining & chosen_by_all(of_cell, of_cell[own], len(ends))
        solid, _ = split_edges(solid, ends, of_cell, split)
        settled = False
    return moved_onto_shapes(solid)


def layered(
    solid: Solid,
    held: tuple[int, ...],
    share: float = LAYER_SHARE,
    regions: tuple[Region, ...] = (),
) -> Parts:
    """Divide the tetrahedra along singular edges.

    Args:
        solid: result of :func:`split_joining_edges`.
        held: numbers of the patches that are clamped or loaded.
        share: thickness of the layer of thin elements, as a fraction of each divided
            edge.
        regions: regions of the link.

    Returns:
        The parts of all tetrahedra.
    """
    parts = whole_elements(solid)
    count = len(solid.points)
    touched = np.zeros(count, dtype=bool)
    touched[graded_edges(solid, held, regions)] = True
    # tetrahedra that touch several singular edges are not divided
    while (several := touched[parts.corners].sum(axis=1) > 2).any():
        touched[parts.corners[several]] = False
    on = touched[parts.corners]
    # corners on singular edges come first
    order = np.argsort(~on, axis=1, kind="stable")
    corners = np.take_along_axis(parts.corners, order, axis=1)
    places = np.take_along_axis(parts.places, order[:, :, None], axis=1)
    kinds = on.sum(axis=1)
    cut = np.unique(
        np.concatenate([
            edge_code(corners[kinds == k][:, pairs].reshape(-1, 2), count)
            for k, pairs in _CUT_EDGES.items()
        ])
    )
    pieces = [(corners[kinds == 0], places[kinds == 0], parts.parent[kinds == 0])]
    for kind, pairs in _CUT_EDGES.items():
        own, near = corners[kinds == kind], places[kinds == kind]
        new = count + np.searchsorted(cut, edge_code(own[:, pairs], count))
        start, end = np.array(pairs).T
        between = (1 - share) * near[:, start] + share * near[:, end]
        own, near = np.hstack([own, new]), np.concatenate([near, between], axis=1)
        members = _PARTS[kind]
        pieces.append((
            own[:, members].reshape(-1, 4),
            near[:, members].reshape(-1, 4, 4),
            np.repeat(parts.parent[kinds == kind], len(members)),
        ))
    corners, places, parent = (np.concatenate(v) for v in zip(*pieces, strict=True))
    order = np.argsort(corners, axis=1)
    corners = np.take_along_axis(corners, order, axis=1)
    return Parts(corners, np.take_along_axis(places, order[:, :, None], axis=1), parent)
