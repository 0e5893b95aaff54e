"""Cheapest tolerances within planes by Lagrange multipliers, and planes by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.assembly.statistics.cutting_planes import cheapest_within, cut_planes
from forcefit.assembly.statistics.requirement import Plan
from forcefit.inputs.table import BadInput
from tests.tolerances_for_tests import silent

COSTS = np.array([1.0, 4.0, 2.0])
PLANE = np.array([30.0, 5.0, 2e3])  # [1/rad or 1/m]
NONE, LOOSE = np.zeros(3), np.full(3, 1e3)


def plan(cost="reciprocal", **options):
    """Three classes; of three errors, unless others are given."""
    return Plan(None, np.arange(3), ("a", "b", "c"), COSTS, NONE, LOOSE, {}, cost,
                **options)  # fmt: skip


def test_cheapest_tolerances_respect_their_bounds_and_use_the_plane_fully():
    """The first is at most 5e-4, the second at least 0.15."""
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


def test_least_tolerances_beyond_a_plane_are_refused():
    with pytest.raises(BadInput) as error:
        cheapest_within(plan(), [PLANE], np.array([0.0, 0.21, 0.0]), LOOSE)
    assert str(error.value) == (
        "tolerances: even the tightest ones allowed violate a limit"
    )


class Sums:
    """Limits of which the worst corner is a sum of tolerances, and a constant."""

    def __init__(self, rows, limits, constant=0.0):
        self.plan = plan()
        object.__setattr__(self.plan, "limits", limits)
        self.convex = {key: [None] for key in limits}
        self.rows, self.constant = rows, constant

    def worst_corner(self, key, i, t, corners):
        row = self.rows[key]
        value = self.constant + row @ t
        return SimpleNamespace(value=value, slopes=row, signs=np.ones(3))


ROWS = {"a": np.array([10.0, 20, 5]), "b": np.array([0.0, 0, 40])}


def test_cutting_planes_are_added_until_no_limit_is_exceeded():
    """Sums of tolerances of two limits: 10 t1 + 20 t2 + 5 t3 <= 1, 40 t3 <= 1."""
    requirement = Sums(ROWS, {"a": 1.0, "b": 1.0})
    t, bound, count = cut_planes(requirement, silent)
    assert count == 2
    best = cheapest_within(requirement.plan, list(ROWS.values()), NONE, LOOSE)
    np.testing.assert_allclose(t, best, rtol=1e-6)
    assert bound == pytest.approx((COSTS / t).sum(), rel=1e-9)
    t, bound, count = cut_planes(Sums(ROWS, {"a": 1e9, "b": 1e9}), silent)
    np.testing.assert_array_equal(t, LOOSE)
    assert (bound, count) == (-np.inf, 0)


def test_limit_exceeded_by_perfect_parts_is_refused():
    requirement = Sums(ROWS, {"a": 2.0, "b": 1e9}, constant=2.1)
    with pytest.raises(BadInput, match="^even perfect parts exceed a limit of 2$"):
        cut_planes(requirement, silent)
