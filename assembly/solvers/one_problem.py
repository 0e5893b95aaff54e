"""One cone programme, and one body's farthest screw, by ``one_problem.cpp``.

The same equations and thresholds as :mod:`assembly.solvers.interior`, for cones of any
size, and as :mod:`assembly.solvers.farthest`.
"""

import ctypes

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.native import load_library

SOURCE = "solvers/one_problem.cpp"


class _Given(ctypes.Structure):
    """``Given`` of one_problem.cpp."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("r", "p", "cones")),
        *((name, ctypes.c_void_p) for name in ("starts", "G", "h", "d", "H", "k")),
        ("tolerance", ctypes.c_double),
    )


class _Asked(ctypes.Structure):
    """``Asked`` of one_problem.cpp."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("p", "cones", "half")),
        *((n, ctypes.c_void_p) for n in ("starts", "centre", "map", "rows", "start")),
        ("tolerance", ctypes.c_double),
    )


def interior_point(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, starts: NDArray,
    tolerance: float,
) -> tuple[NDArray, NDArray] | None:  # fmt: skip
    """Minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_k| <= 1 for each cone.

    Args:
        G: (r, nu).
        h: (r,).
        d: (nu,).
        H: (p, nu) of full row rank.
        k: (p,).
        starts: (cones + 1,) first column of each cone, and nu.
        tolerance: gap asked for.

    Returns:
        u (nu,) and the multipliers (p,) of H, as far as the method came; None where
        there is no compiler.
    """
    library = load_library(SOURCE)
    if library is None:
        return None
    arrays = _contiguous(starts, G, h, d, H, k)
    u, n = np.zeros(len(d)), np.zeros(len(k))
    given = _Given(len(h), len(k), len(starts) - 1, *_addresses(*arrays), tolerance)
    library.interior_point(
        ctypes.byref(given), ctypes.c_void_p(u.ctypes.data),
        ctypes.c_void_p(n.ctypes.data),
    )  # fmt: skip
    return u, n


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
        ctypes.byref(asked), ctypes.c_void_p(bounds.ctypes.data),
        ctypes.c_void_p(screw.ctypes.data),
    )  # fmt: skip
    return None if supports < 0 else (bounds, screw, supports)


def _contiguous(starts: NDArray, *arrays: NDArray) -> tuple[NDArray, ...]:
    """Arrays as C++ reads them."""
    rows = (np.ascontiguousarray(array, dtype=float) for array in arrays)
    return (np.ascontiguousarray(starts, dtype=np.int64), *rows)


def _addresses(*arrays: NDArray) -> list[int]:
    """Where their numbers are."""
    return [array.ctypes.data for array in arrays]
