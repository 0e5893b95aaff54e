"""Short loops over rows, compiled: numpy's own forms of them compile far longer.

An assignment to a slice, an array expression or ``np.sum`` brings numba's broadcasting
and its error messages into every kernel that calls it: ten times the code to compile.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import kernel, part
from assembly.solvers.layouts import Indices, Matrices, Matrix, Vector


@part
def vector(n: int) -> Vector:
    """(n,) zeros."""
    return np.zeros(n)


@part
def matrix(rows: int, columns: int) -> Matrix:
    """(rows, columns) zeros."""
    return np.zeros((rows, columns))


@part
def matrices(count: int, rows: int, columns: int) -> Matrices:
    """(count, rows, columns) zeros."""
    return np.zeros((count, rows, columns))


@part
def indices(n: int) -> Indices:
    """(n,) zeros."""
    return np.zeros(n, np.int64)


@kernel
def inner(a: NDArray, b: NDArray) -> float:
    """a.b, summed in order; :func:`assembly.solvers.layers.dot` is the fast one."""
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@kernel
def fill(to: NDArray, value: float) -> None:
    """Set all of a row to a value."""
    for j in range(len(to)):
        to[j] = value


@kernel
def copy(source: NDArray, to: NDArray) -> None:
    """Copy a row into the first components of another."""
    for j in range(len(source)):
        to[j] = source[j]


@kernel
def divide(v: NDArray, divisor: float) -> NDArray:
    """(n,) a new row: v / divisor."""
    quotient = np.empty(len(v))
    for j in range(len(v)):
        quotient[j] = v[j] / divisor
    return quotient


@kernel
def into_cones(starts: NDArray, u: NDArray) -> None:
    """Cones' vectors shortened to length 1 where rounding made them longer.

    Args:
        starts: (cones + 1,) first column of each cone, and nu.
        u: (nu,) to shorten.
    """
    for c in range(len(starts) - 1):
        size = 0.0
        for i in range(starts[c], starts[c + 1]):
            size += u[i] * u[i]
        if size > 1.0:
            size = np.sqrt(size)
            for i in range(starts[c], starts[c + 1]):
                u[i] /= size
