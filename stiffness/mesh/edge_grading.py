r"""Layers of thin elements along edges at which the stress is singular.

Strains increase as r^(a - 1) with a < 1 near two kinds of edges: re-entrant edges of
the part, and edges that separate a clamped from a free face.  Elements of uniform size
converge slowly there, regardless of their polynomial degree. A layer of elements that
are thin across the edge, and as long along it as their neighbours, removes most of the
error at little cost.

A tetrahedron with an edge on a singular edge is cut into a wedge along this edge and a
remaining part.  The cut divides its remaining edges in the same ratio, measured from
the singular edge.  A tetrahedron with only a corner on a singular edge is cut into a
small tetrahedron and a remaining part.  Neighbours cut their common face at the same
points. Cuts are made in the coordinates of the curved element, so thin layers follow a
round edge.
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

ENDS = (0, 1)  # patches of base and tip; distributed tractions end at their outlines
# ratio of layer thickness to element size; values from 0.15 to 0.3 are equally accurate
LAYER_SHARE = 0.25
# largest number of passes to split edges between singular edges; 3 to 12 suffice for
# the parts in meshes/
_PASSES = 100
# cosine of 35 degrees: the stress at a flatter re-entrant edge is hardly singular
_REENTRANT = np.cos(np.radians(35.0))
# edges that are cut, for a singular corner or a singular edge; singular corners first
_CUT_EDGES = {1: [[0, 1], [0, 2], [0, 3]], 2: [[0, 2], [0, 3], [1, 2], [1, 3]]}
# Pieces of a cut tetrahedron: a small tetrahedron and a prism, or two prisms.  Corners
# are numbered 0 to 3, and cut points from 4 on, in the order above. Each prism is
# divided into three tetrahedra. The diagonal of each side starts at the smallest
# number, so that neighbours agree (Dompierre et al. 1999). Because corner numbers
# increase and cut points come last, the diagonals are the same in all tetrahedra.
_PARTS = {
    1: np.array([[0, 4, 5, 6], [1, 3, 2, 6], [1, 6, 2, 5], [1, 6, 5, 4]]),
    2: np.array([
        [0, 4, 5, 7], [0, 4, 7, 6], [0, 6, 7, 1],
        [2, 4, 6, 7], [2, 4, 7, 5], [2, 5, 7, 3],
    ]),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Parts:
    """Tetrahedra of a solid, cut into smaller tetrahedra (parts).

    Attributes:
        corners: (t, 4) numbers of the parts' corners, increasing in each row; a number
            below the number of the solid's points denotes a corner of the solid.
        places: (t, 4, 4) barycentric coordinates of the corners in their parent
            tetrahedron, whose corners are in increasing order.
        parent: (t,) tetrahedron of the solid that contains each part.
    """

    corners: NDArray
    places: NDArray
    parent: NDArray


def whole_elements(solid: Solid) -> Parts:
    """Return all tetrahedra uncut, each as a single part."""
    count = len(solid.cells)
    places = np.broadcast_to(np.eye(4), (count, 4, 4))
    return Parts(np.sort(solid.cells, axis=1), places, np.arange(count))


def singular_edges(solid: Solid, held: tuple[int, ...]) -> NDArray:
    """Find the edges of a solid at which stresses are singular.

    Args:
        solid: solid with patches.
        held: patches that are clamped or loaded.

    Returns:
        (e, 2) corners of the edges: outlines of the clamped patches, and re-entrant
        edges between patches that meet at more than 215 degrees.
    """
    count = len(solid.points)
    pairs = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    code = edge_code(pairs, count).ravel()
    order = np.argsort(code, kind="stable")
    code, owner = code[order], order // 3
    # where two bodies touch, an edge has four faces, and any pairing of them is valid
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
    """Find the singular edges, including boundary edges between two materials.

    Args:
        solid: solid with patches.
        held: patches that are clamped or loaded.
        regions: regions of the link.

    Returns:
        (e, 2) corners of the edges.
    """
    both = (singular_edges(solid, held), material_edges(solid, regions))
    return np.unique(np.concatenate(both), axis=0) if len(both[1]) else both[0]


def split_joining_edges(
    solid: Solid, held: tuple[int, ...], regions: tuple[Region, ...] = ()
) -> Solid:
    """Split the edges that connect two singular edges.

    Args:
        solid: solid with patches.
        held: patches that are clamped or loaded.
        regions: regions of the link.

    Returns:
        A solid in which each tetrahedron has at most one corner or one edge on singular
        edges, except for a few that may remain after a hundred passes.
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
        # if a triangle has three singular edges, its longest edge is split too
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
        # first split edges that are the longest such edge in all their tetrahedra
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
    """Cut a layer of thin parts along the singular edges.

    Args:
        solid: result of :func:`split_joining_edges`.
        held: patches that are clamped or loaded.
        share: thickness of the layer, as a fraction of each edge from its singular end.
        regions: regions of the link.

    Returns:
        The parts. Tetrahedra without a singular corner or edge remain uncut.
    """
    parts = whole_elements(solid)
    count = len(solid.points)
    touched = np.zeros(count, dtype=bool)
    touched[graded_edges(solid, held, regions)] = True
    # tetrahedra that touch several singular edges are not cut
    while (several := touched[parts.corners].sum(axis=1) > 2).any():
        touched[parts.corners[several]] = False
    on = touched[parts.corners]
    # singular corners come first; the orientation of the tetrahedron is irrelevant
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
