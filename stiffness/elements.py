r"""Quadratic isoparametric tetrahedra for linear elasticity.

====== ========================================================== ==========
symbol meaning                                                    shape
====== ========================================================== ==========
N      quadratic shape functions at quadrature points             (q, 10)
G      their gradients in space                                   (t, q, 10, 3)
w      quadrature weights times the Jacobian's determinant        (t, q)
====== ========================================================== ==========

A tetrahedron's nodes are its 4 corners, then the middles of the edges in ``EDGES``, as
in scikit-fem, whose element and quadrature these are.  The stiffness is assembled from
the scalar gradients, all elements at once, much faster than from a weak form:
K[ai, bj] = sum_q w (lam G_ai G_bj + mu G_aj G_bi + mu d_ij G_a . G_b).
Straight tetrahedra are integrated exactly; curved ones with a rule of degree 5.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from stiffness.mesh import Solid, node_patches, on_shapes

EDGES = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])  # of the reference tetrahedron
TRIANGLE_EDGES = np.array([[0, 1], [1, 2], [0, 2]])
_CHUNK = 4096  # elements at a time: 4096 x 900 numbers are 30 MB


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A solid's quadratic tetrahedra.

    Attributes:
        nodes: (n, 3) [m] corners first, then middles of edges, on the exact shapes.
        cells: (t, 10) nodes of each tetrahedron.
        faces: (f, 6) nodes of each boundary triangle: 3 corners, 3 middles.
        patch: (f,) number of each face's patch; 0 is the base interface, 1 the tip.
        curved: (t,) whether an edge of the tetrahedron is bent.
    """

    nodes: NDArray
    cells: NDArray
    faces: NDArray
    patch: NDArray
    curved: NDArray


def quadratic(solid: Solid) -> Quadratic:
    """Quadratic tetrahedra whose boundary nodes lie on the known shapes.

    Args:
        solid: the straight tetrahedra.

    Returns:
        The tetrahedra; one that bending would turn over somewhere keeps straight edges.
    """
    corners = len(solid.points)
    pairs = np.sort(solid.cells[:, EDGES].reshape(-1, 2), axis=1)
    code, index = np.unique(pairs[:, 0] * corners + pairs[:, 1], return_inverse=True)
    middle = solid.points[np.column_stack([code // corners, code % corners])].mean(1)
    straight = np.concatenate([solid.points, middle])
    cells = np.column_stack([solid.cells, corners + index.reshape(-1, 6)])
    edges = np.sort(solid.faces[:, TRIANGLE_EDGES].reshape(-1, 2), axis=1)
    middles = corners + np.searchsorted(code, edges[:, 0] * corners + edges[:, 1])
    middles = middles.reshape(-1, 3)
    groups = [
        (key, group + corners)
        for key, group in node_patches(len(middle), middles - corners, solid.patch)
    ]
    longest = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    bent = on_shapes(straight, groups, solid.shapes, 0.05 * longest)
    nodes = _without_folds(straight, bent, cells)
    moved = np.abs(nodes - straight).max(axis=1) > 1e-12 * longest
    curved = moved[cells].any(axis=1)
    faces = np.column_stack([solid.faces, middles])
    return Quadratic(nodes, cells, faces, solid.patch, curved)


def _without_folds(straight: NDArray, bent: NDArray, cells: NDArray) -> NDArray:
    """Bent nodes, straightened step by step where an element would fold."""
    nodes = bent.copy()
    suspects = np.flatnonzero((bent != straight)[cells].any(axis=(1, 2)))
    check = np.concatenate([_quadrature(4)[0], _CORNERS])
    dN = _shape_functions(check)[1]
    for _ in range(4):
        J = np.einsum("qai,tax->tqix", dN, nodes[cells[suspects]])
        size = np.linalg.det(J)
        folded = suspects[size.min(axis=1) < 0.05 * size.max(axis=1)]
        if len(folded) == 0:
            break
        touched = np.unique(cells[folded])
        nodes[touched] = (nodes[touched] + straight[touched]) / 2
    else:
        nodes[touched] = straight[touched]
    return nodes


def _shape_functions(points: NDArray) -> tuple[NDArray, NDArray]:
    """N (q, 10) and derivatives (q, 10, 3) at reference points (q, 3)."""
    from skfem import ElementTetP2

    element = ElementTetP2()
    found = [element.lbasis(points.T, i) for i in range(10)]
    N = np.stack([values for values, _ in found], axis=1)
    return N, np.stack([gradients.T for _, gradients in found], axis=1)


@lru_cache(maxsize=4)
def _quadrature(degree: int) -> tuple[NDArray, NDArray]:
    """Points (q, 3) and positive weights (q,) of a rule of at least a degree."""
    from skfem.quadrature import get_quadrature
    from skfem.refdom import RefTet

    # the rules of degree 3 and 4 have negative weights; 5 has 14 points, all positive
    points, weights = get_quadrature(RefTet, degree if degree <= 2 else max(degree, 5))
    return points.T, weights


def integration(
    mesh: Quadratic, degree: int | None = None
) -> Iterator[tuple[NDArray, NDArray, NDArray, NDArray]]:
    """Elements in chunks, with what integrals over them need.

    Args:
        mesh: the tetrahedra.
        degree: of the rule, 2 or 4; 2 for straight and 4 for curved ones if absent.

    Yields:
        Indices (c,) of elements, shape functions N (q, 10), gradients G (c, q, 10, 3)
        [1/m] and weights w (c, q) [m^3].
    """
    for bent, natural in ((False, 2), (True, 4)):
        points, weights = _quadrature(degree or natural)
        N, dN = _shape_functions(points)
        members = np.flatnonzero(mesh.curved == bent)
        for first in range(0, len(members), _CHUNK):
            part = members[first : first + _CHUNK]
            J = np.einsum("qai,tax->tqix", dN, mesh.nodes[mesh.cells[part]])
            G = np.einsum("qai,tqxi->tqax", dN, np.linalg.inv(J))
            yield part, N, G, weights * np.linalg.det(J)


def node_gradients(mesh: Quadratic) -> Iterator[tuple[NDArray, NDArray]]:
    """Gradients of the shape functions at the nodes of each element.

    Args:
        mesh: the tetrahedra.

    Yields:
        Indices (c,) of elements and gradients (c, 10, 10, 3) [1/m]: node, function,
        direction.
    """
    places = np.concatenate([_CORNERS, _CORNERS[EDGES].mean(axis=1)])
    dN = _shape_functions(places)[1]
    for first in range(0, len(mesh.cells), _CHUNK):
        part = np.arange(first, min(first + _CHUNK, len(mesh.cells)))
        J = np.einsum("qai,tax->tqix", dN, mesh.nodes[mesh.cells[part]])
        yield part, np.einsum("qai,tqxi->tqax", dN, np.linalg.inv(J))


def triangle_areas(mesh: Quadratic, faces: NDArray) -> tuple[NDArray, NDArray]:
    """What integrals over curved triangles need.

    Args:
        mesh: whose nodes they have.
        faces: (f, 6) nodes of triangles.

    Returns:
        Shape functions (6, 6) at the quadrature points and weights (f, 6) [m^2].
    """
    N, dN, weights = triangle_rule()
    J = np.einsum("qai,tax->tqix", dN, mesh.nodes[faces])
    return N, np.linalg.norm(np.cross(J[:, :, 0], J[:, :, 1]), axis=2) * weights


def triangle_rule() -> tuple[NDArray, NDArray, NDArray]:
    """Quadrature of six points on a quadratic triangle, degree 4 (Dunavant).

    Returns:
        Shape functions (6, 6), their gradients (6, 6, 2) and weights (6,).
    """
    a, b = 0.445948490915965, 0.091576213509771
    v, w = 0.223381589678011 / 2, 0.109951743655322 / 2
    L = np.array([np.roll([1 - 2 * p, p, p], k) for p in (a, b) for k in range(3)])
    pairs = [(0, 1), (1, 2), (0, 2)]
    middle = np.stack([4 * L[:, i] * L[:, j] for i, j in pairs], axis=1)
    d = np.zeros((6, 6, 3))
    for k in range(3):
        d[:, k, k] = 4 * L[:, k] - 1
    for k, (i, j) in enumerate(pairs):
        d[:, 3 + k, i], d[:, 3 + k, j] = 4 * L[:, j], 4 * L[:, i]
    N = np.concatenate([L * (2 * L - 1), middle], axis=1)
    return N, d[:, :, 1:] - d[:, :, :1], np.repeat([v, w], 3)


def lame(E: float, nu: float) -> tuple[float, float]:
    """Lame's constants.

    Args:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.

    Returns:
        lambda and mu [Pa].
    """
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def assemble(mesh: Quadratic, lam: NDArray, mu: NDArray) -> csr_array:
    """The stiffness of all elements together.

    Args:
        mesh: the tetrahedra.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.

    Returns:
        (3n, 3n) [N/m] the upper triangle; row 3 i + k is direction k of node i.
    """
    count = len(mesh.nodes)
    a, b = np.triu_indices(10)
    row, column = mesh.cells[:, a], mesh.cells[:, b]
    swapped = row > column
    code = np.minimum(row, column) * np.int64(count) + np.maximum(row, column)
    code, position = np.unique(code.ravel(), return_inverse=True)
    position = position.reshape(row.shape)
    values = np.zeros((9, len(code)))
    for part, _, G, w in integration(mesh):
        block = _node_blocks(G, w, lam[part], mu[part])[:, a, b]
        turned = swapped[part]
        block[turned] = block[turned].transpose(0, 2, 1)
        place = position[part].ravel()
        low, high = place.min(), place.max() + 1
        for k, entries in enumerate(block.reshape(-1, 9).T):
            values[k, low:high] += np.bincount(place - low, entries, high - low)
    start = np.searchsorted(code // count, np.arange(count + 1))
    blocks = (values.T.reshape(-1, 3, 3), code % count, start)
    whole = bsr_array(blocks, shape=(3 * count, 3 * count)).tocsr()
    # a node's own block comes first: its second row loses one entry, its third two
    first = whole.indptr[:-1].reshape(-1, 3)
    upper = np.ones(whole.nnz, dtype=bool)
    upper[[first[:, 1], first[:, 2], first[:, 2] + 1]] = False
    lost = np.r_[0, np.cumsum(np.tile([0, 1, 2], count))]
    kept = (whole.data[upper], whole.indices[upper], whole.indptr - lost)
    return csr_array(kept, shape=whole.shape)


def _node_blocks(G: NDArray, w: NDArray, lam: NDArray, mu: NDArray) -> NDArray:
    """(c, 10, 10, 3, 3) stiffness between pairs of nodes of each element."""
    flat = (G * np.sqrt(w)[:, :, None, None]).reshape(len(G), w.shape[1], 30)
    S = (flat.transpose(0, 2, 1) @ flat).reshape(-1, 10, 3, 10, 3)
    S = S.transpose(0, 1, 3, 2, 4)  # [a, b, i, j] = sum w G_ai G_bj
    m = mu[:, None, None, None, None]
    block = lam[:, None, None, None, None] * S + m * S.swapaxes(3, 4)
    trace = np.trace(S, axis1=3, axis2=4)
    block[..., range(3), range(3)] += mu[:, None, None, None] * trace[..., None]
    return block
