"""Test a robot on a rocking base whose tilt is measured by a sensor.

The simulated machine rotates by rotation matrices.  In the tested model, the rotation
is a first-order function that acts at the base.
"""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.stiffness.screws import rotation_matrix
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.correction.prediction import predict
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.results import learned
from tests.campaigns_for_tests import table_rows, write_campaign

SIGMA, ROWS, ROCKING = 2e-5, 80, 1e-3
GAIN = 0.8  # rotation of the base per unit of the sensor value


def arm():
    """Return an arm with two perpendicular revolute joints."""
    frames = (
        Frame("one", translation=[0, 0, 0.5], joint="revolute", actuated=True),
        Frame("two", "one", [0.4, 0, 0], [np.pi / 2, 0, 0], joint="revolute",
              actuated=True),
        Frame("tip", "two", [0.3, 0, 0]),
    )  # fmt: skip
    return Robot("arm", "tip", frames)


@pytest.fixture
def rocking(tmp_path):
    """Campaign of an arm whose base rocks about y, with the covariate ``cov.tilt``."""
    rng = np.random.default_rng(8)
    q = rng.uniform(-1.2, 1.2, (ROWS, 2))
    tilt = ROCKING * rng.normal(size=ROWS)
    rows = []
    for i, (a, b) in enumerate(q.tolist()):
        out = np.array([np.cos(a), np.sin(a), 0.0])
        tip = 0.4 * out + 0.3 * (np.cos(b) * out + np.sin(b) * np.array([0, 0, 1.0]))
        tip = tip + [0, 0, 0.5]
        turned = rotation_matrix(np.array([0, GAIN * tilt[i], 0])) @ tip
        read = turned - tip + SIGMA * rng.normal(size=3)
        rows.append([a, b, *read, tilt[i]])
    head = "id,q.one,q.two,meas.tx,meas.ty,meas.tz,cov.tilt"
    write_robot(arm(), tmp_path / "arm.toml")
    folder = write_campaign(
        tmp_path / "day", head, table_rows(rows),
        robot=(tmp_path / "arm.toml").read_text(),
        noise=f"[noise]\nposition = {SIGMA}\n",
    )  # fmt: skip
    return read_campaign(folder)


def with_gain(campaign, gain):
    """Return the campaign with a robot whose base rotates with the sensor value."""
    turn = Function("base", ("ry",), ("cov.tilt",), "powers", {"1": gain})
    return replace(campaign, robot=replace(campaign.robot, functions=(turn,)))


def test_prediction_error_equals_the_noise_for_the_true_gain(rocking):
    """The effect is about 20 sigma.  An error of 0.2 in the gain is about 4 sigma."""
    assert predict(rocking).error.normalised > 8
    assert 0.85 < predict(with_gain(rocking, GAIN)).error.normalised < 1.15
    assert predict(with_gain(rocking, 1.0)).error.normalised > 2


def test_unknown_gain_of_a_measured_motion_is_learned(rocking):
    """The standard error of the gain is a few thousandths."""
    found = diagnose(rocking)
    assert found.verdict == "learned"
    assert 0.8 < found.after.normalised < 1.2
    one = next(one for one in learned(found) if "ry" in one["components"])
    assert (one["where"], one["variables"]) == ("base", ["cov.tilt"])
    numbers = one["parameters"]
    (name,) = [n for n in numbers if n in ("1", "ry.1")]
    assert 0 < one["std"][name] < 0.01
    assert abs(numbers[name] - GAIN) < 4 * one["std"][name]
