"""Test the estimated pose of the measuring device."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.effects.registration import BASE
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.validation.diagnosis.registration import coarse_frame, register
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import LENGTH, along, bar
from tests.campaigns_for_tests import campaign_at
from tests.planar_arm_for_tests import SIGMA

TURN, SHIFT = [0.3, -0.2, 0.5], [1.0, 0.5, -2.0]


def seen_by(turn, shift):
    """Return the readings (8, 6) of a bar for a given pose of the device."""
    p, R = LENGTH * along(bar()), Rotation.from_rotvec(turn)
    return np.hstack([np.tile(turn, (8, 1)), R.apply(p) + shift - p])


@pytest.mark.parametrize("cell", range(6))
def test_registration_ignores_incomplete_rows(cell):
    """The other readings in the incomplete row are wrong."""
    seen = seen_by(TURN, SHIFT)
    kind = slice(0, 3) if cell < 3 else slice(3, 6)
    seen[2, kind] += 0.3
    seen[2, cell] = np.nan
    campaign = bar(measured=seen)
    conditions = conditions_of(campaign)
    guess = coarse_frame(campaign, conditions)
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-9)
    seen[2] = 0.5
    lost = np.zeros((8, 6))
    lost[2, cell] = np.nan
    guess = coarse_frame(bar(measured=seen), replace(conditions, second_order=lost))
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-9)


def test_device_rotation_does_not_include_the_model_rotation():
    """The measured rotation is R = D M, where D is the rotation of the device.

    The estimate is the mean over all rows.
    """
    model = np.array([0.02, -0.03, 0.04])
    own = Rotation.from_rotvec(model)
    spread = Rotation.from_rotvec(np.outer([-1, 1] * 4, [0, 2e-3, 1e-3]))
    seen = np.full((8, 6), np.nan)
    seen[:, :3] = (Rotation.from_rotvec(TURN) * spread * own).as_rotvec()
    campaign = bar(measured=seen)
    turned = np.tile([*model, 0, 0, 0], (8, 1))
    conditions = replace(conditions_of(campaign), second_order=turned)
    guess = coarse_frame(campaign, conditions)
    assert list(guess.values())[:3] == pytest.approx(TURN, abs=1e-9)


@pytest.mark.parametrize("points", [2, 3, 4])
def test_registration_requires_three_points_that_are_not_collinear(points):
    seen = seen_by(TURN, SHIFT)
    seen[:, :3], seen[points:] = np.nan, np.nan
    campaign = bar(measured=seen)
    if points < 3:
        words = "nor 3 measured points that are not on one line"
        with pytest.raises(BadInput, match=words):
            coarse_frame(campaign, conditions_of(campaign))
        return
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*TURN, *SHIFT], abs=1e-8)


@pytest.mark.parametrize("turn", [[0.6, -0.5, 0.62], [0.0, 3.0, 0.0]])
@pytest.mark.parametrize("cells", ["all", "points", "one rotation", "rotations"])
def test_device_pose_far_from_the_base_is_estimated_exactly(turn, cells):
    """The readings contain no noise.  Without positions, the translation is zero."""
    t = np.array([2.0, -2.0, 1.0])
    seen = seen_by(turn, t)
    if cells == "points":
        seen[:, :3] = np.nan
    if cells == "one rotation":
        seen[1:, :3] = np.nan
    if cells == "rotations":
        seen[:, 3:], t = np.nan, np.zeros(3)
    campaign = bar(measured=seen)
    # Without model errors, the start value is exact.
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess) == list(BASE)
    assert list(guess.values()) == pytest.approx([*turn, *t], abs=1e-8)
    found = register(campaign, conditions_of(campaign))
    assert found.base == pytest.approx([*turn, *t], abs=1e-9)


def test_collinear_points_do_not_determine_the_device_rotation():
    """The positions of a slide are collinear, and no rotations are measured."""
    robot = Robot("slide", "tip", (
        Frame("rail", translation=[0.3, 0.5, -0.2], rotation=[0.4, 0.2, 0]),
        Frame("slide", "rail", joint="prismatic", actuated=True),
        Frame("tip", "slide", [0.1, 0, 0]),
    ))  # fmt: skip
    placed = [place_robot(robot, joints={"slide": 0.1 * k}) for k in range(5)]
    seen = np.zeros((5, 6))
    seen[:, :3] = np.nan
    campaign = campaign_at(robot, placed, seen, SIGMA)
    with pytest.raises(BadInput, match="measured points that are not on one line"):
        register(campaign, conditions_of(campaign))


def test_device_pose_does_not_include_declared_errors():
    """The declared error of the tip is 4 mm."""
    plain = bar()
    errors = np.zeros((2, 6))
    errors[1] = [0, 0, 0, 1e-3, 4e-3, -2e-3]
    robot = plain.robot.with_errors(errors)
    turn, t = np.array([0.3, -0.2, 0.5]), np.array([1.0, 0.5, -2.0])
    R = Rotation.from_rotvec(turn)
    q = plain.coordinates[:, 0]
    off = Rotation.from_rotvec(np.outer(q, [0, 0, 1])).apply(errors[1, 3:])
    p = LENGTH * along(plain)
    seen = np.hstack([np.full((8, 3), np.nan), R.apply(p + off) + t - p])
    campaign = replace(bar(measured=seen), robot=robot)
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*turn, *t], abs=1e-8)


def test_device_pose_is_estimated_for_each_session():
    """A session without rows raises an error."""
    plain, sessions = bar(), np.array(["a", "b"] * 4)
    p, seen = LENGTH * along(plain), np.zeros((8, 6))
    seen[:, :3] = np.nan
    where = {"a": ([0.1, 0.2, -0.3], [1.0, 2.0, 0.5]), "b": ([0, 0, 1.0], [-1.0, 0, 0])}
    for k, name in enumerate(sessions):
        turn, t = where[name]
        seen[k, 3:] = Rotation.from_rotvec(turn).apply(p[k]) + t - p[k]
    campaign = replace(bar(measured=seen), session=sessions)
    found = register(campaign, conditions_of(campaign))
    left = campaign.measured - predict(found).deviation
    assert np.abs(left[:, 3:]).max() < 1e-9
    unknown = replace(campaign, session=np.array(["a"] * 8))
    with pytest.raises(BadInput, match='no usable row in session "b"'):
        register(unknown, conditions_of(campaign))
