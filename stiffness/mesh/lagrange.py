r"""Lagrange polynomials on tetrahedra and triangles.

====== ========================================================== ==========
symbol meaning                                                    shape
====== ========================================================== ==========
L      barycentric coordinates of points                          (q, c)
N      shape functions at the points                              (q, m)
dN     derivatives of N, with L_1 .. L_(c-1) as variables          (q, m, c-1)
====== ========================================================== ==========

The number of coordinates c is 4 for a tetrahedron and 3 for a triangle. The lattice of
degree p consists of all points whose barycentric coordinates are multiples of 1 / p.
Corners come first, then points on edges, points on faces and inner points. The corners
of each element are in increasing order, so that two elements have the nodes of a common
face in the same order.
"""

from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

EDGES = np.array(list(combinations(range(4), 2)))
FACES = np.array(list(combinations(range(4), 3)))  # face k is opposite to corner 3 - k


@lru_cache(maxsize=16)
def lattice(degree: int, corners: int = 4) -> NDArray:
    """Return the barycentric coordinates of the lattice points.

    Args:
        degree: degree of the polynomials, >= 1.
        corners: 4 for a tetrahedron, 3 for a triangle.

    Returns:
        (m, corners) integers, which are the coordinates times ``degree``.
    """
    points = []
    for size in range(1, corners + 1):
        for members in combinations(range(corners), size):
            for shares in _partitions(degree, size):
                point = np.zeros(corners, dtype=int)
                point[list(members)] = shares
                points.append(point)
    return np.array(points)


def _partitions(total: int, parts: int) -> list[tuple[int, ...]]:
    """List all tuples of positive integers with a given sum."""
    if parts == 1:
        return [(total,)]
    return [
        (first, *rest)
        for first in range(total - parts + 1, 0, -1)
        for rest in _partitions(total - first, parts - 1)
    ]


def shape_functions(degree: int, L: NDArray) -> tuple[NDArray, NDArray]:
    """Evaluate the Lagrange polynomials at given points.

    Args:
        degree: degree of the polynomials.
        L: (q, c) barycentric coordinates.

    Returns:
        Shape functions N, (q, m), and their derivatives dN, (q, m, c - 1).

    Sources:
        Silvester (1969) for polynomials that are products of functions of one
        coordinate.
    """
    count, corners = L.shape
    P = np.ones((degree + 1, count, corners))
    D = np.zeros_like(P)
    for k in range(1, degree + 1):
        factor = (degree * L - k + 1) / k
        P[k] = P[k - 1] * factor
        D[k] = D[k - 1] * factor + P[k - 1] * degree / k
    order = lattice(degree, corners)
    values = np.stack([P[order[:, c], :, c].T for c in range(corners)])
    slopes = np.stack([D[order[:, c], :, c].T for c in range(corners)])
    by_corner = [
        slopes[c] * np.delete(values, c, axis=0).prod(axis=0) for c in range(corners)
    ]
    dN = np.stack([d - by_corner[0] for d in by_corner[1:]], axis=-1)
    return values.prod(axis=0), dN


def numbered(corners: NDArray, degree: int) -> tuple[NDArray, int]:
    """Number the nodes of elements. Shared nodes have the same number.

    Args:
        corners: (t, 4) corners of each element, in increasing order.
        degree: degree of the polynomials.

    Returns:
        Node numbers of each element, (t, m), and the total number of nodes.
    """
    total = int(corners.max()) + 1
    parts = [corners]
    for members in (EDGES, FACES):
        size = members.shape[1]
        each = len(_partitions(degree, size)) if degree >= size else 0
        if each:
            code = np.zeros((len(corners), len(members)), dtype=np.int64)
            for k in range(size):
                code = code * (int(corners.max()) + 1) + corners[:, members[:, k]]
            unique, index = np.unique(code, return_inverse=True)
            first = total + each * index.reshape(code.shape + (1,))
            parts.append((first + np.arange(each)).reshape(len(corners), -1))
            total += each * len(unique)
    inside = len(lattice(degree)) - sum(part.shape[1] for part in parts)
    if inside:
        own = total + np.arange(inside * len(corners))
        parts.append(own.reshape(len(corners), inside))
        total += inside * len(corners)
    return np.concatenate(parts, axis=1), total


@lru_cache(maxsize=8)
def face_nodes(degree: int) -> NDArray:
    """Return the indices of the nodes on each face of a tetrahedron.

    Args:
        degree: degree of the polynomials.

    Returns:
        (4, k) indices of the nodes on each of ``FACES``, in the order of the lattice
        points of a triangle.
    """
    whole = [tuple(point) for point in lattice(degree)]
    rows = []
    for face in FACES:
        points = np.zeros((len(lattice(degree, 3)), 4), dtype=int)
        points[:, face] = lattice(degree, 3)
        rows.append([whole.index(tuple(point)) for point in points])
    return np.array(rows)
