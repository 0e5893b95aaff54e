"""Tests of the bounds without one of the imperfections."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.validation.study.governing import CLEARANCE, ERROR, governing
from tests.guided_stage_for_tests import STAGE


def chain(*parts):
    """Return a chain of coincident frames with errors along x and axial clearances."""
    frames, parent = [], "base"
    for k, (shift, clearance) in enumerate(parts):
        frames.append(Frame(
            f"f{k}", parent=parent, geometric_error=[0, 0, 0, shift, 0, 0],
            clearance=Clearance(axial=clearance) if clearance else None,
        ))  # fmt: skip
        parent = f"f{k}"
    return home_posture(Robot("chain", f"f{len(parts) - 1}", tuple(frames)))


def test_governing_bounds_equal_hand_calculation():
    """The robot has errors of 0.3 and -0.1 mm along x and 0.4 mm clearance along z."""
    rows = governing(chain((3e-4, None), (-1e-4, None), (0.0, 4e-4)))
    seen = [(one["part"], one["what"], one["translation"]) for one in rows]
    expected = [
        ("f2", CLEARANCE, 2e-4),  # sum of both errors
        ("f0", ERROR, np.hypot(1e-4, 4e-4)),
        ("f1", ERROR, np.hypot(3e-4, 4e-4)),  # the other error is not compensated
    ]
    assert [one[:2] for one in seen] == [one[:2] for one in expected]
    # The accuracy of the bounds is 1 um.
    for (*_, bound), (*_, size) in zip(seen, expected, strict=True):
        assert size * (1 - 1e-9) <= bound <= size + 1e-6
    assert [one["rotation"] for one in rows] == pytest.approx([0.0] * 3, abs=1e-12)


def test_free_motion_of_a_joint_is_not_a_governing_clearance():
    posture = chain((0.0, None), (1e-4, None))
    first, second = posture.robot.frames
    hinge = replace(first, joint="revolute", clearance=Clearance(spin=0.1))
    robot = replace(posture.robot, frames=(hinge, second))
    rows = governing(replace(posture, robot=robot))
    assert [(one["part"], one["what"]) for one in rows] == [("f1", ERROR)]


def test_ball_is_one_governing_clearance():
    """The bound without one of two imperfections equals the other imperfection."""
    posture = chain((3e-4, None), (0.0, None))
    first, second = posture.robot.frames
    ball = replace(second, clearance=Clearance(ball=1e-4))
    robot = replace(posture.robot, frames=(first, ball))
    rows = governing(replace(posture, robot=robot))
    seen = [(one["part"], one["what"]) for one in rows]
    assert seen == [("f0", ERROR), ("f1", CLEARANCE)]
    for one, size in zip(rows, (1e-4, 3e-4), strict=True):
        assert size * (1 - 1e-9) <= one["translation"] <= size + 1e-6


def test_perfect_robot_has_no_governing_part():
    assert governing(chain((0.0, None), (0.0, None))) == []


def test_parallel_contacts_are_one_governing_clearance(tmp_path):
    """The expected values were computed in cvxpy."""
    path = tmp_path / "stage.toml"
    path.write_text(STAGE)
    rows = governing(home_posture(read_robot(path)))
    assert [(one["part"], one["what"]) for one in rows] == [
        ("x", CLEARANCE), ("foot", CLEARANCE), ("y", CLEARANCE)
    ]  # fmt: skip
    for one, size in zip(rows, (49.025e-6, 62.425e-6, 107.196e-6), strict=True):
        assert size * (1 - 1e-5) <= one["translation"] <= size + 1e-6
    turns = [one["rotation"] for one in rows]
    assert turns == pytest.approx([0.48487e-3, 0.71161e-3, 0.56899e-3], rel=1e-4)
