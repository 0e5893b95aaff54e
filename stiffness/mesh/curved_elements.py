"""Curved elements with boundary nodes on the exact shapes of a solid.

The nodes of a straight element form a regular lattice. First, the nodes on boundary
edges are moved onto the shapes of their patches. The nodes on the adjacent faces are
moved with them. The nodes on boundary faces are then moved onto the shapes. Cubic edges
and faces interpolate the shapes at points that make the mean interpolation error zero.
The volume error is therefore proportional to the sixth power of the element size.
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

_LARGEST_MOVE = 0.05  # largest displacement of a node, relative to the size of the part
# ratio of the smallest to the largest Jacobian determinant in an element below which
# the element is treated as inverted
_INVERTED = 0.05
_PASSES = 3  # maximum number of passes to bisect inverted elements
# value of two barycentric coordinates of an interpolation point on a face, which is a
# root of 9 t^3 - 10 t^2 + 3.6 t = 0.4
_SAMPLE = 0.2128543571118083


@dataclass(frozen=True, eq=False)
class CurvedElements:
    """Elements of a solid with curved geometry.

    Attributes:
        cells: (t, m) indices of the nodes of each element, with its corners in
            increasing order.
        nodes: (n, 3) [m] positions of the nodes.
        patch: (t, 4) patch of each face, in the order of ``FACES``; -1 for an inner
            face.
        curved: (t,) bool, True for an element that is not straight.
        inverted: (t,) bool, True for an element that was straightened because it would
            be inverted.
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
        The elements. Elements that would be inverted are straightened.
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
    """Find the patch of each face of tetrahedra.

    Args:
        faces: (f, 3) corners of the boundary triangles.
        patch: (f,) patch number of each boundary triangle.
        corners: (t, 4) corners of each tetrahedron in increasing order.

    Returns:
        (t, 4) patch of each face, in the order of ``FACES``; -1 for an inner face.
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
    """Bisect tetrahedra that would be inverted when they are curved.

    Args:
        solid: straight tetrahedra.
        order: order of the curved elements, 2 or 3.

    Returns:
        The refined solid.
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
    """Return the displacements of the two nodes on each edge, (t, 6, 2, 3) [m]."""
    # The shape is interpolated at the Lobatto points, so that the mean error of a cubic
    # edge on an arc is zero. The interpolation is then evaluated at the nodes.
    s = (1 + np.array([-1, 1]) / np.sqrt(5)) / 2
    places = np.zeros((int(pairs.max()) + 1, 3))
    places[pairs] = ends[:, :, :1] + s[:, None] * (ends[:, :, 1:] - ends[:, :, :1])
    moved = (moved_nodes(places, pairs) - places)[pairs]
    # The displacement is s (1 - s) (c_0 + c_1 (2 s - 1)), where s (1 - s) is 1 / 5 at
    # the Lobatto points and 2 / 9 at the nodes.
    c_0 = 5 / 2 * (moved[:, :, 1] + moved[:, :, 0])
    c_1 = 5 / 2 * np.sqrt(5) * (moved[:, :, 1] - moved[:, :, 0])
    return 2 / 9 * np.stack([c_0 - c_1 / 3, c_0 + c_1 / 3], axis=2)


def _face_nodes_by_edges(moved: NDArray) -> NDArray:
    """Return displacements of face nodes caused by edge nodes, (t, 4, 3) [m]."""
    # The displacement due to an edge is L_a L_b (c_0 + c_1 (L_b - L_a)), which is c_0 /
    # 9 in the middle of an adjacent face.
    carried = np.zeros((len(moved), 4, 3))
    # L_a L_b is 2 / 9 at the nodes of an edge, so c_0 is the mean displacement of these
    # nodes times 9 / 2
    mean = moved[:, 4:16].reshape(-1, 6, 2, 3).mean(axis=2)
    for f, face in enumerate(FACES):
        around = [np.isin(edge, face).all() for edge in EDGES]
        carried[:, f] = mean[:, around].sum(axis=1) / 2
    return carried


def _cubic_faces(
    corners: NDArray, patch: NDArray, shapes: tuple[Shape | None, ...], reach: float
) -> NDArray:
    """Return the displacements of the nodes in the middle of faces, (f, 3) [m]."""
    # The shape is interpolated at three points, so that the mean of the interpolation
    # error is zero. At these points, with x = L_1 L_2 + L_2 L_3 + L_3 L_1, the cubic
    # that interpolates x^2 and equals x^2 on the edges has the same integral as x^2.
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
    """Straighten inverted elements, and return which elements were straightened."""
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
        # this loop ends because straight elements are not inverted
        kept = 0.5 if step < 4 else 0.0
        nodes[touched] += (1 - kept) * (straight - nodes)[touched]
    return nodes, inverted
