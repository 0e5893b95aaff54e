"""Worst corners and minimum-cost tolerances."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from forcefit import bound_pose_error, place_robot, solve_assembly, zone_margin
from forcefit.assembly.model.link_stress import peak_stresses
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.allocated_tolerances import (
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.allocation import allocate
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins
from forcefit.assembly.statistics.requirement import Plan
from forcefit.assembly.statistics.responses import respond
from forcefit.assembly.statistics.worst_case import (
    bound_energy,
    bound_margin,
    random_corners,
    worst_corner,
)
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import (
    PLAY,
    arm,
    pairs_of_bars,
    parallel,
    plan_for,
    rigid_pair,
)

ENDS = [("one", 3), ("two", 3)]


@pytest.mark.parametrize(
    ("places", "costs", "cost", "expected"),
    [
        (ENDS, [1, 4], "reciprocal", np.array([1, 2]) / 3),
        (ENDS, [1, 4], "logarithm", np.array([1, 4]) / 5),
        ([("one", 3), ("two", 4)], [1, 1], "reciprocal", np.full(2, np.sqrt(0.5))),
    ],
    ids=["roots of costs", "costs", "right angles"],
)
def test_tolerances_of_two_lengths_equal_closed_form(places, costs, cost, expected):
    """The cost c1/t1 + c2/t2 or -c1 log t1 - c2 log t2 is minimised.

    Parallel errors satisfy t1 + t2 = clearance. Perpendicular errors with equal costs
    satisfy t1^2 + t2^2 = clearance^2.
    """
    robot = rigid_pair(radial=PLAY)
    plan = plan_for(robot, places, costs, {"margin": 1.0}, cost=cost)
    found = allocate([place_robot(robot)], plan, fresh=200)
    np.testing.assert_allclose(found.tolerances, PLAY * expected, rtol=2e-3)
    assert found.price_bound <= found.price
    assert found.price - found.price_bound <= 2e-3 * abs(found.price_bound)
    assert found.worst["margin"][0] == pytest.approx(1.0, rel=1e-3)
    assert found.verification["verdict"] == "no draw failed"
    if places == ENDS:
        assert found.worst["margin"][1] == pytest.approx(1.0, rel=1e-3)
        assert found.proven_scale == pytest.approx(1.0, rel=1e-3)
    else:
        # For perpendicular errors, the bound is too large by the factor sqrt(2).
        assert found.proven_scale >= 1 / np.sqrt(2) - 1e-6


def test_tolerances_for_an_energy_limit_equal_closed_form():
    """The energy is k (t1 + t2)^2 / 4 = E. For equal costs, both are sqrt(E / k)."""
    robot = coaxial_beams(np.zeros(6))
    plan = plan_for(robot, ENDS, [1, 1], {"energy": 1e-3})
    found = allocate([place_robot(robot)], plan, fresh=0)
    np.testing.assert_allclose(found.tolerances, np.sqrt(1e-3 / 1e6), rtol=2e-3)
    lower, upper = found.worst["energy"]
    assert lower == pytest.approx(1e-3, rel=3e-3)
    assert upper == pytest.approx(lower, rel=1e-4)


@pytest.mark.slow
def test_single_tolerance_equals_clearance_over_yield():
    """For a uniform error within t, the yield is clearance / t. The tolerance is
    slightly smaller, because the yield is demonstrated with 95 % confidence.
    """
    robot = rigid_pair(radial=PLAY)
    plan = plan_for(robot, [("one", 3)], [1], {"margin": 1.0}, asked_yield=0.8,
                    draws=20_000)  # fmt: skip
    found = allocate([place_robot(robot)], plan, fresh=5000)
    assert found.tolerances[0] == pytest.approx(PLAY / 0.8, rel=0.02)
    assert found.tolerances[0] < PLAY / 0.8
    assert found.verification["verdict"] != "contradicted"


@pytest.fixture(scope="module")
def paper():
    robot = load_robot("irsbot2")
    plan = plan_for(
        robot,
        [(f"leg{leg}.{link}", c) for leg in (1, 2) for link in ("link_a", "link_b")
         for c in (0, 3)],
        [1] * 8, {"margin_free": 1.0},
    )  # fmt: skip
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    return posture, plan.sources, np.tile([2e-3, 1e-4], 4)


@pytest.mark.parametrize("kind", ["free", "rigid", "energy"])
def test_worst_corner_agrees_with_evaluation_of_all_corners(paper, kind):
    """All 256 corners of the tolerance box are evaluated."""
    posture, sources, t = paper
    energy = kind == "energy"
    ready = linear_response(posture) if energy else prepare_margins(posture, kind)
    every = np.array(list(product([-1.0, 1.0], repeat=8)))
    truth = respond(ready, sources, every * t)[0].max()
    found = worst_corner(ready, sources, t, random_corners(24, 8))
    assert found.value == pytest.approx(truth, rel=1e-7)
    bound = (bound_energy if energy else bound_margin)(ready, sources, t)
    assert truth * (1 - 1e-7) <= bound <= truth * (4.0 if energy else 1.5)
    inside = np.random.default_rng(1).uniform(-1, 1, size=(200, 8))
    assert respond(ready, sources, inside * t)[0].max() <= truth


@pytest.mark.parametrize(
    ("clearance", "cost"),
    [(None, "reciprocal"), (1e-4, "reciprocal"), (None, "logarithm")],
)
def test_tolerances_for_a_force_limit_equal_closed_form(clearance, cost):
    """The force in two springs k in series is (k/2) (t1 + t2 - clearance), so each pair
    satisfies t1 + t2 = 2F/k + clearance. The tolerances are in the ratio of the square
    roots of the cost coefficients or, for logarithmic costs, of the cost coefficients.
    """
    k, F, c = np.array([1e6, 1e5]), 50.0, np.array([1.0, 4.0, 1.0, 1.0])
    robot = pairs_of_bars(k, clearance)
    places = [("one0", 3), ("two0", 3), ("one1", 3), ("two1", 3)]
    plan = plan_for(robot, places, c, {"force": F}, draws=100, cost=cost)
    found = allocate([place_robot(robot)], plan, fresh=500)
    weights = np.sqrt(c) if cost == "reciprocal" else c
    share = weights / np.repeat(weights.reshape(2, 2).sum(axis=1), 2)
    best = np.repeat(2 * F / k + (clearance or 0.0), 2) * share
    np.testing.assert_allclose(found.tolerances, best, rtol=1e-2)
    least = plan.price(best)
    assert least - 1e-9 * abs(least) <= found.price <= least + 2e-3 * abs(least)
    # The uniformly scaled tolerances do not reach the limit of the softer pair.
    assert found.price_uniformly_scaled - found.price > 0.04 * abs(least)
    assert found.worst["force"][0] == pytest.approx(F, rel=1e-3)
    assert np.isnan(found.worst["force"][1])
    assert found.verification["verdict"] == "no draw failed"


@pytest.fixture(scope="module")
def several(paper):
    """Return an allocation for IRSBot-2 with five limits at two postures."""
    posture, sources, _ = paper
    postures = [posture, place_robot(posture.robot, pose={"tx": -0.2, "tz": -0.4})]
    limits = {"translation": 2e-4, "rotation": 5e-3, "stress": 5e6, "force": 300.0,
              "margin_free": 4.0}  # fmt: skip
    plan = Plan(sources, np.tile([0, 1], 4), ("RX", "TX"), np.array([1.0, 0.01]),
                np.zeros(2), np.array([0.05, 0.005]), limits, asked_yield=0.9,
                draws=100, clearance="least")  # fmt: skip
    return postures, plan, allocate(postures, plan, fresh=300)


def test_minimum_cost_is_at_most_that_of_uniform_scaling(several):
    _, _, found = several
    assert np.isnan(found.price_bound)
    assert found.price <= found.price_uniformly_scaled
    assert found.verification["verdict"] != "contradicted"


@pytest.mark.slow
def test_allocated_tolerances_have_the_required_yield(several):
    """The new draws have another seed and are solved by :func:`solve_assembly`."""
    postures, plan, found = several
    half = plan.spread(found.tolerances)
    rng, fits, largest = np.random.default_rng(12345), 0, 0.0
    for draw in plan.sources.errors(rng.uniform(-1, 1, size=(150, 8)) * half):
        share = max(
            largest_share(replace(p, robot=p.robot.with_errors(draw)), plan.limits)
            for p in postures
        )
        fits, largest = fits + (share <= 1 + 1e-6), max(largest, share)
    # For a yield of 0.9, fewer than 124 of 150 have a probability of 1/300.
    assert fits >= 124
    assert largest > 1.0


def largest_share(posture, limits):
    answer = solve_assembly(posture)
    screw, wrenches = answer.platform_screw, answer.wrenches
    values = {
        "translation": np.linalg.norm(screw[3:]),
        "rotation": np.linalg.norm(screw[:3]),
        "stress": peak_stresses(posture.robot, wrenches).max(),
        "force": np.linalg.norm(wrenches[:, 3:], axis=1).max(),
        "margin_free": zone_margin(posture, "free").margin,
    }
    return max(values[key] / limit for key, limit in limits.items())


@pytest.mark.slow
def test_allocation_in_the_worst_clearance_model_has_the_required_yield(paper):
    """The new draws are solved separately. The required yield is 0.9."""
    posture, sources, _ = paper
    limit = 6e-4
    plan = Plan(sources, np.tile([0, 1], 4), ("RX", "TX"), np.array([1.0, 0.01]),
                np.zeros(2), np.array([0.05, 0.005]), {"translation": limit},
                asked_yield=0.9, draws=200)  # fmt: skip
    found = allocate([posture], plan, fresh=300)
    assert found.price <= found.price_uniformly_scaled
    assert found.verification["verdict"] != "contradicted"
    half = plan.spread(found.tolerances)
    fits, largest = 0, 0.0
    for draw in sources.errors(
        np.random.default_rng(7).uniform(-1, 1, (150, 8)) * half
    ):
        erring = replace(posture, robot=posture.robot.with_errors(draw))
        worst = bound_pose_error(solve_assembly(erring), "frozen").translation_error
        fits, largest = fits + (worst[0] <= limit), max(largest, worst[0])
    # For a yield of 0.9, fewer than 124 of 150 have a probability of 1/300.
    assert fits >= 124
    assert largest > 0.8 * limit


def test_tolerances_for_a_pose_error_limit_equal_closed_form():
    """The platform moves by w1 t1 + w2 t2 = D with w_i = k_i / (k1 + k2).

    The minimum of c1/t1 + c2/t2 is at t_i = D sqrt(c_i/w_i) / sum sqrt(c w).
    """
    k, c, D = np.array([9e6, 1e6]), np.array([1.0, 4.0]), 1e-4
    robot = parallel(*k)
    plan = plan_for(robot, [("one", 3), ("two", 3)], c, {"translation": D}, draws=100)
    found = allocate([place_robot(robot)], plan, fresh=500)
    w = k / k.sum()
    best = D * np.sqrt(c / w) / np.sqrt(c * w).sum()
    np.testing.assert_allclose(found.tolerances, best, rtol=5e-3)
    alike = D * np.sqrt(c) / (w * np.sqrt(c)).sum()
    np.testing.assert_allclose(found.uniformly_scaled, alike, rtol=5e-3)
    assert found.price == pytest.approx((c / best).sum(), rel=2e-3)
    assert found.price_uniformly_scaled == pytest.approx((c / alike).sum(), rel=2e-3)


@pytest.mark.slow
def test_tolerances_for_a_yield_equal_closed_form():
    """The standard deviation of the platform error is |w t| / 3.

    The minimum of sum c/t for a given sum (w t)^2 is at t_i ~ (c_i / w_i^2)^(1/3).
    Truncation at 3 standard deviations reduces the standard deviation by the factor
    0.9866.
    """
    k, c, D = np.array([9e6, 1e6]), np.array([1.0, 4.0]), 1e-4
    robot = parallel(*k)
    plan = plan_for(robot, [("one", 3), ("two", 3)], c, {"translation": D},
                    asked_yield=0.9, draws=10_000)  # fmt: skip
    s = plan.sources
    normal = type(s)(robot, s.frame, s.component, np.full(2, 2), s.centre, s.scale / 3,
                     s.least, np.full(2, 3.0), s.signed)  # fmt: skip
    found = allocate([place_robot(robot)], replace(plan, sources=normal), fresh=5000)
    w = k / k.sum()
    shape = (c / w**2) ** (1 / 3)
    best = shape * 3 * D / (1.6449 * 0.9866 * np.linalg.norm(w * shape))
    # For 10000 draws, the standard error of the quantile is about 1 %.
    assert found.price == pytest.approx((c / best).sum(), rel=0.03)
    np.testing.assert_allclose(found.tolerances / best, 1.0, atol=0.12)
    assert found.price < 0.97 * found.price_uniformly_scaled
    assert found.verification["verdict"] != "contradicted"


def test_clearance_reduces_the_tolerance_for_a_pose_error_limit():
    """The largest error of a serial arm is the sum of length error and clearance."""
    robot = arm(radial=PLAY)
    plan = plan_for(robot, [("tip", 3)], [1], {"translation": 3e-4}, draws=50)
    for play, tolerance in (("worst", 3e-4 - PLAY), ("least", 3e-4)):
        found = allocate([place_robot(robot)], replace(plan, clearance=play), fresh=100)
        assert found.tolerances[0] == pytest.approx(tolerance, rel=1e-3)
        said = allocation_text(allocation_of(found))
        assert f"pose errors: clearance {play}" in said
