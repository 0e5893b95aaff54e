"""Tests of the sparse solver."""

import sys

import numpy as np
import pytest
from scipy.sparse import csr_array, random_array

from forcefit.stiffness.fem import sparse_solver
from forcefit.stiffness.fem.sparse_solver import _mkl, solve, solver_name


@pytest.fixture
def chosen():
    """Yield ``solver_name`` with an empty cache."""
    solver_name.cache_clear()
    yield solver_name
    solver_name.cache_clear()


@pytest.mark.parametrize("name", sorted({"SuperLU", solver_name()}))
@pytest.mark.parametrize("columns", [1, 6])
def test_sparse_solver_needs_only_the_upper_triangle(rng, name, columns):
    """The reference is the dense solution by NumPy."""
    B = random_array((40, 40), density=0.1, rng=rng).toarray()
    A = B @ B.T + np.eye(40)
    loads = rng.normal(size=(40, columns))
    x = solve(csr_array(np.triu(A)), loads, name)
    np.testing.assert_allclose(x, np.linalg.solve(A, loads), atol=1e-10)
    np.testing.assert_allclose(solve(csr_array(np.triu(A)), loads), x, atol=1e-10)


@pytest.mark.parametrize("spec", [None, object()], ids=["absent", "does not load"])
def test_superlu_is_used_if_pypardiso_cannot_be_imported(spec, monkeypatch, chosen):
    """The import fails if pypardiso is not installed or if the MKL library cannot be
    loaded."""
    monkeypatch.setattr(sparse_solver, "find_spec", lambda _: spec)
    monkeypatch.setattr(sparse_solver, "_mkl", lambda: None)
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    assert chosen() == "SuperLU"


def test_mkl_library_is_none_when_mkl_is_not_installed(monkeypatch):
    def absent(name):
        raise sparse_solver.PackageNotFoundError(name)

    monkeypatch.setattr(sparse_solver, "files", absent)
    assert _mkl() is None
