"""Householder triangulation with pivoting, compiled; vectors lie as rows.

The transpose of a QR factorisation with column pivoting: rows F[order] = L Q^T with L
lower triangular (a trapezoid where the rank falls short), Q a product of reflectors.

Sources:
    Golub, Van Loan, Matrix Computations, 4th ed., sections 5.2-5.4 (Householder QR with
    column pivoting, complete orthogonal factorisation).
"""

import numpy as np

from assembly.solvers.compiled import part
from assembly.solvers.layers import LANES
from assembly.solvers.layouts import Indices, Matrix, Vector
from assembly.solvers.vectors import matrix, vector

CLEAR = 10.0  # within this factor of the threshold the rank is ambiguous


@part(fastmath={"contract", "reassoc"})
def triangulate(
    F: Matrix, turns: Vector, diagonal: Vector, order: Indices, relative: float,
    floor: float, clean: float,
) -> int:  # fmt: skip
    """Turn the rows of F into a lower triangle, the largest remaining row first.

    Args:
        F: (p, m); on exit, reflectors above the diagonal, the triangle below it.
        turns: (p,) on exit, factors of the reflectors.
        diagonal: (p,) of the triangle.
        order: (p,) original rows in their new order.
        relative: a row this small relative to the first adds nothing new.
        floor: nor does one this small.
        clean: where some row adds nothing, its largest size relative to the first (the
            least motions have a threshold of their own); any if negative.

    Returns:
        The rank; -1 where it is numerically ambiguous.
    """
    p, m = F.shape
    # the rows still to be reduced, zero in the triangle and beyond m: see LANES
    rest, sizes = matrix(p, m + -m % LANES), vector(p)
    for i in range(p):
        order[i] = i
        size = 0.0
        for a in range(m):
            rest[i, a] = F[i, a]
            size += F[i, a] * F[i, a]
        sizes[i] = size
    first = 0.0
    for step in range(p):
        best, at = -1.0, step
        for i in range(step, p):
            if sizes[i] > best:
                best, at = sizes[i], i
        best = np.sqrt(best)
        if step == 0:
            first = best
        limit = max(floor, relative * first)
        if not best > limit * CLEAR:
            ambiguous = best > limit / CLEAR or (clean >= 0.0 and best > clean * first)
            return -1 if ambiguous or best != best else step
        own = rest[step]
        if at != step:
            order[step], order[at] = order[at], order[step]
            sizes[at] = sizes[step]
            for a in range(len(own)):
                own[a], rest[at, a] = rest[at, a], own[a]
            for a in range(step):
                F[step, a], F[at, a] = F[at, a], F[step, a]
        diagonal[step] = -best if own[step] > 0.0 else best
        own[step] -= diagonal[step]
        turns[step] = -1.0 / (diagonal[step] * own[step])
        for i in range(step + 1, p):
            # inline: as calls these loops take half as long again
            row, along, size = rest[i], 0.0, 0.0
            for a in range(len(own)):
                along += own[a] * row[a]
            along *= turns[step]
            for a in range(len(own)):
                row[a] -= along * own[a]
            F[i, step], row[step] = row[step], 0.0
            for a in range(len(own)):
                size += row[a] * row[a]
            sizes[i] = size
        for a in range(step, m):
            F[step, a] = own[a]
    return p


@part(fastmath={"contract", "reassoc"})
def turn_all(F: Matrix, turns: Vector, rank: int, X: Matrix) -> None:
    """Every column x of X becomes Q x."""
    m, count = X.shape
    dots = vector(count)
    for step in range(rank - 1, -1, -1):
        own = F[step]
        for i in range(count):
            dots[i] = 0.0
        for a in range(step, m):
            row, weight = X[a], own[a]
            for i in range(count):
                dots[i] += weight * row[i]
        for i in range(count):
            dots[i] *= turns[step]
        for a in range(step, m):
            row, weight = X[a], own[a]
            for i in range(count):
                row[i] -= weight * dots[i]


@part(fastmath={"contract", "reassoc"})
def turn(F: Matrix, turns: Vector, rank: int, x: Vector) -> None:
    """X becomes Q x."""
    for step in range(rank - 1, -1, -1):
        own = F[step]
        along = 0.0
        for a in range(step, len(x)):
            along += own[a] * x[a]
        along *= turns[step]
        for a in range(step, len(x)):
            x[a] -= along * own[a]


@part(fastmath={"contract", "reassoc"})
def turn_back(F: Matrix, turns: Vector, rank: int, x: Vector) -> None:
    """X becomes Q^T x."""
    for step in range(rank):
        own = F[step]
        along = 0.0
        for a in range(step, len(x)):
            along += own[a] * x[a]
        along *= turns[step]
        for a in range(step, len(x)):
            x[a] -= along * own[a]
