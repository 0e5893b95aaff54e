"""Gains of errors: levers by hand, and central differences of the solution."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_slopes import (
    platform_gains,
    platform_slopes,
)
from forcefit.assembly.statistics.importance_table import (
    ImportanceOptions,
    importance_design,
)
from forcefit.assembly.statistics.linear_response import linear_response
from tests.tolerances_for_tests import arm


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gain_of_a_rotation_error_equals_its_lever_arm(seed):
    """A turn of the pin moves a tip 0.4 m away by 0.4 um for each urad, along y or z.

    Along x the tip stays, so the gain of RX is 0 in translation and 1 in rotation.
    """
    robot = arm()
    sources = tolerance_sources(robot, [1e-3, 2e-3, 3e-3, 0, 0, 0], ("pin",))
    experiment = Experiment(home_posture(robot), sources, seed, "least", margins=False)
    design = importance_design(experiment, ImportanceOptions(16, "source"))
    rotation, translation = platform_gains(experiment, design)
    np.testing.assert_allclose(rotation, 1.0, rtol=1e-12)
    np.testing.assert_allclose(translation, [0.0, 0.4, 0.4], atol=1e-12)


def test_gain_of_a_group_is_the_root_mean_square_weighted_by_variance():
    """RY at the pin (lever 0.4) and at the tip (none), deviations 1 and 2."""
    robot = arm()
    pin = tolerance_sources(robot, [0, 1e-3, 0, 0, 0, 0], ("pin", "tip"))
    pin.scale[1] *= 2.0
    experiment = Experiment(home_posture(robot), pin, 1, "least", margins=False)
    design = importance_design(experiment, ImportanceOptions(16, "source"))
    groups = [("both", np.arange(2))]
    _, translation = platform_gains(
        experiment, type(design)(design.A, design.B, groups)
    )
    assert translation[0] == pytest.approx(0.4 / np.sqrt(5), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "load"),
    [
        ("irsbot2", None),
        ("irsbot2", [3.0, 0, -2.0, 20.0, -10.0, -60.0]),
        ("five_bar", [0, 0, 0, 20.0, -10.0, 0]),
    ],
)
def test_platform_slopes_equal_central_differences_also_under_load(name, load, rng):
    """Differences of the screws of (22); springs are pressed by errors or loads."""
    robot = load_robot(name)
    pose = {"tx": 0.1, "tz": -0.5} if name == "irsbot2" else None
    posture = place_robot(robot, pose=pose) if pose else home_posture(robot)
    prepared = linear_response(posture, load)
    touched = np.array([f.link is not None for f in robot.frames])[:, None]
    size = np.array([5e-3] * 3 + [2e-4] * 3) * touched
    errors = rng.normal(size=(4, *size.shape)) * size
    draws = prepared.solve(errors)
    slopes = platform_slopes(prepared, draws)
    step = 1e-5 * rng.normal(size=size.shape) * size
    ahead, back = (prepared.solve(errors + s).platform_screw for s in (step, -step))
    along = np.einsum("ckni,ni->kc", slopes, step)
    scale = np.abs(along).max(axis=0)
    assert (ahead - back) / 2 / scale == pytest.approx(along / scale, abs=2e-3)
