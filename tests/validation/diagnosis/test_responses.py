"""Test the responses of the readings to small screws against hand calculation."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.stiffness.screws import rotation_matrix, skew
from forcefit.validation.diagnosis.responses import responses
from forcefit.validation.diagnosis.signatures import conditions_of
from tests.bar_for_tests import BEAM, LENGTH, along, bar
from tests.linkages_for_tests import five_bar
from tests.robots_for_tests import with_frames

LOAD = np.array([0.3, -0.2, 3.0, 1.0, 5.0, -2.0])


def loaded(rows=8, **given):
    """Return a campaign of a loaded elastic bar and its conditions."""
    campaign = bar(LOAD, rows=rows, link=BEAM, **given)
    return campaign, conditions_of(campaign)


def turns_of(campaign):
    """Return the rotation matrices (R, 3, 3) of the bar."""
    q = campaign.coordinates[:, 0]
    return np.stack([rotation_matrix(np.array([0, 0, angle])) for angle in q])


@pytest.mark.parametrize("rows", [1, 50, 51, 120])
def test_screw_responses_and_wrenches_agree_with_hand_calculation(rows):
    """A screw at the drive is in base axes, and a screw at the tip is in bar axes.

    The postures may be in any order and may occur several times.
    """
    campaign, once = loaded(rows)
    order = np.append(np.arange(rows)[::-1], np.arange(0, rows, 3))
    found = responses(once.take(order))
    R, arm = turns_of(campaign)[order], LENGTH * along(campaign)[order]
    whole = np.tile(np.eye(6), (len(order), 1, 1))
    at_tip, at_drive = whole.copy(), whole.copy()
    at_tip[:, :3, :3], at_tip[:, 3:, 3:] = R, R
    at_drive[:, 3:, :3] = -np.stack([skew(p) for p in arm])
    np.testing.assert_allclose(found.reading, whole, atol=1e-9)
    np.testing.assert_allclose(found.screws[:, :, 0], at_drive, atol=1e-9)
    np.testing.assert_allclose(found.screws[:, :, 1], at_tip, atol=1e-9)
    moment = LOAD[:3] + np.cross(arm, LOAD[3:])
    np.testing.assert_allclose(found.wrenches[:, 0, :3], moment, atol=1e-9)
    np.testing.assert_allclose(found.wrenches[:, 0, 3:], 0 * arm + LOAD[3:])
    assert not found.wrenches[:, 1].any()


def test_readings_of_small_screws_are_in_device_axes():
    """The reading is R (t + r x arm), where the arm ends at the measured point."""
    campaign, conditions = loaded()
    b, point, tool = np.array([0.4, -0.9, 0.7]), [0.1, -0.2, 0.3], [0.05, 0.02, -0.1]
    conditions = replace(
        conditions, point=np.array(point), tool=np.array(tool),
        base=np.array([*b, 1.0, -2.0, 0.5]),
    )  # fmt: skip
    found = responses(conditions)
    angle, B, R = np.linalg.norm(b), skew(b), rotation_matrix(b)
    inverse = np.eye(3) + B / 2
    inverse += (1 - angle / 2 / np.tan(angle / 2)) / angle**2 * B @ B
    for k, axes in enumerate(turns_of(campaign)):
        arm = axes @ (np.array(point) + tool)
        expected = np.block([
            [inverse, np.zeros((3, 3))], [-R @ skew(arm), R],
        ])  # fmt: skip
        np.testing.assert_allclose(found.reading[k], expected, atol=1e-8)
        np.testing.assert_allclose(
            found.screws[k][:, 1, 3:], (expected[:, 3:] @ axes), atol=1e-8
        )


def test_response_of_a_row_without_a_solution_is_zero():
    """One row of a closed chain has an unknown error.  Other rows do not change."""
    at = home_posture(five_bar())
    three = replace(
        at, coordinates=np.stack([at.coordinates] * 3),
        transforms=np.stack([at.transforms] * 3),
    )  # fmt: skip
    conditions = as_declared(three, [0, 0, 0, 5.0, 20.0, 0])
    errors = conditions.errors.copy()
    errors[1, 0, 3] = np.nan
    found, whole = responses(replace(conditions, errors=errors)), responses(conditions)
    assert not found.screws[1].any()
    assert not found.wrenches[1].any()
    for k in (0, 2):
        assert np.abs(whole.wrenches[k]).max() > 5.0
        np.testing.assert_allclose(found.screws[k], whole.screws[k])
        np.testing.assert_allclose(found.wrenches[k], whole.wrenches[k])


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("closed", [False, True])
def test_response_does_not_depend_on_clearance_under_load(held, closed):
    """The load keeps the joint at the boundary of its clearance."""
    if closed:
        robot, loose = five_bar(), "right.elbow"
        load = [0, 0, 0, 5.0, 20.0, 0]
        conditions = as_declared(home_posture(robot), load)
    else:
        campaign, conditions = loaded()
        robot, loose = campaign.robot, "drive"
    clearance = Clearance(radial=1e-5, axial=2e-5)
    there = with_frames(robot, lambda f: f.name == loose, clearance=clearance)
    there = replace(conditions, robot=there)
    if held:
        rest = np.zeros_like(conditions.errors)
        rest[:, robot.index(loose), 3] = 1.0
        there = replace(there, rest=rest)
    found, tight = responses(there), responses(conditions)
    np.testing.assert_allclose(found.screws, tight.screws, atol=1e-9)
    np.testing.assert_allclose(found.wrenches, tight.wrenches, atol=1e-8)
    np.testing.assert_allclose(found.reading, tight.reading, atol=1e-9)
    assert tight.wrenches.any()


def test_clearance_in_a_parallel_spring_does_not_change_its_load():
    """Each of the two springs transmits half of the load."""
    spring = np.eye(6) * 1e6
    robot = Robot("pair", "end_a", (
        Frame("a", joint_stiffness=spring, clearance=Clearance(radial=1e-5)),
        Frame("end_a", "a", [0.1, 0, 0]), Frame("b", joint_stiffness=spring),
        Frame("end_b", "b", [0.1, 0, 0]),
    ), (("end_a", "end_b"),))  # fmt: skip
    found = responses(as_declared(home_posture(robot), [0, 0, 0, 30.0, 0, 0]))
    assert found.wrenches[0, [0, 2], 3] == pytest.approx([15.0, 15.0], rel=1e-9)
