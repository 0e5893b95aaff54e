"""Test the Gaussian linear model against probability densities from SciPy."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from forcefit.validation.diagnosis.gaussian import (
    FREEDOM,
    SIZES,
    evidence_gains,
    leave_block_out,
    marginalise,
)


@pytest.fixture
def draw():
    """Random columns (40, 7), prior standard deviations (7,) and readings (40,)."""
    rng = np.random.default_rng(3)
    X = rng.normal(size=(40, 7)) * 10 ** rng.uniform(-2, 2, 7)
    return X, 10 ** rng.uniform(-2, 1, 7), rng.normal(size=40)


def test_leave_block_out_errors_equal_those_of_refits(draw):
    X, std, z = draw
    blocks = np.repeat(np.arange(8), 5)
    marginal = marginalise(X, std, z, np.zeros((40, 0)))
    errors, densities = leave_block_out(marginal, blocks)
    for k in range(8):
        own, rest = blocks == k, blocks != k
        P = X[rest].T @ X[rest] + np.diag(std**-2.0)
        x = np.linalg.solve(P, X[rest].T @ z[rest])
        assert errors[own] == pytest.approx(z[own] - X[own] @ x, rel=1e-8)
        C = np.eye(5) + X[own] @ np.linalg.solve(P, X[own].T)
        expected = multivariate_normal(mean=X[own] @ x, cov=C).logpdf(z[own])
        assert densities[k] == pytest.approx(expected, rel=1e-8)


def test_projection_equals_a_model_with_very_wide_priors(draw):
    X, std, z = draw
    flat = np.linalg.qr(np.random.default_rng(0).normal(size=(40, 3)))[0]
    without = np.eye(40) - flat @ flat.T
    marginal = marginalise(without @ X, std, without @ z, flat)
    large = np.append(np.full(3, 1e5), std)
    other = marginalise(np.hstack([flat, X]), large, z, np.zeros((40, 0)))
    B = np.random.default_rng(1).normal(size=(40, 2))
    gram = [
        B.T @ B - (t.factor_columns.T @ B).T @ (t.factor_columns.T @ B)
        for t in (marginal, other)
    ]
    assert gram[0] == pytest.approx(gram[1], abs=1e-7)


@pytest.mark.parametrize("columns", [1, 3])
def test_evidence_gain_equals_average_over_prior_deviations(draw, columns):
    X, std, z = draw
    rng = np.random.default_rng(5)
    B = np.linalg.qr(rng.normal(size=(40, columns)))[0]
    z = z + 6 * B[:, 0]
    marginal = marginalise(X, std, z, np.zeros((40, 0)))
    shown = marginal.factor_columns.T @ B
    gram, along = (B.T @ B - shown.T @ shown)[None], (B.T @ marginal.held)[None]
    found = evidence_gains(gram, along, np.array([np.inf]), False, marginal)

    def density(columns, std):
        C = np.eye(40) + (columns * std**2) @ columns.T
        return multivariate_t(shape=C, df=FREEDOM).logpdf(z)

    each = [
        density(np.hstack([X, B]), np.append(std, np.full(columns, size)))
        for size in SIZES
    ]
    expected = np.log(np.mean(np.exp(np.array(each) - density(X, std))))
    assert found[0] == pytest.approx(expected, rel=1e-9)


def test_evidence_gain_of_a_positive_unknown_equals_quadrature():
    # The expected ratio p(z | x > 0) / p(z | x = 0) is computed by quadrature.  The
    # large number of readings determines tau.
    b, n = 0.8, 1_000_000
    z = np.where(np.arange(n) % 2, 1.0, -1.0)
    marginal = marginalise(np.zeros((n, 0)), np.zeros(0), z, np.zeros((n, 0)))
    most = np.array([SIZES[0]])
    one, along = np.ones((1, 1, 1)), np.full((1, 1), b)
    found = evidence_gains(one, along, most, True, marginal)
    x = np.linspace(0, 12 * SIZES[0], 200001)
    prior = 2 / SIZES[0] / np.sqrt(2 * np.pi) * np.exp(-(x**2) / 2 / SIZES[0] ** 2)
    ratio = np.trapezoid(prior * np.exp(b * x - x**2 / 2), x)
    assert found[0] == pytest.approx(np.log(ratio), abs=1e-5)
