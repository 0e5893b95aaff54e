"""Beams in pieces: frames in a row that are the beam, and postures of these."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.pieces import cut_beams
from assembly.kinematics.posture import home_posture, place_robot
from assembly.model.links import link_compliance
from assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from stiffness.screws import rotation_matrix, screw_map, transform

BEAM = BeamLink({"radius": 0.01}, 7e10, 0.3)
LENGTH = np.sqrt(0.3**2 + 0.2**2 + 0.6**2)  # 0.7 m


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


@pytest.mark.parametrize("pieces", [2, 3, 5])
def test_pieces_follow_each_other_along_the_beam_to_its_end(pieces):
    """n of L / n, the first turned as the frame is; the last is the frame itself."""
    robot = arm(pieces)
    cut = cut_beams(robot)
    rows = range(1, 1 + pieces)
    assert [cut.robot.frames[i].name for i in rows] == [
        *(f"elbow.piece{k}" for k in range(1, pieces)), "elbow",
    ]  # fmt: skip
    assert cut.owner.tolist() == [0, *[1] * pieces, 2, 3]
    assert cut.last.tolist() == [0, pieces, pieces + 1, pieces + 2]
    along = LENGTH * np.arange(pieces - 1, -1, -1) / pieces
    assert cut.back[1 : 1 + pieces] == pytest.approx(along, rel=1e-13)
    T = np.eye(4)
    for k, i in enumerate(rows, start=1):
        piece = cut.robot.frames[i]
        assert piece.link.length == pytest.approx(LENGTH / pieces, rel=1e-14)
        assert piece.link.pieces == 1
        T = T @ cut.robot.fixed_transforms[i]
        share = k / pieces * np.array([0.3, -0.2, 0.6])
        assert T == pytest.approx(
            transform(share, rotation_matrix([0.5, -0.3, 0.2])), abs=1e-14
        )
    # its joint, error and mass are at the end
    for i in rows:
        frame, end = cut.robot.frames[i], i == pieces
        assert (frame.joint == "revolute", frame.mass == 2.0) == (end, end)
        assert frame.geometric_error.any() == end


@pytest.mark.parametrize("pieces", [2, 4])
def test_small_motions_of_pieces_in_a_row_add_up_to_the_beams(pieces):
    robot = arm(pieces)
    cut = cut_beams(robot)
    C = np.zeros((6, 6))
    _, axis = LENGTH, np.array([0.3, -0.2, 0.6]) / LENGTH
    toward = rotation_matrix([0.5, -0.3, 0.2]).T @ axis
    for i in range(1, 1 + pieces):
        A = screw_map(-cut.back[i] * toward)
        C += A @ link_compliance(cut.robot.frames[i]) @ A.T
    whole = link_compliance(arm(1).frames[1])
    scale = np.sqrt(np.outer(np.diag(whole), np.diag(whole)))
    assert np.abs((C - whole) / scale).max() < 1e-12


def test_a_posture_is_cut_as_the_cut_robot_is_placed():
    """Of any drives; and of many postures in one."""
    robot = arm(3)
    cut = cut_beams(robot)
    joints = {"hinge": 1.1, "elbow": 0.3}
    found = cut.cut(place_robot(robot, joints=joints))
    expected = place_robot(cut.robot, joints=joints)
    assert found.robot is cut.robot
    assert found.transforms == pytest.approx(expected.transforms, abs=1e-14)
    assert found.coordinates == pytest.approx(expected.coordinates, abs=1e-14)
    home = home_posture(robot)
    many = replace(
        home,
        coordinates=np.stack([home.coordinates] * 2),
        transforms=np.stack([home.transforms] * 2),
    )
    both = cut.cut(many)
    assert both.transforms.shape == (2, 6, 4, 4)
    for row in both.transforms:
        assert row == pytest.approx(cut.cut(home).transforms, abs=1e-15)
