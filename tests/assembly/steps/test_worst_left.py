"""Tests of the largest pose error over all positions of a bolted joint."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.model.robot import Clearance, Frame, LockedAt, Robot
from forcefit.assembly.report.pose_errors import pose_error_of
from forcefit.assembly.steps.bolted import bolt_generators, bolt_joints, bolted_errors
from forcefit.assembly.steps.worst_left import BRACKET, CONVEX, worst_left
from forcefit.inputs.table import BadInput
from tests.assembly.steps.test_bolted import four_bar
from tests.assembly.steps.test_left_anywhere import pin, platform_of_two_pins

WORST = {"left": "worst"}


def assert_bracket(found, expected):
    """Assert that both bounds agree with the exact value within 1e-3."""
    low, high = found
    assert expected * (1 - 1e-3) <= low <= expected * (1 + 1e-9)
    assert expected * (1 - 1e-9) <= high <= expected * (1 + 1e-3)


def left(robot, rule):
    """Return a robot whose bolted joints have another rule ``left``."""
    frames = [
        replace(frame, locked_at=replace(frame.locked_at, left=rule))
        if frame.locked_at
        else frame
        for frame in robot.frames
    ]
    return replace(robot, frames=tuple(frames))


def test_largest_error_of_slot_with_arm_equals_closed_form():
    """A tilt of 2 mrad at an arm of 0.3 m is added to a radial clearance of 1 mm."""
    gaps = Clearance(radial=1e-3, axial=2e-4, tilt=2e-3)
    slot = Frame("slot", "base", locked_at=LockedAt(gaps, **WORST))
    arm = Frame("arm", "slot", translation=[0, 0, 0.3])
    robot = bolt_joints(Robot("slot", "arm", (slot, arm), ()))
    worst = worst_left(home_posture(robot))
    assert worst.assumption == CONVEX
    assert_bracket(worst.rotation, 2e-3)
    assert_bracket(worst.translation, np.hypot(1e-3 + 0.3 * 2e-3, 2e-4))


def test_largest_error_on_two_axial_pins_equals_closed_form():
    """Pins at 0 +- 20 um and 30 +- 20 um allow positions between 10 and 20 um."""
    frames = [Frame("guide", "base", joint="prismatic"), Frame("platform", "guide")]
    for name, error in (("left", 0.0), ("right", 30e-6)):
        axial = {"axial": 20e-6}
        frames += pin(name, axial, [0, 0, 0, 0, 0, error], **WORST)
    closures = (("platform", "left.end"), ("platform", "right.end"))
    robot = bolt_joints(Robot("pins", "platform", tuple(frames), closures))
    worst = worst_left(home_posture(robot))
    assert worst.assumption == CONVEX
    assert_bracket(worst.translation, 20e-6)
    assert worst.rotation == pytest.approx([0, 0], abs=1e-12)


@pytest.mark.parametrize("distance", [1e-4, 1.6e-4])
def test_largest_error_on_two_round_pins_equals_closed_form(distance):
    """The positions are in the intersection of two discs with a radius of 0.1 mm."""
    robot = left(platform_of_two_pins({"radial": 1e-4}, distance), "worst")
    worst = worst_left(home_posture(bolt_joints(robot)))
    assert worst.assumption == CONVEX
    assert_bracket(worst.translation, 1e-4)


@pytest.mark.parametrize("angle", [0.4, 1.6])
def test_upper_bound_exceeds_errors_of_random_positions(tmp_path, angle):
    """The errors of random positions do not exceed the upper bound."""
    key = '{ joints = { crank = 1.2 }, left = "worst" }'
    robot = load_robot(str(four_bar(tmp_path, key)))
    posture = place_robot(bolt_joints(robot), joints={"crank": angle})
    worst = worst_left(posture)
    assert worst.assumption == BRACKET
    count = 200
    anywhere = left(robot, "uniform")
    errors = np.repeat(robot.declared_errors[None], count, axis=0)
    errors = bolted_errors(anywhere, errors, bolt_generators(anywhere, 1, range(count)))
    found = bound_pose_error(solve_assembly(posture, errors=errors))
    for name in ("rotation", "translation"):
        low, high = getattr(worst, name)
        largest = np.nanmax(getattr(found, f"{name}_error")[:, 0])
        assert largest <= high
        assert 0.98 * largest <= low <= high


def test_command_error_reports_bounds_of_largest_error(tmp_path, run):
    """The command and the function return the same values."""
    key = '{ joints = { crank = 1.2 }, left = "worst" }'
    path = four_bar(tmp_path, key)
    status, text, _ = run("assembly", "error", path, "--joint", "crank=0.4")
    assert status == 0
    assert "bolted at worst, rotation" in text
    words = ("assembly", "error", path, "--joint", "crank=0.4", "--json", "-")
    status, text, _ = run(*words)
    found = json.loads(text)["bolted_worst"]
    robot = bolt_joints(load_robot(path))
    worst = worst_left(place_robot(robot, joints={"crank": 0.4}))
    bounds = [found["translation"][key] for key in ("lower", "upper")]
    assert bounds == pytest.approx(worst.translation)
    assert found["assumption"] == BRACKET


def test_worst_position_under_load_is_rejected(tmp_path):
    """The worst position is defined only without a load."""
    key = '{ joints = { crank = 1.2 }, left = "worst" }'
    robot = bolt_joints(load_robot(str(four_bar(tmp_path, key))))
    posture = place_robot(robot, joints={"crank": 0.4})
    with pytest.raises(BadInput, match='left = "worst", expected no load'):
        pose_error_of(posture, load=[0, 0, 0, 0, 0, -1.0])
