"""Nodes of a solid's elements, on the exact shapes its boundary stands for.

The nodes of straight elements lie on their lattices.  Those on the boundary's edges are
moved onto the shapes of the patches there; the faces inside follow their edges, and the
boundary's faces are then moved onto their own shapes.  So neighbours agree, and what is
left of the error is that of interpolating the shapes.  Cubic edges and faces are placed
so that it is to both sides alike: a volume's error falls with the sixth power of h.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count as steps

import numpy as np
from numpy.typing import NDArray

from stiffness.mesh.lagrange import (
    EDGES,
    FACES,
    face_nodes,
    lattice,
    numbered,
    quadrature,
    shape_functions,
)
from stiffness.mesh.mesh import Solid, node_patches, on_shapes
from stiffness.mesh.refine import refine
from stiffness.surface.primitives import Shape

_REACH = 0.05  # of the part's size: no node is moved further
_FOLDED = 0.05  # of an element's largest Jacobian determinant
_ROUNDS = 3  # of halving elements that would fold
_MET = 0.2128543571118083  # solves 9 t^3 - 10 t^2 + 3.6 t = 0.4: two of three L


@dataclass(frozen=True, eq=False)
class Curved:
    """A solid's elements, bent.

    Attributes:
        cells: (t, m) nodes of each tetrahedron, its corners in rising order.
        nodes: (n, 3) [m].
        patch: (t, 4) patch of each face, in the order of ``FACES``; -1 inside.
        bent: (t,) whether an element is not straight.
        folded: (t,) whether it had to be straightened so as not to fold.
    """

    cells: NDArray
    nodes: NDArray
    patch: NDArray
    bent: NDArray
    folded: NDArray


def curved(solid: Solid, order: int) -> Curved:
    """Bend a solid's elements.

    Args:
        solid: straight tetrahedra.
        order: of the elements, 2 or 3.

    Returns:
        The elements; those that would fold somewhere are straightened by halves.
    """
    corners = np.sort(solid.cells, axis=1)
    cells, count = numbered(corners, order)
    straight = np.zeros((count, 3))
    share = lattice(order) / order
    straight[cells] = np.einsum("nk,tkx->tnx", share, solid.points[corners])
    patch = patches_of_cells(solid, corners)
    row, face = np.nonzero(patch >= 0)
    members = cells[row[:, None], face_nodes(order)[face]]
    groups = node_patches(count, members, patch[row, face])
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    nodes = straight.copy()

    def bent(places: NDArray, some: NDArray) -> NDArray:
        chosen = np.zeros(count, dtype=bool)
        chosen[some] = True
        kept = [(key, group[chosen[group]]) for key, group in groups]
        kept = [(key, group) for key, group in kept if len(group)]
        return on_shapes(places, kept, solid.shapes, _REACH * size)

    if order == 2:
        nodes = bent(straight, cells[:, 4:])
    else:
        pairs = cells[:, 4:16].reshape(-1, 6, 2)
        nodes[pairs] += _cubic_edges(solid.points[corners][:, EDGES], pairs, bent)
        moved = (np.abs(nodes - straight).max(axis=1) > 0)[cells].any(axis=1)
        nodes[cells[moved, 16:]] += _carried_by_edges((nodes - straight)[cells[moved]])
        faces, reach = (nodes[members], patch[row, face]), _REACH * size
        nodes[members[:, 9]] += _cubic_faces(*faces, solid.shapes, reach)
    nodes, folded = _without_folds(straight, nodes, cells, order)
    off = np.abs(nodes - straight).max(axis=1) > 1e-12 * size
    return Curved(cells, nodes, patch, off[cells].any(axis=1), folded)


def patches_of_cells(solid: Solid, corners: NDArray) -> NDArray:
    """Patches of the tetrahedra's faces.

    Args:
        solid: whose boundary is told.
        corners: (t, 4) its tetrahedra's corners in rising order.

    Returns:
        (t, 4) in the order of ``FACES``; -1 inside the solid.
    """
    total = np.int64(len(solid.points))

    def code(corners: NDArray) -> NDArray:
        a, b, c = np.moveaxis(corners, -1, 0)
        return (a * total + b) * total + c

    known = code(np.sort(solid.faces, axis=1))
    order = np.argsort(known)
    wanted = code(corners[:, FACES])
    place = np.searchsorted(known, wanted, sorter=order)
    place = order[np.minimum(place, len(known) - 1)]
    return np.where(known[place] == wanted, solid.patch[place], -1)


def without_folds(solid: Solid, order: int) -> Solid:
    """Halve the elements that could not be bent as their shapes ask for.

    Args:
        solid: straight tetrahedra.
        order: of the elements to be made of them.

    Returns:
        The solid, finer where a wall is thinner than its bend.
    """
    for _ in range(_ROUNDS):
        folded = curved(solid, order).folded
        if not folded.any():
            break
        solid = refine(solid, folded.astype(int)).solid
    return solid


def _cubic_edges(
    ends: NDArray, pairs: NDArray, bent: Callable[[NDArray, NDArray], NDArray]
) -> NDArray:
    """(t, 6, 2, 3) displacements of edges' nodes, which lie at their thirds."""
    # met at the Lobatto points, where a cubic leaves an arc to both sides alike, the
    # cubic is then read at the thirds
    s = (1 + np.array([-1, 1]) / np.sqrt(5)) / 2
    places = np.zeros((int(pairs.max()) + 1, 3))
    places[pairs] = ends[:, :, :1] + s[:, None] * (ends[:, :, 1:] - ends[:, :, :1])
    moved = (bent(places, pairs) - places)[pairs]
    # a displacement is s (1 - s) (c_0 + c_1 (2 s - 1)); s (1 - s) = 1 / 5, then 2 / 9
    c_0 = 5 / 2 * (moved[:, :, 1] + moved[:, :, 0])
    c_1 = 5 / 2 * np.sqrt(5) * (moved[:, :, 1] - moved[:, :, 0])
    return 2 / 9 * np.stack([c_0 - c_1 / 3, c_0 + c_1 / 3], axis=2)


def _carried_by_edges(moved: NDArray) -> NDArray:
    """(t, 4, 3) displacement of cubic faces' nodes by those (t, 20, 3) of edges."""
    # along an edge it is L_a L_b (c_0 + c_1 (L_b - L_a)), which is carried on over the
    # faces: at a face's middle each of its edges adds c_0 / 9
    carried = np.zeros((len(moved), 4, 3))
    # at thirds L_a L_b is 2 / 9: c_0 is the mean of the two nodes' times 9 / 2
    mean = moved[:, 4:16].reshape(-1, 6, 2, 3).mean(axis=2)
    for f, face in enumerate(FACES):
        around = [np.isin(edge, face).all() for edge in EDGES]
        carried[:, f] = mean[:, around].sum(axis=1) / 2
    return carried


def _cubic_faces(
    corners: NDArray, patch: NDArray, shapes: tuple[Shape | None, ...], reach: float
) -> NDArray:
    """(f, 3) displacements of faces' middle nodes; their other nodes are in place."""
    # met at three points, where a quartic x^2, x = L_1 L_2 + L_2 L_3 + L_3 L_1, leaves
    # the cubic that it has along the edges and the same integral as it: then what is
    # left of a shape is to both sides alike
    L = np.full((3, 3), _MET) + (1 - 3 * _MET) * np.eye(3)
    N, _ = shape_functions(3, L)
    places = N @ corners
    number = np.arange(3 * len(corners)).reshape(-1, 3)
    groups: list[tuple[tuple[int, ...], NDArray]] = [
        ((int(p),), number[patch == p].ravel()) for p in np.unique(patch)
    ]
    goal = on_shapes(places.reshape(-1, 3), groups, shapes, reach)
    return np.asarray((goal.reshape(-1, 3, 3) - places).mean(axis=1) / N[0, 9])


def _without_folds(
    straight: NDArray, bent: NDArray, cells: NDArray, order: int
) -> tuple[NDArray, NDArray]:
    """Bent nodes, straightened step by step where an element would fold, and which."""
    nodes = bent.copy()
    suspects = np.flatnonzero((bent != straight)[cells].any(axis=(1, 2)))
    places = np.concatenate([quadrature(6)[0], lattice(order) / order])
    dN = shape_functions(order, places)[1]
    corners = straight[cells[:, :4]]
    hand = np.sign(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    folded = np.zeros(len(cells), dtype=bool)
    for step in steps():
        J = np.einsum("qai,tax->tqix", dN, nodes[cells[suspects]], optimize=True)
        size = np.linalg.det(J) * hand[suspects, None]
        bad = suspects[size.min(axis=1) < _FOLDED * size.max(axis=1)]
        if len(bad) == 0:
            break
        folded[bad] = True
        touched = np.unique(cells[bad])
        # straight elements do not fold: in the end no more are left to be straightened
        kept = 0.5 if step < 4 else 0.0
        nodes[touched] += (1 - kept) * (straight - nodes)[touched]
    return nodes, folded
