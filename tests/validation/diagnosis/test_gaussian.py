"""The algebra of a Gaussian model, against the density of the normal distribution."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from validation.diagnosis.gaussian import (
    SIZES,
    Products,
    evidence_gains,
    leave_block_out,
    log_evidence,
    marginalise,
)


@pytest.fixture
def draw():
    """Columns (40, 7), prior std (7,), readings (40,)."""
    rng = np.random.default_rng(3)
    X = rng.normal(size=(40, 7)) * 10 ** rng.uniform(-2, 2, 7)
    return X, 10 ** rng.uniform(-2, 1, 7), rng.normal(size=40)


def _products(X, z):
    side = np.column_stack([X, z])
    return Products(side.T @ side)


def test_evidence_is_the_density_of_the_readings(draw):
    X, std, z = draw
    C = np.eye(40) + (X * std**2) @ X.T
    found = _products(X, z).eliminate(np.arange(7), std).log_evidence(40)
    assert found == pytest.approx(multivariate_normal(cov=C).logpdf(z), rel=1e-12)


@pytest.mark.parametrize("freedom", [3.0, 20.0])
def test_evidence_with_an_unknown_scale_is_that_of_multivariate_t(draw, freedom):
    X, std, z = draw
    C = np.eye(40) + (X * std**2) @ X.T
    found = _products(X, z).eliminate(np.arange(7), std).log_evidence(40, freedom)
    t = multivariate_t(shape=C, df=freedom)
    assert found == pytest.approx(t.logpdf(z), rel=1e-12)


def test_order_of_elimination_does_not_matter(draw):
    X, std, z = draw
    G = _products(X, z)
    one = G.eliminate(np.arange(7), std)
    two = G.eliminate(np.array([5, 0]), std[[5, 0]])
    rest = np.array([1, 2, 3, 4, 6])
    two = two.eliminate(rest, std[rest])
    assert two.log_det == pytest.approx(one.log_det, rel=1e-12)
    assert two.matrix[-1, -1] == pytest.approx(one.matrix[-1, -1], rel=1e-12)


def test_posterior_beside_eliminated_unknowns_is_the_conditional_normal(draw):
    X, std, z = draw
    C = np.eye(40) + (X * std**2) @ X.T
    own = np.array([2, 5])
    others = np.setdiff1d(np.arange(7), own)
    mean, cov = _products(X, z).eliminate(others, std[others]).posterior(own, std[own])
    cross = (X[:, own] * std[own] ** 2).T @ np.linalg.inv(C)
    assert mean == pytest.approx(cross @ z, rel=1e-9)
    expected = np.diag(std[own] ** 2) - cross @ (X[:, own] * std[own] ** 2)
    assert cov == pytest.approx(expected, rel=1e-6)


def test_a_flat_prior_leaves_the_sum_of_squares_of_least_squares(draw):
    X, _, z = draw
    left = z - X @ np.linalg.lstsq(X, z, rcond=None)[0]
    found = _products(X, z).eliminate(np.arange(7), np.inf)
    assert found.matrix[-1, -1] == pytest.approx(left @ left, rel=1e-12)
    assert found.log_det == 0.0


def test_blocks_left_out_are_foretold_as_by_refits(draw):
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


def test_flat_columns_are_projected_out_exactly(draw):
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
def test_gain_is_the_evidence_averaged_over_sizes(draw, columns):
    X, std, z = draw
    rng = np.random.default_rng(5)
    B = np.linalg.qr(rng.normal(size=(40, columns)))[0]
    z = z + 6 * B[:, 0]
    marginal = marginalise(X, std, z, np.zeros((40, 0)))
    shown = marginal.factor_columns.T @ B
    gram, along = (B.T @ B - shown.T @ shown)[None], (B.T @ marginal.held)[None]
    found = evidence_gains(gram, along, np.array([np.inf]), False, marginal, 20.0)
    known = log_evidence(marginal.squares, 0.0, 40, 20.0)
    each = []
    for size in SIZES:
        G = _products(np.hstack([X, B]), z)
        whole = np.append(std, np.full(columns, size))
        end = G.eliminate(np.arange(7 + columns), whole)
        start = G.eliminate(np.arange(7), std)
        log_det = end.log_det - start.log_det
        each.append(log_evidence(end.matrix[-1, -1], log_det, 40, 20.0) - known)
    expected = np.log(np.mean(np.exp(each)))
    assert found[0] == pytest.approx(expected, rel=1e-9)


def test_a_bounded_unknown_gains_the_ratio_of_half_normals():
    # quadrature over the half axis: p(z | x > 0) against p(z | x = 0), tau known
    b, n = 0.8, 400
    rng = np.random.default_rng(2)
    B = np.linalg.qr(rng.normal(size=(n, 1)))[0]
    z = b * B[:, 0]
    marginal = marginalise(np.zeros((n, 0)), np.zeros(0), z, np.zeros((n, 0)))
    huge = 1e9  # degrees of freedom: the scale is known
    most = np.array([SIZES[0]])
    found = evidence_gains(
        np.ones((1, 1, 1)), np.full((1, 1), b), most, True, marginal, huge
    )
    x = np.linspace(0, 12 * SIZES[0], 200001)
    prior = 2 / SIZES[0] / np.sqrt(2 * np.pi) * np.exp(-(x**2) / 2 / SIZES[0] ** 2)
    ratio = np.trapezoid(prior * np.exp(b * x - x**2 / 2), x)
    assert found[0] == pytest.approx(np.log(ratio), abs=1e-5)


def test_what_cannot_plausibly_show_is_worth_nothing(draw):
    X, std, z = draw
    marginal = marginalise(X, std, z, np.zeros((40, 0)))
    least = np.array([0.5 * SIZES[0]])
    found = evidence_gains(
        np.ones((1, 1, 1)), np.ones((1, 1)), least, False, marginal, 20.0
    )
    assert found[0] == -np.inf
