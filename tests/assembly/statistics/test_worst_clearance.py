"""Clearance models, and joints with motion limits."""

import numpy as np
import pytest
from scipy import stats

from forcefit import Clearance, Frame, MatrixLink, Robot, load_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import (
    draw_generator,
    tolerance_sources,
)
from forcefit.assembly.statistics.clearance_positions import (
    CLEARANCE_MODELS,
    position_clearances,
)
from forcefit.assembly.statistics.experiment import Experiment, precision_for
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.summary import summarise, summary_text
from forcefit.assembly.statistics.worst_clearance import bound_worst_errors
from tests.robots_for_tests import random_robot, with_bounded_motion
from tests.tolerances_for_tests import ARM, arm

RADIAL, TILT = 1e-4, 2e-3
POSE = {"tx": 0.1, "tz": -0.5}


def papers(share, **options):
    """Return IRSBot-2 with errors of its links."""
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [share * 4e-3] * 3 + [share * 2e-4] * 3)
    return Experiment(place_robot(robot, pose=POSE), sources, margins=False, **options)


def test_screws_of_the_worst_model_attain_its_bounds(rng):
    """For radial clearance p, tilt clearance b and error e, the bounds are b and
    hypot(e + p, L b).

    A draw without a solution has no bounds.
    """
    prepared = linear_response(home_posture(arm(radial=RADIAL, tilt=TILT)))
    errors = np.zeros((3, 2, 6))
    errors[:, 1, 3] = 0.0, 2e-4, 0.0
    draws = prepared.solve(errors)
    draws.energy[2] = np.nan
    bounds, screws = bound_worst_errors(draws, (1e-8, 1e-8))
    size = np.hypot(errors[:2, 1, 3] + RADIAL, ARM * TILT)
    np.testing.assert_allclose(bounds[:2, 0], TILT, atol=1e-8)
    np.testing.assert_allclose(bounds[:2, 1], np.stack([size, size], 1), atol=1e-8)
    assert np.isnan(bounds[2]).all()
    turned, moved = screws[:2, 0, :3], screws[:2, 1, 3:]
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), TILT, rtol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), size, rtol=1e-4)


@pytest.mark.parametrize(
    "share", [0.02, pytest.param(0.3, marks=pytest.mark.slow), 1.0]
)
@pytest.mark.parametrize("play", ["least", "uniform", "contact"])
def test_pose_errors_of_irsbot2_are_within_the_worst_model_bounds(share, play):
    """The draws are inside the assembly zone, at its boundary and outside."""
    worst, other = papers(share), papers(share, clearance=play)
    values = worst.sources.draw(0, 60, seed=1)
    bound, found = (e.evaluate(values, range(60)) for e in (worst, other))
    for name in ("rotation", "translation"):
        assert (bound[name] >= found[name] - 1e-9).all()
        assert (bound[f"{name}_lower"] <= bound[name]).all()
    if share < 0.1 and play == "uniform":
        assert np.median(bound["translation"] / found["translation"]) > 2


def test_yield_is_zero_in_the_worst_clearance_model():
    """All draws assemble by clearances. The limit of 0.1 mm is satisfied only in the
    model "least".
    """
    limits, share = {"translation": 1e-4}, {}
    for play in CLEARANCE_MODELS:
        experiment = papers(0.025, clearance=play, precision=precision_for(limits))
        data = run_draws(experiment, 120)
        said = summarise(data, limits)
        within, exceeds = said["within_limits"], said["exceeds"]["translation"]
        share[play] = within["probability"]
        assert within["clearance"] == exceeds["clearance"]
        assert f"yield [clearance {play}], all limits met" in summary_text(said)
        assert said["clearance_means"] in data["translation"].attrs["long_name"]
    assert share["least"] > 0.99
    assert 0.0 == share["worst"] < share["contact"] < share["uniform"] < share["least"]


def test_worst_model_adds_no_error_if_all_joints_are_in_contact():
    """The pin is in contact under the load."""
    robot, load = arm(radial=RADIAL), (0, 0, 0, 10.0, 0, 0)
    sources = tolerance_sources(robot, [0, 0, 0, 1e-4, 1e-4, 1e-4], ("tip",))
    values = sources.draw(0, 10, seed=1)
    rows = Experiment(home_posture(robot), sources, load=load, margins=False).evaluate(
        values, range(10)
    )
    rest = np.linalg.norm(values + [RADIAL, 0, 0], axis=1)
    np.testing.assert_allclose(rows["translation"], rest, atol=1e-9)
    np.testing.assert_allclose(rows["translation_lower"], rest, atol=1e-9)


SPIN, PIN = 1e-4, 1e-6


def positions(robot, clearance, errors, count=200, **options):
    """Return platform screws of many draws with the same errors."""
    prepared = linear_response(home_posture(robot), **options)
    draws = prepared.solve(np.repeat(np.asarray(errors, dtype=float)[None], count, 0))
    rngs = [draw_generator(3, i, 9) for i in range(count)]
    screws, mixed = position_clearances(prepared, draws, clearance, rngs)
    assert mixed.all()
    return screws


def test_contact_model_rotates_a_hinge_to_its_motion_limit():
    """The tip moves by the product of arm length and limit along y, and by the radial
    clearance along the force.
    """
    hinge = arm(passive=True, radial=PIN, spin=SPIN)
    screws = positions(hinge, "contact", np.zeros((2, 6)))
    np.testing.assert_allclose(np.abs(screws[:, 2]), SPIN, rtol=1e-6)
    radial = screws[:, 3:5] - np.stack([0 * screws[:, 2], ARM * screws[:, 2]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(radial, axis=1), PIN, rtol=1e-3)
    assert 0.3 < (screws[:, 2] > 0).mean() < 0.7


@pytest.mark.parametrize(
    ("joint", "key", "component"), [("revolute", "spin", 2), ("prismatic", "axial", 5)]
)
def test_uniform_model_is_uniform_within_motion_limits(joint, key, component):
    robot = arm(passive=True, joint=joint, **{key: SPIN})
    screws = positions(robot, "uniform", np.zeros((2, 6)))
    part = (screws[:, component] / SPIN + 1) / 2
    assert stats.kstest(part, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("error", [0.0, 2.4e-4])
@pytest.mark.parametrize("steel", [0.0, 1e9])
def test_two_coaxial_hinges_rotate_within_both_motion_limits(error, steel):
    """The limits |angle| <= a and |angle - error| <= b define an interval."""
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
def test_moment_rotates_a_hinge_to_its_limit_in_every_clearance_model(clearance):
    """A moment of 5 N m about its axis rotates the hinge."""
    robot = arm(passive=True, spin=SPIN)
    load = [0, 0, 5.0, 0, 0, 0]
    screws = positions(robot, clearance, np.zeros((2, 6)), 5, load=load)
    np.testing.assert_allclose(screws[:, 2], SPIN, rtol=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_pose_errors_of_random_robots_are_within_the_worst_model_bounds(seed):
    """The robots are random and have motion limits of passive joints."""
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
