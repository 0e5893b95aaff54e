"""Splitting of mesh edges that cross a surface."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.refine import chosen_by_all, edges_of, split_edges
from forcefit.stiffness.mesh.solid import Solid

_PASSES = 200
Crossing = Callable[[Solid, NDArray, NDArray], tuple[NDArray, NDArray]]


def split_crossing(
    solid: Solid, on: NDArray, crossing: Crossing
) -> tuple[Solid, NDArray]:
    """Split edges at the points where they cross a surface.

    Args:
        solid: straight tetrahedra.
        on: (n,) bool, True for a corner on the surface.
        crossing: function of the solid, its corners on the surface, (n,), and its
            edges, (e, 2). It returns which edges cross the surface and at which
            fraction of their length.

    Returns:
        The split solid, and (n,) bool, True for its corners on the surface.
    """
    for _ in range(_PASSES):
        ends, of_cell = edges_of(solid.cells, len(solid.points))
        wanted, share = crossing(solid, on, ends)
        if not wanted.any():
            break
        split = one_of_each(wanted, of_cell)
        start, end = solid.points[ends[split]].swapaxes(0, 1)
        places = start + share[split, None] * (end - start)
        solid, _ = split_edges(solid, ends, of_cell, split, places)
        on = np.r_[on, np.ones(len(places), dtype=bool)]
    return solid, on


def one_of_each(wanted: NDArray, of_cell: NDArray) -> NDArray:
    """Select edges so that each tetrahedron has at most one selected edge.

    Args:
        wanted: (e,) bool, True for edges that can be selected.
        of_cell: (t, 6) edges of each tetrahedron.

    Returns:
        (e,) bool, True for the selected edges.
    """
    order = np.where(wanted, np.arange(len(wanted), 0, -1), 0)
    first = of_cell[np.arange(len(of_cell)), order[of_cell].argmax(axis=1)]
    touched = wanted[of_cell].any(axis=1)
    return wanted & chosen_by_all(of_cell, first[touched], len(wanted))
