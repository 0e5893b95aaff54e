"""The two methods on cones, each compiled once and called by its address.

A compiled function that calls another is compiled together with it, and so is every
function that calls that one; the two methods are most of the code.  What takes them
as an argument is compiled without them.
"""

from functools import cache
from typing import Any, NamedTuple

from numba import cfunc, types
from numpy.typing import NDArray

from assembly.solvers import dual_newton, interior
from assembly.solvers.compiled import kernel

_row = types.Array(types.float64, 1, "C")
# read only: what may be written to is accepted, too
_given_row = types.Array(types.float64, 1, "C", readonly=True)
_given_rows = types.Array(types.float64, 2, "C", readonly=True)
_given_starts = types.Array(types.int64, 1, "C", readonly=True)
_INTERIOR_POINT = types.Tuple((_row, _row, types.int64))(
    _given_rows, _given_row, _given_row, _given_rows, _given_row, _given_starts,
    types.float64, types.float64,
)  # fmt: skip
_DUAL_NEWTON = types.int64(
    _given_rows, _given_row, _given_row, types.int64, _given_starts, types.float64,
    types.float64, types.int64, types.float64, _row, _row,
)  # fmt: skip


class ConeSolvers(NamedTuple):
    """What compiled functions are given to call.

    Attributes:
        interior_point: see :func:`assembly.solvers.interior.interior_point`.
        dual_newton: see :func:`assembly.solvers.dual_newton.dual_newton`.
    """

    interior_point: Any
    dual_newton: Any


@cache
def cone_solvers() -> ConeSolvers:
    """Both methods, compiled or read from numba's cache at the first call."""
    return ConeSolvers(
        cfunc(
            _INTERIOR_POINT, cache=True, fastmath=interior.FAST, error_model="numpy"
        )(interior.interior_point),
        cfunc(
            _DUAL_NEWTON, cache=True, fastmath=dual_newton.FAST, error_model="numpy"
        )(dual_newton.dual_newton),
    )  # fmt: skip


@kernel
def interior_point(
    solvers: ConeSolvers, G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray,
    starts: NDArray, tolerance: float,
) -> tuple[NDArray, NDArray, int]:  # fmt: skip
    """The interior-point method for callers that are not compiled themselves."""
    return solvers.interior_point(G, h, d, H, k, starts, tolerance, 0.0)


@kernel
def newton(
    solvers: ConeSolvers, Gt: NDArray, h: NDArray, d: NDArray, springs: int,
    starts: NDArray, relative: float, absolute: float, steps: int, sharp: float,
    u: NDArray, y: NDArray,
) -> int:  # fmt: skip
    """Newton's method for callers that are not compiled themselves."""
    return solvers.dual_newton(
        Gt, h, d, springs, starts, relative, absolute, steps, sharp, u, y
    )
