"""Best order of joining, against all orders carried out one by one."""

from itertools import permutations

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.steps.plan import Adjust, Fix, Join, Measure, Plan, Release
from forcefit.assembly.steps.run import assemble_in_steps
from forcefit.assembly.steps.search import OBJECTIVES, best_order
from tests.assembly.steps.robots_for_steps import leg, planar_platform, three_legs
from tests.assembly.steps.test_run import LENGTHS, gough

LEG = {i: ("platform", f"leg{i}") for i in (1, 2, 3)}


def join(i, **more):
    return Join(f"{i}", (f"seat{i}", f"end{i}"), **more)


def outcome(plan, posture, objective):
    results = assemble_in_steps(plan, posture)
    if objective == "force":
        return max(r.closing_force[0] for r in results if isinstance(r.step, Join))
    if objective == "energy":
        return results[-1].energy[0]
    return np.linalg.norm(results[-1].platform_screw[0, 3:])


def test_minimum_peak_force_of_three_legs_equals_hand_calculation():
    """Closing forces by hand: the last leg requires 6.7, 86.7 or 80 N; before it, two
    legs close with k_i k_j / (k_i + k_j) |d_i - d_j|.
    """
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
def test_order_found_by_the_search_is_the_best_of_all_orders(objective, slots, rng):
    errors = rng.normal(size=5) * 40e-6
    posture = planar_platform([0.0, 0.4, 0.1, 0.3, 0.25], errors)
    locked = {i: ("TZ",) if i in slots else () for i in range(1, 6)}
    steps = tuple(join(i, locked=locked[i]) for i in range(1, 6))
    found = best_order(Plan(steps), posture, objective)
    every = [outcome(Plan(order), posture, objective) for order in permutations(steps)]
    assert found.value == pytest.approx(min(every), rel=1e-9, abs=1e-15)
    assert found.bound == pytest.approx(found.value)
    assert found.given == pytest.approx(every[0])
    assert outcome(found.plan, posture, objective) == pytest.approx(
        found.value, rel=1e-9, abs=1e-15
    )


def test_search_changes_the_order_only_of_joining_steps_between_other_steps():
    steps = (
        Join("1", LEG[1]), Fix("clamp", "platform", None), Join("3", LEG[3]),
        Join("2", LEG[2]), Release("free", ("clamp",)),
    )  # fmt: skip
    found = best_order(Plan(steps), three_legs(), "force")
    names = [step.name for step in found.plan.steps]
    assert (names[0], names[1], names[4]) == ("1", "clamp", "free")
    assert sorted(names[2:4]) == ["2", "3"]


def test_search_exchanges_adjustments_and_joins_to_reduce_the_error():
    """Two legs of 1e6 N/m, a shim at leg 0 to read 0 at the platform.

    With leg 0 alone, the shim brings the platform to 0, and leg 1, which is 60 um too
    long, then raises it to 30 um. Once both are joined, the shim brings it to 0.
    """
    posture = legs_on_a_guide((10e-6, 60e-6))
    shim = Adjust("shim", "leg0", ("TZ",), Measure("z", "platform", ("TZ",)))
    joins = [Join(f"{i}", ("platform", f"leg{i}")) for i in range(2)]
    given = Plan((joins[0], shim, joins[1]))
    assert outcome(given, posture, "error") == pytest.approx(30e-6)
    found = best_order(given, posture, "error")
    assert found.value == pytest.approx(0.0, abs=1e-12)
    assert [step.name for step in found.plan.steps].index("shim") == 2


def test_search_for_the_minimum_error_also_changes_the_adjustments():
    """For leg 6 of the Gough platform, -34.1 um leave 5.4 um, whereas -40 um make TZ
    zero.
    """
    shim = Adjust("shim", "leg6", ("TZ",), Measure("z", "platform", ("TZ",)))
    found = best_order(Plan((shim,)), gough(LENGTHS), "error")
    assert found.given == pytest.approx(6.6e-6, abs=0.05e-6)
    assert found.value == pytest.approx(5.4e-6, abs=0.05e-6)
    assert found.plan.steps[0].amount == pytest.approx([-34.1e-6], abs=0.05e-6)
    assert found.bound == 0.0
    assert outcome(found.plan, gough(LENGTHS), "error") == pytest.approx(found.value)


def test_search_for_minimum_energy_adjusts_within_the_increments():
    """A shim of 50 um leaves no energy. One of 40 um leaves a gap of 10 um to two legs
    of 1e6 N/m in series, 25 uJ."""
    posture = legs_on_a_guide((10e-6, 60e-6))
    reading = Measure("z", "platform", ("TZ",))
    joins = tuple(Join(f"{i}", ("platform", f"leg{i}")) for i in range(2))
    for increment, amount, energy in ((0.0, 50e-6, 0.0), (40e-6, 40e-6, 25e-6)):
        shim = Adjust("shim", "leg0", ("TZ",), reading, increment)
        found = best_order(Plan((*joins, shim)), posture, "energy")
        (shim,) = (step for step in found.plan.steps if isinstance(step, Adjust))
        assert shim.amount == pytest.approx([amount], rel=1e-6)
        assert found.value == pytest.approx(energy, rel=1e-6, abs=1e-12)


def test_adjustment_for_a_closure_is_never_moved_after_the_step_that_joins_it():
    """Closing requires no force once leg 1 is cut to the opening left by leg 0."""
    posture = legs_on_a_guide((10e-6, 60e-6))
    gap = Measure("gap", ("platform", "leg1"))
    shim = Adjust("shim", "leg1", ("TZ",), gap)
    joins = [Join(f"{i}", ("platform", f"leg{i}")) for i in range(2)]
    found = best_order(Plan((joins[0], shim, joins[1])), posture, "force")
    names = [step.name for step in found.plan.steps]
    assert names.index("shim") < names.index("1")
    assert found.value == pytest.approx(0.0, abs=1e-9)


def test_minimum_error_search_over_many_joins_stops_early_without_a_bound(rng):
    """Nine joins have 362 880 orders; no partial order bounds the error."""
    posture = planar_platform(np.linspace(0, 0.4, 9), 40e-6 * rng.normal(size=9))
    locks = [("TZ",) if i % 3 == 0 else () for i in range(1, 10)]
    steps = tuple(join(i, locked=lock) for i, lock in enumerate(locks, 1))
    found = best_order(Plan(steps), posture, "error", most=300)
    assert found.bound == 0.0 <= found.value <= found.given
    assert 300 <= found.searched < 320


@pytest.mark.parametrize("objective", ["force", "energy"])
@pytest.mark.parametrize("most", [20, 60])
def test_search_that_stops_early_bounds_the_best_value(objective, most, rng):
    errors = rng.normal(size=5) * 40e-6
    posture = planar_platform([0.0, 0.4, 0.1, 0.3, 0.25], errors)
    steps = tuple(join(i, locked=("TZ",) if i in (2, 5) else ()) for i in range(1, 6))
    every = best_order(Plan(steps), posture, objective)
    early = best_order(Plan(steps), posture, objective, most=most)
    assert early.bound <= every.value * (1 + 1e-9)
    assert every.value <= early.value * (1 + 1e-9)
    assert early.searched < every.searched


def legs_on_a_guide(lengths, k=1e6):
    """Legs of equal stiffness on a platform that a guide allows to move along z."""
    legs = (leg(f"leg{i}", k, d) for i, d in enumerate(lengths))
    guide = Frame("guide", "base", joint="prismatic")
    frames = (guide, Frame("platform", "guide"), *legs)
    closures = tuple(("platform", f"leg{i}") for i in range(len(lengths)))
    return home_posture(Robot("legs", "platform", frames, closures))


def legs_along_z(rng, count):
    """Stiffnesses and errors of legs on a platform that a guide allows to move
    along z.
    """
    k, d = rng.uniform(1e6, 3e6, count), rng.normal(size=count) * 3e-5
    frames = [
        Frame("guide", "base", joint="prismatic"),
        Frame("platform", "guide"),
        *(leg(f"leg{i}", *kd) for i, kd in enumerate(zip(k, d, strict=True))),
    ]
    closures = tuple(("platform", f"leg{i}") for i in range(count))
    robot = Robot("legs", "platform", tuple(frames), closures)
    return home_posture(robot), Plan(tuple(Join(b, (a, b)) for a, b in closures)), k, d


def least_peak(k, d):
    """Minimise the peak force over all 2^n sets, where leg i requires k_i (d_i - x)."""
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


def test_minimum_peak_force_of_twelve_legs_equals_minimum_over_all_subsets(
    rng,
):
    posture, plan, k, d = legs_along_z(rng, 12)
    found = best_order(plan, posture, "force")
    assert found.value == pytest.approx(least_peak(k, d), rel=1e-9)
    assert found.bound == pytest.approx(found.value)
    assert outcome(found.plan, posture, "force") == pytest.approx(found.value)


@pytest.mark.parametrize("most", [12, 20, 40])
def test_search_over_subsets_that_stops_early_bounds_the_minimum_peak_force(most, rng):
    posture, plan, k, d = legs_along_z(rng, 9)
    found = best_order(plan, posture, "force", most=most)
    least = least_peak(k, d)
    assert found.bound <= least * (1 + 1e-9)
    assert least <= found.value * (1 + 1e-9)
    assert outcome(found.plan, posture, "force") == pytest.approx(found.value)


def test_interrupted_search_returns_the_best_order_so_far():
    posture = planar_platform([0.0, 0.4, 0.1, 0.3], [0, 3e-5, 4e-5, -2e-5])
    steps = tuple(join(i, locked=("TZ",) if i == 4 else ()) for i in range(1, 5))

    def stop(done):
        if done == 12:
            raise KeyboardInterrupt

    found = best_order(Plan(steps), posture, "force", progress=stop)
    assert found.bound <= found.value <= found.given


def test_bolting_the_slot_first_or_last_determines_the_error_of_nine_legs():
    """Beyond 8 joins, the minimum energy is searched with bounds; it is zero with slots
    first.
    """
    errors = np.array([0, 0, 10, 20, -10, 5, 15, -5, 25]) * 1e-6
    posture = planar_platform(np.linspace(0, 0.4, 9), errors)
    steps = tuple(join(i, locked=("TZ",) if i > 2 else ()) for i in range(1, 10))
    found = best_order(Plan(steps[::-1]), posture, "energy")
    assert found.value == pytest.approx(0.0, abs=1e-15)
    assert found.bound == pytest.approx(0.0, abs=1e-15)
