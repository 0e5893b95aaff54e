"""Solutions for many draws of errors at one posture."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import CannotAssemble, place_robot, solve_assembly, zone_margin
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.robots import load_robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins
from tests.robots_for_tests import random_robot
from tests.tolerances_for_tests import drawn_errors, without_clearances

ROBOTS = ["irsbot2", "five_bar", "3rrr", "orthoglide", "hexapod", "arm6"]
LOAD, GRAVITY = [1.0, 2.0, 3.0, 30.0, 10.0, -100.0], [1.0, 2.0, -9.81]


def assert_equal_single_solutions(posture, errors, *loads):
    """Check that solutions agree. Energies are certified to 1e-8, so wrenches agree to
    about 1e-4.
    """
    found = linear_response(posture, *loads).solve(errors)
    wrenches = found.wrenches
    for i, own in enumerate(errors):
        try:
            erring = replace(posture, robot=posture.robot.with_errors(own))
            answer = solve_assembly(erring, loads[0], gravity=loads[1])
        except (CannotAssemble, FreeMotion, SolverFailed):
            assert np.isnan(found.energy[i])
            continue
        allowed = 3e-8 * answer.energy + 3e-12 * answer.energy_without_clearance + 1e-20
        assert 0.0 <= found.duality_gap()[i] <= allowed
        unloaded = loads == (None, None)
        spread = {"abs": allowed} if unloaded else {"rel": 1e-6, "abs": 1e-12}
        assert found.energy[i] == pytest.approx(answer.energy, **spread)
        if answer.energy > 1e-6 * answer.energy_without_clearance:
            off = np.abs(wrenches[i] - answer.wrenches).max()
            limit = 3e-4 if unloaded else 1e-4
            assert off <= limit * np.abs(answer.wrenches).max()


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize(
    ("scale", "load", "gravity"),
    [(0.2, None, None), (1.0, None, None), (10.0, None, None), (4.0, LOAD, None),
     (4.0, LOAD, GRAVITY)],
)  # fmt: skip
def test_solutions_of_draws_equal_single_solutions(name, scale, load, gravity):
    robot = load_robot(name)
    errors = drawn_errors(robot, scale)
    assert_equal_single_solutions(place_robot(robot), errors, load, gravity)


@pytest.mark.parametrize(
    ("seed", "load"), [*((k, None) for k in range(20)), *((k, LOAD) for k in range(6))]
)
def test_draws_of_random_robots_equal_single_solutions(seed, load):
    """Some of the robots have rigid loops, joint limits or loops that cannot close."""
    robot = random_robot(np.random.default_rng(seed))
    posture = place_robot(robot)
    draws = np.random.default_rng(seed + 100).normal(size=(4, len(robot.frames), 6))
    draws *= np.array([1e-3] * 3 + [1e-4] * 3)
    try:
        assert_equal_single_solutions(posture, draws, load, None)
    except ValueError:
        with pytest.raises(ValueError, match="motion"):
            solve_assembly(posture, load)


def test_errors_of_a_wrong_shape_are_rejected():
    robot = load_robot("four_bar")
    posture = place_robot(robot)
    with pytest.raises(ValueError, match=r"expected \(k, 8, 6\)"):
        linear_response(posture).solve(np.zeros((3, 7, 6)))
    with pytest.raises(ValueError, match="all finite"):
        prepare_margins(posture).solve(np.full((1, 8, 6), np.nan))


def test_margin_is_convex_and_proportional_to_errors():
    """By Euler's theorem, the product of derivatives and errors is the margin."""
    robot = load_robot("irsbot2")
    errors = drawn_errors(robot, count=40)
    ready = prepare_margins(place_robot(robot), "free")
    found = ready.solve(errors)
    work = (ready.slopes(found) * errors).sum(axis=(1, 2))
    np.testing.assert_allclose(work, found.margin, rtol=1e-8)
    halves = ready.solve((errors[:20] + errors[20:]) / 2)
    # The margins are certified by lower bounds to 1e-8.
    assert (halves.bound <= (found.margin[:20] + found.margin[20:]) / 2).all()
    np.testing.assert_allclose(halves.bound, halves.margin, rtol=1e-8)
    np.testing.assert_allclose(ready.solve(3 * errors).margin, 3 * found.margin, 1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_margins_of_draws_of_random_robots_equal_single_solutions(seed):
    robot = random_robot(np.random.default_rng(seed))
    posture = place_robot(robot)
    draws = np.random.default_rng(seed + 100).normal(size=(3, len(robot.frames), 6))
    draws *= np.array([1e-3] * 3 + [1e-4] * 3)
    for compliant in ("rigid", "free"):
        found = prepare_margins(posture, compliant).solve(draws)
        for i, own in enumerate(draws):
            one = replace(posture, robot=robot.with_errors(own))
            zone = zone_margin(one, compliant)
            assert found.margin[i] == pytest.approx(zone.margin, rel=1e-6)


def test_margin_is_infinite_if_loops_cannot_close():
    """The coupler of a planar four-bar linkage is out of plane."""
    robot = without_clearances(load_robot("four_bar"))
    errors = np.zeros((5, len(robot.frames), 6))
    errors[1:, 2, 5] = 1e-9, 1e-6, 1e-3, -1.0
    for compliant in ("rigid", "free"):
        found = prepare_margins(place_robot(robot), compliant).solve(errors)
        assert set(found.method) == {"compiled"}
        assert found.margin.tolist() == found.bound.tolist() == [0.0] + [np.inf] * 4
