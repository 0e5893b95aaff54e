"""Free motions and springs eliminated: :mod:`assembly.linear.reduction`, compiled.

For speed vectors are stored as rows, one Householder triangulation with pivoting serves
the free motions, the springs and the least motions, and springs that enter the same
closures are first combined into six.  Springs enter by the square roots of their
compliances throughout.

======  ============  ==============================================================
symbol  shape         meaning
======  ============  ==============================================================
``P``   (n, 6, 6)     row ``axis``: unit screw of frame j along it, read at the
                      platform in base axes, translations by the reference length
``F``   (nq, m)       columns of the free motions as rows; m = 6 closures
``Z``   (m - rank, m) orthonormal, orthogonal to all free motions; later the rows
                      that springs enter, L^-1 Z, and those that none enters
``L``   (ng, 6, 6)    each group's springs as six, lower triangular but for pivoting
``Y``   (.., 6 ng)    Z times the springs' columns
======  ============  ==============================================================
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_structure import (
    free_columns,
    grouped_springs,
    largest_spring,
)
from assembly.linear.robot_structure import Structure
from assembly.linear.thresholds import NOISE
from assembly.solvers.compiled import kernel, part
from assembly.solvers.householder import CLEAR, triangulate, turn, turn_all, turn_back
from assembly.solvers.layers import LANES
from assembly.solvers.layouts import Indices, Matrices, Matrix, Vector
from assembly.solvers.vectors import (
    copy,
    divide,
    fill,
    indices,
    inner,
    matrices,
    matrix,
    vector,
)


@part(fastmath={"contract", "reassoc"})
def orthogonal_rows(F: Matrix, turns: Vector, rank: int, m: int) -> Matrix:
    """Orthonormal rows orthogonal to all triangulated ones."""
    count = m - rank
    Zt = matrix(m, count + -count % LANES)
    for i in range(count):
        Zt[rank + i, i] = 1.0
    turn_all(F, turns, rank, Zt)
    return np.ascontiguousarray(Zt[:, :count].T)


@kernel(fastmath={"contract", "reassoc"})
def pattern_part(Z: NDArray, i: int, pattern: NDArray, part: NDArray) -> None:
    """Row i of Z, for a screw that enters the closures with these signs."""
    for a in range(6):
        part[a] = 0.0
    for k in range(len(pattern)):
        if pattern[k] != 0.0:
            for a in range(6):
                part[a] += pattern[k] * Z[i, 6 * k + a]


@part
def spring_rows(s: Structure, Z: Matrix, L: Matrices) -> Matrix:
    """Rows of Z times the closure columns of the grouped springs."""
    Y = matrix(len(Z), 6 * len(L))
    part = vector(6)
    for i in range(len(Z)):
        for g in range(len(L)):
            pattern_part(Z, i, s.patterns[s.group_pattern[g]], part)
            for a in range(6):
                for b in range(6):
                    Y[i, 6 * g + b] += part[a] * L[g, a, b]
    return Y


@part
def eliminate_springs(
    Z: Matrix, Y: Matrix, diagonal: Vector, order: Indices, rank: int
) -> None:
    """Order Z like Y's triangle, and divide by it: rows that springs enter first.

    The others have length 1: what is rounding there has their size.
    """
    rows = Z.copy()
    for i in range(len(Z)):
        copy(rows[order[i]], Z[i])
        for l in range(min(i, rank)):
            for a in range(Z.shape[1]):
                Z[i, a] -= Y[i, l] * Z[l, a]
        size = diagonal[i] if i < rank else np.sqrt(inner(Z[i], Z[i]))
        for a in range(Z.shape[1]):
            Z[i, a] /= size


class Triangle(NamedTuple):
    """Columns brought to a triangle by reflections, as ``triangulate`` leaves them.

    Attributes:
        columns: (n, m) reflectors and the triangle, a column in each row.
        turns: (n,) sizes of the reflectors.
        diagonal: (n,) of the triangle.
        order: (n,) in which columns were taken.
        rank: how many are independent; negative if that is in doubt.
    """

    columns: Matrix
    turns: Vector
    diagonal: Vector
    order: Indices
    rank: int


class Elimination(NamedTuple):
    """What closures leave of free motions and springs; see the head of this module.

    Attributes:
        free: the free motions' columns F.
        Z: rows that no free motion enters.
        L: the groups' springs.
        springs: the springs' columns Y of those rows.
        decided: whether both ranks are beyond doubt; if not, Z to Y are empty.
    """

    free: Triangle
    Z: Matrix
    L: Matrices
    springs: Triangle
    decided: bool


@part
def eliminate(s: Structure, P: Matrices, tolerance: float) -> Elimination:
    """Bring free motions, then springs to triangles.

    Args:
        s: the robot.
        P: unit screws of all frames.
        tolerance: relative, of ranks.

    Returns:
        Both triangles, and the rows between them.
    """
    m, nq = 6 * s.patterns.shape[1], len(s.free_frame)
    F = free_columns(s, P, m)
    turns, diagonal, order = vector(nq), vector(nq), indices(nq)
    rank = triangulate(F, turns, diagonal, order, tolerance, 0.0, 1e-11)
    free = Triangle(F, turns, diagonal, order, rank)
    if rank < 0:
        return Elimination(free, matrix(0, 0), matrices(0, 6, 6), free, False)
    Z = orthogonal_rows(F, turns, rank, m)
    L = grouped_springs(s, P)
    Y = spring_rows(s, Z, L)
    count = len(Z)
    own_turns, own_diagonal, own_order = vector(count), vector(count), indices(count)
    noise = NOISE * largest_spring(s, P)
    rank = triangulate(Y, own_turns, own_diagonal, own_order, tolerance, noise, -1.0)
    springs = Triangle(Y, own_turns, own_diagonal, own_order, rank)
    return Elimination(free, Z, L, springs, rank >= 0)


@part
def misfit_of(s: Structure, P: Matrices, errors: Matrix) -> Vector:
    """(m,) closure error that the geometric errors cause."""
    closures = s.patterns.shape[1]
    known = vector(6 * closures)
    moved = vector(6)
    for j in range(len(P)):
        fill(moved, 0.0)
        for axis in range(6):
            if errors[j, axis] != 0.0:
                for a in range(6):
                    moved[a] += P[j, axis, a] * errors[j, axis]
        for k in range(closures):
            sign = s.patterns[s.pattern_of[j], k]
            for a in range(6):
                known[6 * k + a] += sign * moved[a]
    return known


@part
def rigid_rows(
    s: Structure, P: Matrices, Z: Matrix, rank: int, known: Vector, errors: Matrix,
    tolerance: float,
) -> bool:  # fmt: skip
    """Whether clearances or errors enter rows that no spring enters."""
    count, cones = len(Z) - rank, len(s.cone_frame)
    parts, most = matrices(len(s.patterns), count, 6), vector(len(s.patterns))
    entering = vector(len(s.patterns))
    for g in range(len(s.patterns)):
        for k in range(s.patterns.shape[1]):
            entering[g] = max(entering[g], abs(s.patterns[g, k]))
        for i in range(count):
            pattern_part(Z, rank + i, s.patterns[g], parts[g, i])
            for a in range(6):
                most[g] = max(most[g], abs(parts[g, i, a]))
    sizes, largest, worst = vector(cones), 0.0, 0.0
    for c in range(cones):
        j = s.cone_frame[c]
        for a in range(6):
            sizes[c] = max(sizes[c], abs(P[j, s.cone_axis[c], a]) * s.cone_size[c])
        largest = max(largest, sizes[c] * entering[s.pattern_of[j]])
    for c in range(cones):
        j = s.cone_frame[c]
        g = s.pattern_of[j]
        if 6.0 * sizes[c] * most[g] <= NOISE * largest / CLEAR:
            continue  # as nearly all are
        for i in range(count):
            total = 0.0
            for a in range(6):
                total += parts[g, i, a] * P[j, s.cone_axis[c], a]
            worst = max(worst, abs(total * s.cone_size[c]))
    if worst > NOISE * largest / CLEAR:
        return True
    size = 0.0
    for j in range(len(P)):
        for axis in range(6):
            if errors[j, axis] != 0.0:
                for a in range(6):
                    size = max(size, abs(P[j, axis, a] * errors[j, axis]))
    for i in range(rank, len(Z)):
        total = 0.0
        for a in range(len(known)):
            total += Z[i, a] * known[a]
        if not abs(total) <= 1e-12 / CLEAR + tolerance * size:
            return True
    return False


@part(fastmath={"contract", "reassoc"})
def small_problem(
    s: Structure, P: Matrices, Z: Matrix, rank: int, known: Vector
) -> tuple[Matrix, Vector]:
    """G, its columns as rows, and h: strains by clearances and by errors."""
    nu = len(s.cone_frame)
    Gt, h = matrix(nu, rank), vector(rank)
    parts = matrices(len(s.patterns), 6, rank)
    part = vector(6)
    for i in range(rank):
        for a in range(len(known)):
            h[i] -= Z[i, a] * known[a]
        for g in range(len(s.patterns)):
            pattern_part(Z, i, s.patterns[g], part)
            for a in range(6):
                parts[g, a, i] = part[a]
    for c in range(nu):
        j = s.cone_frame[c]
        column, own = P[j, s.cone_axis[c]], parts[s.pattern_of[j]]
        for a in range(6):
            weight = -s.cone_size[c] * column[a]
            if weight != 0.0:
                for i in range(rank):
                    Gt[c, i] += weight * own[a, i]
    return Gt, h


@part
def moved_by(
    s: Structure, P: Matrices, L: Matrices, u: Vector, spring: Vector, known: Vector,
    screw: Vector,
) -> Vector:  # fmt: skip
    """(m,) closure error of errors, clearances and springs; their platform screw."""
    closures = s.patterns.shape[1]
    moved = known.copy()
    for a in range(6):
        screw[a] = 0.0
    for c in range(len(u)):
        j = s.cone_frame[c]
        for a in range(6):
            step = P[j, s.cone_axis[c], a] * s.cone_size[c] * u[c]
            screw[a] += s.on_path[j] * step
            for k in range(closures):
                moved[6 * k + a] += s.patterns[s.pattern_of[j], k] * step
    for g in range(len(L)):
        for a in range(6):
            step = 0.0
            for b in range(6):
                step += L[g, a, b] * spring[6 * g + b]
            screw[a] += s.group_on_path[g] * step
            for k in range(closures):
                moved[6 * k + a] += s.patterns[s.group_pattern[g], k] * step
    return moved


@part
def least_motions(
    F: Matrix, turns: Vector, diagonal: Vector, order: Indices, rank: int,
    moved: Vector, motions: Vector,
) -> None:  # fmt: skip
    """Free motions of least size that close the rest."""
    nq = len(F)
    right = divide(moved, -1.0)
    turn_back(F, turns, rank, right)
    least = vector(nq)
    if rank == nq:
        for i in range(nq - 1, -1, -1):
            total = right[i]
            for l in range(i + 1, nq):
                total -= F[l, i] * least[l]
            least[i] = total / diagonal[i]
    else:
        # the triangle's columns, as rows, triangulated once more
        R = matrix(rank, nq)
        for i in range(rank):
            R[i, i] = diagonal[i]
            for l in range(i + 1, nq):
                R[i, l] = F[l, i]
        own_turns, own_diagonal = vector(rank), vector(rank)
        own_order = indices(rank)
        row_rank = triangulate(R, own_turns, own_diagonal, own_order, 0.0, 0.0, -1.0)
        for i in range(row_rank):
            total = right[own_order[i]]
            for l in range(i):
                total -= R[i, l] * least[l]
            least[i] = total / own_diagonal[i]
        turn(R, own_turns, row_rank, least)
    for i in range(nq):
        motions[order[i]] = least[i]
