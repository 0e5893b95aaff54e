"""Self-intersections of a surface."""

import numpy as np
from numpy.typing import NDArray


def crossing_triangles(points: NDArray, triangles: NDArray) -> NDArray:
    """Find pairs of triangles that intersect.

    Args:
        points: (n, 3) [m] positions of the corners.
        triangles: (m, 3) indices of points.

    Returns:
        (k, 2) indices of the triangles of each pair. An edge of one triangle passes
        through the interior of the other, and they have no common corner. Pairs that
        only touch are not included.
    """
    pairs = _near_pairs(points, triangles)
    shared = (
        triangles[pairs[:, 0]][:, :, None] == triangles[pairs[:, 1]][:, None]
    ).any(axis=(1, 2))
    pairs = pairs[~shared]
    cut = _edge_through(points, triangles, pairs)
    cut |= _edge_through(points, triangles, pairs[:, ::-1])
    return pairs[cut]


def _near_pairs(points: NDArray, triangles: NDArray) -> NDArray:
    """Find the pairs of triangles whose bounding boxes overlap."""
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    axis = int(np.argmax(np.ptp(points, axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    start = low[order, axis]
    last = np.searchsorted(start, high[order, axis], side="right")
    pairs = []
    for first in range(0, len(order), 512):
        rows = np.arange(first, min(first + 512, len(order)))
        columns = rows[:, None] + np.arange(1, int((last[rows] - rows).max()))
        proper = columns < last[rows][:, None]
        columns = np.minimum(columns, len(order) - 1)
        a, b = order[rows][:, None], order[columns]
        for k in range(3):
            if k != axis:
                proper &= (low[a, k] <= high[b, k]) & (low[b, k] <= high[a, k])
        i, j = np.nonzero(proper)
        pairs.append(np.column_stack([order[rows[i]], order[columns[i, j]]]))
    return np.concatenate(pairs)


def _edge_through(points: NDArray, triangles: NDArray, pairs: NDArray) -> NDArray:
    """Return whether an edge of the first triangle passes through the second."""
    a, b, c = np.moveaxis(points[triangles[pairs[:, 1]]], 1, 0)
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    hit = np.zeros(len(pairs), dtype=bool)
    for k in range(3):
        p = points[triangles[pairs[:, 0], k]]
        q = points[triangles[pairs[:, 0], (k + 1) % 3]]
        # the signs of volumes determine whether the edge crosses the plane inside the
        # triangle
        dp = np.einsum("ij,ij->i", normal, p - a)
        dq = np.einsum("ij,ij->i", normal, q - a)
        tiny = 1e-9 * size * np.linalg.norm(q - p, axis=1)
        through = (dp * dq < 0) & (np.abs(dp) > tiny) & (np.abs(dq) > tiny)
        sides = [
            np.einsum("ij,ij->i", q - p, np.cross(u - p, v - p))
            for u, v in ((a, b), (b, c), (c, a))
        ]
        within = np.all([s > tiny for s in sides], axis=0)
        within |= np.all([s < -tiny for s in sides], axis=0)
        hit |= through & within
    return hit
