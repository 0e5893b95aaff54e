"""Robots, loads and directions without a stiffness are refused in one line."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.inputs.errors import BadInput


def test_free_motion_of_another_body_is_refused_with_a_fixed_platform():
    """A wheel turns freely, driven by a couple on its rim."""
    frames = (
        Frame("wheel", joint="revolute"),
        Frame("rim", "wheel", [0.1, 0, 0]),
        Frame("tip", translation=[0, 0, 0.3], link=MatrixLink(np.eye(6))),
    )
    couple = np.zeros((3, 6))
    couple[1, 2] = 2.0
    with pytest.raises(FreeMotion, match="it moves wheel rz; the platform is at rest"):
        solve_assembly(home_posture(Robot("beside", "tip", frames)), bodies=couple)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"at": [0, np.nan, 0]}, "at: found nan as number 2, expected 3 numbers"),
        ({"at": [0, 1]}, "at: found .* of length 2, expected 3 numbers"),
        ({"load": [1.0]}, "load: found .* of length 1, expected 6 numbers"),
        ({"load": [np.inf] * 6}, "load: found inf as number 1"),
        ({"state": "loaded"}, "no state 'loaded'"),
        ({"side": "left"}, "no side 'left'"),
    ],
)
def test_invalid_point_load_or_state_is_refused(words, message):
    with pytest.raises(ValueError, match=message):
        platform_stiffness(home_posture(load_robot("orthoglide")), **words)


@pytest.mark.parametrize("direction", [[0] * 6, [1, 0, 0], [np.nan] * 6, "tx"])
def test_invalid_direction_is_refused(direction):
    stiffness = platform_stiffness(home_posture(load_robot("orthoglide")))
    for asked in (stiffness.along, stiffness.shares):
        with pytest.raises(BadInput, match="direction: found"):
            asked(direction)
