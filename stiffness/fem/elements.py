r"""Isoparametric tetrahedra for linear elasticity.

====== ========================================================== ==========
symbol meaning                                                    shape
====== ========================================================== ==========
N      shape functions at quadrature points                       (q, m)
G      gradients of N with respect to position                    (t, q, m, 3)
w      quadrature weights times the Jacobian determinant          (t, q)
====== ========================================================== ==========

A cubic tetrahedron has m = 20 nodes, and a quadratic tetrahedron has 10
(:mod:`forcefit.stiffness.mesh.lagrange`). The stiffness of nodes a, b in the directions
i, j is K[ai, bj] = sum_q w (lam G_ai G_bj + mu G_aj G_bi + mu d_ij G_a . G_b). The
quadrature is exact for straight tetrahedra. For curved tetrahedra, the degree of the
quadrature rule is higher by two.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from forcefit.stiffness.mesh.curved_elements import curved_elements
from forcefit.stiffness.mesh.edge_grading import Parts, whole_elements
from forcefit.stiffness.mesh.lagrange import (
    FACES,
    face_nodes,
    lattice,
    numbered,
    shape_functions,
)
from forcefit.stiffness.mesh.quadrature import quadrature
from forcefit.stiffness.mesh.solid import Solid

# order of the elements; for an error of 0.1 %, quadratic elements need many more
# unknowns than cubic elements
ORDER = 3
# derivatives of the barycentric coordinates with respect to the reference coordinates
_COORDINATES = np.vstack([-np.ones(3), np.eye(3)])
_CHUNK = 3_600_000  # number of stiffness entries in a batch, which occupy 30 MB


@dataclass(frozen=True, eq=False)
class Elements:
    """Isoparametric tetrahedral elements of a solid.

    Attributes:
        order: order of the polynomials, 2 or 3.
        nodes: (n, 3) [m] positions of the nodes, corners first. Boundary nodes are on
            the exact shapes.
        cells: (t, m) indices of the nodes of each element.
        faces: (f, k) indices of the nodes of each boundary face.
        patch: (f,) patch number of each boundary face. Patch 0 is the base interface,
            and patch 1 is the tip interface.
        owner: (f,) index of the element with each boundary face.
        curved: (t,) bool, True for a curved element.
    """

    order: int
    nodes: NDArray
    cells: NDArray
    faces: NDArray
    patch: NDArray
    owner: NDArray
    curved: NDArray


class Chunk(NamedTuple):
    """Quadrature data for a batch of elements.

    Attributes:
        part: (c,) indices of the elements.
        L: (q, 4) barycentric coordinates of the quadrature points.
        weights: (q,) quadrature weights on the reference element.
        N: (q, m) shape functions.
        G: (c, q, m, 3) [1/m] gradients of the shape functions with respect to position.
        w: (c, q) [m^3] quadrature weights times the Jacobian determinant.
    """

    part: NDArray
    L: NDArray
    weights: NDArray
    N: NDArray
    G: NDArray
    w: NDArray


def isoparametric(
    solid: Solid, order: int = ORDER, parts: Parts | None = None
) -> Elements:
    """Create isoparametric elements from straight tetrahedra.

    Args:
        solid: straight tetrahedra.
        order: order of the polynomials, 2 or 3.
        parts: tetrahedra into which the tetrahedra of the solid are divided. If None,
            each tetrahedron of the solid becomes an element.

    Returns:
        The elements.
    """
    whole, parts = curved_elements(solid, order), parts or whole_elements(solid)
    cells, count = numbered(parts.corners, order)
    nodes = np.zeros((count, 3))
    L = (lattice(order) / order) @ parts.places
    # tetrahedra that are divided in the same way are treated together
    cuts = parts.places.reshape(len(L), 16)
    _, first, cut = np.unique(cuts, axis=0, return_index=True, return_inverse=True)
    for k, example in enumerate(first):
        members = np.flatnonzero(cut == k)
        N, _ = shape_functions(order, L[example])
        corners = whole.nodes[whole.cells[parts.parent[members]]]
        nodes[cells[members]] = np.einsum("na,tax->tnx", N, corners)
    # a face of an element is on the boundary if it is part of a boundary face of the
    # tetrahedron
    faces, patch, owner = [], [], []
    for side, on in zip(FACES, face_nodes(order), strict=True):
        for other, missing in enumerate((3, 2, 1, 0)):
            parent_patch = whole.patch[parts.parent, other]
            inside = (parts.places[:, side, missing] == 0).all(axis=1)
            member = np.flatnonzero(inside & (parent_patch >= 0))
            faces.append(cells[member][:, on])
            patch.append(parent_patch[member])
            owner.append(member)
    return Elements(
        order=order,
        nodes=nodes,
        cells=cells,
        faces=np.concatenate(faces),
        patch=np.concatenate(patch),
        owner=np.concatenate(owner),
        curved=whole.curved[parts.parent],
    )


def integration(mesh: Elements, some: NDArray | None = None) -> Iterator[Chunk]:
    """Yield quadrature data for the elements in batches.

    Args:
        mesh: the elements.
        some: (t,) bool, True for selected elements. By default, all elements are
            selected.

    Yields:
        A :class:`Chunk`.
    """
    straight = 2 * (mesh.order - 1)
    some = np.ones(len(mesh.cells), dtype=bool) if some is None else some
    for curved, degree in ((False, straight), (True, straight + 2)):
        L, weights = quadrature(degree)
        N, dN = shape_functions(mesh.order, L)
        members = np.flatnonzero(some & (mesh.curved == curved))
        for part in _chunks(members, N.shape[1]):
            J = _jacobians(dN, mesh.nodes[mesh.cells[part]])
            G = dN @ np.linalg.inv(J)
            w = weights * np.abs(np.linalg.det(J))
            yield Chunk(part, L, weights, N, G, w)


def _chunks(members: NDArray, nodes: int) -> Iterator[NDArray]:
    """Yield indices of elements in batches of limited memory."""
    step = max(1, _CHUNK // (9 * nodes**2))
    for first in range(0, len(members), step):
        yield members[first : first + step]


def gradients_on_faces(
    mesh: Elements, faces: NDArray
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return data for the integration of stresses over boundary faces.

    Args:
        mesh: the elements.
        faces: (f,) indices of the boundary faces.

    Returns:
        Positions of the quadrature points, (f, q, 3) [m]; outward normals, (f, q, 3);
        weights, (f, q) [m^2]; and gradients of the shape functions in the adjacent
        elements, (f, q, m, 3) [1/m].
    """
    N, area = _face_vectors(mesh, mesh.faces[faces])
    size = np.linalg.norm(area, axis=2)
    places = np.einsum("qa,tax->tqx", N, mesh.nodes[mesh.faces[faces]])
    cells = mesh.cells[mesh.owner[faces]]
    G = np.zeros((*size.shape, cells.shape[1], 3))
    inward = np.zeros_like(area)
    corners = mesh.faces[faces, :3]
    for side in FACES:
        members = np.flatnonzero((cells[:, side] == corners).all(axis=1))
        L = np.zeros((len(N), 4))
        L[:, side] = quadrature(2 * mesh.order, corners=3)[0]
        slope = shape_functions(mesh.order, L)[1]
        inverse = np.linalg.inv(_jacobians(slope, mesh.nodes[cells[members]]))
        G[members] = slope @ inverse
        # the barycentric coordinate of the opposite corner increases inward
        (opposite,) = set(range(4)) - set(side)
        inward[members] = _COORDINATES[opposite] @ inverse
    outward = -np.sign(np.einsum("tqx,tqx->tq", area, inward))
    return places, area * (outward / size)[..., None], size, G


def _jacobians(dN: NDArray, corners: NDArray) -> NDArray:
    """Return derivatives of position by reference coordinates, (c, q, 3, 3) [m]."""
    q, m, _ = dN.shape
    flat = dN.transpose(0, 2, 1).reshape(3 * q, m) @ corners
    return np.asarray(flat.reshape(len(corners), q, 3, 3)).swapaxes(2, 3)


def node_gradients(
    mesh: Elements, members: NDArray | None = None
) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield the gradients of the shape functions at the nodes of each element.

    Args:
        mesh: the elements.
        members: (c,) indices of the elements. By default, all elements are selected.

    Yields:
        Indices of elements, (c,); and gradients, (c, m, m, 3) [1/m], with the axes
        element, node, shape function and direction.
    """
    dN = shape_functions(mesh.order, lattice(mesh.order) / mesh.order)[1]
    members = np.arange(len(mesh.cells)) if members is None else members
    for part in _chunks(members, dN.shape[1]):
        yield part, dN @ np.linalg.inv(_jacobians(dN, mesh.nodes[mesh.cells[part]]))


def triangle_areas(mesh: Elements, faces: NDArray) -> tuple[NDArray, NDArray]:
    """Return data for the integration over boundary faces.

    Args:
        mesh: the elements.
        faces: (f, k) indices of the nodes of each face.

    Returns:
        Shape functions at the quadrature points, (q, k); and weights, (f, q) [m^2].
    """
    N, area = _face_vectors(mesh, faces)
    return N, np.linalg.norm(area, axis=2)


def _face_vectors(mesh: Elements, faces: NDArray) -> tuple[NDArray, NDArray]:
    """Return shape functions, (q, k), and weighted normals, (f, q, 3) [m^2]."""
    N, dN, weights = triangle_rule(mesh.order)
    J = np.einsum("qai,tax->tqix", dN, mesh.nodes[faces])
    return N, np.cross(J[:, :, 0], J[:, :, 1]) * weights[:, None]


def triangle_rule(order: int) -> tuple[NDArray, NDArray, NDArray]:
    """Return a triangle quadrature rule for products of two shape functions.

    Args:
        order: order of the polynomials.

    Returns:
        Shape functions, (q, k); their gradients, (q, k, 2); and weights, (q,).
    """
    L, weights = quadrature(2 * order, corners=3)
    N, dN = shape_functions(order, L)
    return N, dN, weights


def lame(E: float, nu: float) -> tuple[float, float]:
    """Return Lame's constants of an isotropic material.

    Args:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.

    Returns:
        Lame's constants lambda and mu [Pa].
    """
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def assemble(mesh: Elements, lam: NDArray, mu: NDArray) -> csr_array:
    """Assemble the stiffness matrix of all elements.

    Args:
        mesh: the elements.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.

    Returns:
        Upper triangle of the matrix, (3n, 3n) [N/m]. Row 3 i + k belongs to direction k
        of node i.
    """
    cells, count = mesh.cells, np.int64(len(mesh.nodes))
    a, b = np.triu_indices(cells.shape[1])
    row, column = cells[:, a], cells[:, b]
    swapped = row > column
    code = np.minimum(row, column) * count + np.maximum(row, column)
    code, position = np.unique(code.ravel(), return_inverse=True)
    position = position.reshape(row.shape)
    values = np.zeros((9, len(code)))
    for part, block in _node_blocks(mesh, lam, mu, a, b):
        turned = block.reshape(-1, 3, 3, len(a)).swapaxes(1, 2).reshape(block.shape)
        block = np.where(swapped[part, None], turned, block)
        place = position[part].ravel()
        for k in range(9):
            # np.bincount would need too much memory here
            np.add.at(values[k], place, block[:, k].ravel())
    return _upper(values, code // count, code % count, int(count))


def _node_blocks(
    mesh: Elements, lam: NDArray, mu: NDArray, a: NDArray, b: NDArray
) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield element indices, (c,), and stiffness blocks of node pairs, (c, 9, p)."""
    L, weights = quadrature(2 * (mesh.order - 1))
    _, dN = shape_functions(mesh.order, L)
    # integrals of products of derivatives of the shape functions with respect to
    # reference coordinates
    own = np.einsum("q,qpx,qpy->xyp", weights, dN[:, a], dN[:, b]).reshape(9, -1)
    for part in _chunks(np.flatnonzero(~mesh.curved), dN.shape[1]):
        corners = mesh.nodes[mesh.cells[part, :4]]
        J = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
        inverse, size = np.linalg.inv(J), np.abs(np.linalg.det(J))
        # G_ai G_bj is the sum over x and y of turn[c, i, j, x, y] dN_ax dN_by, where dN
        # are derivatives with respect to reference coordinates
        turn = np.einsum("c,cxi,cyj->cijxy", size, inverse, inverse)
        yield part, _hooke(turn.reshape(-1, 3, 3, 9), lam[part], mu[part]) @ own
    for part, _, _, _, G, w in integration(mesh, mesh.curved):
        count, points, nodes, _ = G.shape
        flat = (G * np.sqrt(w)[:, :, None, None]).reshape(count, points, -1)
        S = (flat.swapaxes(1, 2) @ flat).reshape(count, nodes, 3, nodes, 3)
        S = S[:, a, :, b, :].transpose(1, 2, 3, 0)  # sum w G_ai G_bj
        yield part, _hooke(S, lam[part], mu[part])


def _hooke(S: NDArray, lam: NDArray, mu: NDArray) -> NDArray:
    """Return the stiffness blocks lam S_ij + mu S_ji + mu d_ij S_kk, (c, 9, p)."""
    m = mu[:, None, None, None]
    block = lam[:, None, None, None] * S + m * S.swapaxes(1, 2)
    block[:, range(3), range(3)] += m[:, 0] * np.trace(S, axis1=1, axis2=2)[:, None]
    return np.asarray(block.reshape(len(S), 9, -1))


def _upper(values: NDArray, row: NDArray, column: NDArray, count: int) -> csr_array:
    """Build the upper triangle of the matrix from the blocks of node pairs."""
    start = np.searchsorted(row, np.arange(count + 1))
    width = np.diff(start)
    # The diagonal block of a node comes first. Of this block, the first row has three
    # entries, the second row two, and the third row one.
    indptr = np.zeros(3 * count + 1, dtype=np.int32)
    lengths = np.stack([3 * width, 3 * width - 1, 3 * width - 2], axis=1)
    indptr[1:] = np.cumsum(lengths.ravel())
    data, indices = np.empty(indptr[-1]), np.empty(indptr[-1], dtype=np.int32)
    offset = 3 * (np.arange(len(row)) - start[row])
    for i in range(3):
        first = indptr[3 * row + i] + offset - i
        for j in range(3):
            kept = slice(None) if j >= i else np.flatnonzero(offset)
            data[first[kept] + j] = values[3 * i + j, kept]
            indices[first[kept] + j] = 3 * column[kept] + j
    return csr_array((data, indices, indptr), shape=(3 * count, 3 * count))
