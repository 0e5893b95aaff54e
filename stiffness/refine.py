"""Finer tetrahedra where they are asked for, by bisecting longest edges (Rivara).

An edge is split only when it is the longest of every tetrahedron around it, so the mesh
stays conforming at every step; neighbours are split first where it is not.  Boundary
triangles are split with their tetrahedra and keep their patch, and new corners are
moved onto the patch's shape.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffness.mesh import Solid, moved_onto_shapes

_TETRA = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
_TRIANGLE = np.array([[0, 1], [1, 2], [0, 2]])


@dataclass(frozen=True, eq=False)
class Finer:
    """A refined solid.

    Attributes:
        solid: the finer one.
        parent: (t,) tetrahedron of the coarser one that each came from.
    """

    solid: Solid
    parent: NDArray


def refine(solid: Solid, halvings: NDArray) -> Finer:
    """Bisect tetrahedra as often as asked; neighbours where conformity needs it.

    Args:
        solid: to refine.
        halvings: (t,) how many times each tetrahedron's volume is to be halved.

    Returns:
        The finer solid.
    """
    points, cells, faces, patch = solid.points, solid.cells, solid.faces, solid.patch
    parent, need = np.arange(len(cells)), np.array(halvings, dtype=int)
    while (need > 0).any():
        ends, of_cell = _edges(cells, _TETRA, len(points))
        split = _terminal_edges(points, ends, of_cell, need > 0)
        middle = np.full(len(ends), -1)
        middle[split] = len(points) + np.arange(split.sum())
        points = np.concatenate([points, points[ends[split]].mean(axis=1)])
        code = ends[:, 0] * np.int64(len(points)) + ends[:, 1]
        pairs = np.sort(faces[:, _TRIANGLE], axis=2)
        of_face = np.searchsorted(code, pairs[..., 0] * len(points) + pairs[..., 1])
        faces, (patch,) = _halved(faces, middle[of_face], _TRIANGLE, patch)
        cells, (parent, need) = _halved(
            cells, middle[of_cell], _TETRA, parent, need, spent=True
        )
    finer = Solid(points, cells, faces, patch, solid.shapes)
    return Finer(moved_onto_shapes(finer), parent)


def _edges(cells: NDArray, pairs: NDArray, points: int) -> tuple[NDArray, NDArray]:
    """Ends (e, 2) of all edges, in order, and the edges (t, 6) of each cell."""
    ends = np.sort(cells[:, pairs].reshape(-1, 2), axis=1)
    code, index = np.unique(
        ends[:, 0] * np.int64(points) + ends[:, 1], return_inverse=True
    )
    ends = np.column_stack([code // points, code % points])
    return ends, index.reshape(-1, len(pairs))


def _terminal_edges(
    points: NDArray, ends: NDArray, of_cell: NDArray, wanted: NDArray
) -> NDArray:
    """(e,) edges to split now: longest in all their cells, in a wanted one's way."""
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    rank = np.empty(len(ends), dtype=int)
    rank[np.lexsort((np.arange(len(ends)), length))] = np.arange(len(ends))
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
    around = np.bincount(of_cell.ravel(), minlength=len(ends))
    first = np.bincount(longest, minlength=len(ends))
    return marked & (around == first)


def _halved(
    cells: NDArray,
    middle: NDArray,
    pairs: NDArray,
    *labels: NDArray,
    spent: bool = False,
) -> tuple[NDArray, list[NDArray]]:
    """Cells with a split edge become two; the last label counts down if spent."""
    row, which = np.nonzero(middle >= 0)
    new = middle[row, which]
    first, second = cells[row].copy(), cells[row].copy()
    each = np.arange(len(row))
    first[each, pairs[which, 1]] = new
    second[each, pairs[which, 0]] = new
    result = cells.copy()
    result[row] = first
    carried = []
    for k, label in enumerate(labels):
        label = label.copy()
        if spent and k == len(labels) - 1:
            label[row] = np.maximum(label[row] - 1, 0)
        carried.append(np.concatenate([label, label[row]]))
    return np.concatenate([result, second]), carried
