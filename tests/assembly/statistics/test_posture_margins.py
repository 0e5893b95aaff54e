"""Margins of many draws at one posture: properties, and single solutions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.posture_margins import prepare_margins
from tests.robots_for_tests import random_robot
from tests.tolerances_for_tests import drawn_errors


def test_margins_are_proportional_to_the_errors_and_convex():
    """Euler: slope . errors is the margin; the margin of a mean is at most the mean."""
    robot = load_robot("irsbot2")
    errors = drawn_errors(robot, count=40)
    ready = prepare_margins(place_robot(robot), "free")
    found = ready.solve(errors)
    work = (ready.slopes(found) * errors).sum(axis=(1, 2))
    np.testing.assert_allclose(work, found.margin, rtol=1e-8)
    halves = ready.solve((errors[:20] + errors[20:]) / 2)
    # bounds lie below the least factor, margins above it; both by less than 1e-8
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


def test_errors_that_cannot_be_closed_have_infinite_compiled_margins():
    """A planar four-bar whose coupler is out of the plane by more than rounding."""
    robot = load_robot("four_bar")
    tight = tuple(replace(f, clearance=None) for f in robot.frames)
    robot = replace(robot, frames=tight)
    errors = np.zeros((5, len(robot.frames), 6))
    errors[1:, 2, 5] = 1e-9, 1e-6, 1e-3, -1.0
    for compliant in ("rigid", "free"):
        found = prepare_margins(place_robot(robot), compliant).solve(errors)
        assert set(found.method) == {"compiled"}
        assert found.margin.tolist() == found.bound.tolist() == [0.0] + [np.inf] * 4
