"""Postures for given poses and joint coordinates, compared with closed forms."""

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput
from tests.linkages_for_tests import (
    CRANK,
    GROUND,
    driven,
    four_bar,
    four_bar_angles,
    frame,
    free,
)

# [rad, m] closure tolerance, 1e-10 of the longest body, with a margin of 10
EXACT = 1e-9


@pytest.mark.parametrize("mode", [1.0, -1.0])
@pytest.mark.parametrize("q", [-2.0, 0.1, 1.5, 3.0, 5.0])
def test_four_bar_angles_satisfy_the_law_of_cosines(q, mode):
    """The crank makes a full turn in each assembly mode."""
    posture = place_robot(four_bar(mode=mode), joints={"crank": q})
    coupler, _, end = four_bar_angles(q, mode)
    np.testing.assert_allclose(posture.platform[:2, 3], end, rtol=0, atol=EXACT)
    along = [math.cos(coupler), math.sin(coupler), 0.0]
    np.testing.assert_allclose(posture.platform[:3, 0], along, rtol=0, atol=EXACT)
    assert posture.mismatch < EXACT


def test_inaccurate_home_coordinates_are_corrected():
    """Errors of 0.05 rad of the passive coordinates are corrected."""
    posture = home_posture(four_bar(0.5))
    assert posture.coordinates[0] == 0.5
    np.testing.assert_allclose(
        posture.platform[:2, 3], four_bar_angles(0.5)[2], rtol=0, atol=EXACT
    )


def test_message_contains_the_angle_at_which_a_crank_stops():
    """The crank stops where coupler and rocker of 0.3 m are collinear."""
    short = 0.3
    robot = Robot(
        "short", "end",
        (
            frame("crank", **driven(0.0)),
            frame("elbow", "crank", (CRANK, 0, 0), **free(math.acos(5 / 6))),
            frame("end", "elbow", (short, 0, 0)),
            frame("rocker", at=(GROUND, 0, 0), **free(math.pi - math.acos(5 / 6))),
            frame("wrist", "rocker", (short, 0, 0),
                  **free(2 * math.acos(5 / 6) - math.pi)),
            frame("seat", "wrist"),
        ),
        (("end", "seat"),),
    )  # fmt: skip
    flat = math.acos((CRANK**2 + GROUND**2 - (2 * short) ** 2) / (2 * CRANK * GROUND))
    place_robot(robot, joints={"crank": flat - 1e-3})
    left = (1 - flat / 2.0) * 100
    with pytest.raises(BadInput, match="short: these joint coordinates") as caught:
        place_robot(robot, joints={"crank": 2.0})
    found = float(str(caught.value).split("closures fail ")[1].split(" %")[0])
    assert found == pytest.approx(left, abs=0.1)


def arm(lengths=(0.5, 0.4), angles=(0.3, 0.9)):
    """Return a planar serial arm with two driven joints."""
    first, second = lengths
    return Robot("arm", "hand", (
        frame("a", **driven(angles[0])),
        frame("b", "a", (first, 0, 0), **driven(angles[1])),
        frame("hand", "b", (second, 0, 0)),
    ))  # fmt: skip


@pytest.mark.parametrize("x", [0.2, 0.5, 0.85])
def test_arm_reaches_a_pose_in_its_home_assembly_mode(x):
    y = 0.2
    posture = place_robot(arm(), pose={"tx": x, "ty": y})
    far = (x**2 + y**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4)
    np.testing.assert_allclose(posture.coordinates[1], math.acos(far), atol=EXACT)
    np.testing.assert_allclose(posture.platform[:2, 3], [x, y], rtol=0, atol=EXACT)


def test_message_contains_the_remaining_rotation_angle():
    """The platform on a hinge about z cannot tilt."""
    robot = Robot("hinge", "hand", (
        frame("a", **driven(0.3)), frame("hand", "a", (0.4, 0, 0), (0.2, -0.1, 0.3)),
    ))  # fmt: skip
    goal = [0.5, -0.4, 1.1]
    asked = dict(zip(("rx", "ry", "rz"), goal, strict=True))
    with pytest.raises(BadInput, match="cannot be reached") as caught:
        place_robot(robot, pose=asked)
    text = str(caught.value)
    stopped = re.search(r"stops at rx=(\S+), ry=(\S+), rz=(\S+), ", text).groups()
    (short,) = re.findall(r"(\S+) rad short", text)
    between = (
        Rotation.from_rotvec(goal) * Rotation.from_rotvec(np.float64(stopped)).inv()
    )
    assert float(short) == pytest.approx(between.magnitude(), rel=1e-5)


def test_unspecified_pose_components_are_nearest_to_home():
    """Of all joint angles with the hand at x, the nearest to home are selected."""
    robot = arm()
    home = home_posture(robot)
    x = home.platform[0, 3]
    here = place_robot(robot, pose={"tx": x})
    np.testing.assert_allclose(here.coordinates, home.coordinates, atol=EXACT)
    near = place_robot(robot, pose={"tx": x + 1e-4})
    step = near.coordinates - home.coordinates
    # The motion of minimum norm is along the gradient of x, to first order.
    c = home.coordinates
    gradient = -np.array([
        0.5 * math.sin(c[0]) + 0.4 * math.sin(c[0] + c[1]),
        0.4 * math.sin(c[0] + c[1]),
    ])
    expected = gradient * 1e-4 / (gradient @ gradient)
    np.testing.assert_allclose(step[:2], expected, rtol=0, atol=1e-7)


def test_slider_crank_position_equals_its_closed_form():
    """The passive prismatic joint is at x = r cos q + sqrt(l^2 - r^2 sin^2 q)."""
    half = math.pi / 2
    r, l, q = 0.2, 0.5, 1.1
    robot = Robot("slider_crank", "pin", (
        frame("crank", **driven(0.3)),
        frame("elbow", "crank", (r, 0, 0), **free(-0.4)),
        frame("pin", "elbow", (l, 0, 0)),
        frame("slide", turn=(0, half, 0), **free(0.6, "prismatic")),
        frame("block", "slide", turn=(0, -half, 0), **free(0.0)),
        frame("seat", "block"),
    ), (("pin", "seat"),))  # fmt: skip
    posture = place_robot(robot, joints={"crank": q})
    x = r * math.cos(q) + math.sqrt(l**2 - (r * math.sin(q)) ** 2)
    np.testing.assert_allclose(posture.platform[:3, 3], [x, 0, 0], atol=EXACT)
    slide = posture.coordinates[robot.index("slide")]
    assert slide == pytest.approx(x, abs=EXACT)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pose": {"tx": 0.1}, "joints": {"a": 1}}, "found both a pose and joints"),
        ({"pose": {"x": 0.1}}, 'pose: unknown component "x"'),
        ({"pose": {"tx": math.nan}}, "pose.tx: found nan, expected a finite number"),
        ({"joints": {"aa": 1.0}}, 'joints: no actuated joint "aa"; did you mean "a"?'),
        ({"joints": {"hand": 1.0}}, 'joints: no actuated joint "hand"'),
        ({"joints": {"a": math.inf}}, "joint a: found inf, expected a finite number"),
    ],
)
def test_invalid_pose_or_joint_request_is_rejected(given, message):
    with pytest.raises(BadInput) as caught:
        place_robot(arm(), **given)
    assert str(caught.value).startswith(message)
