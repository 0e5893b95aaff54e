r"""Bounded least squares of a model that takes long to evaluate.

    x          (k,)    unknowns between bounds
    r          (N,)    residual r(x)
    J          (N, k)  dr/dx, taken by differences, then Broyden's updates of it
    D          (k,)    norms of J's columns
    damping    λ       of Levenberg and Marquardt

A step d is the least of |r + J d|^2 + λ |D d|^2 between the bounds, an exact solution
of k unknowns.  Slopes are taken anew only where updated ones led astray, or nowhere.

Sources:
    Madsen, Nielsen, Tingleff (2004), Methods for non-linear least squares problems,
    2nd ed., DTU: algorithm 3.16 (damping) and section 3.5 (the secant version).
    Nocedal, Wright, Numerical Optimization, 2nd ed., sections 10.3 and 16.7.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

_DAMPING = 1e-9  # of the squares of a column: next to none
_FIRST = 1e-3  # where a step has led astray
_LEAST = 1e-12  # that keeps equal columns apart
_POOR = 0.25  # of the decrease that slopes promise, below which they are taken anew
_TINY = 1e-300


class LeastSquares(NamedTuple):
    """Where a search ended.

    Attributes:
        x: (k,) unknowns.
        residual: (N,) there.
        slopes: (N, k) there, or a step shorter than what counts from there.
    """

    x: NDArray
    residual: NDArray
    slopes: NDArray


def least_squares(
    residual: Callable[[NDArray], NDArray],
    slopes: Callable[[NDArray], NDArray],
    start: tuple[NDArray, NDArray],
    bounds: tuple[NDArray, NDArray],
    converged: float,
    most: int,
) -> LeastSquares:
    """The least sum of squares between bounds.

    Args:
        residual: (N,) at unknowns (k,).
        slopes: (N, k) at unknowns, where the residual was asked for last.
        start: unknowns between the bounds, and the slopes there.
        bounds: lower and upper ones, (k,) each, infinite where there are none.
        converged: relative decrease of the squares that counts for nothing.
        most: times that slopes are taken anew.

    Returns:
        The unknowns, at the least residual seen.
    """
    x, J = start
    r = residual(x)
    squares, taken, fresh = float(r @ r), 0, True
    damping, growth = _DAMPING, 2.0
    last = False
    while not last:
        d, promised = _step(J, r, damping, (bounds[0] - x, bounds[1] - x))
        enough = promised <= converged * squares
        last = enough and (fresh or taken == most)
        gain = -1.0
        if last or not enough:
            trial = np.clip(x + d, *bounds)
            after = residual(trial)
            gain = (squares - float(after @ after)) / max(promised, _TINY)
            if gain > 0:
                J = _updated(J, trial - x, after - r)
                x, r, squares, fresh = trial, after, float(after @ after), False
                damping *= max(1 / 3, 1 - (2 * gain - 1) ** 3)
                growth = 2.0
            elif fresh or taken == most:
                damping, growth = max(damping, _FIRST) * growth, 2 * growth
        if gain < _POOR and not (fresh or last) and taken < most:
            J, taken, fresh = slopes(x), taken + 1, True
    return LeastSquares(x, r, J)


def _step(
    J: NDArray, r: NDArray, damping: float, room: tuple[NDArray, NDArray]
) -> tuple[NDArray, float]:
    """The damped step within the room left by bounds, and the decrease it promises."""
    D = np.sqrt(np.einsum("ij,ij->j", J, J))
    D[D == 0] = 1.0
    C, g = (J.T @ J) / np.outer(D, D), (J.T @ r) / D
    L = np.linalg.cholesky(C + max(damping, _LEAST) * np.eye(len(C)))
    aim = np.linalg.solve(L, -g)
    y = lsq_linear(L.T, aim, (room[0] * D, room[1] * D), method="bvls").x
    return y / D, float(-2 * g @ y - y @ C @ y)


def _updated(J: NDArray, step: NDArray, change: NDArray) -> NDArray:
    """Slopes that say of a step what it did, by Broyden; lengths as columns have it."""
    along = np.einsum("ij,ij->j", J, J) * step
    return J + np.outer(change - J @ step, along / max(step @ along, _TINY))
