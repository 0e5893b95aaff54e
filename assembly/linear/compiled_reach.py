"""The reachable set of platform screws of (27) and its farthest point, compiled.

Readings ``frozen`` and ``free``: deformations stay, unloaded clearances move, passive
joints follow.  See :mod:`assembly.linear.pose_error` for the problem, and
:mod:`assembly.solvers.farthest` for the search.  Points with a numerically ambiguous
rank, or where a passive joint could pass the bound of its motion, go to the fallback.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_reduction import (
    Triangle,
    least_motions,
    orthogonal_rows,
    small_problem,
)
from assembly.linear.compiled_structure import free_columns, paths_of
from assembly.linear.compiled_zone import largest_clearance, orthonormal_rows
from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import (
    FALLBACK,
    SOLVED,
    Bounds,
    Centres,
    ClearanceLoads,
)
from assembly.linear.thresholds import MISMATCH_FACTOR, RANK, UNBOUNDED
from assembly.solvers.compiled import kernel, part
from assembly.solvers.farthest import DONE, advance, begin
from assembly.solvers.householder import CLEAR, triangulate, turn_all
from assembly.solvers.layers import LANES
from assembly.solvers.layouts import Mask, Matrices, Matrix, Vector
from assembly.solvers.polytope import empty_polytope
from assembly.solvers.support import ConvexBody
from assembly.solvers.vectors import copy, indices, into_cones, matrix, vector

_APART = 100.0  # load and slack of a cone must differ by this factor, see loaded_cones


@kernel
def bound_all(
    s: Structure, T: NDArray, mismatch: NDArray, centres: Centres,
    loads: ClearanceLoads, asked: tuple[NDArray, NDArray], out: Bounds,
) -> None:  # fmt: skip
    """Bracket the largest pose errors of all points not left to the fallback.

    Args:
        s: the robot, without springs.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        centres: the solution of (22).
        loads: which of its clearances are held.
        asked: (3,) [m] from the platform's origin to the point whose error is meant;
            (2,) [rad, m] asked of upper minus lower bounds.
        out: arrays to fill; rows whose outcome is FALLBACK are left out.
    """
    outer, (offset, tolerance) = empty_polytope(), asked
    for i in range(len(T)):
        if out.outcome[i] != SOLVED:
            continue
        decided, loaded = loaded_cones(loads, paths_of(T[i], s), i)
        rank_tolerance = RANK + MISMATCH_FACTOR * mismatch[i]
        bounded, body = body_of(s, T[i], rank_tolerance, centres, i, loaded, offset)
        if not (decided and bounded):
            out.outcome[i] = FALLBACK
            continue
        for half in range(2):
            search = begin(body, 3 * half, tolerance[half], outer)
            if advance(body, search) != DONE:
                out.outcome[i] = FALLBACK
            out.supports[i] += search.counts[1]
            if half == 0:
                copy(search.bounds, out.rotation[i])
                copy(search.best, out.rotation_screw[i])
            else:
                copy(search.bounds, out.translation[i])
                copy(search.best, out.translation_screw[i])


@part
def loaded_cones(loads: ClearanceLoads, P: Matrices, point: int) -> tuple[bool, Mask]:
    """Clearances whose constraint is active, as in :mod:`assembly.linear.reach`.

    Load times slack is about the solver's gap, so one of the two is nearly zero.

    Args:
        loads: of the solution of (22).
        P: (n, 6, 6) unit screws of every frame at the platform.
        point: which one.

    Returns:
        Whether that is unambiguous; (cones,) bool.
    """
    h, wrench = loads.structure, loads.multipliers[point]
    energy = loads.energy[point]
    scale = max(energy, 1e-9 * loads.without_clearance[point], 1e-300)
    loaded, decided = np.zeros(len(loads.cone_of), np.bool_), True
    for c in range(len(loaded)):
        squares, size = 0.0, 0.0
        own = loads.cone_of[c]
        for i in range(h.starts[own], h.starts[own + 1]):
            j, component = h.cone_frame[i], 0.0
            for k in range(h.patterns.shape[1]):
                sign = h.patterns[h.pattern_of[j], k]
                if sign != 0.0:
                    for a in range(6):
                        component += sign * wrench[6 * k + a] * P[j, h.cone_axis[i], a]
            squares += (component * h.cone_size[i]) ** 2
            size += loads.clearances[point, i] ** 2
        load = np.sqrt(squares) / scale
        slack = max(1.0 - np.sqrt(size), 0.0)  # in this order NaN stays NaN
        loaded[c] = load > slack and load > 1e-9
        apart = load > _APART * slack or slack > _APART * load
        # written so that NaN is ambiguous
        decided = decided and (apart or max(load, slack) <= 1e-9)
    return decided, loaded


@part
def body_of(
    s: Structure, T: Matrices, tolerance: float, centres: Centres, point: int,
    loaded: Mask, offset: Vector,
) -> tuple[bool, ConvexBody]:  # fmt: skip
    """The set of platform screws of one point, and whether it is valid.

    Args:
        s: the robot, without springs.
        T: (n, 4, 4) frames of the point.
        tolerance: of ranks.
        centres: the solution of (22).
        point: which one.
        loaded: (cones,) the clearances that are held.
        offset: (3,) [m] to the point of the platform whose error is meant.

    Returns:
        Whether ranks are unambiguous, the platform moves within bounds, and no passive
        joint comes to the bound of its own motion; the set.
    """
    P = paths_of(T, s)
    m, nq = 6 * s.patterns.shape[1], len(s.free_frame)
    F = free_columns(s, P, m)
    turns, diagonal, order = vector(nq), vector(nq), indices(nq)
    rank = triangulate(F, turns, diagonal, order, tolerance, 0.0, 1e-11)
    centre, clearances = centres.screws[point].copy(), centres.clearances[point]
    _shift(centre.reshape(6, 1), offset)
    nothing = matrix(6, 0), matrix(0, 0), vector(0), indices(1)
    if rank < 0:
        return False, ConvexBody(centre, *nothing)
    free = Triangle(F, turns, diagonal, order, rank)
    bounded, follow = _follow(s, P, free, m)
    motions = centres.motions[point]
    if not bounded or not _within_bounds(s, P, free, clearances, motions, loaded):
        return False, ConvexBody(centre, *nothing)
    Z = orthogonal_rows(F, turns, rank, m)
    columns, _ = small_problem(s, P, Z, len(Z), vector(m))
    kept = 0
    for c in range(len(s.starts) - 1):
        if not loaded[c]:
            kept += s.starts[c + 1] - s.starts[c]
    X, rows, start = matrix(6, kept), matrix(len(Z), kept), vector(kept)
    starts = indices(len(s.starts))
    at, cones = 0, 0
    for c in range(len(s.starts) - 1):
        if loaded[c]:
            continue
        for i in range(s.starts[c], s.starts[c + 1]):
            for l in range(len(Z)):
                rows[l, at] = columns[i, l]
            start[at] = clearances[i]
            _move_platform(s, P, follow, i, X, at)
            at += 1
        cones += 1
        starts[cones] = at
    starts = starts[: cones + 1].copy()
    into_cones(starts, start)
    _shift(X, offset)
    decided, B, _ = orthonormal_rows(rows, vector(len(Z)), largest_clearance(s, P))
    return decided, ConvexBody(centre, X, B, start, starts)


@part
def _follow(s: Structure, P: Matrices, free: Triangle, m: int) -> tuple[bool, Matrix]:
    """Scaled platform screws (6, m) as free motions follow the closures.

    Returns:
        False where free motions move the platform and no closure; the screws.
    """
    F, turns, diagonal, order, rank = free
    nq = len(s.free_frame)
    follow, largest = matrix(m, LANES), 0.0
    for a in range(6):
        drive = vector(nq)
        for i in range(nq):
            j = s.free_frame[order[i]]
            drive[i] = s.on_path[j] * P[j, s.free_axis[order[i]], a]
            for l in range(min(i, rank)):
                drive[i] -= F[i, l] * follow[l, a]
            if i < rank:
                follow[i, a] = drive[i] / diagonal[i]
            else:
                largest = max(largest, abs(drive[i]))
    turn_all(F, turns, rank, follow)
    return largest <= UNBOUNDED / CLEAR, np.ascontiguousarray(follow[:, :6].T)


@part
def _within_bounds(
    s: Structure, P: Matrices, free: Triangle, clearances: Vector, motions: Vector,
    loaded: Mask,
) -> bool:  # fmt: skip
    """Whether no passive joint passes its bound; see :mod:`assembly.linear.reach`."""
    F, turns, diagonal, order, rank = free
    nq, m = F.shape
    bounded = False
    for q in range(nq):
        bounded = bounded or s.free_bound[q] < np.inf
    if not bounded:
        return True
    middle, most = motions.copy(), vector(nq)
    moved, step = vector(m), vector(nq)
    for c in range(len(s.starts) - 1):
        if loaded[c]:
            continue
        squares = vector(nq)
        for i in range(s.starts[c], s.starts[c + 1]):
            j = s.cone_frame[i]
            for k in range(m // 6):
                sign = s.patterns[s.pattern_of[j], k] * s.cone_size[i]
                for a in range(6):
                    moved[6 * k + a] = sign * P[j, s.cone_axis[i], a]
            least_motions(F, turns, diagonal, order, rank, moved, step)
            for q in range(nq):
                middle[q] -= step[q] * clearances[i]
                squares[q] += step[q] * step[q]
        for q in range(nq):
            most[q] += np.sqrt(squares[q])
    for q in range(nq):
        # written so that NaN is not within
        if s.free_bound[q] < np.inf:
            if not abs(middle[q]) + most[q] <= s.free_bound[q]:
                return False
    return True


@part
def _move_platform(
    s: Structure, P: Matrices, follow: Matrix, i: int, X: Matrix, at: int
) -> None:
    """Column of X [rad, m]: what clearance i does to the platform, free motions too."""
    j = s.cone_frame[i]
    column, pattern = P[j, s.cone_axis[i]], s.patterns[s.pattern_of[j]]
    for a in range(6):
        X[a, at] = s.on_path[j] * column[a]
        for k in range(len(pattern)):
            if pattern[k] != 0.0:
                for b in range(6):
                    X[a, at] -= follow[a, 6 * k + b] * pattern[k] * column[b]
        X[a, at] *= s.cone_size[i] if a < 3 else s.cone_size[i] * s.size


@part
def _shift(screws: Matrix, offset: Vector) -> None:
    """Read screws, the columns, at another point of the platform."""
    for j in range(screws.shape[1]):
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            moved = screws[b, j] * offset[c] - screws[c, j] * offset[b]
            screws[3 + a, j] += moved
