"""Cheapest tolerances within planes by Lagrange's multipliers, and planes by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from assembly.statistics import cutting_planes
from assembly.statistics.cutting_planes import cheapest_within, cut_planes
from assembly.statistics.requirement import Plan
from forcefit.inputs.table import BadInput

COSTS = np.array([1.0, 4.0, 2.0])
PLANE = np.array([30.0, 5.0, 2e3])  # [1/rad or 1/m]
NONE, LOOSE = np.zeros(3), np.full(3, 1e3)


def plan(cost="reciprocal", **options):
    """Three classes; of three errors, unless others are given."""
    return Plan(None, np.arange(3), ("a", "b", "c"), COSTS, NONE, LOOSE, {}, cost,
                **options)  # fmt: skip


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e6])
def test_one_plane_is_shared_by_lagranges_multipliers(unit):
    """Minimise sum c/t with a.t = 1: t ~ sqrt(c/a); of -sum c log t: t = c/(a sum c).

    In any unit of the tolerances.
    """
    a, most = PLANE / unit, LOOSE * unit
    found = cheapest_within(plan(), [a], NONE, most)
    best = np.sqrt(COSTS / a) / np.sqrt(COSTS * a).sum()
    np.testing.assert_allclose(found, best, rtol=1e-4)
    found = cheapest_within(plan("logarithm"), [a], NONE, most)
    np.testing.assert_allclose(found, COSTS / a / COSTS.sum(), rtol=1e-4)


@pytest.mark.parametrize("cost", ["reciprocal", "logarithm"])
def test_planes_of_one_tolerance_each_leave_all_at_their_planes(cost):
    planes = [row for row in np.diag([10.0, 20.0, 40.0])] + [np.array([-5.0, 0, 0])]
    found = cheapest_within(plan(cost), planes, NONE, LOOSE)
    np.testing.assert_allclose(found, [0.1, 0.05, 0.025], rtol=1e-5)


def test_tolerances_at_a_bound_leave_the_rest_of_the_plane_to_the_others():
    """The first no looser than 5e-4, the second no tighter than 0.15."""
    best = np.sqrt(COSTS / PLANE) / np.sqrt(COSTS * PLANE).sum()
    most, least = LOOSE.copy(), NONE.copy()
    most[0], least[1] = 5e-4, 0.15
    assert best[0] > most[0]
    assert best[1] < least[1]
    found = cheapest_within(plan(), [PLANE], least, most)
    rest = (1 - PLANE[0] * 5e-4 - PLANE[1] * 0.15) / PLANE[2]
    np.testing.assert_allclose(found, [5e-4, 0.15, rest], rtol=1e-4)
    # bounds hold exactly, whatever the solver's rounding
    assert found[0] <= most[0]
    assert found[1] >= least[1]
    np.testing.assert_allclose(cheapest_within(plan(), [], NONE, most), most, rtol=1e-3)


def test_tolerances_that_may_not_be_tight_enough_are_refused():
    with pytest.raises(BadInput) as error:
        cheapest_within(plan(), [PLANE], np.array([0.0, 0.21, 0.0]), LOOSE)
    assert str(error.value) == (
        "tolerances: even the tightest ones allowed violate a limit"
    )


class Found:
    """Limits of which the worst corner, or the response of each draw, is given."""

    def __init__(self, limits, postures, corners=None, responses=None, **options):
        self.plan = plan(**options)
        object.__setattr__(self.plan, "limits", limits)
        object.__setattr__(self.plan, "sources", self)
        self.convex = {key: [None] * postures for key in limits}
        self.corners, self.responses, self.asked = corners, responses, []

    def worst_corner(self, key, i, t, corners):
        self.asked.append((key, i, t, corners))
        return self.corners[key, i]

    def draw(self, first, count, seed, stream):
        """Draws of one error at a time, so that a draw's slopes are of one class."""
        self.asked.append((first, count, seed, stream))
        return np.tile(np.eye(3) * [1.0, -1.0, 0.5], (count // 3, 1))

    def respond(self, key, i, values):
        return self.responses[key, i](values)


def corner(value, slopes=(1.0, 2.0, 3.0), signs=(1.0, -1.0, 1.0)):
    return SimpleNamespace(value=value, slopes=np.array(slopes), signs=np.array(signs))


T = np.array([0.1, 0.2, 0.3])


@pytest.mark.parametrize("value", [2.0 + 1.6, 2.0 + 1.7])
def test_a_plane_that_no_tolerances_meet_is_refused(value):
    """g.t = 0.6: at t = 0 the value is 0.6 less, which is the limit or more."""
    found = Found({"margin": 2.0}, 1, {("margin", 0): corner(value, signs=(1, 1, 1))})
    assert np.dot([1, 2, 3], T) == pytest.approx(1.4)
    with pytest.raises(BadInput, match="^even perfect parts exceed a limit of 2$"):
        list(cutting_planes._violated(found, T))


def test_planes_are_added_until_no_limit_is_exceeded():
    """Sums of tolerances of two limits: 10 t1 + 20 t2 + 5 t3 <= 1, 40 t3 <= 1."""
    rows = {("a", 0): np.array([10.0, 20, 5]), ("b", 0): np.array([0.0, 0, 40])}

    class Sums(Found):
        def worst_corner(self, key, i, t, corners):
            return corner(rows[key, i] @ t, rows[key, i], np.ones(3))

    requirement, seen = Sums({"a": 1.0, "b": 1.0}, 1), []
    t, bound, count = cut_planes(requirement, lambda *step: seen.append(step))
    assert count == 2
    best = cheapest_within(requirement.plan, list(rows.values()), NONE, LOOSE)
    np.testing.assert_allclose(t, best, rtol=1e-6)
    assert bound == pytest.approx((COSTS / t).sum(), rel=1e-9)
    assert seen == [("cutting planes", k, 200) for k in (0, 1, 200)]
    wide = Sums({"a": 1e9, "b": 1e9}, 1)
    t, bound, count = cut_planes(wide, lambda *_: None)
    np.testing.assert_array_equal(t, LOOSE)
    assert (bound, count) == (-np.inf, 0)
