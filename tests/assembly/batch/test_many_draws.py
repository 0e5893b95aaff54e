"""Many draws of the errors at one posture, against one solve at a time."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.batch.many_draws import prepare_energies
from assembly.batch.many_margins import prepare_margins
from assembly.kinematics.posture import place_robot
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.zone import zone_margin
from assembly.model.error_distributions import tolerance_sources
from assembly.robots import load_robot
from tests.robots_for_tests import random_robot

ROBOTS = ["irsbot2", "five_bar", "3rrr", "orthoglide", "hexapod"]


def some_errors(robot, scale=1.0, count=6):
    sources = tolerance_sources(robot, scale * np.array([1e-3] * 3 + [1e-4] * 3))
    return sources.errors(sources.draw(0, count, seed=4))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("scale", [0.2, 1.0, 10.0])
def test_draws_agree_with_one_solve_at_a_time(name, scale):
    """Both certify 1e-8 of the energy, so wrenches agree to about its root, 1e-4."""
    robot = load_robot(name)
    posture = place_robot(robot)
    errors = some_errors(robot, scale)
    one = prepare_energies(posture)
    found = one.solve(errors)
    wrenches = one.wrenches(found.multipliers)
    for i, own in enumerate(errors):
        answer = solve_assembly(replace(posture, robot=robot.with_errors(own)))
        allowed = 2e-8 * answer.energy + 2e-12 * answer.energy_without_clearance
        assert found.energy[i] - found.bound[i] <= allowed
        assert found.energy[i] == pytest.approx(answer.energy, abs=allowed)
        size = np.abs(answer.wrenches).max()
        if answer.energy > 1e-6 * answer.energy_without_clearance:
            off = np.abs(wrenches[i] - answer.wrenches).max()
            assert off <= 3e-4 * size


def test_where_no_play_is_left_screws_agree(rng):
    """Without clearances the answer is unique and linear: only rounding is allowed."""
    robot = load_robot("irsbot2")
    robot = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    posture = place_robot(robot)
    errors = some_errors(robot)
    found = prepare_energies(posture).solve(errors)
    for i, own in enumerate(errors):
        answer = solve_assembly(replace(posture, robot=robot.with_errors(own)))
        scale = np.abs(answer.platform_screw).max()
        off = np.abs(found.platform_screw[i] - answer.platform_screw).max()
        assert off <= 1e-9 * scale


@pytest.mark.parametrize("seed", range(20))
def test_random_robots_agree_whatever_their_ranks(seed):
    robot = random_robot(np.random.default_rng(seed))
    posture = place_robot(robot)
    draws = np.random.default_rng(seed + 100).normal(size=(4, len(robot.frames), 6))
    draws *= np.array([1e-3] * 3 + [1e-4] * 3)
    found = prepare_energies(posture).solve(draws)
    for i, own in enumerate(draws):
        try:
            answer = solve_assembly(replace(posture, robot=robot.with_errors(own)))
        except CannotAssemble:
            assert np.isnan(found.energy[i])
            continue
        allowed = 3e-8 * answer.energy + 3e-12 * answer.energy_without_clearance + 1e-20
        assert found.energy[i] == pytest.approx(answer.energy, abs=allowed)
        assert found.energy[i] - found.bound[i] <= allowed


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_agree_with_one_solve_at_a_time(name, compliant):
    robot = load_robot(name)
    posture = place_robot(robot)
    errors = some_errors(robot)
    found = prepare_margins(posture, compliant).solve(errors)
    for i, own in enumerate(errors):
        zone = zone_margin(replace(posture, robot=robot.with_errors(own)), compliant)
        assert found.margin[i] == pytest.approx(zone.margin, rel=2e-8, abs=1e-12)
        assert found.bound[i] <= found.margin[i]


def test_margins_are_proportional_to_the_errors_and_convex():
    """Euler: slope . errors is the margin; a mean of draws has no larger margin."""
    robot = load_robot("irsbot2")
    errors = some_errors(robot, count=40)
    ready = prepare_margins(place_robot(robot), "free")
    found = ready.solve(errors)
    work = (found.slopes * errors).sum(axis=(1, 2))
    np.testing.assert_allclose(work, found.margin, rtol=1e-8)
    halves = ready.solve((errors[:20] + errors[20:]) / 2)
    # bounds lie below the least factor, margins above it; both by less than 1e-8
    assert (halves.bound <= (found.margin[:20] + found.margin[20:]) / 2).all()
    np.testing.assert_allclose(halves.bound, halves.margin, rtol=1e-8)
    np.testing.assert_allclose(ready.solve(3 * errors).margin, 3 * found.margin, 1e-8)


@pytest.mark.parametrize("seed", range(12))
def test_margins_of_random_robots_agree(seed):
    robot = random_robot(np.random.default_rng(seed))
    posture = place_robot(robot)
    draws = np.random.default_rng(seed + 100).normal(size=(3, len(robot.frames), 6))
    draws *= np.array([1e-3] * 3 + [1e-4] * 3)
    for compliant in ("rigid", "free"):
        found = prepare_margins(posture, compliant).solve(draws)
        for i, own in enumerate(draws):
            one = replace(posture, robot=robot.with_errors(own))
            zone = zone_margin(one, compliant)
            expected = np.inf if zone.margin is None else zone.margin
            assert found.margin[i] == pytest.approx(expected, rel=1e-6)


def test_errors_of_another_shape_are_refused():
    robot = load_robot("four_bar")
    posture = place_robot(robot)
    with pytest.raises(ValueError, match=r"expected \(k, 8, 6\)"):
        prepare_energies(posture).solve(np.zeros((3, 7, 6)))
    with pytest.raises(ValueError, match="all finite"):
        prepare_margins(posture).solve(np.full((1, 8, 6), np.nan))


def test_a_joint_at_the_end_of_its_motion_carries_its_share_of_the_wrench():
    """Robots whose passive joints have play only: the stop's wrench is the solver's."""
    seen = 0
    for seed in (1, 4, 16, 24):
        robot = random_robot(np.random.default_rng(seed))
        posture = place_robot(robot)
        one = prepare_energies(posture)
        found = one.solve(robot.errors[None])
        assert found.fallback.all()
        answer = solve_assembly(posture)
        wrenches = one.wrenches(found.multipliers)[0]
        seen += int(np.abs(wrenches).max() > 0)
        np.testing.assert_allclose(
            wrenches, answer.wrenches, atol=1e-9 * np.abs(answer.wrenches).max()
        )
    assert seen == 4


def test_errors_that_nothing_closes_have_no_margin_and_ask_no_other_solver():
    """A planar four-bar whose coupler is out of the plane, by any amount that shows."""
    robot = load_robot("four_bar")
    tight = tuple(replace(f, clearance=None) for f in robot.frames)
    robot = replace(robot, frames=tight)
    errors = np.zeros((5, len(robot.frames), 6))
    errors[1:, 2, 5] = 1e-9, 1e-6, 1e-3, -1.0
    for compliant in ("rigid", "free"):
        found = prepare_margins(place_robot(robot), compliant).solve(errors)
        assert not found.fallback.any()
        assert found.margin.tolist() == found.bound.tolist() == [0.0] + [np.inf] * 4
