"""One cone programme, and one body's farthest screw, compiled.

The same equations and thresholds as :mod:`assembly.solvers.interior`,
:mod:`assembly.solvers.dual_newton`, and :mod:`assembly.solvers.farthest`, for cones of
any size.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.kernels.choice import kernels
from forcefit.native.libraries import numba_alone

Problem = tuple[NDArray, NDArray, NDArray, NDArray, NDArray]


class SolverLimits(NamedTuple):
    """How far a method goes.

    Attributes:
        relative: gap asked for, relative to |G u + h|^2 / 2 ..
        absolute: .. plus this.
        first_sigma: of Newton's method, times the mean |G_k^T h|.
        steps: most of Newton's method.
    """

    relative: float
    absolute: float
    first_sigma: float
    steps: int


def interior_point(
    problem: Problem, starts: NDArray, tolerance: float
) -> tuple[NDArray, NDArray] | None:
    """Minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.

    Args:
        problem: G (r, nu), h (r,), d (nu,), H (p, nu) of full row rank, k (p,).
        starts: (cones + 1,) first column of each cone, and nu.
        tolerance: gap asked for.

    Returns:
        u (nu,) and the multipliers (p,) of H, as far as the method came; None where
        callers asked for numba.
    """
    if numba_alone():
        return None
    _, h, d, _, k = problem
    u, y = np.zeros(len(d)), np.zeros(len(h) + len(k))
    kernels.interior_point(*_contiguous(*problem), _integers(starts), tolerance, u, y)
    return u, y[len(h) :]


def newton(
    problem: Problem, starts: NDArray, limits: SolverLimits, u: NDArray, y: NDArray
) -> bool:
    """The same by Newton's method on the dual.

    Args:
        problem: as above.
        starts: as above.
        limits: how far it goes.
        u: (nu,) first guess within the cones; overwritten with the solution.
        y: (r + p,) overwritten with the multipliers of G's rows, and of H's, which are
            a first guess too.

    Returns:
        Whether it did; not where callers asked for numba.
    """
    if numba_alone():
        return False
    kernels.newton(*_contiguous(*problem), _integers(starts), *limits, u, y)
    return True


def farthest(
    centre: NDArray, X: NDArray, H: NDArray, start: NDArray, starts: NDArray,
    half: int, tolerance: float,
) -> tuple[NDArray, NDArray, int] | None:  # fmt: skip
    """Bracket the largest size of half a screw in {centre + X (v - start)}.

    Args:
        centre: (6,) [rad, m] the screw at ``start``.
        X: (6, nv) [rad, m].
        H: (p, nv) orthonormal rows; H (v - start) = 0.
        start: (nv,) within the unit cones.
        starts: (cones + 1,) first column of each cone, and nv.
        half: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] asked of upper minus lower bound.

    Returns:
        (2,) lower and upper bound, (6,) the screw that attains the lower, and how many
        support functions it took; None where callers asked for numba, or bounds did
        not come as close.
    """
    if numba_alone():
        return None
    bounds, screw = np.zeros(2), np.zeros(6)
    supports = kernels.farthest(
        *_contiguous(centre, X, H, start), _integers(starts), half, tolerance, bounds,
        screw,
    )  # fmt: skip
    return None if supports < 0 else (bounds, screw, supports)


def _contiguous(*arrays: NDArray) -> tuple[NDArray, ...]:
    """Numbers as C++ reads them."""
    return tuple(np.ascontiguousarray(array, dtype=float) for array in arrays)


def _integers(array: NDArray) -> NDArray:
    """Whole numbers likewise."""
    return np.ascontiguousarray(array, dtype=np.int64)
