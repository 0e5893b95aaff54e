"""Derivatives of solutions in comparison with finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import CannotAssemble, place_robot, solve_assembly, zone_margin
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins
from forcefit.assembly.statistics.responses import respond
from forcefit.assembly.statistics.sensitivity import energy_slopes, solution_slopes
from tests.robots_for_tests import random_robot

POSES = [{"tx": 0.1, "tz": -0.5}, {"tx": -0.23, "tz": -0.41}, {"tx": 0.3, "tz": -0.55}]


def with_errors(posture, errors):
    return replace(posture, robot=posture.robot.with_errors(errors))


def some_errors(robot, rng):
    touched = np.array([f.link is not None for f in robot.frames])
    sizes = np.array([5e-3] * 3 + [2e-4] * 3)
    return rng.normal(size=(len(robot.frames), 6)) * sizes * touched[:, None]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margin_slopes_of_irsbot2_equal_central_differences(pose, compliant, rng):
    robot = load_robot("irsbot2")
    posture = place_robot(robot, pose=pose)
    errors = some_errors(robot, rng)
    ready = prepare_margins(posture, compliant)
    slopes = ready.slopes(ready.solve(errors[None]))[0]
    for _ in range(8):
        step = 1e-4 * some_errors(robot, rng)
        above, below = (
            zone_margin(with_errors(posture, errors + s), compliant).margin
            for s in (step, -step)
        )
        along = float((slopes * step).sum())
        assert (above - below) / 2 == pytest.approx(along, rel=2e-3, abs=1e-8)


@pytest.mark.parametrize("seed", range(10))
def test_energy_slopes_of_random_robots_equal_central_differences(seed):
    """The directional derivative along a random direction of all errors is compared."""
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


def test_margin_slopes_of_a_zero_margin_are_zero():
    robot = load_robot("hexapod")  # has six degrees of freedom
    ready = prepare_margins(place_robot(robot), "free")
    margins = ready.solve(robot.errors[None])
    assert margins.margin == 0.0
    assert not ready.slopes(margins).any()


@pytest.mark.parametrize("seed", range(25))
def test_wrench_slopes_of_random_robots_equal_central_differences(seed):
    """The function is a random linear combination of all wrenches."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    ready, errors = linear_response(place_robot(robot)), robot.errors
    weights = rng.normal(size=errors.shape) * np.array([10.0] * 3 + [1.0] * 3)
    step = 1e-5 * rng.normal(size=errors.shape) * np.abs(errors)
    found = ready.solve(errors[None])
    if not np.isfinite(found.clearances).all():
        pytest.skip("it does not close, or a passive joint is at the end of its motion")
    slopes = solution_slopes(ready, found, weights[None], np.zeros((1, 6)))[0]
    both = ready.solve(np.array([errors + step, errors - step]))
    above, below = (both.wrenches * weights).sum(axis=(1, 2))
    scale = float((np.abs(slopes) * np.abs(step)).sum())
    # A duality gap of 1e-10 causes relative errors of 1e-5 in the wrenches.
    assert (above - below) / 2 == pytest.approx(
        float((slopes * step).sum()), abs=1e-3 * scale
    )


@pytest.mark.parametrize(
    "key", ["force", "moment", "stress", "rotation", "translation"]
)
@pytest.mark.parametrize("pose", POSES)
def test_quantity_slopes_of_irsbot2_equal_central_differences(pose, key, rng):
    """The errors are so large that all joints are in contact."""
    robot = load_robot("irsbot2")
    posture = place_robot(robot, pose=pose)
    frames = tuple(f.name for f in robot.frames if f.link is not None)
    sources = tolerance_sources(robot, [5e-3] * 3 + [2e-4] * 3, frames)
    ready = linear_response(posture)
    values = rng.normal(size=(1, len(sources))) * sources.scale
    slopes = respond(ready, sources, values, key)[1][0]
    for _ in range(4):
        step = 1e-4 * rng.normal(size=len(sources)) * sources.scale
        above, below = (
            respond(ready, sources, values + s, key)[0][0] for s in (step, -step)
        )
        scale = float(np.linalg.norm(slopes * step))
        assert (above - below) / 2 == pytest.approx(slopes @ step, abs=5e-3 * scale)
