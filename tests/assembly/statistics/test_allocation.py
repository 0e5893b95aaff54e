"""The last scaling of an allocation, and where it starts without a convex limit."""

from types import SimpleNamespace

import numpy as np
import pytest

from assembly.statistics.allocation import _scaled_tolerances
from assembly.statistics.requirement import SCALING, TRAINING, Plan


class Dozen:
    """Twelve sources of errors."""

    def __init__(self, draw):
        self.draw = draw

    def __len__(self):
        return 12


class Sum:
    """A limit on the sum of a dozen errors: two classes, of six errors each."""

    is_convex = False
    cases = [("sum", 0)]

    def __init__(self, asked_yield, draws):
        self.drawn = []
        self.plan = Plan(Dozen(self.draw), np.repeat([0, 1], 6), ("a", "b"),
                         np.array([1.0, 4.0]), np.zeros(2), np.full(2, 10.0), {},
                         asked_yield=asked_yield, draws=draws)  # fmt: skip

    def draw(self, first, count, seed, stream):
        self.drawn.append((stream, count))
        return np.random.default_rng(stream).uniform(-1, 1, (count, 12))

    def utilisations(self, values):
        sums = np.abs(values.sum(axis=1))[None]
        return 0 * sums, sums

    def utilisation_slopes(self, case, values):
        return np.repeat(np.sign(values.sum(axis=1))[:, None], 12, axis=1)

    def worst_corner(self, key, i, t, corners):
        return SimpleNamespace(signs=np.ones(12))


def silent(*_):
    """No progress is shown."""


def test_what_must_always_hold_holds_at_the_worst_corner():
    """Six corners of 4096 are drawn; the sum of all tolerances, 6 t1 + 6 t2, is 1."""
    requirement = Sum(1.0, 6)
    found, alike = _scaled_tolerances(requirement, np.array([1.0, 1.0]), silent)
    assert 6 * found.sum() == pytest.approx(1.0, rel=2e-4)
    np.testing.assert_allclose(alike, 1 / 12, rtol=2e-4)
    # c / t with t1 + t2 given: as the roots of the costs
    np.testing.assert_allclose(found, np.array([1, 2]) / 18, rtol=0.02)
    assert requirement.drawn == []


def test_with_a_yield_other_draws_scale_than_those_that_shaped_the_tolerances():
    """Four times as many; of these just so few fail that the yield is shown."""
    requirement = Sum(0.8, 150)
    found, alike = _scaled_tolerances(requirement, np.array([1.0, 1.0]), silent)
    assert requirement.drawn == [(TRAINING, 150), (SCALING, 600)]
    draws = np.random.default_rng(SCALING).uniform(-1, 1, (600, 12))
    price = requirement.plan.price
    assert price(found) <= price(alike)
    for t in (found, alike):
        failed = np.abs(draws @ np.repeat(t, 6)) > 1 + 1e-9
        # 0.8 of 600 draws, less what 95 % of chance leave open
        assert 0.8 <= 1 - failed.mean() <= 0.85
