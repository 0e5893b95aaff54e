"""Solver for sparse symmetric positive definite systems.

If the MKL package is installed, its PARDISO solver is used. Otherwise SciPy's SuperLU
is used, which needs about ten times the time and twice the memory.
"""

import os
import warnings
from functools import cache
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, csr_matrix, triu
from scipy.sparse.linalg import splu

# Parameters iparm of PARDISO. Parameter 8 disables iterative refinement. Parameter 24
# selects two-level factorisation, which saves an eighth of the time. Parameter 37 forms
# blocks of rows with nearly the same nonzero columns, which halves the time of the
# analysis.
_SETTINGS = {1: 1, 2: 2, 8: 0, 10: 8, 18: -1, 24: 1, 37: -90}


class FactorisationFailed(RuntimeError):
    """Error of a sparse matrix factorisation."""


@cache
def solver_name() -> str:
    """Return the name of the fastest installed solver."""
    if find_spec("pypardiso") is None:
        return "SuperLU"
    # pypardiso would search all folders of the Python installation, which takes seconds
    if library := _mkl():
        os.environ.setdefault("PYPARDISO_MKL_RT", library)
    try:
        import pypardiso  # noqa: F401
    except (ImportError, OSError):
        return "SuperLU"
    return "PARDISO"


def _mkl() -> str | None:
    """Find the MKL library in the list of files of its package."""
    try:
        listed = files("mkl") or []
    except PackageNotFoundError:
        return None
    libraries = [
        str(f.locate()) for f in listed if f.name.startswith(("libmkl_rt.", "mkl_rt."))
    ]
    return next(
        (f for f in libraries if Path(f).suffix != ".lib" and Path(f).exists()), None
    )


def solve(upper: csr_array, loads: NDArray, solver: str | None = None) -> NDArray:
    """Solve K x = loads for a symmetric positive definite matrix K.

    Args:
        upper: (n, n) upper triangle of K.
        loads: (n, k) right-hand sides.
        solver: ``"PARDISO"`` or ``"SuperLU"``. The default is the fastest installed
            solver.

    Returns:
        (n, k) solutions.

    Raises:
        FactorisationFailed: the matrix is singular, or there is not enough memory.
    """
    if (solver or solver_name()) == "PARDISO":
        return _solve_with_pardiso(upper, loads)
    full = csc_array(upper + triu(upper, 1).T)
    try:
        factor = splu(
            full,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except (RuntimeError, MemoryError) as error:
        raise FactorisationFailed(f"SuperLU failed: {error}") from error
    return factor.solve(np.asfortranarray(loads))


def _solve_with_pardiso(upper: csr_array, loads: NDArray) -> NDArray:
    """Solve with PARDISO."""
    import pypardiso

    solver = pypardiso.PyPardisoSolver(mtype=2)
    for number, value in _SETTINGS.items():
        solver.set_iparm(number, value)
    # pypardiso requires a csr_matrix with sorted 32-bit indices
    matrix = csr_matrix(upper)
    matrix.sort_indices()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            solver.factorize(matrix)
            return np.asarray(solver.solve(matrix, np.asfortranarray(loads)))
    except Exception as error:
        raise FactorisationFailed(f"PARDISO failed: {error}") from error
    finally:
        solver.free_memory(everything=True)


def expected_cost(unknowns: int) -> tuple[float, float]:
    """Estimate the memory and the time of a solution.

    Args:
        unknowns: number of rows of the matrix.

    Returns:
        Memory [byte], and time on two processor cores [s].
    """
    share = unknowns / 400e3
    memory, seconds = 3.8e9 * share**1.1, 20.0 * share**1.4
    if solver_name() == "SuperLU":
        return 3 * memory, 10 * seconds
    return memory, seconds
