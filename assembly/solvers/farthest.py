"""The farthest point of a convex body of platform screws, bracketed: problem (27).

The largest rotation, or translation, in the body of :mod:`assembly.solvers.support` is
sought.  It depends on three components: their projection is approximated from outside
by planes in three dimensions:

- a support function gives a cut on the upper side and a point on the lower; where the
  body is symmetric, the same support holds for the opposite direction;
- first the search climbs: the direction of the supporting point gains more;
- then a box along that direction, and always the farthest vertex of what remains;
- :mod:`assembly.solvers.majorant` bounds round bodies, which would take many cuts.

Where the certificate of the interior-point method falls short, :data:`NEEDED` is
returned: the caller solves that direction by the fallback and the search continues.

Sources:
    Horst, Tuy (1996), Global Optimization, ch. II (outer approximation of a convex
    maximisation).
"""

from typing import NamedTuple

import numpy as np

from assembly.solvers.compiled import kernel, part
from assembly.solvers.layouts import GivenVector, Indices, Matrix, Vector
from assembly.solvers.majorant import eigenvectors, majorant_bound
from assembly.solvers.polytope import (
    Polytope,
    cut,
    empty_polytope,
    farthest_corner,
    start_box,
)
from assembly.solvers.support import ConvexBody, screw_at, support, symmetric, within
from assembly.solvers.vectors import copy, divide, fill, indices, inner, matrix, vector

DONE, NEEDED, GAVE_UP = range(3)
_CLIMBING, _BOXING, _CUTTING = range(3)
_CLIMBS = 8
_MOST_SUPPORTS = 400  # after which a search gives up
_GAIN = 1e-3  # [tolerances] a climb that gains less is over
_SHARE = 0.1  # of the tolerance that a support is asked to leave open at most ..
_POOR = 0.5  # .. and with which the search still goes on


class Search(NamedTuple):
    """State of a search.

    Attributes:
        part: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] asked of upper minus lower bound.
        bounds: (2,) [rad or m] lower and upper.
        best: (6,) [rad, m] attains the lower bound.
        direction: (3,) of the next support.
        axes: (3, 3) rows of the box.
        heights: (2, 3) of the box, low and high, NaN where not known.
        cuts: (32, 4) planes found before there was a box.
        counts: (4,) stage, supports, planes kept, whether the last improved.
        outer: polytope of the planes.
    """

    part: int
    tolerance: float
    bounds: Vector
    best: Vector
    direction: Vector
    axes: Matrix
    heights: Matrix
    cuts: Matrix
    counts: Indices
    outer: Polytope


@kernel
def begin_search(body: ConvexBody, part: int, tolerance: float) -> Search:
    """:func:`begin` for callers that are not compiled themselves."""
    return begin(body, part, tolerance, empty_polytope())


@kernel
def search_on(
    body: ConvexBody, search: Search, height: float, screw: Vector, gradient: Vector
) -> int:
    """Take in what :func:`learn` is given, unless empty, and :func:`advance`."""
    if len(gradient):
        learn(body, search, height, screw, gradient)
        choose(search)
    return advance(body, search)


@part
def begin(body: ConvexBody, part: int, tolerance: float, outer: Polytope) -> Search:
    """A search without supports yet.

    Args:
        body: what is searched.
        part: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] asked of upper minus lower bound.
        outer: room for the planes.

    Returns:
        The search, its first direction chosen.
    """
    best = body.centre.copy()
    size = 0.0
    for a in range(3):
        size += best[part + a] ** 2
    size = np.sqrt(size)
    search = Search(
        part, tolerance, vector(2), best, vector(3), matrix(3, 3),
        matrix(2, 3), matrix(32, 4), indices(4), outer,
    )  # fmt: skip
    search.bounds[0], search.bounds[1] = size, np.inf
    fill(search.heights[0], np.nan)
    fill(search.heights[1], np.nan)
    if body.map.shape[1]:
        _first_direction(body, search)
    else:
        search.bounds[1] = size
    return search


@part
def _first_direction(body: ConvexBody, search: Search) -> None:
    """The direction of farthest reach if there were no closures."""
    p, nv = body.rows.shape
    free = body.map[search.part : search.part + 3].copy()
    for i in range(p):
        for a in range(3):
            along = inner(free[a], body.rows[i])
            for j in range(nv):
                free[a, j] -= along * body.rows[i, j]
    Q = matrix(3, 3)
    for a in range(3):
        for b in range(3):
            Q[a, b] = inner(free[a], free[b])
    _, vectors = eigenvectors(Q)
    most = -1.0
    for candidate in range(4):
        d = vector(3)
        for a in range(3):
            d[a] = body.centre[search.part + a]
            if candidate < 3:
                d[a] = vectors[a, candidate]
        size = np.sqrt(inner(d, d))
        if not size > 0.0:
            continue
        d = divide(d, size)
        middle, height = 0.0, 0.0
        for a in range(3):
            middle += d[a] * body.centre[search.part + a]
        for c in range(len(body.starts) - 1):
            length = 0.0
            for j in range(body.starts[c], body.starts[c + 1]):
                own = d[0] * free[0, j] + d[1] * free[1, j] + d[2] * free[2, j]
                length += own * own
                middle -= own * body.start[j]
            height += np.sqrt(length)
        sign = 1.0 if middle >= 0.0 else -1.0
        if height + abs(middle) > most:
            most = height + abs(middle)
            for a in range(3):
                search.direction[a] = sign * d[a]


@part
def advance(body: ConvexBody, search: Search) -> int:
    """Continue until the bounds are as close as asked.

    Args:
        body: what is searched.
        search: updated in place.

    Returns:
        DONE; NEEDED where a support in ``search.direction`` must be given to
        :func:`learn` first; GAVE_UP after as many supports as allowed.
    """
    while True:
        if search.bounds[1] - search.bounds[0] <= search.tolerance:
            return DONE
        if search.counts[1] >= _MOST_SUPPORTS:
            return GAVE_UP
        height, v, gradient, n = support(
            body, search.part, search.direction, _SHARE * search.tolerance
        )
        screw = screw_at(body, v)
        reached = 0.0
        for a in range(3):
            reached += search.direction[a] * screw[search.part + a]
        # written so that NaN fails
        if not height - reached <= _POOR * search.tolerance:
            return NEEDED
        learn(body, search, max(height, reached), screw, gradient)
        if symmetric(body):
            _learn_opposite(body, search, v, gradient)
        choose(search)


@part
def learn(
    body: ConvexBody,
    search: Search,
    height: float,
    screw: GivenVector,
    gradient: GivenVector,
) -> None:
    """Add a support in ``search.direction``.

    Args:
        body: what is searched.
        search: updated in place.
        height: [rad or m] certified upper bound along the direction.
        screw: (6,) of the body.
        gradient: (nv,) X^T d - H^T n.
    """
    search.counts[1] += 1
    search.counts[3] = 0
    _improve(search, screw)
    part = search.part
    search.bounds[1] = min(search.bounds[1], majorant_bound(
        body.centre[part : part + 3], body.map[part : part + 3], body.rows, body.start,
        body.starts, gradient,
    ))  # fmt: skip
    _add_plane(search, search.direction, height)
    search.bounds[1] = max(search.bounds[1], search.bounds[0])


@part
def _improve(search: Search, screw: GivenVector) -> None:
    """Keep a screw that is farther than the best."""
    size = 0.0
    for a in range(3):
        size += screw[search.part + a] ** 2
    size = np.sqrt(size)
    if size > search.bounds[0]:
        if size > search.bounds[0] + _GAIN * search.tolerance:
            search.counts[3] = 1
        search.bounds[0] = size
        for j in range(len(screw)):  # not copy: it would need a signature for this
            search.best[j] = screw[j]


@part
def _add_plane(search: Search, direction: Vector, height: float) -> None:
    """Add a plane: to the box, to those kept for it, or to the polytope."""
    stage = search.counts[0]
    if stage == _CUTTING:
        cut(search.outer, direction, height)
        return
    if stage == _BOXING:
        _set_side(search, direction, height)
        return
    kept = search.counts[2]
    if kept < len(search.cuts):
        copy(direction, search.cuts[kept])
        search.cuts[kept, 3] = height
        search.counts[2] += 1


@part
def _set_side(search: Search, direction: Vector, height: float) -> None:
    """A side of the box, if the direction is one of its axes or the opposite."""
    for axis in range(3):
        along, against = True, True
        for a in range(3):
            along = along and direction[a] == search.axes[axis, a]
            against = against and direction[a] == -search.axes[axis, a]
        if along:
            search.heights[1, axis] = height
        elif against:
            search.heights[0, axis] = -height


@part
def _learn_opposite(
    body: ConvexBody, search: Search, v: Vector, gradient: Vector
) -> None:
    """Add the opposite support of a symmetric body."""
    start = body.start
    screw = screw_at(body, within(body, divide(v, -1.0)))
    _improve(search, screw)
    height = 0.0
    for a in range(3):
        height -= search.direction[a] * body.centre[search.part + a]
    for c in range(len(body.starts) - 1):
        size = 0.0
        for j in range(body.starts[c], body.starts[c + 1]):
            size += gradient[j] * gradient[j]
            height += gradient[j] * start[j]
        height += np.sqrt(size)
    reached = 0.0
    for a in range(3):
        reached -= search.direction[a] * screw[search.part + a]
    _add_plane(search, divide(search.direction, -1.0), max(height, reached))


@part
def choose(search: Search) -> None:
    """Choose the next direction, and the stage."""
    counts, direction = search.counts, search.direction
    if counts[0] == _CLIMBING:
        if counts[3] and counts[1] < _CLIMBS:
            _towards(search, search.best[search.part : search.part + 3])
            return
        _start_boxing(search)
    if counts[0] == _BOXING:
        for axis in range(3):
            for side in range(2):
                if np.isnan(search.heights[side, axis]):
                    for a in range(3):
                        direction[a] = (2 * side - 1) * search.axes[axis, a]
                    return
        start_box(search.outer, search.axes, search.heights[0], search.heights[1])
        counts[0] = _CUTTING
        for i in range(counts[2]):
            cut(search.outer, search.cuts[i, :3].copy(), search.cuts[i, 3])
    corner = farthest_corner(search.outer)
    size = np.sqrt(inner(corner, corner))
    search.bounds[1] = max(search.bounds[0], min(search.bounds[1], size))
    # where the last support gained, the direction of its point gains more, and the
    # second bound is tightest there; else the farthest vertex
    if counts[3]:
        _towards(search, search.best[search.part : search.part + 3])
    else:
        _towards(search, corner)


@part
def _towards(search: Search, point: Vector) -> None:
    """Take the direction of a point."""
    size = np.sqrt(inner(point, point))
    for a in range(3):
        search.direction[a] = point[a] / size


@part
def _start_boxing(search: Search) -> None:
    """A box along the best point's direction, its planes not known yet."""
    search.counts[0] = _BOXING
    own = search.direction
    least = 0
    for a in range(1, 3):
        if abs(own[a]) < abs(own[least]):
            least = a
    axes = search.axes
    for a in range(3):
        axes[0, a], axes[1, a] = own[a], -own[least] * own[a]
    axes[1, least] += 1.0
    copy(divide(axes[1], np.sqrt(inner(axes[1], axes[1]))), axes[1])
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        axes[2, a] = own[b] * axes[1, c] - own[c] * axes[1, b]
    for i in range(search.counts[2]):
        _set_side(search, search.cuts[i, :3], search.cuts[i, 3])
