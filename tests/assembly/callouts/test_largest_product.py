"""Comparison of the support function of a tolerance zone with cvxpy."""

import cvxpy as cp
import numpy as np
import pytest

from forcefit.assembly.callouts.largest_product import largest_product


@pytest.mark.parametrize("seed", range(6))
def test_support_function_of_discs_and_double_cones_agrees_with_cvxpy(seed):
    """The zone in five coordinates is bounded by double cones, discs and intervals."""
    rng = np.random.default_rng(seed)
    bounds = [*np.split(np.eye(5), 5), rng.normal(size=(2, 5)), rng.normal(size=(2, 5))]
    cones = [rng.normal(size=(3, 5)), rng.normal(size=(3, 5))]
    w = rng.normal(size=5)
    x = cp.Variable(5)
    limits = [cp.norm(b @ x) <= 1 for b in bounds]
    limits += [cp.abs(c[0] @ x) + cp.norm(c[1:] @ x) <= 1 for c in cones]
    problem = cp.Problem(cp.Maximize(w @ x), limits)
    problem.solve(solver="CLARABEL")
    found, bound = largest_product(w, bounds, cones)
    assert w @ found == pytest.approx(problem.value, rel=1e-6)
    assert w @ found <= bound <= (w @ found) * (1 + 1e-7)
    sizes = [np.linalg.norm(b @ found) for b in bounds]
    sizes += [abs(c[0] @ found) + np.linalg.norm(c[1:] @ found) for c in cones]
    assert max(sizes) <= 1 + 1e-12
