"""Test prior standard deviations of maximum evidence against a general optimiser."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_t

from forcefit.validation.diagnosis.gaussian import size_penalty
from forcefit.validation.diagnosis.prior_sizes import Grouped, best_sizes


def _case(seed=1):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(60, 12)) / np.sqrt(60)
    group = np.repeat([0, 1], [8, 4])
    x = np.where(group == 0, 5.0, 30.0) * rng.normal(size=12)
    return X, group, X @ x + rng.normal(size=60)


def test_optimised_prior_deviations_maximise_the_evidence():
    X, group, z = _case()

    def cost(logs):
        C = np.eye(60) + (X * np.exp(2 * logs)[group]) @ X.T
        return -multivariate_t(shape=C, df=20).logpdf(z)

    expected = np.exp(minimize(cost, np.log([5.0, 30.0]), tol=1e-10).x)
    nan, inf = np.full(12, np.nan), np.full(12, np.inf)
    found = best_sizes(Grouped(X.T @ X, X.T @ z, z @ z, 60, group, nan, inf))
    assert [found.of_group[g] for g in (0, 1)] == pytest.approx(expected, rel=0.05)


def test_penalty_of_a_prior_deviation_agrees_with_quadrature():
    # The average of exp(-gamma u^2) is computed by numerical integration.
    for gamma in (1.0, 6.0):
        u = np.linspace(-5.18, 5.18, 100001)
        average = np.log(np.trapezoid(np.exp(-gamma * u**2), u) / 10.36)
        assert size_penalty(gamma) == pytest.approx(-average, abs=2e-3)
