"""Minimum-cost tolerances for given limits."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.statistics.cutting_planes import cheapest_within, cut_planes
from forcefit.assembly.statistics.least_cost import least_cost
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.statistics.scaling import Samples
from forcefit.inputs.table import BadInput
from tests.tolerances_for_tests import silent


class Sums:
    """Requirement on two sums of error sizes."""

    weights = np.array([[4.0, 0.5, 0.5], [1.0, 1.0, 1.0]])
    cases = [(0, 0), (1, 0)]
    plan = Plan(SimpleNamespace(draw=None), np.array([0, 1, 1]), ("a", "b"),
                np.array([1.0, 4.0]), np.zeros(2), np.full(2, 1e3), {})  # fmt: skip

    def utilisations(self, values):
        sums = self.weights @ np.abs(values.T)
        return 0 * sums, sums

    def utilisation_slopes(self, case, values):
        return np.sign(values) * self.weights[case]

    def worst_corner(self, key, i, t, corners):
        return SimpleNamespace(signs=np.ones(3))


CORNERS = Samples(np.array([[1.0, -1, 1], [-1, -1, 1]]), 0)


def test_minimum_cost_of_two_limits_is_at_their_intersection():
    """The limits 4 t1 + t2 = 1 and t1 + 2 t2 = 1 intersect at (1/7, 3/7)."""
    t, _ = least_cost(Sums(), CORNERS, np.array([1.0, 1.0]), silent)
    np.testing.assert_allclose(t, [1 / 7, 3 / 7], rtol=5e-3)


COSTS = np.array([1.0, 4.0, 2.0])
PLANE = np.array([30.0, 5.0, 2e3])  # [1/rad or 1/m]
NONE, LOOSE = np.zeros(3), np.full(3, 1e3)


def plan(limits):
    """Return a plan with three classes of errors."""
    return Plan(None, np.arange(3), ("a", "b", "c"), COSTS, NONE, LOOSE, limits)


def test_infeasible_smallest_tolerances_are_rejected():
    with pytest.raises(BadInput) as error:
        cheapest_within(plan({}), [PLANE], np.array([0.0, 0.21, 0.0]), LOOSE)
    assert str(error.value) == (
        "tolerances: even the smallest allowed tolerances exceed a limit; increase the "
        "limit or allow smaller tolerances"
    )


class Exceeded:
    """Requirement whose limit of 2 is exceeded without errors."""

    plan, convex = plan({"a": 2.0}), {"a": [None]}

    def worst_corner(self, key, i, t, corners):
        row = np.array([10.0, 20, 5])
        return SimpleNamespace(value=2.1 + row @ t, slopes=row, signs=np.ones(3))


def test_limit_exceeded_without_errors_is_rejected():
    with pytest.raises(
        BadInput, match="^even a robot without .* exceeds a limit of 2;"
    ):
        cut_planes(Exceeded(), silent)
