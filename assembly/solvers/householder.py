"""Householder triangulation with pivoting, compiled; vectors lie as rows.

The transpose of a QR factorisation with column pivoting: rows F[order] = L Q^T with L
lower triangular (a trapezoid where the rank falls short), Q a product of reflectors.

Sources:
    Golub, Van Loan, Matrix Computations, 4th ed., sections 5.2-5.4 (Householder QR with
    column pivoting, complete orthogonal factorisation).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_CLEAR = 10.0  # a pivot within this factor of the threshold decides nothing


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def triangulate(
    F: NDArray, turns: NDArray, diagonal: NDArray, order: NDArray, relative: float,
    floor: float, clean: float,
) -> int:  # fmt: skip
    """Turn the rows of F into a lower triangle, the largest remaining row first.

    Args:
        F: (p, m); leaves with reflectors right of the diagonal, the triangle left.
        turns: (p,) leaves with the reflectors' factors.
        diagonal: (p,) of the triangle.
        order: (p,) original rows in their new order.
        relative: a row this small relative to the first adds nothing new.
        floor: nor does one this small.
        clean: where some row adds nothing, the largest size relative to the first
            that it may keep (the least motions are found with a threshold of their
            own); any if negative.

    Returns:
        The rank; -1 where it hangs on rounding.
    """
    p, m = F.shape
    for i in range(p):
        order[i] = i
    first = 0.0
    for step in range(p):
        best, at = -1.0, step
        for i in range(step, p):
            size = 0.0
            for a in range(step, m):
                size += F[i, a] * F[i, a]
            if size > best:
                best, at = size, i
        best = np.sqrt(best)
        if step == 0:
            first = best
        limit = max(floor, relative * first)
        if not best > limit * _CLEAR:
            doubtful = best > limit / _CLEAR or (clean >= 0.0 and best > clean * first)
            return -1 if doubtful or best != best else step
        if at != step:
            order[step], order[at] = order[at], order[step]
            for a in range(m):
                F[step, a], F[at, a] = F[at, a], F[step, a]
        own = F[step]
        diagonal[step] = -best if own[step] > 0.0 else best
        own[step] -= diagonal[step]
        turns[step] = -1.0 / (diagonal[step] * own[step])
        for i in range(step + 1, p):
            dot = 0.0
            for a in range(step, m):
                dot += own[a] * F[i, a]
            dot *= turns[step]
            if dot != 0.0:
                for a in range(step, m):
                    F[i, a] -= dot * own[a]
    return p


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def turn(F: NDArray, turns: NDArray, rank: int, x: NDArray) -> None:
    """From the triangle's coordinates back: x becomes Q x."""
    for step in range(rank - 1, -1, -1):
        own = F[step]
        dot = 0.0
        for a in range(step, len(x)):
            dot += own[a] * x[a]
        dot *= turns[step]
        for a in range(step, len(x)):
            x[a] -= dot * own[a]


@njit(cache=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def turn_back(F: NDArray, turns: NDArray, rank: int, x: NDArray) -> None:
    """Into the triangle's coordinates: x becomes Q^T x."""
    for step in range(rank):
        own = F[step]
        dot = 0.0
        for a in range(step, len(x)):
            dot += own[a] * x[a]
        dot *= turns[step]
        for a in range(step, len(x)):
            x[a] -= dot * own[a]
