"""The worst clearance: closed forms and other models."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment, precision_for
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.summary import summarise, summary_text
from forcefit.assembly.statistics.worst_clearance import bound_worst_errors
from tests.tolerances_for_tests import ARM, arm

RADIAL, TILT = 1e-4, 2e-3
POSE = {"tx": 0.1, "tz": -0.5}


def tip_errors(robot, size):
    return tolerance_sources(robot, [0, 0, 0, size, size, size], ("tip",))


def papers(share, **options):
    """The paper's robot with errors of its links, a share of a few mrad."""
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [share * 4e-3] * 3 + [share * 2e-4] * 3)
    return Experiment(place_robot(robot, pose=POSE), sources, margins=False, **options)


def test_screws_of_the_worst_clearance_attain_its_bounds(rng):
    """A disc of radius p and a tilt b on an arm L: rotation b, and hypot(e + p, L b).

    Beside errors e along x; a draw without an answer has no bounds.
    """
    posture = home_posture(arm(radial=RADIAL, tilt=TILT))
    prepared = linear_response(posture)
    errors = np.zeros((3, 2, 6))
    errors[:, 1, 3] = 0.0, 2e-4, 0.0
    draws = prepared.solve(errors)
    draws.energy[2] = np.nan
    bounds, screws = bound_worst_errors(draws, (1e-8, 1e-8))
    size = np.hypot(errors[:2, 1, 3] + RADIAL, ARM * TILT)
    np.testing.assert_allclose(bounds[:2, 0], TILT, atol=1e-8)
    np.testing.assert_allclose(bounds[:2, 1, 0], size, atol=1e-8)
    np.testing.assert_allclose(bounds[:2, 1, 1], size, atol=1e-8)
    assert np.isnan(bounds[2]).all()
    turned, moved = screws[:2, 0, :3], screws[:2, 1, 3:]
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), TILT, rtol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), size, rtol=1e-4)


@pytest.mark.parametrize(
    "share", [0.02, pytest.param(0.3, marks=pytest.mark.slow), 1.0]
)
@pytest.mark.parametrize("play", ["least", "uniform", "contact"])
def test_no_clearance_model_exceeds_the_certified_worst_case_in_any_draw(share, play):
    """Inside the zone, at its edge and outside; 1e-9: two solutions of (22)."""
    worst, other = papers(share), papers(share, clearance=play)
    values = worst.sources.draw(0, 60, seed=1)
    bound, found = (e.evaluate(values, range(60)) for e in (worst, other))
    for name in ("rotation", "translation"):
        assert (bound[name] >= found[name] - 1e-9).all()
        assert (bound[f"{name}_lower"] <= bound[name]).all()
    if share < 0.1 and play == "uniform":
        assert np.median(bound["translation"] / found["translation"]) > 2


def test_yield_falls_to_zero_with_the_worst_clearance():
    """Clearance alone suffices to assemble: 0.1 mm holds only for least clearances."""
    limits, share = {"translation": 1e-4}, {}
    for play in CLEARANCE_MODELS:
        data = run_draws(
            papers(0.025, clearance=play, precision=precision_for(limits)), 120
        )
        said = summarise(data, limits)
        share[play] = said["within_limits"]["probability"]
        assert (
            said["within_limits"]["clearance"]
            == said["exceeds"]["translation"]["clearance"]
        )
        assert f"yield [clearance {play}], all limits met" in summary_text(said)
        assert said["clearance_means"] in data["translation"].attrs["long_name"]
    assert share["least"] > 0.99
    assert share["worst"] == 0.0
    assert share["worst"] < share["contact"] < share["uniform"] < share["least"]


def test_worst_clearance_adds_no_error_if_a_load_closes_all_clearances():
    """A load presses the pin to one side of its disc, so it cannot move sideways."""
    robot = arm(radial=RADIAL)
    sources, load = tip_errors(robot, 1e-4), (0, 0, 0, 10.0, 0, 0)
    values = sources.draw(0, 10, seed=1)
    rows = Experiment(home_posture(robot), sources, load=load, margins=False).evaluate(
        values, range(10)
    )
    rest = np.linalg.norm(values + [RADIAL, 0, 0], axis=1)
    np.testing.assert_allclose(rows["translation"], rest, atol=1e-9)
    np.testing.assert_allclose(rows["translation_lower"], rest, atol=1e-9)
