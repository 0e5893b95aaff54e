"""The two methods on cones for callers that are not compiled themselves."""

from numpy.typing import NDArray

from assembly.solvers import dual_newton, interior
from assembly.solvers.compiled import kernel
from assembly.solvers.interior import Programme

_interior_point, _dual_newton = interior.interior_point, dual_newton.dual_newton


@kernel
def interior_point(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, starts: NDArray,
    tolerance: float,
) -> tuple[NDArray, NDArray, int]:  # fmt: skip
    """See :func:`assembly.solvers.interior.interior_point`; writable arrays only."""
    return _interior_point(Programme(G, h, d, H, k, starts), tolerance, 0.0)


@kernel
def newton(
    dual: dual_newton.Dual, steps: int, first_sigma: float, u: NDArray, y: NDArray
) -> int:
    """See :func:`assembly.solvers.dual_newton.dual_newton`; writable arrays only."""
    return _dual_newton(dual, steps, first_sigma, u, y)
