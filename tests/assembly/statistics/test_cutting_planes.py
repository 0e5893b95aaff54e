"""Cutting planes: limits that no tolerances meet are refused."""

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


def test_least_tolerances_beyond_a_plane_are_refused():
    with pytest.raises(BadInput) as error:
        cheapest_within(plan(), [PLANE], np.array([0.0, 0.21, 0.0]), LOOSE)
    assert str(error.value) == (
        "tolerances: even the smallest allowed tolerances violate a limit; loosen the "
        "limit or allow smaller tolerances"
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


def test_limit_that_perfect_parts_exceed_is_refused():
    requirement = Sums(ROWS, {"a": 2.0, "b": 1e9}, constant=2.1)
    with pytest.raises(
        BadInput, match="^even a robot without .* exceeds a limit of 2;"
    ):
        cut_planes(requirement, silent)
