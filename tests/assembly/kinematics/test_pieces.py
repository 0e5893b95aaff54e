"""Beams in pieces: serial frames equivalent to the beam, and their postures."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.pieces import cut_beams
from forcefit.assembly.kinematics.posture import home_posture, place_robot, together
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot

BEAM = BeamLink({"radius": 0.01}, 7e10, 0.3)


def arm(pieces):
    """Hinge, a beam askew with a hinge at its end, a second beam, and a tip."""
    beam = replace(BEAM, pieces=pieces)
    return Robot("arm", "tip", (
        Frame("hinge", joint="revolute", actuated=True, position=0.4),
        Frame("elbow", "hinge", [0.3, -0.2, 0.6], [0.5, -0.3, 0.2], joint="revolute",
              actuated=True, position=-0.7, link=beam, mass=2.0,
              geometric_error=[1e-3, 0, 0, 0, 0, 2e-4]),
        Frame("wrist", "elbow", [0.0, 0.4, 0.0], link=BEAM),
        Frame("tip", "wrist", [0.1, 0, 0], link=MatrixLink(np.eye(6))),
    ))  # fmt: skip


def test_cutting_a_posture_equals_placing_the_cut_robot():
    """For any drive positions, and for several postures together."""
    robot = arm(3)
    cut = cut_beams(robot)
    joints = {"hinge": 1.1, "elbow": 0.3}
    found = cut.cut(place_robot(robot, joints=joints))
    expected = place_robot(cut.robot, joints=joints)
    assert found.robot is cut.robot
    assert found.transforms == pytest.approx(expected.transforms, abs=1e-14)
    assert found.coordinates == pytest.approx(expected.coordinates, abs=1e-14)
    home = home_posture(robot)
    both = cut.cut(together([home] * 2))
    assert both.transforms.shape == (2, 6, 4, 4)
    for row in both.transforms:
        assert row == pytest.approx(cut.cut(home).transforms, abs=1e-15)
