"""Nodes of curved elements, placed on the exact boundary shapes of a solid.

The nodes of straight elements form a lattice.  Nodes on boundary edges are moved onto
the shapes of their patches, inner faces follow their edges, and nodes on boundary faces
are then moved onto their shapes. The mesh is conforming, and its geometric error is the
interpolation error of the shapes. Cubic edges and faces interpolate the shapes at
points where this error has zero mean, so the volume error decreases with the sixth
power of the element size h.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count as steps

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.lagrange import (
    EDGES,
    FACES,
    face_nodes,
    lattice,
    numbered,
    shape_functions,
)
from forcefit.stiffness.mesh.quadrature import quadrature
from forcefit.stiffness.mesh.refine import refine
from forcefit.stiffness.mesh.solid import Solid, node_patches, on_shapes
from forcefit.stiffness.surface.primitives import Shape

_LARGEST_MOVE = 0.05  # largest displacement of a node, relative to the part's size
# ratio of the smallest to the largest Jacobian determinant in an element, below which
# the element counts as inverted
_INVERTED = 0.05
_PASSES = 3  # largest number of passes to bisect inverted elements
# solution of 9 t^3 - 10 t^2 + 3.6 t = 0.4: value of two of three coordinates L
_SAMPLE = 0.2128543571118083


@dataclass(frozen=True, eq=False)
class CurvedElements:
    """Elements of a solid with curved geometry.

    Attributes:
        cells: (t, m) nodes of each tetrahedron, with its corners in increasing order.
        nodes: (n, 3) [m] positions of the nodes.
        patch: (t, 4) patch of each face, in the order of ``FACES``; -1 inside.
        curved: (t,) bool, True for an element that is not straight.
        inverted: (t,) bool, True for an element that was straightened because its
            Jacobian changed sign.
    """

    cells: NDArray
    nodes: NDArray
    patch: NDArray
    curved: NDArray
    inverted: NDArray


def curved_elements(solid: Solid, order: int) -> CurvedElements:
    """Create the curved elements of a solid.

    Args:
        solid: straight tetrahedra.
        order: order of the elements, 2 or 3.

    Returns:
        The elements, of which inverted ones are straightened stepwise until valid.
    """
    corners = np.sort(solid.cells, axis=1)
    cells, count = numbered(corners, order)
    straight = np.zeros((count, 3))
    share = lattice(order) / order
    straight[cells] = np.einsum("nk,tkx->tnx", share, solid.points[corners])
    patch = patches_of_cells(solid.faces, solid.patch, corners)
    inner = patches_of_cells(solid.inner, solid.inner_patch, corners)
    on_shape = np.maximum(patch, inner)
    row, face = np.nonzero(on_shape >= 0)
    members = cells[row[:, None], face_nodes(order)[face]]
    groups = node_patches(count, members, on_shape[row, face])
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    nodes = straight.copy()

    def moved_nodes(places: NDArray, some: NDArray) -> NDArray:
        chosen = np.zeros(count, dtype=bool)
        chosen[some] = True
        kept = [(key, group[chosen[group]]) for key, group in groups]
        kept = [(key, group) for key, group in kept if len(group)]
        reach = _LARGEST_MOVE * size
        return on_shapes(places, kept, solid.shapes, reach, solid.walls)

    if order == 2:
        nodes = moved_nodes(straight, cells[:, 4:])
    else:
        pairs = cells[:, 4:16].reshape(-1, 6, 2)
        nodes[pairs] += _cubic_edges(
            solid.points[corners][:, EDGES], pairs, moved_nodes
        )
        moved = (np.abs(nodes - straight).max(axis=1) > 0)[cells].any(axis=1)
        nodes[cells[moved, 16:]] += _face_nodes_by_edges(
            (nodes - straight)[cells[moved]]
        )
        faces, reach = (nodes[members], on_shape[row, face]), _LARGEST_MOVE * size
        nodes[members[:, 9]] += _cubic_faces(*faces, solid.shapes, reach)
    nodes, inverted = _straightened(straight, nodes, cells, order)
    off = np.abs(nodes - straight).max(axis=1) > 1e-12 * size
    return CurvedElements(cells, nodes, patch, off[cells].any(axis=1), inverted)


def patches_of_cells(faces: NDArray, patch: NDArray, corners: NDArray) -> NDArray:
    """Find the patch of each face of the tetrahedra.

    Args:
        faces: (f, 3) corners of the triangles on patches.
        patch: (f,) patch numbers of these triangles.
        corners: (t, 4) corners of the tetrahedra in increasing order.

    Returns:
        (t, 4) patches in the order of ``FACES``; -1 for a face on no patch.
    """
    if not len(faces):
        return np.full((len(corners), 4), -1)
    total = np.int64(max(corners.max(), faces.max()) + 1)

    def code(corners: NDArray) -> NDArray:
        a, b, c = np.moveaxis(corners, -1, 0)
        return (a * total + b) * total + c

    known = code(np.sort(faces, axis=1))
    order = np.argsort(known)
    wanted = code(corners[:, FACES])
    place = np.searchsorted(known, wanted, sorter=order)
    place = order[np.minimum(place, len(known) - 1)]
    return np.where(known[place] == wanted, patch[place], -1)


def refine_inverted(solid: Solid, order: int) -> Solid:
    """Bisect elements that would be inverted when their faces are curved.

    Args:
        solid: straight tetrahedra.
        order: order of the elements to be created.

    Returns:
        The solid, refined where a wall is thin relative to its radius of curvature.
    """
    for _ in range(_PASSES):
        inverted = curved_elements(solid, order).inverted
        if not inverted.any():
            break
        solid = refine(solid, inverted.astype(int)).solid
    return solid


def _cubic_edges(
    ends: NDArray, pairs: NDArray, moved_nodes: Callable[[NDArray, NDArray], NDArray]
) -> NDArray:
    """Return (t, 6, 2, 3) displacements of the two nodes at the thirds of each edge."""
    # the shape is interpolated at the Lobatto points, where the error of a cubic
    # against an arc has zero mean, and then evaluated at the thirds of the edge
    s = (1 + np.array([-1, 1]) / np.sqrt(5)) / 2
    places = np.zeros((int(pairs.max()) + 1, 3))
    places[pairs] = ends[:, :, :1] + s[:, None] * (ends[:, :, 1:] - ends[:, :, :1])
    moved = (moved_nodes(places, pairs) - places)[pairs]
    # the displacement is s (1 - s) (c_0 + c_1 (2 s - 1)); s (1 - s) is 1 / 5, then 2 /
    # 9
    c_0 = 5 / 2 * (moved[:, :, 1] + moved[:, :, 0])
    c_1 = 5 / 2 * np.sqrt(5) * (moved[:, :, 1] - moved[:, :, 0])
    return 2 / 9 * np.stack([c_0 - c_1 / 3, c_0 + c_1 / 3], axis=2)


def _face_nodes_by_edges(moved: NDArray) -> NDArray:
    """Compute (t, 4, 3) displacements of face nodes from those of edges (t, 20, 3)."""
    # along an edge the displacement is L_a L_b (c_0 + c_1 (L_b - L_a)), extended over
    # the faces; at the middle of a face each of its edges adds c_0 / 9
    carried = np.zeros((len(moved), 4, 3))
    # at the thirds, L_a L_b is 2 / 9, so c_0 is the mean of the two nodes times 9 / 2
    mean = moved[:, 4:16].reshape(-1, 6, 2, 3).mean(axis=2)
    for f, face in enumerate(FACES):
        around = [np.isin(edge, face).all() for edge in EDGES]
        carried[:, f] = mean[:, around].sum(axis=1) / 2
    return carried


def _cubic_faces(
    corners: NDArray, patch: NDArray, shapes: tuple[Shape | None, ...], reach: float
) -> NDArray:
    """Return (f, 3) displacements of face midpoints, given those of all other nodes."""
    # interpolated at three points; there the cubic that equals the quartic x^2, with x
    # = L_1 L_2 + L_2 L_3 + L_3 L_1, along the edges also has the integral of x^2, so
    # that the error of a shape has zero mean
    L = np.full((3, 3), _SAMPLE) + (1 - 3 * _SAMPLE) * np.eye(3)
    N, _ = shape_functions(3, L)
    places = N @ corners
    number = np.arange(3 * len(corners)).reshape(-1, 3)
    groups: list[tuple[tuple[int, ...], NDArray]] = [
        ((int(p),), number[patch == p].ravel()) for p in np.unique(patch)
    ]
    target = on_shapes(places.reshape(-1, 3), groups, shapes, reach)
    return np.asarray((target.reshape(-1, 3, 3) - places).mean(axis=1) / N[0, 9])


def _straightened(
    straight: NDArray, curved: NDArray, cells: NDArray, order: int
) -> tuple[NDArray, NDArray]:
    """Straighten inverted elements; return the nodes and these elements."""
    nodes = curved.copy()
    suspects = np.flatnonzero((curved != straight)[cells].any(axis=(1, 2)))
    places = np.concatenate([quadrature(6)[0], lattice(order) / order])
    dN = shape_functions(order, places)[1]
    corners = straight[cells[:, :4]]
    orientation = np.sign(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    inverted = np.zeros(len(cells), dtype=bool)
    for step in steps():
        J = np.einsum("qai,tax->tqix", dN, nodes[cells[suspects]], optimize=True)
        size = np.linalg.det(J) * orientation[suspects, None]
        bad = suspects[size.min(axis=1) < _INVERTED * size.max(axis=1)]
        if len(bad) == 0:
            break
        inverted[bad] = True
        touched = np.unique(cells[bad])
        # the loop terminates because straight elements are never inverted
        kept = 0.5 if step < 4 else 0.0
        nodes[touched] += (1 - kept) * (straight - nodes)[touched]
    return nodes, inverted
