r"""Layers of thin elements along the edges at which the stress is singular.

Near an edge that is clamped on one side and free on the other, or near a re-entrant
edge of the part, strains increase as r^(a - 1) with a < 1.  There, polynomials on
elements of one size converge slowly, whatever their degree.  A layer of elements that
is thin across the edge, and as long as its neighbours along it, costs little and
removes most of the error.

A tetrahedron with an edge on a singular edge is cut at the same share of its other
edges, measured from the singular edge.  It becomes a wedge along the edge and a
remainder.  A tetrahedron with only a corner on a singular edge becomes a small
tetrahedron and a remainder.  Neighbours cut their common face at the same points.  The
cuts are made in the coordinates of the curved element, so that thin layers follow a
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
# ratio of layer thickness to element size; 0.15 to 0.3 are equally accurate
LAYER_SHARE = 0.25
# largest number of passes that split joining edges; 3 to 12 suffice for meshes/
_PASSES = 100
# cosine of 35 degrees: a flatter re-entrant edge is hardly singular
_REENTRANT = np.cos(np.radians(35.0))
# edges that are cut at a singular corner or edge; singular corners are first
_CUT_EDGES = {1: [[0, 1], [0, 2], [0, 3]], 2: [[0, 2], [0, 3], [1, 2], [1, 3]]}
# Parts, by corners 0 to 3 and by cuts in the order above from 4: a small tetrahedron
# and a prism, or two prisms.  Each prism becomes three tetrahedra by the diagonals that
# start at the smallest number of each side, so that neighbours agree (Dompierre et al.
# 1999). Corner numbers increase and cut numbers follow them, so the diagonals are the
# same in all tetrahedra.
_PARTS = {
    1: np.array([[0, 4, 5, 6], [1, 3, 2, 6], [1, 6, 2, 5], [1, 6, 5, 4]]),
    2: np.array([
        [0, 4, 5, 7], [0, 4, 7, 6], [0, 6, 7, 1],
        [2, 4, 6, 7], [2, 4, 7, 5], [2, 5, 7, 3],
    ]),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Parts:
    """A solid's tetrahedra cut into smaller ones.

    Attributes:
        corners: (t, 4) numbers of the parts' corners, increasing in each row; numbers
            below the solid's count are corners of the solid.
        places: (t, 4, 4) barycentric coordinates of the corners in their parent
            tetrahedron, whose corners are in increasing order.
        parent: (t,) tetrahedron of the solid that contains each part.
    """

    corners: NDArray
    places: NDArray
    parent: NDArray


def whole_elements(solid: Solid) -> Parts:
    """Return each tetrahedron as a single part."""
    count = len(solid.cells)
    places = np.broadcast_to(np.eye(4), (count, 4, 4))
    return Parts(np.sort(solid.cells, axis=1), places, np.arange(count))


def singular_edges(solid: Solid, held: tuple[int, ...]) -> NDArray:
    """Return the edges of a solid at which stresses are singular.

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
    # two bodies that touch have an edge with four faces, of which any pairing is valid
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
    """Return singular edges, and edges between materials at the boundary.

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
    """Split the edges that join two singular edges.

    Args:
        solid: solid with patches.
        held: patches that are clamped or loaded.
        regions: regions of the link.

    Returns:
        A solid whose tetrahedra each have at most one corner or one edge on the
        singular edges; a few have more if more than a hundred passes would be needed.
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
        # of a triangle with three singular edges, the longest edge is split too
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
        # edges that are the longest joining edge of all their tetrahedra are first
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
        share: thickness of the layer, as a share of each edge from its singular end.
        regions: regions of the link.

    Returns:
        The parts; tetrahedra that touch no singular edge remain whole.
    """
    parts = whole_elements(solid)
    count = len(solid.points)
    touched = np.zeros(count, dtype=bool)
    touched[graded_edges(solid, held, regions)] = True
    # corners of tetrahedra that touch several singular edges get no graded layer
    while (several := touched[parts.corners].sum(axis=1) > 2).any():
        touched[parts.corners[several]] = False
    on = touched[parts.corners]
    # singular corners are first; the orientation does not matter
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
