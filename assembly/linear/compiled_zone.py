"""Problem (21), the zone's margin, compiled from the frames' poses to the certificate.

With every link and joint rigid, B u = w must hold, B's rows orthonormal, |u_k| <= t.
The least t is |w| over the most that g.u can be with |u_k| <= 1 and the rest of B u
zero, g = B^T w / |w|.  In this problem u = 0 is feasible, and so is the start of the
interior-point method.  Its multipliers n bound the margin from below,

    t >= |w| / sum_k |(g - B_rest^T n)_k|.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_reduction import (
    least_motions,
    misfit_of,
    moved_by,
    orthogonal_rows,
    small_problem,
)
from assembly.linear.compiled_structure import free_columns, paths_of
from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import FALLBACK, SOLVED
from assembly.linear.thresholds import (
    INFEASIBLE,
    MARGIN_GAP,
    MISMATCH_FACTOR,
    NOISE,
    RANK,
    ROWS_RANK,
)
from assembly.solvers.compiled import kernel, part
from assembly.solvers.householder import triangulate, turn
from assembly.solvers.interior import Programme, interior_point
from assembly.solvers.layouts import Indices, Matrices, Matrix, Vector
from assembly.solvers.vectors import divide, indices, inner, matrices, matrix, vector

_STOP = 1e-9  # of the margin: gap at which the solver stops


@kernel
def all_margins(
    s: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    margin: NDArray, bound: NDArray, outcome: NDArray,
) -> None:  # fmt: skip
    """Margins of all points, with their lower bounds.

    Args:
        s: the robot, without springs.
        T: (k, n, 4, 4) frames.
        errors: (k, n, 6) [rad, m], or (1, n, 6) for all.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        margin: (k,) to fill.
        bound: (k,) to fill.
        outcome: (k,) to fill: SOLVED or FALLBACK.
    """
    for i in range(len(T)):
        margin[i], bound[i], outcome[i] = np.nan, np.nan, FALLBACK
        tolerance = RANK + MISMATCH_FACTOR * mismatch[i]
        P = paths_of(T[i], s)
        known = misfit_of(s, P, errors[i if len(errors) > 1 else 0])
        if inner(known, known) == 0.0:
            # nothing to close: no clearance is needed
            margin[i], bound[i], outcome[i] = 0.0, 0.0, SOLVED
            continue
        m, nq = 6 * s.patterns.shape[1], len(s.free_frame)
        F = free_columns(s, P, m)
        turns, diagonal, order = vector(nq), vector(nq), indices(nq)
        free = triangulate(F, turns, diagonal, order, tolerance, 0.0, 1e-11)
        if free < 0:
            continue
        Z = orthogonal_rows(F, turns, free, m)
        columns, right = small_problem(s, P, Z, len(Z), known)
        rows = np.ascontiguousarray(columns.T)
        misfit = divide(right, -1.0)
        decided, B, w = orthonormal_rows(rows, misfit, largest_clearance(s, P))
        size = np.sqrt(inner(w, w))
        if not (decided and size > 0.0):
            continue
        turn_first(B, w, size)
        u, gradient = farthest(B, s.starts)
        reach, most = inner(B[0], u), 0.0
        for c in range(len(s.starts) - 1):
            part = 0.0
            for k in range(s.starts[c], s.starts[c + 1]):
                part += gradient[k] * gradient[k]
            most += np.sqrt(part)
        if not reach > 0.0:
            continue
        # motions of passive joints must stay within their ranges
        none, screw = matrices(0, 6, 6), vector(6)
        for c in range(len(u)):
            u[c] *= size / reach
        moved = moved_by(s, P, none, u, vector(0), known, screw)
        motions = vector(nq)
        least_motions(F, turns, diagonal, order, free, moved, motions)
        within = True
        for c in range(nq):
            within = within and abs(motions[c]) <= s.free_bound[c]
        if within:
            margin[i], bound[i] = size / reach, size / most
            # a bound that is NaN fails
            if margin[i] - bound[i] <= MARGIN_GAP * margin[i]:
                outcome[i] = SOLVED


@part
def largest_clearance(s: Structure, P: Matrices) -> float:
    """Largest entry of the clearances' closure columns, for the noise floor."""
    largest = 0.0
    for c in range(len(s.cone_frame)):
        j = s.cone_frame[c]
        enters = False
        for k in range(s.patterns.shape[1]):
            enters = enters or s.patterns[s.pattern_of[j], k] != 0.0
        if enters:
            for a in range(6):
                entry = P[j, s.cone_axis[c], a] * s.cone_size[c]
                largest = max(largest, abs(entry))
    return largest


@part
def orthonormal_rows(
    rows: Matrix, right: Vector, largest: float
) -> tuple[bool, Matrix, Vector]:
    """Write rows u = right as B u = w with orthonormal rows.

    Args:
        rows: (p, nu); they are overwritten.
        right: (p,).
        largest: entry of the columns that the rows were projected from.

    Returns:
        Whether ranks are unambiguous and nothing contradicts; B and w.
    """
    p, nu = rows.shape
    turns, diagonal = vector(p), vector(p)
    order = indices(p)
    rank = triangulate(rows, turns, diagonal, order, ROWS_RANK, NOISE * largest, -1.0)
    if rank < 0:
        return False, matrix(0, nu), vector(0)
    B, w = matrix(rank, nu), vector(rank)
    for i in range(p):
        total = right[order[i]]
        for l in range(min(i, rank)):
            total -= rows[i, l] * w[l]
        if i < rank:
            w[i] = total / diagonal[i]
        elif not abs(total) <= INFEASIBLE:
            return False, B, w
    for i in range(rank):
        B[i, i] = 1.0
        turn(rows, turns, rank, B[i])
    return True, B, w


@part
def turn_first(B: Matrix, w: Vector, size: float) -> None:
    """Combine the rows of B so that the first is along w and the others across it."""
    v = divide(w, size)
    sign = 1.0 if v[0] <= 0.0 else -1.0
    v[0] -= sign
    factor = 2.0 / inner(v, v)
    for c in range(B.shape[1]):
        dot = 0.0
        for i in range(len(v)):
            dot += v[i] * B[i, c]
        for i in range(len(v)):
            B[i, c] -= factor * dot * v[i]
        B[0, c] *= sign


@part
def farthest(B: Matrix, starts: Indices) -> tuple[Vector, Vector]:
    """U within the cones with the most B[0].u and no B[1:] u; the reduced gradient."""
    nu = B.shape[1]
    rest = np.ascontiguousarray(B[1:])
    programme = Programme(
        matrix(0, nu), vector(0), B[0].copy(), rest, vector(len(rest)), starts
    )
    u, n, _ = interior_point(programme, _STOP, 0.0)
    gradient = B[0].copy()
    for i in range(len(rest)):
        for c in range(nu):
            gradient[c] -= rest[i, c] * n[i]
    # the residual of the rest by rounding is removed, then u scaled into the cones
    for i in range(len(rest)):
        residual = inner(rest[i], u)
        for c in range(nu):
            u[c] -= residual * rest[i, c]
    worst = 1.0
    for c in range(len(starts) - 1):
        size = 0.0
        for i in range(starts[c], starts[c + 1]):
            size += u[i] * u[i]
        worst = max(worst, np.sqrt(size))
    return divide(u, worst), gradient
