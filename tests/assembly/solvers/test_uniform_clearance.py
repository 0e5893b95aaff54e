"""Convergence diagnosis of chains by textbook formulas, and Dikin's ellipsoids."""

import numpy as np
import pytest

from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.solvers.uniform_clearance import (
    _ellipsoid,
    diagnose,
    is_mixed,
    sample_uniform_position,
)


def by_the_textbook(x):
    """Split R-hat and effective size, sum by sum (Gelman et al. 2013, 11.4-11.5)."""
    n = x.shape[1] // 2
    chains = [row[i * n : (i + 1) * n] for row in x for i in (0, 1)]
    m = len(chains)
    W = np.mean([np.var(chain, ddof=1) for chain in chains])
    B = n * np.var([chain.mean() for chain in chains], ddof=1)
    plus = (n - 1) / n * W + B / n
    rho = []
    for t in range(n):
        shared = [
            sum((c[: n - t] - c.mean()) * (c[t:] - c.mean())) / (n - 1) for c in chains
        ]
        rho.append(1 - (W - np.mean(shared)) / plus)
    pairs = [rho[t] + rho[t + 1] for t in range(0, n - 1, 2)]
    total, least = -1.0, np.inf
    for pair in pairs:
        least = min(least, pair)
        if least <= 0:
            break
        total += 2 * least
    return np.sqrt(plus / W), m * n / max(total, 1 / np.log10(m * n))


@pytest.mark.parametrize("length", [8, 9, 12, 64])
@pytest.mark.parametrize("correlation", [-0.5, 0.0, 0.7, 0.95])
def test_chain_diagnosis_equals_the_textbook_formulas(length, correlation, rng):
    x = rng.normal(size=(4, length)) + rng.normal(size=(4, 1))
    for t in range(1, length):
        x[:, t] += correlation * x[:, t - 1]
    np.testing.assert_allclose(diagnose(x), by_the_textbook(x), rtol=1e-9)
    # in any unit, about any value
    np.testing.assert_allclose(diagnose(1e-6 * x + 1e-3), diagnose(x), rtol=1e-6)


def test_chains_are_reported_as_mixed_only_if_every_varying_component_is_mixed(rng):
    """Chains of correlated points and chains about different means are not mixed."""
    apart = np.array([-1.5, -0.5, 0.5, 1.5])[:, None]
    slow = rng.normal(size=(4, 64))
    for t in range(1, 64):
        slow[:, t] += 0.6 * slow[:, t - 1]
    good = rng.normal(size=(4, 64))
    for one, mixed in ((good, True), (slow, False), (good + apart, False)):
        for size in (1.0, 1e-9):
            trace = np.zeros((4, 64, 6))
            trace[:, :, 0] = size * good
            trace[:, :, 3] = size * one
            trace[:, :, 4] = 7.0 + 1e-14 * slow  # rounding
            assert is_mixed(trace) == mixed
    assert is_mixed(np.ones((4, 64, 6)))
    assert not is_mixed(np.where(np.arange(6) == 2, np.nan, trace))


def test_chains_stuck_at_different_points_are_not_mixed():
    """Nothing varies within a chain, as in corners of the set: R-hat is infinite."""
    trace = np.zeros((4, 64, 6))
    trace[:, :, 1] = np.arange(4)[:, None]
    assert not is_mixed(trace)
    assert diagnose(trace[:, :, 1])[0] == np.inf


@pytest.mark.parametrize("dimensions", [1, 2, 5])
@pytest.mark.parametrize("start", [0.0, 0.6, 0.95, 1.0])
def test_dikin_ellipsoid_of_a_box_is_a_ball_about_its_middle(dimensions, start):
    """-sum log(1 - u_i^2) has the Hessian 2 I at 0: axes of 1 / sqrt 2."""
    heads = np.arange(dimensions + 1)
    u, M = _ellipsoid(np.eye(dimensions), heads, np.full(dimensions, start))
    np.testing.assert_allclose(u, 0.0, atol=2e-3)
    np.testing.assert_allclose(M @ M.T, np.eye(dimensions) / 2, atol=1e-4)


def test_point_without_freedom_does_not_move_and_counts_as_mixed():
    u, to_screw = np.array([0.3, 0.4]), np.eye(6)[:, :2].copy()
    rng = draw_generator(1, 0, 9)
    assert sample_uniform_position(np.zeros((2, 0)), np.array([0, 2]), to_screw, u, rng)
    np.testing.assert_array_equal(u, [0.3, 0.4])
