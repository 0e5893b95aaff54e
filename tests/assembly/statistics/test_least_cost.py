"""Steps towards the least cost, for limits whose least cost is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.statistics.least_cost import least_cost
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.statistics.scaling import Samples
from tests.tolerances_for_tests import silent

COSTS = np.array([1.0, 4.0])
GROUP = np.array([0, 1, 1])


class Sums:
    """Limits on sums of sizes of three errors, of two classes."""

    def __init__(self, weights, asked_yield=1.0, cost="reciprocal", power=1.0):
        self.weights, self.power = np.array(weights), power
        sources = SimpleNamespace(draw=None)
        self.plan = Plan(sources, GROUP, ("a", "b"), COSTS, np.zeros(2),
                         np.full(2, 1e3), {}, cost, asked_yield)  # fmt: skip
        self.cases = [(k, 0) for k in range(len(weights))]

    def utilisations(self, values):
        sums = self.weights @ np.abs(values.T)
        return 0 * sums, sums**self.power

    def utilisation_slopes(self, case, values):
        inner = self.power * (np.abs(values) @ self.weights[case]) ** (self.power - 1)
        return np.sign(values) * self.weights[case] * inner[:, None]

    def worst_corner(self, key, i, t, corners):
        return SimpleNamespace(signs=np.ones(3))


CORNERS = Samples(np.array([[1.0, -1, 1], [-1, -1, 1]]), 0)


def test_least_cost_of_two_crossing_limits_is_at_their_crossing():
    """4 t1 + t2 <= 1 and t1 + 2 t2 <= 1 cross at (1/7, 3/7), where c/t is least."""
    requirement = Sums([[4.0, 0.5, 0.5], [1.0, 1.0, 1.0]])
    t, _ = least_cost(requirement, CORNERS, np.array([1.0, 1.0]), silent)
    np.testing.assert_allclose(t, [1 / 7, 3 / 7], rtol=5e-3)


class Signed(Sums):
    """A limit on the sum itself, in which errors of opposite signs cancel."""

    def utilisations(self, values):
        sums = np.abs(self.weights @ values.T)
        return 0 * sums, sums

    def utilisation_slopes(self, case, values):
        sums = values @ self.weights[case]
        return np.sign(sums)[:, None] * self.weights[case]


def test_least_cost_respects_a_worse_corner_found_during_the_steps():
    """At the first samples 3 t2 reduces the sum; at the worst corner it adds to it."""
    requirement = Signed([[2.0, 3.0, 5.0]])
    t, _ = least_cost(requirement, CORNERS, np.array([1.0, 1.0]), silent)
    assert 2 * t[0] + 8 * t[1] == pytest.approx(1.0, rel=2e-3)


class Norm(Sums):
    """A limit on the root of the sum of the squares of the weighted errors."""

    def utilisations(self, values):
        size = np.sqrt(self.weights**2 @ (values.T**2))
        return 0 * size, size

    def utilisation_slopes(self, case, values):
        size = np.sqrt(values**2 @ self.weights[case] ** 2)
        return values * self.weights[case] ** 2 / size[:, None]


@pytest.mark.parametrize("weights", [[1.0, 1.0, 1.0], [20.0, 1.0, 0.5]])
def test_least_cost_of_a_sum_of_squares_follows_cube_roots(weights):
    """Minimise sum c/t with sum (a t)^2 = 1: t ~ (c / a^2)^(1/3)."""
    squares = np.array([weights[0] ** 2, weights[1] ** 2 + weights[2] ** 2])
    best = (COSTS / squares) ** (1 / 3)
    best /= np.sqrt(squares @ best**2)
    t, _ = least_cost(Norm([weights]), CORNERS, np.array([1.0, 1.0]), silent)
    assert np.sqrt(squares @ t**2) == pytest.approx(1.0, rel=1.1e-3)
    assert (COSTS / t).sum() == pytest.approx((COSTS / best).sum(), rel=3e-3)
