"""Scaling of tolerances to a limit, and minimum-cost tolerances."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.statistics.cutting_planes import cheapest_within, cut_planes
from forcefit.assembly.statistics.least_cost import least_cost
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.statistics.scaling import Samples, draw_samples, scale_uniformly
from forcefit.inputs.table import BadInput
from tests.tolerances_for_tests import silent


class Known:
    """Requirement whose utilisation is a given function of the error size."""

    def __init__(self, utilisation, least=0.0, most=1e9, tolerances=1):
        self.utilisation = utilisation
        self.plan = SimpleNamespace(
            least=np.full(tolerances, least), most=np.full(tolerances, most),
            spread=lambda t: t,
        )  # fmt: skip

    def utilisations(self, values):
        """Return lower bounds of zero, and upper bounds for two limits."""
        upper = self.utilisation(np.abs(values).max(axis=1))
        return np.zeros((2, len(values))), np.stack([upper, upper / 2])


ONE = Samples(np.ones((1, 1)), 0)


@pytest.mark.parametrize("power", [0.4, 1.0, 2.0, 8.0])
@pytest.mark.parametrize("start", [0.2, 1.0, 5.0])
def test_scaling_of_a_power_law_reaches_the_limit(power, start):
    """The utilisation (t / 3)^power is 1 for t = 3."""
    known = Known(lambda size: (size / 3.0) ** power)
    (found,) = scale_uniformly(known, ONE, np.array([start]))
    assert 1 - 1e-4 <= (found / 3.0) ** power <= 1 + 1e-9


@pytest.mark.parametrize("start", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("within", [0.0, 0.5])
@pytest.mark.parametrize("beyond", [2.0, np.inf])
def test_scaling_at_a_discontinuity_satisfies_the_limit(start, within, beyond):
    """The result is the largest admissible factor within the precision."""
    known = Known(lambda size: np.where(size <= 3.0, within, beyond))
    for precision in (1e-2, 1e-4):
        (found,) = scale_uniformly(known, ONE, np.array([start]), precision)
        assert 3.0 * (1 - precision) <= found <= 3.0


def test_scaling_preserves_proportions_within_bounds():
    """A tolerance at its upper bound is not increased."""
    known = Known(lambda size: size / 6.0, least=0.5, most=8.0, tolerances=3)
    found = scale_uniformly(known, Samples(np.ones((1, 3)), 0), np.array([1.0, 2, 4]))
    np.testing.assert_allclose(found, [1.5, 3.0, 6.0], rtol=1e-4)
    found = scale_uniformly(known, Samples(np.ones((1, 3)), 0), np.array([0.1, 2, 4]))
    np.testing.assert_allclose(found, [0.5, 3.0, 6.0], rtol=1e-4)
    loose = Known(lambda size: size / 20.0, most=8.0, tolerances=2)
    found = scale_uniformly(loose, Samples(np.ones((1, 2)), 0), np.array([1.0, 1e-3]))
    np.testing.assert_array_equal(found, [8.0, 8.0])


@pytest.mark.parametrize("allowed", [0, 1, 300])
def test_scaling_accepts_the_allowed_number_of_failures(allowed):
    """Of the sizes 1 to 1000, the largest size that must satisfy the limit is 1000 -
    allowed.
    """
    values = np.random.default_rng(1).permutation(np.arange(1.0, 1001.0))[:, None]
    known = Known(lambda size: size / 6.0)
    (found,) = scale_uniformly(known, Samples(values, allowed), np.ones(1))
    assert found == pytest.approx(6.0 / (1000 - allowed), rel=1e-4)


@pytest.mark.parametrize("least", [0.0, 0.7])
def test_limits_exceeded_for_all_scale_factors_are_rejected(least):
    """The limit is exceeded without errors or with the tightest tolerances."""
    constant = Known(lambda size: 2.0 + 0 * size, least)
    beyond = Known(lambda size: 2.0 + size, least)
    for known in (constant, beyond):
        with pytest.raises(BadInput, match="^tolerances: even a robot without geom"):
            scale_uniformly(known, ONE, np.ones(1))


@pytest.mark.parametrize(("draws", "allowed"), [(59, 0), (92, 0), (93, 1), (124, 2)])
def test_allowed_number_of_failures_equals_values_of_wilks(draws, allowed):
    """According to Wilks (1942), 59, 93 and 124 draws with 0, 1 and 2 failures
    demonstrate a yield of 95 % with 95 % confidence.
    """
    plan = SimpleNamespace(
        asked_yield=0.95, draws=draws, draws_of=lambda stream, count: (stream, count)
    )
    samples = draw_samples(SimpleNamespace(plan=plan), 7)
    assert samples.allowed == allowed
    assert samples.values == (7, draws)


def test_too_few_draws_for_a_yield_are_rejected():
    plan = SimpleNamespace(asked_yield=0.95, draws=29, draws_of=lambda *_: np.zeros(1))
    requirement = SimpleNamespace(plan=plan)
    with pytest.raises(BadInput) as error:
        draw_samples(requirement, 7, 2)
    assert str(error.value) == (
        "tolerances: 58 draws are too few to demonstrate a yield of 0.95, even if none "
        "of them fails; use more draws"
    )
    assert draw_samples(requirement, 7, 3).allowed == 0


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
