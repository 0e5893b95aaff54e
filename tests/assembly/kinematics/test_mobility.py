"""Freedoms and overconstraint of linkages that are counted by hand."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from tests.linkages_for_tests import five_bar, four_bar

TURNING = {"joint": "revolute", "actuated": True}


def side_by_side(*joints):
    """Joints at one place about or along z, of which the first is driven."""
    frames, closures = [], []
    for k, joint in enumerate(joints):
        frames += [Frame(f"j{k}", joint=joint, actuated=k == 0),
                   Frame(f"end{k}", f"j{k}", [0.1, 0, 0])]  # fmt: skip
        closures += [("end0", f"end{k}")] if k else []
    return Robot("bundle", "end0", tuple(frames), tuple(closures))


@pytest.mark.parametrize(("robot", "counts"), [
    # an arm closes nothing: its joints are its freedoms
    (Robot("arm", "tip", (Frame("a", **TURNING), Frame("b", "a", [1, 0, 0], **TURNING),
                          Frame("tip", "b"))), (2, 0, 0)),
    # in a plane: three equations of a closure of six
    (four_bar(), (1, 0, 3)), (four_bar(mode=-1.0), (1, 0, 3)),
    # its tip turns by itself about the two pins it hangs from
    (five_bar(), (3, 1, 3)),
    # one motion in common, of twelve equations two
    (side_by_side("prismatic", "prismatic", "prismatic"), (1, 0, 10)),
    # nothing in common
    (side_by_side("revolute", "prismatic"), (0, 0, 4)),
    (side_by_side("revolute", "fixed"), (0, 0, 5)),
])  # fmt: skip
def test_freedoms_and_overconstraint_equal_hand_counts(robot, counts):
    """All freedoms, freedoms with locked drives, and redundant equations."""
    found = mobility(home_posture(robot))
    assert (found.freedoms, found.locked_freedoms, found.overconstraint) == counts


@pytest.mark.parametrize("count", [2, 3, 5])
@pytest.mark.parametrize("joint", ["prismatic", "revolute"])
def test_least_singular_value_of_parallel_joints_equals_its_closed_form(joint, count):
    """Rows q1 - qk: 1, or sqrt(2) of a single row, in rad and in sizes of the robot."""
    robot = side_by_side(*[joint] * count)
    least = np.sqrt(2.0) if count == 2 else 1.0
    found = mobility(home_posture(robot)).smallest_singular_value
    assert found == pytest.approx(least)


def test_robot_without_closures_has_no_positive_singular_value():
    arm = Robot("arm", "tip", (Frame("a", **TURNING), Frame("tip", "a", [1, 0, 0])))
    assert mobility(home_posture(arm)).smallest_singular_value == 0.0
