"""Local refinement of tetrahedra by longest-edge bisection (Rivara).

An edge is split only if it is the longest edge of all adjacent tetrahedra. Otherwise,
the adjacent tetrahedra are split first, so that the mesh is always conforming. New
corners on the boundary are moved onto the shape of their patch.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.lagrange import EDGES
from forcefit.stiffness.mesh.solid import Solid, moved_onto_shapes

_TRIANGLE = np.array([[0, 1], [1, 2], [0, 2]])


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined solid.

    Attributes:
        solid: the finer solid.
        parent: (t,) index of the tetrahedron before refinement that contains each
            tetrahedron.
    """

    solid: Solid
    parent: NDArray


def refine(solid: Solid, halvings: NDArray) -> Refined:
    """Bisect tetrahedra, and their neighbours as required for a conforming mesh.

    Args:
        solid: straight tetrahedra.
        halvings: (t,) number of successive bisections of each tetrahedron.

    Returns:
        The refined solid.
    """
    parent, need = np.arange(len(solid.cells)), np.array(halvings, dtype=int)
    while (need > 0).any():
        ends, of_cell = edges_of(solid.cells, len(solid.points))
        split = _terminal_edges(solid.points, ends, of_cell, need > 0)
        solid, row = split_edges(solid, ends, of_cell, split)
        need[row] = np.maximum(need[row] - 1, 0)
        need, parent = np.r_[need, need[row]], np.r_[parent, parent[row]]
    return Refined(moved_onto_shapes(solid), parent)


def split_edges(
    solid: Solid,
    ends: NDArray,
    of_cell: NDArray,
    split: NDArray,
    places: NDArray | None = None,
) -> tuple[Solid, NDArray]:
    """Split edges, of which each tetrahedron has at most one.

    Args:
        solid: straight tetrahedra. New corners are not moved onto the shapes.
        ends: (e, 2) corners of all edges, from :func:`edges_of`.
        of_cell: (t, 6) edges of each tetrahedron, from :func:`edges_of`.
        split: (e,) bool, True for edges to split.
        places: (k, 3) [m] positions of the new corners. By default, they are the
            midpoints of the edges.

    Returns:
        The solid, and the indices of the bisected tetrahedra, (r,). The first half of
        each has the same index as before. The second halves are appended in this order.
    """
    count = len(solid.points)
    middle = np.full(len(ends), -1)
    middle[split] = count + np.arange(split.sum())
    if places is None:
        places = solid.points[ends[split]].mean(axis=1)
    points = np.concatenate([solid.points, places])
    code = edge_code(ends, count)

    def halved(faces: NDArray, patch: NDArray) -> tuple[NDArray, NDArray]:
        pairs = np.sort(faces[:, _TRIANGLE], axis=2)
        of_face = np.searchsorted(code, edge_code(pairs, count))
        finer, row = _halved(faces, middle[of_face], _TRIANGLE)
        return finer, np.r_[patch, patch[row]]

    faces, patch = halved(solid.faces, solid.patch)
    inner, inner_patch = halved(solid.inner, solid.inner_patch)
    cells, row = _halved(solid.cells, middle[of_cell], EDGES)
    region = None if solid.region is None else np.r_[solid.region, solid.region[row]]
    finer = replace(
        solid,
        points=points,
        cells=cells,
        faces=faces,
        patch=patch,
        inner=inner,
        inner_patch=inner_patch,
        region=region,
    )
    return finer, row


def edges_of(cells: NDArray, points: int) -> tuple[NDArray, NDArray]:
    """Find the edges of tetrahedra.

    Args:
        cells: (t, 4) corners.
        points: total number of corners.

    Returns:
        Corners of each edge, (e, 2), and edges of each tetrahedron, (t, 6).
    """
    ends = np.sort(cells[:, EDGES].reshape(-1, 2), axis=1)
    code, index = np.unique(edge_code(ends, points), return_inverse=True)
    ends = np.column_stack([code // points, code % points])
    return ends, index.reshape(-1, 6)


def edge_code(ends: NDArray, points: int) -> NDArray:
    """Return a number that identifies each edge.

    Args:
        ends: (..., 2) corners of each edge.
        points: total number of corners.

    Returns:
        (...) numbers, which are in the lexicographic order of the corners.
    """
    return np.asarray(ends[..., 0] * np.int64(points) + ends[..., 1])


def length_ranks(points: NDArray, ends: NDArray) -> NDArray:
    """Return the rank of each edge by length.

    Args:
        points: (n, 3) [m] positions of the corners.
        ends: (e, 2) corners of each edge.

    Returns:
        (e,) ranks; 0 for the shortest edge. Of two equally long edges, the first has
        the lower rank.
    """
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    rank = np.empty(len(ends), dtype=int)
    rank[np.lexsort((np.arange(len(ends)), length))] = np.arange(len(ends))
    return rank


def chosen_by_all(of_cell: NDArray, chosen: NDArray, edges: int) -> NDArray:
    """Find the edges that are selected in all adjacent tetrahedra.

    Args:
        of_cell: (t, 6) edges of each tetrahedron, from :func:`edges_of`.
        chosen: selected edge of each tetrahedron with a selection.
        edges: number of edges.

    Returns:
        (e,) bool, True for these edges.
    """
    around = np.bincount(of_cell.ravel(), minlength=edges)
    return np.asarray(around == np.bincount(chosen, minlength=edges))


def _terminal_edges(
    points: NDArray, ends: NDArray, of_cell: NDArray, wanted: NDArray
) -> NDArray:
    """Return which edges must be split first to bisect the selected tetrahedra."""
    rank = length_ranks(points, ends)
    longest = np.take_along_axis(
        of_cell, rank[of_cell].argmax(axis=1)[:, None], axis=1
    ).ravel()
    marked = np.zeros(len(ends), dtype=bool)
    marked[longest[wanted]] = True
    while True:
        reached = longest[marked[of_cell].any(axis=1)]
        if marked[reached].all():
            break
        marked[reached] = True
    return marked & chosen_by_all(of_cell, longest, len(ends))


def _halved(cells: NDArray, middle: NDArray, pairs: NDArray) -> tuple[NDArray, NDArray]:
    """Bisect tetrahedra, and append the second halves."""
    row, which = np.nonzero(middle >= 0)
    new = middle[row, which]
    first, second = cells[row].copy(), cells[row].copy()
    each = np.arange(len(row))
    first[each, pairs[which, 1]] = new
    second[each, pairs[which, 0]] = new
    result = cells.copy()
    result[row] = first
    return np.concatenate([result, second]), row
