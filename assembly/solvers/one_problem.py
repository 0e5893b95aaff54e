"""Compiled solvers for cones of any dimension, and for the farthest screw of a set."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels

Problem = tuple[NDArray, NDArray, NDArray, NDArray, NDArray]
# Support function: it returns a certified height along a direction, a screw (6,) that
# approximately attains the height, and the gradient (nv,).
Support = Callable[[NDArray], tuple[float, NDArray, NDArray]]


class SolverLimits(NamedTuple):
    """Convergence criteria and largest number of steps of an iterative method.

    Attributes:
        relative: required duality gap, relative to |G u + h|^2 / 2.
        absolute: absolute duality gap that is added to the relative one.
        first_sigma: initial sigma of Newton's method, relative to the mean |G_k^T h|.
        steps: largest number of Newton steps.
    """

    relative: float
    absolute: float
    first_sigma: float
    steps: int


def interior_point(
    problem: Problem, starts: NDArray, tolerance: float
) -> tuple[NDArray, NDArray]:
    """Minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.

    Args:
        problem: G (r, nu), h (r,), d (nu,), H (p, nu) of full row rank, k (p,).
        starts: (cones + 1,) index of the first column of each cone, then nu.
        tolerance: required duality gap.

    Returns:
        u (nu,) and the multipliers (p,) of H at the last iterate.
    """
    _, h, d, _, k = problem
    u, y = np.zeros(len(d)), np.zeros(len(h) + len(k))
    kernels.interior_point(*_contiguous(*problem), _integers(starts), tolerance, u, y)
    return u, y[len(h) :]


def newton(
    problem: Problem, starts: NDArray, limits: SolverLimits, u: NDArray, y: NDArray
) -> None:
    """Minimise the objective of :func:`interior_point` by Newton's method on the dual.

    Args:
        problem: see :func:`interior_point`.
        starts: see :func:`interior_point`.
        limits: limits of the iteration.
        u: (nu,) initial guess within the cones; overwritten with the solution.
        y: (r + p,) initial guess of the multipliers of G and H; overwritten with the
            solution.
    """
    kernels.newton(*_contiguous(*problem), _integers(starts), *limits, u, y)


def farthest_points(
    rows: NDArray, starts: NDArray, directions: NDArray, right: NDArray,
    tolerance: NDArray,
) -> tuple[NDArray, NDArray, NDArray]:  # fmt: skip
    """Maximise d.u over {rows u = right, |u_k| <= 1 for each cone} for many d.

    Args:
        rows: (p, nu) matrix of full row rank.
        starts: (cones + 1,) index of the first column of each cone, then nu.
        directions: (k, nu) directions d, of length 1.
        right: (k, p) right-hand sides.
        tolerance: (k,) accepted difference between d.u and its upper bound.

    Returns:
        u (k, nu) and the multipliers n (k, p) of the rows at the last iterate.  They
        satisfy d.u <= n.right + sum |(d - rows^T n)_c|. Also a mask (k,) of directions
        for which both sides of this inequality differ by less than the tolerance and
        the equations are satisfied to machine precision.
    """
    count, (p, nu) = len(directions), rows.shape
    points, multipliers = np.zeros((count, nu)), np.zeros((count, p))
    solved = np.zeros(count, dtype=np.int64)
    rows, *asked = _contiguous(rows, directions, right, tolerance)
    kernels.farthest_points(
        rows, _integers(starts), *asked, points, multipliers, solved
    )
    return points, multipliers, solved > 0


def farthest(
    centre: NDArray, X: NDArray, H: NDArray, start: NDArray, starts: NDArray,
    half: int, tolerance: float, support: Support,
) -> tuple[NDArray, NDArray, int]:  # fmt: skip
    """Bound the largest rotation or translation among {centre + X (v - start)}.

    Args:
        centre: (6,) [rad, m] screw at ``start``.
        X: (6, nv) [rad, m] map to screws.
        H: (p, nv) orthonormal rows with H (v - start) = 0.
        start: (nv,) point within the unit cones.
        starts: (cones + 1,) index of the first column of each cone, then nv.
        half: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] required difference between the upper and lower bound.
        support: support function of a direction (3,) of this half, called if the
            compiled method is inaccurate.  Its gradient is X^T d minus the contribution
            of the multipliers of H.

    Returns:
        (2,) lower and upper bound; (6,) the screw that attains the lower bound; and the
        number of support functions, at most 400.  If 400 do not suffice, the bounds are
        wider than required.
    """

    def asked(direction: tuple[float, float, float]) -> tuple[float, NDArray, NDArray]:
        height, *rows = support(np.array(direction))
        attains, gradient = _contiguous(*rows)
        return height, attains, gradient

    bounds, screw = np.zeros(2), np.zeros(6)
    supports = kernels.farthest(
        *_contiguous(centre, X, H, start), _integers(starts), half, tolerance, asked,
        bounds, screw,
    )  # fmt: skip
    return bounds, screw, supports


def _contiguous(*arrays: NDArray) -> tuple[NDArray, ...]:
    """Convert arrays to C-contiguous arrays of floats."""
    return tuple(np.ascontiguousarray(array, dtype=float) for array in arrays)


def _integers(array: NDArray) -> NDArray:
    """Convert an array to contiguous 64-bit integers."""
    return np.ascontiguousarray(array, dtype=np.int64)
