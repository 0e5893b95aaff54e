"""Slopes from multipliers, against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.energy import CannotAssemble, solve_assembly
from assembly.posture import place_robot
from assembly.robots import load_robot
from assembly.statistics.sensitivity import energy_slopes, margin_slopes
from assembly.zone import zone_margin
from tests.robots_for_tests import random_robot

POSES = [{"tx": 0.1, "tz": -0.5}, {"tx": -0.23, "tz": -0.41}, {"tx": 0.3, "tz": -0.55}]


def with_errors(posture, errors):
    return replace(posture, robot=posture.robot.with_errors(errors))


def some_errors(robot, rng):
    touched = np.array([f.link is not None for f in robot.frames])
    sizes = np.array([5e-3] * 3 + [2e-4] * 3)
    return rng.normal(size=(len(robot.frames), 6)) * sizes * touched[:, None]


@pytest.mark.parametrize("pose", POSES)
def test_energy_slopes_of_the_papers_robot(pose, rng):
    """Every delta l by itself; central differences of 1e-4 of the errors' size."""
    robot = load_robot("irsbot2")
    posture = place_robot(robot, pose=pose)
    errors = some_errors(robot, rng)
    slopes = energy_slopes(solve_assembly(with_errors(posture, errors)))
    scale = np.array([5e-3] * 3 + [2e-4] * 3)
    largest = np.abs(slopes * scale).max()
    for row in np.flatnonzero(errors.any(axis=1)):
        for c in range(6):
            step = np.zeros_like(errors)
            step[row, c] = 1e-3 * scale[c]
            above, below = (
                solve_assembly(with_errors(posture, errors + s)).energy
                for s in (step, -step)
            )
            found = (above - below) / 2e-3
            assert found == pytest.approx(slopes[row, c] * scale[c], abs=1e-4 * largest)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margin_slopes_of_the_papers_robot(pose, compliant, rng):
    robot = load_robot("irsbot2")
    posture = place_robot(robot, pose=pose)
    errors = some_errors(robot, rng)
    found = margin_slopes(with_errors(posture, errors), compliant)
    for _ in range(8):
        step = 1e-4 * some_errors(robot, rng)
        above, below = (
            zone_margin(with_errors(posture, errors + s), compliant).margin
            for s in (step, -step)
        )
        along = float((found.slopes * step).sum())
        assert (above - below) / 2 == pytest.approx(along, rel=2e-3, abs=1e-8)


@pytest.mark.parametrize("seed", range(10))
def test_slopes_of_random_robots(seed):
    """Any frame may have errors: steps along random directions."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    posture = place_robot(robot)
    errors = robot.errors
    step = 1e-4 * rng.normal(size=errors.shape) * np.abs(errors).max()
    try:
        slopes = energy_slopes(solve_assembly(posture))
        above, below = (
            solve_assembly(with_errors(posture, errors + s)).energy
            for s in (step, -step)
        )
    except CannotAssemble:
        pytest.skip("this robot does not close at any energy")
    along = float((slopes * step).sum())
    scale = float((np.abs(slopes) * np.abs(step)).sum())
    assert (above - below) / 2 == pytest.approx(along, rel=1e-4, abs=1e-4 * scale)


def test_errors_that_nothing_decides_have_no_slopes():
    robot = load_robot("hexapod")  # mobile in every direction: margin 0, slopes 0
    found = margin_slopes(place_robot(robot))
    assert found.margin == 0.0
    assert not found.slopes.any()
