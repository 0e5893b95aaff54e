"""Clearance models with limited motion of passive joints: intervals by hand."""

import numpy as np
import pytest
from scipy import stats

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import (
    draw_generator,
    tolerance_sources,
)
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.statistics.clearance_positions import position_clearances
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from tests.robots_for_tests import random_robot, with_bounded_motion
from tests.tolerances_for_tests import ARM, arm

SPIN, RADIAL = 1e-4, 1e-6


def positions(robot, clearance, errors, count=200, **options):
    """Platform screws of draws that all have the same errors."""
    prepared = linear_response(home_posture(robot), **options)
    draws = prepared.solve(np.repeat(np.asarray(errors, dtype=float)[None], count, 0))
    rngs = [draw_generator(3, i, 9) for i in range(count)]
    screws, mixed = position_clearances(prepared, draws, clearance, rngs)
    assert mixed.all()
    return screws


def test_contact_model_turns_a_hinge_to_its_motion_limit():
    """The tip moves by arm times angle along y, and by the radius along the force."""
    hinge = arm(passive=True, radial=RADIAL, spin=SPIN)
    screws = positions(hinge, "contact", np.zeros((2, 6)))
    np.testing.assert_allclose(np.abs(screws[:, 2]), SPIN, rtol=1e-6)
    radial = screws[:, 3:5] - np.stack([0 * screws[:, 2], ARM * screws[:, 2]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(radial, axis=1), RADIAL, rtol=1e-3)
    assert 0.3 < (screws[:, 2] > 0).mean() < 0.7


@pytest.mark.parametrize(
    ("joint", "key", "component"), [("revolute", "spin", 2), ("prismatic", "axial", 5)]
)
def test_uniform_model_is_uniform_over_the_limited_motion(joint, key, component):
    robot = arm(passive=True, joint=joint, **{key: SPIN})
    screws = positions(robot, "uniform", np.zeros((2, 6)))
    part = (screws[:, component] / SPIN + 1) / 2
    assert stats.kstest(part, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("error", [0.0, 2.4e-4])
@pytest.mark.parametrize("steel", [0.0, 1e9])
def test_two_hinges_on_one_axis_turn_within_both_motion_limits(error, steel):
    """|angle| <= a, |angle - error| <= b: an interval, whose ends are the contacts."""
    a, b = 1e-4, 1.5e-4
    link = MatrixLink(np.eye(6) * steel) if steel else None
    frames = (
        Frame("one", link=link, joint="revolute", clearance=Clearance(spin=a)),
        Frame("one_end", "one"),
        Frame("two", joint="revolute", clearance=Clearance(spin=b)),
        Frame("two_end", "two"),
    )
    robot = Robot("two hinges", "one_end", frames, (("one_end", "two_end"),))
    errors = np.zeros((4, 6))
    errors[2, 2] = error
    low, high = max(-a, error - b), min(a, error + b)
    angle = positions(robot, "uniform", errors)[:, 2]
    assert stats.kstest((angle - low) / (high - low), "uniform").pvalue > 1e-3
    ends = positions(robot, "contact", errors)[:, 2]
    np.testing.assert_allclose(
        np.minimum(np.abs(ends - low), np.abs(ends - high)), 0, atol=1e-6 * a
    )
    assert 0.3 < (ends > (low + high) / 2).mean() < 0.7


@pytest.mark.parametrize("clearance", ["uniform", "contact", "least"])
def test_moment_turns_a_hinge_to_its_limit_in_every_clearance_model(clearance):
    """Under 5 N m about its axis it stops at +spin."""
    robot = arm(passive=True, spin=SPIN)
    load = [0, 0, 5.0, 0, 0, 0]
    screws = positions(robot, clearance, np.zeros((2, 6)), 5, load=load)
    np.testing.assert_allclose(screws[:, 2], SPIN, rtol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_no_clearance_model_exceeds_the_certified_worst_in_any_draw(seed):
    """Random robots with motion limits of passive joints of the size of the errors."""
    rng = np.random.default_rng(seed)
    robot = with_bounded_motion(random_robot(rng, joints=4), rng)
    sources = tolerance_sources(robot, [1e-5] * 6, [f.name for f in robot.frames])
    rows = {
        model: Experiment(
            home_posture(robot), sources, margins=False, clearance=model
        ).solve(0, 12)
        for model in ("worst", "uniform", "contact", "least")
    }
    worst = rows.pop("worst")
    solved = worst["status"] == 0
    assert solved.any()
    for of_model in rows.values():
        for key in ("rotation", "translation"):
            assert np.isfinite(of_model[key][solved]).all()
            assert (of_model[key] <= worst[key] * (1 + 1e-7))[solved].all()
