"""Registration and tangents, on a bar whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.posture import place_robot
from assembly.measurement.predict import predict
from assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput
from tests.bar_for_tests import (
    BEAM,
    LENGTH,
    LONGER,
    along,
    bar,
    fit_of,
)
from validation.diagnosis.derivatives import Derivatives
from validation.diagnosis.registration import coarse_frame, register
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import Tangents, conditions_of, whiten

# registration


@pytest.mark.parametrize("turn", [[0.6, -0.5, 0.62], [0.0, 3.0, 0.0]])
@pytest.mark.parametrize("cells", ["all", "points", "one rotation"])
def test_a_device_anywhere_in_the_room_is_found_exactly(turn, cells):
    """p' = R p + t and R' = R, noise-free: 1 rad and 3 m, by points or by rotations."""
    campaign = bar()
    R, t = Rotation.from_rotvec(turn), np.array([2.0, -2.0, 1.0])
    p = LENGTH * along(campaign)
    seen = np.hstack([np.tile(turn, (8, 1)), R.apply(p) + t - p])
    if cells == "points":
        seen[:, :3] = np.nan
    if cells == "one rotation":
        seen[1:, :3] = np.nan
    campaign = bar(measured=seen)
    # without errors of the model a first guess is right already
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*turn, *t], abs=1e-8)
    found = register(campaign, conditions_of(campaign))
    assert found.base[:3] == pytest.approx(turn, abs=1e-9)
    assert found.base[3:] == pytest.approx(t, abs=1e-9)


def test_a_device_that_cannot_be_located_is_said():
    """Two positions, and no rotation."""
    seen = np.zeros((2, 6))
    seen[:, :3] = np.nan
    campaign = bar(measured=seen, rows=2)
    with pytest.raises(BadInput, match="registration is unknown, and there are no"):
        register(campaign, conditions_of(campaign))


def test_points_on_a_line_anywhere_do_not_say_how_a_device_is_turned():
    """Five places of a slide half a metre beside the base, no rotation read."""
    robot = Robot("slide", "tip", (
        Frame("rail", translation=[0.3, 0.5, -0.2], rotation=[0.4, 0.2, 0]),
        Frame("slide", "rail", joint="prismatic", actuated=True),
        Frame("tip", "slide", [0.1, 0, 0]),
    ))  # fmt: skip
    placed = [place_robot(robot, joints={"slide": 0.1 * k}) for k in range(5)]
    seen = np.zeros((5, 6))
    seen[:, :3] = np.nan
    campaign = replace(
        bar(rows=5, measured=seen), robot=robot,
        coordinates=np.stack([p.coordinates for p in placed]),
        transforms=np.stack([p.transforms for p in placed]),
    )  # fmt: skip
    with pytest.raises(BadInput, match="measured points off one line"):
        register(campaign, conditions_of(campaign))


def test_a_device_is_found_beside_errors_that_the_model_knows():
    """The declared tip is 4 mm off: that is the machine's, and not the device's."""
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


def test_each_session_has_a_device_of_its_own():
    """Two places in the room, two sessions; rows without any are all of one."""
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
    with pytest.raises(BadInput, match='session "b" has no row'):
        register(unknown, conditions_of(campaign))


# tangents


@pytest.mark.parametrize("x", [0.0, 3e-4, -2e-3])
def test_a_length_has_the_same_tangent_about_any_value(x):
    """1 / sigma along the bar, and nothing at zero; another length beside it too."""
    campaign = bar(link=BEAM)
    tangents = Tangents(campaign, Derivatives(conditions_of(campaign)))
    expected = whiten(campaign, fit_of(campaign, 1.0))
    beside = {"encoder_offset": {"drive": 1e-9}}
    for found in (
        tangents.at_start(LONGER),
        tangents.about(LONGER, np.array([x]), {}),
        tangents.about(LONGER, np.array([x]), beside),
    ):
        assert found.columns[:, 0] == pytest.approx(expected, abs=1e-6 * expected.max())
        assert found.offset == pytest.approx(np.zeros(len(expected)), abs=1e-6)


def test_wrenches_are_as_small_as_their_loads():
    """Zero is what is rounding beside the largest, and not beside 1 N."""
    load = np.array([0, 0, 3.0, 0, 5.0, 0])
    one = responses(conditions_of(bar(load, link=BEAM)))
    tiny = responses(conditions_of(bar(1e-12 * load, link=BEAM)))
    assert np.abs(one.wrenches).max() > 1.0
    assert 1e12 * tiny.wrenches == pytest.approx(one.wrenches, rel=1e-9, abs=1e-9)
    assert tiny.screws == pytest.approx(one.screws)
