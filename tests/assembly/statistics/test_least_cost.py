"""Steps towards the least cost, for limits whose least cost is known."""

from types import SimpleNamespace

import numpy as np

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
