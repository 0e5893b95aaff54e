"""HTML page on a stepwise assembly."""

import numpy as np
import pytest

from forcefit import load_robot, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.report.plot import displaced_bodies
from forcefit.assembly.report.steps import drawn_steps, steps_of
from forcefit.assembly.report.steps_page import assembly_of, steps_page
from forcefit.assembly.steps.machine import machine_at
from forcefit.assembly.steps.plan import Join, Plan
from forcefit.page.page import Provenance
from tests.pages_for_tests import parse
from tests.tolerances_for_tests import without_clearances


def in_sequence(robot):
    """Return a plan that joins all loops in sequence."""
    return Plan(tuple(Join(" - ".join(c), c) for c in robot.closures))


def pinned(posture):
    """Return the results of joining all loops in sequence, and the states."""
    states = []
    results = steps_of(in_sequence(posture.robot), posture, states=states)
    return results, machine_at(posture), states


@pytest.fixture
def four_bar(rng):
    robot = without_clearances(load_robot("four_bar"))
    scale = np.repeat([1e-3, 1e-4], 3)
    errors = rng.normal(size=robot.errors.shape) * scale
    return home_posture(robot.with_errors(errors))


def test_stepwise_assembly_agrees_with_solve_assembly(four_bar):
    results, machine, states = pinned(four_bar)
    found, expected = assembly_of(machine, states[-1]), solve_assembly(four_bar)
    assert results["energy"] == pytest.approx(expected.energy, rel=1e-9)
    size = np.abs(expected.tip_wrenches).max()
    assert found.tip_wrenches == pytest.approx(expected.tip_wrenches, abs=1e-7 * size)
    assert found.link_screws == pytest.approx(expected.link_screws, abs=1e-12)
    mine, yours = displaced_bodies(found), displaced_bodies(expected)
    platform = four_bar.robot.index(four_bar.robot.platform)
    screw = yours.end_screws[platform]
    assert mine.end_screws[platform] == pytest.approx(screw, abs=1e-10)


def test_report_page_contains_the_numbers_of_every_step(four_bar):
    results, machine, states = pinned(four_bar)
    page = parse(steps_page(results, machine, states, Provenance()))
    assert page.fetched == []
    assert page.results["energy"] == pytest.approx(results["energy"])
    shown = [row[1].value for row in page.tables[0][1:]]
    assert shown == pytest.approx([step["energy"] for step in results["steps"]])
    scene = next(f for f in page.figures if "closing" in f)
    assert np.shape(scene["closing"])[0] == len(results["steps"])


def test_interrupted_computation_returns_quantiles(four_bar, rng):
    """The computation is interrupted in the second block of robots."""
    plan = in_sequence(four_bar.robot)
    errors = rng.normal(size=(20_001, *four_bar.robot.errors.shape)) * 1e-5

    def stop(done, total):
        if done == 20_000:
            raise KeyboardInterrupt

    part = drawn_steps(plan, four_bar, errors, progress=stop)
    assert part["draws"] == 20_000
    assert part == drawn_steps(plan, four_bar, errors[:20_000])
