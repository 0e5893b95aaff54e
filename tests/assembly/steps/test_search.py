"""Tests of the search for the best order of joining."""

from itertools import permutations

import numpy as np
import pytest

from forcefit.assembly.steps.plan import Adjust, Fix, Join, Measure, Plan, Release
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.assembly.steps.search import OBJECTIVES, best_order
from tests.assembly.steps.robots_for_steps import (
    guided,
    leg,
    planar_platform,
    three_legs,
)
from tests.assembly.steps.test_run import LENGTHS, gough

LEG = {i: ("platform", f"leg{i}") for i in range(4)}
JOINS = [Join(f"{i}", LEG[i]) for i in range(2)]
HEIGHT = Measure("z", "platform", ("TZ",))


PLACES = [0.0, 0.4, 0.1, 0.3, 0.25]  # [m] of five legs


def joins_with_slots(count, slots):
    """Return the joins of all legs, some of which are in slots along z."""
    return tuple(
        Join(f"{i}", (f"seat{i}", f"end{i}"), locked=("TZ",) if i in slots else ())
        for i in range(1, count + 1)
    )


def outcome(plan, posture, objective):
    results = assemble_in_steps(plan, posture)
    if objective == "force":
        return max(r.closing_force[0] for r in results if isinstance(r.step, Join))
    if objective == "energy":
        return results[-1].energy[0]
    return np.linalg.norm(results[-1].platform_screw[0, 3:])


def test_minimum_peak_force_of_three_legs_equals_closed_form():
    """Two legs are joined with the force k_i k_j / (k_i + k_j) |d_i - d_j|."""
    steps = tuple(Join(f"{i}", LEG[i]) for i in (1, 2, 3))
    found = best_order(Plan(steps), three_legs(), "force")
    k, d = np.array([1e6, 2e6, 3e6]), np.array([30e-6, -20e-6, 50e-6])
    peaks = []
    for a, b, c in permutations(range(3)):
        pair = k[a] * k[b] / (k[a] + k[b])
        x = (k[a] * d[a] + k[b] * d[b]) / (k[a] + k[b])
        all_of = (k[a] + k[b]) * k[c] / k.sum()
        peaks.append(max(pair * abs(d[a] - d[b]), all_of * abs(d[c] - x)))
    assert found.value == pytest.approx(min(peaks))
    assert found.bound == found.value
    assert found.method == "sets"
    assert outcome(found.plan, three_legs(), "force") == pytest.approx(min(peaks))


@pytest.mark.parametrize("objective", OBJECTIVES)
@pytest.mark.parametrize("slots", [(), (2, 5)])
def test_search_finds_the_best_of_all_orders(objective, slots, rng):
    posture = planar_platform(PLACES, rng.normal(size=5) * 40e-6)
    steps = joins_with_slots(5, slots)
    found = best_order(Plan(steps), posture, objective)
    every = [outcome(Plan(order), posture, objective) for order in permutations(steps)]
    assert found.value == pytest.approx(min(every), rel=1e-9, abs=1e-15)
    assert found.bound == pytest.approx(found.value)
    assert found.given == pytest.approx(every[0])
    again = outcome(found.plan, posture, objective)
    assert again == pytest.approx(found.value, rel=1e-9, abs=1e-15)


def test_search_permutes_only_consecutive_joins():
    steps = (
        Join("1", LEG[1]), Fix("clamp", "platform", None), Join("3", LEG[3]),
        Join("2", LEG[2]), Release("free", ("clamp",)),
    )  # fmt: skip
    found = best_order(Plan(steps), three_legs(), "force")
    names = [step.name for step in found.plan.steps]
    assert (names[0], names[1], names[4]) == ("1", "clamp", "free")
    assert sorted(names[2:4]) == ["2", "3"]


def test_search_permutes_adjustments_and_joins():
    """A shim at leg 0 moves the platform to the height 0.

    If leg 1 is joined after the adjustment, it raises the platform by 30 um.
    """
    posture = legs_on_a_guide((10e-6, 60e-6))
    shim = Adjust("shim", "leg0", ("TZ",), HEIGHT)
    given = Plan((JOINS[0], shim, JOINS[1]))
    assert outcome(given, posture, "error") == pytest.approx(30e-6)
    found = best_order(given, posture, "error")
    assert found.value == pytest.approx(0.0, abs=1e-12)
    assert [step.name for step in found.plan.steps].index("shim") == 2


def test_search_for_minimum_error_optimises_adjustments():
    """The adjustment that makes TZ zero does not minimise the translation error."""
    shim = Adjust("shim", "leg6", ("TZ",), HEIGHT)
    found = best_order(Plan((shim,)), gough(LENGTHS), "error")
    assert found.given == pytest.approx(6.6e-6, abs=0.05e-6)
    assert found.value == pytest.approx(5.4e-6, abs=0.05e-6)
    assert found.plan.steps[0].amount == pytest.approx([-34.1e-6], abs=0.05e-6)
    assert found.bound == 0.0
    assert outcome(found.plan, gough(LENGTHS), "error") == pytest.approx(found.value)


def test_search_for_minimum_energy_respects_increments():
    """A shim of 50 um closes the gap.  A shim of 40 um leaves a gap of 10 um."""
    posture = legs_on_a_guide((10e-6, 60e-6))
    for increment, amount, energy in ((0.0, 50e-6, 0.0), (40e-6, 40e-6, 25e-6)):
        shim = Adjust("shim", "leg0", ("TZ",), HEIGHT, increment)
        found = best_order(Plan((*JOINS, shim)), posture, "energy")
        (shim,) = (step for step in found.plan.steps if isinstance(step, Adjust))
        assert shim.amount == pytest.approx([amount], rel=1e-6)
        assert found.value == pytest.approx(energy, rel=1e-6, abs=1e-12)


def test_search_keeps_adjustment_before_join_of_same_closure():
    """Leg 1 is joined without a force after its length is adjusted."""
    posture = legs_on_a_guide((10e-6, 60e-6))
    shim = Adjust("shim", "leg1", ("TZ",), Measure("gap", ("platform", "leg1")))
    found = best_order(Plan((JOINS[0], shim, JOINS[1])), posture, "force")
    names = [step.name for step in found.plan.steps]
    assert names.index("shim") < names.index("1")
    assert found.value == pytest.approx(0.0, abs=1e-9)


def test_search_for_minimum_error_of_many_joins_stops_early(rng):
    """There are 362 880 orders of nine joins, and no bound of the error is known."""
    posture = planar_platform(np.linspace(0, 0.4, 9), 40e-6 * rng.normal(size=9))
    steps = joins_with_slots(9, (3, 6, 9))
    found = best_order(Plan(steps), posture, "error", most=300)
    assert found.bound == 0.0 <= found.value <= found.given
    assert 300 <= found.searched < 320


@pytest.mark.parametrize("objective", ["force", "energy"])
@pytest.mark.parametrize("most", [20, 60])
def test_search_that_stops_early_returns_lower_bound(objective, most, rng):
    posture = planar_platform(PLACES, rng.normal(size=5) * 40e-6)
    steps = joins_with_slots(5, (2, 5))
    every = best_order(Plan(steps), posture, objective)
    early = best_order(Plan(steps), posture, objective, most=most)
    assert early.bound <= every.value * (1 + 1e-9)
    assert every.value <= early.value * (1 + 1e-9)
    assert early.searched < every.searched


def legs_on_a_guide(lengths, k=1e6):
    """Return a platform that moves along z, with elastic legs."""
    k = np.broadcast_to(k, len(lengths))
    return guided([leg(f"leg{i}", k[i], d) for i, d in enumerate(lengths)])


def legs_along_z(rng, count):
    """Return a platform that moves along z, a plan, leg stiffnesses and leg errors."""
    k, d = rng.uniform(1e6, 3e6, count), rng.normal(size=count) * 3e-5
    posture = legs_on_a_guide(d, k)
    joins = tuple(Join(b, (a, b)) for a, b in posture.robot.closures)
    return posture, Plan(joins), k, d


def least_peak(k, d):
    """Return the minimum peak force, computed by dynamic programming over all sets."""
    sets = np.arange(1 << len(k))
    chosen = sets[:, None] >> np.arange(len(k)) & 1
    x = chosen @ (k * d) / np.maximum(chosen @ k, 1.0)
    best = np.full(len(sets), np.inf)
    best[0] = 0.0
    for size in range(1, len(k) + 1):
        layer = sets[chosen.sum(axis=1) == size]
        for i in range(len(k)):
            with_i = layer[layer >> i & 1 == 1]
            force = k[i] * np.abs(d[i] - x[with_i])
            peak = np.maximum(best[with_i & ~(1 << i)], force)
            best[with_i] = np.minimum(best[with_i], peak)
    return best[-1]


def test_minimum_peak_force_of_twelve_legs_equals_dynamic_programming(rng):
    posture, plan, k, d = legs_along_z(rng, 12)
    found = best_order(plan, posture, "force")
    assert found.value == pytest.approx(least_peak(k, d), rel=1e-9)
    assert found.bound == pytest.approx(found.value)
    assert outcome(found.plan, posture, "force") == pytest.approx(found.value)


@pytest.mark.parametrize("most", [12, 20, 40])
def test_search_over_sets_that_stops_early_returns_lower_bound(most, rng):
    posture, plan, k, d = legs_along_z(rng, 9)
    found = best_order(plan, posture, "force", most=most)
    least = least_peak(k, d)
    assert found.bound <= least * (1 + 1e-9)
    assert least <= found.value * (1 + 1e-9)
    assert outcome(found.plan, posture, "force") == pytest.approx(found.value)


def test_interrupted_search_returns_best_order_found():
    posture = planar_platform([0.0, 0.4, 0.1, 0.3], [0, 3e-5, 4e-5, -2e-5])
    steps = joins_with_slots(4, (4,))

    def stop(done):
        if done == 12:
            raise KeyboardInterrupt

    found = best_order(Plan(steps), posture, "force", progress=stop)
    assert found.bound <= found.value <= found.given


def test_search_finds_order_without_energy_for_nine_legs():
    """The energy is zero if the slots are bolted first."""
    errors = np.array([0, 0, 10, 20, -10, 5, 15, -5, 25]) * 1e-6
    posture = planar_platform(np.linspace(0, 0.4, 9), errors)
    steps = joins_with_slots(9, range(3, 10))
    found = best_order(Plan(steps[::-1]), posture, "energy")
    assert found.value == pytest.approx(0.0, abs=1e-15)
    assert found.bound == pytest.approx(0.0, abs=1e-15)
