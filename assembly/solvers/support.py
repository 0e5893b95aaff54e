"""How far a convex body of platform screws extends along a direction, compiled.

The body is {centre + X (v - start) : |v_k| <= 1, H (v - start) = 0}.  Its support
function along d is a small cone programme; the multipliers n of its rows, whatever they
are, prove an upper bound,

    d.(centre - X start) + n.H start + sum_k |(X^T d - H^T n)_k|,

and its point is projected into the body: both hold whatever the solver returned.
"""

from typing import NamedTuple

import numpy as np

from assembly.solvers.compiled import kernel, part
from assembly.solvers.interior import Programme, interior_point
from assembly.solvers.layouts import Indices, Matrix, Vector
from assembly.solvers.vectors import divide, inner, matrix, vector

_SYMMETRIC = 1e-14  # H start counts as zero
_ROUNDING = 1e-14  # by which a cone may be exceeded


class ConvexBody(NamedTuple):
    """Platform screws that remain possible; see the head of this module.

    Attributes:
        centre: (6,) [rad, m] the screw at ``start``.
        map: (6, nv) [rad, m] X.
        rows: (p, nv) H, orthonormal.
        start: (nv,) within the cones.
        starts: (cones + 1,) first column of each cone, and nv.
    """

    centre: Vector
    map: Matrix
    rows: Matrix
    start: Vector
    starts: Indices


@kernel
def gradient_along(
    body: ConvexBody, part: int, direction: Vector, tolerance: float
) -> Vector:
    """The gradient of :func:`support`, for callers that are not compiled themselves."""
    return support(body, part, direction, tolerance)[2]


@part
def support(
    body: ConvexBody, part: int, direction: Vector, tolerance: float
) -> tuple[float, Vector, Vector, Vector]:
    """Largest component of the body's screws along a direction.

    Args:
        body: the convex body.
        part: first of the three components.
        direction: (3,) unit vector.
        tolerance: [rad or m] that may be left between height and point.

    Returns:
        The certified height, v (nv,) of the body, the gradient X^T d - H^T n (nv,) and
        n; height and point may be farther apart where the solver broke down.
    """
    p, nv = body.rows.shape
    gradient, height, size = vector(nv), 0.0, 0.0
    n = vector(p)
    for a in range(3):
        height += direction[a] * body.centre[part + a]
        for j in range(nv):
            gradient[j] += direction[a] * body.map[part + a, j]
    for j in range(nv):
        size += gradient[j] * gradient[j]
        height -= gradient[j] * body.start[j]
    size = np.sqrt(size)
    if not size > 0.0:
        return height, body.start.copy(), gradient, n
    v = body.start.copy()
    if p:
        right = vector(p)
        for i in range(p):
            for j in range(nv):
                right[i] += body.rows[i, j] * body.start[j]
        programme = Programme(
            matrix(0, nv), vector(0), divide(gradient, size), body.rows, right,
            body.starts,
        )  # fmt: skip
        v, n, _ = interior_point(programme, tolerance / size, 0.0)
        for i in range(p):
            n[i] *= size
            height += n[i] * right[i]
            for j in range(nv):
                gradient[j] -= n[i] * body.rows[i, j]
    for c in range(len(body.starts) - 1):
        length = 0.0
        for j in range(body.starts[c], body.starts[c + 1]):
            length += gradient[j] * gradient[j]
        length = np.sqrt(length)
        height += length
        if p == 0 and length > 0.0:
            for j in range(body.starts[c], body.starts[c + 1]):
                v[j] = gradient[j] / length
    return height, within(body, v) if p else v, gradient, n


@part
def within(body: ConvexBody, v: Vector) -> Vector:
    """A nearby v that satisfies rows and cones to rounding."""
    step = vector(len(v))
    for j in range(len(v)):
        step[j] = v[j] - body.start[j]
    for i in range(len(body.rows)):
        residual = inner(body.rows[i], step)
        for j in range(len(step)):
            step[j] -= residual * body.rows[i, j]
    # the longest part of the step, from a start inside, that stays in all cones
    share = 1.0
    for c in range(len(body.starts) - 1):
        aa, ab, bb = 0.0, 0.0, -1.0 - _ROUNDING
        for j in range(body.starts[c], body.starts[c + 1]):
            aa += step[j] * step[j]
            ab += body.start[j] * step[j]
            bb += body.start[j] * body.start[j]
        if aa + 2.0 * ab + bb > 0.0:
            root = np.sqrt(max(ab * ab - aa * bb, 0.0))
            share = min(share, -bb / (ab + root) if ab > 0.0 else (root - ab) / aa)
    for j in range(len(v)):
        step[j] = body.start[j] + max(share, 0.0) * step[j]
    return step


@part
def screw_at(body: ConvexBody, v: Vector) -> Vector:
    """(6,) platform screw at v."""
    screw = body.centre.copy()
    for j in range(len(v)):
        step = v[j] - body.start[j]
        for a in range(6):
            screw[a] += body.map[a, j] * step
    return screw


@part
def symmetric(body: ConvexBody) -> bool:
    """Whether v -> -v leaves the rows satisfied."""
    for i in range(len(body.rows)):
        if not abs(inner(body.rows[i], body.start)) <= _SYMMETRIC:
            return False
    return True
