"""Batched margins (21) against one at a time."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.zone import zone_margin
from assembly.robots import BUILT_IN
from tests.robots_for_tests import random_robot


def assert_same_margin(batch, i, zone):
    """Both margins lie within 1e-8 of their common certified bounds."""
    assert batch.margin[i] == pytest.approx(zone.margin, rel=1e-7, abs=1e-10)
    assert batch.bound[i] <= batch.margin[i] * (1 + 1e-11) + 1e-15
    assert batch.bound[i] <= zone.margin * (1 + 1e-9) + 1e-10


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_equal_one_at_a_time(grid, compliant):
    _, postures = grid
    batch = zone_margin(postures, compliant)
    assert set(batch.method) == {"compiled"}
    for i in range(0, len(postures), 5):
        assert_same_margin(
            batch, i, zone_margin(postures[i], compliant, method="reference")
        )
    assert np.all(batch.bound >= batch.margin * (1 - 1e-8))


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_of_random_and_built_in_robots_equal_one_at_a_time(compliant, rng):
    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(80):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    compiled = 0
    for home in homes:
        errors = 1e-4 * rng.normal(size=(len(home.robot.frames), 6))
        robot = home.robot.with_errors(errors)
        erring = replace(home, robot=robot)
        batch = zone_margin([erring], compliant)
        compiled += batch.method[0] == "compiled"
        one = zone_margin(erring, compliant, method="reference")
        assert_same_margin(batch, 0, one)
    assert compiled


def test_margins_of_a_perfect_robot_are_zero_and_are_compiled(grid):
    robot, postures = grid
    for compliant in ("rigid", "free"):
        margins = zone_margin(postures, compliant, 0.0 * robot.errors)
        assert set(margins.method) == {"compiled"}
        assert np.array_equal(margins.margin, np.zeros(len(postures)))
        assert np.array_equal(margins.bound, margins.margin)
