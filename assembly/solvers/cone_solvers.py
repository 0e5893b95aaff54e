"""The two methods on cones for callers that are not compiled themselves."""

from numpy.typing import NDArray

from assembly.solvers import dual_newton, interior
from assembly.solvers.compiled import kernel

_interior_point, _dual_newton = interior.interior_point, dual_newton.dual_newton


@kernel
def interior_point(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, starts: NDArray,
    tolerance: float,
) -> tuple[NDArray, NDArray, int]:  # fmt: skip
    """See :func:`assembly.solvers.interior.interior_point`."""
    return _interior_point(G, h, d, H, k, starts, tolerance, 0.0)


@kernel
def newton(
    Gt: NDArray, h: NDArray, d: NDArray, springs: int, starts: NDArray, relative: float,
    absolute: float, steps: int, first_sigma: float, u: NDArray, y: NDArray,
) -> int:  # fmt: skip
    """See :func:`assembly.solvers.dual_newton.dual_newton`."""
    return _dual_newton(
        Gt, h, d, springs, starts, relative, absolute, steps, first_sigma, u, y
    )
