"""One cone programme, and one body's farthest screw, by ``one_problem.cpp``.

The same equations and thresholds as :mod:`assembly.solvers.interior`,
:mod:`assembly.solvers.dual_newton`, and :mod:`assembly.solvers.farthest`, for cones of
any size.
"""

import ctypes

import numpy as np
from numpy.typing import NDArray

from forcefit.native.libraries import address, load_library

SOURCE = "assembly/solvers/one_problem.cpp"
Problem = tuple[NDArray, NDArray, NDArray, NDArray, NDArray]


class _Given(ctypes.Structure):
    """``Given`` of one_problem.cpp."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("r", "p", "cones")),
        *((name, ctypes.c_void_p) for name in ("starts", "G", "h", "d", "H", "k")),
    )


class SolverLimits(ctypes.Structure):
    """How far a method goes: ``Limits`` of one_problem.cpp.

    Attributes:
        relative: gap asked for, relative to |G u + h|^2 / 2 ..
        absolute: .. plus this.
        first_sigma: of Newton's method, times the mean |G_k^T h|.
        steps: most of Newton's method.
    """

    _fields_ = (
        *((n, ctypes.c_double) for n in ("relative", "absolute", "first_sigma")),
        ("steps", ctypes.c_int64),
    )


class _Asked(ctypes.Structure):
    """``Asked`` of one_problem.cpp."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("p", "cones", "half")),
        *((n, ctypes.c_void_p) for n in ("starts", "centre", "map", "rows", "start")),
        ("tolerance", ctypes.c_double),
    )


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
        there is no compiler.
    """
    _, h, d, _, k = problem
    u, y = np.zeros(len(d)), np.zeros(len(h) + len(k))
    limits = SolverLimits(absolute=tolerance)
    if not _solve("interior_point", problem, starts, limits, u, y):
        return None
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
        Whether it did; not where there is no compiler.
    """
    return _solve("newton", problem, starts, limits, u, y)


def _solve(
    name: str,
    problem: Problem,
    starts: NDArray,
    limits: SolverLimits,
    u: NDArray,
    y: NDArray,
) -> bool:
    """Call a function of the library; whether it did."""
    library = load_library(SOURCE)
    if library is None:
        return False
    arrays = _contiguous(starts, *problem)
    sizes = len(problem[1]), len(problem[4]), len(starts) - 1
    given = _Given(*sizes, *_addresses(*arrays))
    getattr(library, name)(
        ctypes.byref(given), ctypes.byref(limits),
        *map(ctypes.c_void_p, _addresses(u, y)),
    )  # fmt: skip
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
        support functions it took; None where there is no compiler, or bounds did not
        come as close.
    """
    library = load_library(SOURCE)
    if library is None:
        return None
    arrays = _contiguous(starts, centre, X, H, start)
    bounds, screw = np.zeros(2), np.zeros(6)
    asked = _Asked(len(H), len(starts) - 1, half, *_addresses(*arrays), tolerance)
    library.farthest.restype = ctypes.c_int64
    supports = library.farthest(
        ctypes.byref(asked), *map(ctypes.c_void_p, _addresses(bounds, screw))
    )
    return None if supports < 0 else (bounds, screw, supports)


def _contiguous(starts: NDArray, *arrays: NDArray) -> tuple[NDArray, ...]:
    """Arrays as C++ reads them."""
    rows = (np.ascontiguousarray(array, dtype=float) for array in arrays)
    return (np.ascontiguousarray(starts, dtype=np.int64), *rows)


def _addresses(*arrays: NDArray) -> list[int]:
    """Where their numbers are."""
    return [address(array) for array in arrays]
