"""Reflections and convergence diagnostics of random walks."""

import numpy as np
import pytest

from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.solvers.billiard_walk import Positions
from forcefit.assembly.solvers.uniform_clearance import (
    diagnose,
    is_mixed,
    sample_uniform_position,
)


def by_the_textbook(x):
    """Return split R-hat and effective sample size (Gelman et al. 2013, 11.4-11.5)."""
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
def test_chain_diagnostics_equal_textbook_formulas(length, correlation, rng):
    x = rng.normal(size=(4, length)) + rng.normal(size=(4, 1))
    for t in range(1, length):
        x[:, t] += correlation * x[:, t - 1]
    np.testing.assert_allclose(diagnose(x), by_the_textbook(x), rtol=1e-9)
    # The diagnosis does not depend on unit and offset.
    np.testing.assert_allclose(diagnose(1e-6 * x + 1e-3), diagnose(x), rtol=1e-6)


def test_chains_with_one_unmixed_component_are_not_mixed(rng):
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


def test_constant_chains_at_different_points_are_not_mixed():
    """Each chain is constant, so R-hat is infinite."""
    trace = np.zeros((4, 64, 6))
    trace[:, :, 1] = np.arange(4)[:, None]
    assert not is_mixed(trace)
    assert diagnose(trace[:, :, 1])[0] == np.inf


def test_walk_without_degrees_of_freedom_does_not_move():
    u, to_screw = np.array([0.3, 0.4]), np.eye(6)[:, :2].copy()
    rng = draw_generator(1, 0, 9)
    assert sample_uniform_position(np.zeros((2, 0)), np.array([0, 2]), to_screw, u, rng)
    np.testing.assert_array_equal(u, [0.3, 0.4])


FLIGHT = 2.0  # mean time of a trajectory


def sizes(starts, u):
    """Return the size of each cone."""
    return [
        np.linalg.norm(u[a:b]) for a, b in zip(starts[:-1], starts[1:], strict=True)
    ]


def walked(starts, M, u, every=1, kept=1, seed=1, to_screw=None):
    """Return the end of a walk, its screws, and a copy of the initial generator."""
    M, starts = np.ascontiguousarray(M, dtype=float), np.array(starts)
    to_screw = np.zeros((6, len(M))) if to_screw is None else to_screw
    u, trace = np.array(u, dtype=float), np.empty((kept, 6))
    positions = Positions(M, starts, to_screw)
    positions.walk(u, every, draw_generator(seed, 0, 9), trace)
    return u, trace, draw_generator(seed, 0, 9)


def reflected(starts, M, u, speed, left):
    """Return the same walk in coordinates y with u = M y, by specular reflections."""
    for _ in range(1000):
        w, reach, wall = M @ speed, left, None
        for k, (a, b) in enumerate(zip(starts[:-1], starts[1:], strict=True)):
            # |u_k + t w_k| = 1
            w_k, u_k = w[a:b], u[a:b]
            roots = np.roots([w_k @ w_k, 2 * u_k @ w_k, u_k @ u_k - 1])
            if np.max(roots) < reach:
                reach, wall = np.max(roots), k
        u = u + reach * w
        if wall is None:
            return u
        left -= reach
        a, b = starts[wall], starts[wall + 1]
        normal = M[a:b].T @ u[a:b]
        speed = speed - 2 * (normal @ speed) / (normal @ normal) * normal
    raise AssertionError("too many reflections")


@pytest.mark.parametrize("seed", range(5))
def test_billiard_trajectory_equals_specular_reflections(seed, rng):
    """The reflections are computed in the coordinates of the Dikin ellipsoid."""
    starts = [0, 2, 3, 5]
    for M in (np.eye(5), rng.normal(size=(5, 5)), rng.normal(size=(5, 3))):
        start = np.array([0.6, -0.5, 0.2, 0.0, 0.1])
        u, _, numbers = walked(starts, M, start, seed=seed)
        speed = numbers.standard_normal(M.shape[1])
        left = FLIGHT * numbers.standard_exponential()
        expected = reflected(starts, M, start, speed, left)
        np.testing.assert_allclose(u, expected, atol=1e-7)
        assert max(sizes(starts, u)) <= 1 + 1e-9


def test_cone_of_fixed_coordinates_does_not_stop_the_walk(rng):
    """A cone of fixed coordinates can be at its bound."""
    starts, centre = np.array([0, 2, 3]), np.array([0.6, 0.8, 0.5])
    M, walks = np.array([[0.0], [0.0], [0.3]]), np.empty((8, 3))
    positions = Positions(M, starts, np.zeros((6, 3)))
    positions.start_chains(centre, draw_generator(2, 0, 9), walks)
    ends = centre[2] + (walks[:, 2] - centre[2]) / 0.9
    np.testing.assert_allclose(np.abs(ends), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(walks[:, :2], np.tile(centre[:2], (8, 1)))
    # Fixed coordinates do not change along a trajectory.
    still, _, _ = walked(starts, np.zeros((3, 1)), centre)
    np.testing.assert_array_equal(still, centre)


def test_walk_from_a_point_slightly_outside_returns_inside():
    starts, outside = [0, 1], [1 + 1e-15]
    for seed in range(6):
        u, _, _ = walked(starts, [[0.5]], outside, seed=seed)
        assert abs(u[0]) <= 1 + 2e-15
