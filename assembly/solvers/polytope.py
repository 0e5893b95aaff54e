"""A convex polytope in three dimensions, cut plane by plane; its vertices are known.

A cut drops the corners above the plane and puts new ones where it meets an edge; an
edge is two corners with two planes in common.  Every corner has three planes: one that
a plane touches by accident counts as below it, so that where more than three meet,
corners lie together and nothing else changes.
"""

from typing import NamedTuple

import numpy as np

from assembly.solvers.compiled import part
from assembly.solvers.layouts import IndexRows, Indices, Matrix, Vector
from assembly.solvers.vectors import indices, matrix, vector

_MOST = 4096  # corners; 400 planes make 800


class Polytope(NamedTuple):
    """The points below a growing number of planes.

    Attributes:
        corners: (4096, 3) the first ``used[0]`` are the body's; some may lie together.
        planes: (4096, 3) the planes through each.
        used: (2,) corners, and planes so far.
    """

    corners: Matrix
    planes: IndexRows
    used: Indices


@part
def empty_polytope() -> Polytope:
    """Memory for a polytope."""
    return Polytope(matrix(_MOST, 3), np.empty((_MOST, 3), np.int64), indices(2))


@part
def start_box(body: Polytope, axes: Matrix, low: Vector, high: Vector) -> None:
    """Make the body a box.

    Args:
        body: overwritten with it.
        axes: (3, 3) orthonormal rows, the box's directions.
        low: (3,) least component along each.
        high: (3,) largest.
    """
    for i in range(8):
        for axis in range(3):
            side = (i >> axis) & 1
            height = high[axis] if side else low[axis]
            for a in range(3):
                if axis == 0:
                    body.corners[i, a] = 0.0
                body.corners[i, a] += height * axes[axis, a]
            body.planes[i, axis] = 2 * axis + side
    body.used[0], body.used[1] = 8, 6


@part
def cut(body: Polytope, normal: Vector, height: float) -> bool:
    """Keep the points x with normal . x <= height.

    Args:
        body: cut in place.
        normal: (3,) unit vector.
        height: of the plane along it.

    Returns:
        Whether there was room for the new corners; if not, the body is as it was.
    """
    corners, planes = body.corners, body.planes
    count, plane = body.used[0], body.used[1]
    body.used[1] += 1
    above, size = vector(count), 0.0
    for i in range(count):
        above[i] = -height
        for a in range(3):
            above[i] += corners[i, a] * normal[a]
            size = max(size, abs(corners[i, a]))
    limit = 1e-14 * size
    new = count
    for i in range(count):
        if above[i] <= limit:
            continue
        for j in range(count):
            if above[j] > limit:
                continue
            # the planes in common
            shared, first, second = 0, -1, -1
            for a in range(3):
                one = planes[i, a]
                if one == planes[j, 0] or one == planes[j, 1] or one == planes[j, 2]:
                    shared += 1
                    first, second = second, one
            if shared < 2:
                continue
            if new == _MOST:
                return False
            # an inner corner above the plane by rounding is itself the new one
            share = min(1.0, above[i] / (above[i] - above[j]))
            for a in range(3):
                edge = corners[j, a] - corners[i, a]
                corners[new, a] = corners[i, a] + share * edge
            planes[new, 0], planes[new, 1], planes[new, 2] = first, second, plane
            new += 1
    kept = 0
    for i in range(new):
        if i >= count or above[i] <= limit:
            if kept != i:
                for a in range(3):
                    corners[kept, a], planes[kept, a] = corners[i, a], planes[i, a]
            kept += 1
    body.used[0] = kept
    return True


@part
def farthest_corner(body: Polytope) -> Vector:
    """(3,) the corner farthest from the origin."""
    best, at = -1.0, 0
    for i in range(body.used[0]):
        size = 0.0
        for a in range(3):
            size += body.corners[i, a] ** 2
        if size > best:
            best, at = size, i
    return body.corners[at].copy()
