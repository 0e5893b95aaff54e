"""The reduced problem against the full one, and messages of free motions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.load import loads_on_frames
from forcefit.assembly.linear.reference.reduction import FreeMotion, reduce_problem
from forcefit.assembly.model.robot import Frame, Robot
from tests.robots_for_tests import coaxial_beams


def reduced(robot, load=None):
    """The problem of a robot at home."""
    posture = home_posture(robot)
    loads = None if load is None else loads_on_frames(posture, load)
    return reduce_problem(linearise(posture), virtual_joints(robot), loads)


def rigid_beams(gap):
    """Two rigid links that meet ``gap`` [6] apart."""
    robot = coaxial_beams(gap)
    return replace(robot, frames=tuple(replace(f, link=None) for f in robot.frames))


@pytest.mark.parametrize("gap", [1e-11, 1e-6, 1e-2])
def test_rigid_closure_remains_open_by_its_error(gap):
    """The reference length is 1 m, so the relative gap equals the gap in metres."""
    assert reduced(rigid_beams([0, 0, 0, 0, gap, 0])).inconsistent == pytest.approx(gap)
    assert reduced(rigid_beams([gap, 0, 0, 0, 0, 0])).inconsistent == pytest.approx(gap)


def turn_and_slide():
    """A pin about z and a slider along it, 10 m long."""
    return Robot("chain", "tip", (
        Frame("turn", joint="revolute"),
        Frame("slide", "turn", [10, 0, 0], joint="prismatic"),
        Frame("tip", "slide"),
    ))  # fmt: skip


@pytest.mark.parametrize("load", [1e-9, 1.0, 1e9])
def test_free_motion_message_does_not_depend_on_the_size_of_the_load(load):
    """0.3 N m and 2 N: 0.3 rad against 2 m / 10 m; a unit turn shifts by 10 m."""
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 2.0, 0, 0, 0.3]))
    assert "it moves turn rz, slide tz; " in str(told.value)
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 0.15, 0, 0, 2.0]))
    assert "it moves slide tz, turn rz; " in str(told.value)
    with pytest.raises(FreeMotion) as told:
        reduced(turn_and_slide(), load * np.array([0, 0, 0, 0, 0, 2.0]))
    text = str(told.value)
    assert "it moves slide tz; the platform moves along [0 0 0 0 0 1] [rad, m]" in text
