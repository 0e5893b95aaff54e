"""Robots placed by pose and by joints, against closed forms."""

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform
from tests.linkages_for_tests import (
    CRANK,
    GROUND,
    driven,
    five_bar,
    four_bar,
    four_bar_angles,
    frame,
    free,
)

EXACT = 1e-9  # closures are solved to 1e-10 of the longest body, all near 1 m here


@pytest.mark.parametrize("mode", [1.0, -1.0])
@pytest.mark.parametrize("q", [-2.0, 0.1, 1.5, 3.0, 5.0])
def test_four_bar_follows_the_law_of_cosines_in_its_assembly_mode(q, mode):
    """The crank turns fully, and neither assembly mode is left."""
    posture = place_robot(four_bar(mode=mode), joints={"crank": q})
    coupler, _, end = four_bar_angles(q, mode)
    np.testing.assert_allclose(posture.platform[:2, 3], end, rtol=0, atol=EXACT)
    along = [math.cos(coupler), math.sin(coupler), 0.0]
    np.testing.assert_allclose(posture.platform[:3, 0], along, rtol=0, atol=EXACT)
    assert posture.mismatch < EXACT


def test_rough_home_coordinates_are_corrected_to_close():
    """Passive coordinates 0.05 rad off are solved; the driven one is kept."""
    posture = home_posture(four_bar(0.5))
    assert posture.coordinates[0] == 0.5
    np.testing.assert_allclose(
        posture.platform[:2, 3], four_bar_angles(0.5)[2], rtol=0, atol=EXACT
    )


@pytest.mark.parametrize("seed", range(4))
def test_frame_order_does_not_change_the_posture(seed):
    mixed = np.random.default_rng(seed).permutation(6)
    here = place_robot(four_bar(order=mixed), joints={"crank": 2.0})
    there = place_robot(four_bar(), joints={"crank": 2.0})
    np.testing.assert_allclose(here.platform, there.platform, rtol=0, atol=EXACT)
    parents = here.robot.parents
    assert all(parents < np.arange(6))


def test_message_states_where_a_limited_crank_stops():
    """Coupler and rocker of 0.3 m are in line when the crank's end is 0.6 m away."""
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
    found = float(str(caught.value).split("to hold ")[1].split(" %")[0])
    assert found == pytest.approx(left, abs=0.1)


def arm(lengths=(0.5, 0.4), angles=(0.3, 0.9)):
    """Planar serial arm, both joints driven."""
    first, second = lengths
    return Robot("arm", "hand", (
        frame("a", **driven(angles[0])),
        frame("b", "a", (first, 0, 0), **driven(angles[1])),
        frame("hand", "b", (second, 0, 0)),
    ))  # fmt: skip


@pytest.mark.parametrize("x", [0.2, 0.5, 0.85])
def test_arm_reaches_a_pose_in_the_elbow_mode_of_home(x):
    y = 0.2
    posture = place_robot(arm(), pose={"tx": x, "ty": y})
    far = (x**2 + y**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4)
    np.testing.assert_allclose(posture.coordinates[1], math.acos(far), atol=EXACT)
    np.testing.assert_allclose(posture.platform[:2, 3], [x, y], rtol=0, atol=EXACT)


def test_pose_out_of_reach_is_refused_with_the_missing_distance():
    """The arm reaches 0.9 m, and 1.2 m is requested; home is straight ahead on x."""
    start = math.acos((0.5**2 + 0.6**2 - 0.4**2) / (2 * 0.5 * 0.6))
    bend = -math.acos((0.6**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4))
    robot = arm(angles=(start, bend))
    with pytest.raises(BadInput, match="arm: pose tx=1.2, ty=0 cannot") as caught:
        place_robot(robot, pose={"tx": 1.2, "ty": 0.0})
    text = str(caught.value)
    short = float(text.split(" m short")[0].split(", ")[-1])
    # the track halves its step until 1e-5 of its length, 0.6 m, is left
    assert short == pytest.approx(0.3, abs=1e-4)
    assert "expected a configuration in which every closure holds" in text


def test_missing_angle_equals_that_between_the_two_rotations():
    """A hinge about z cannot tilt: SciPy's angle from its last pose to the target."""
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


def test_unspecified_pose_components_stay_nearest_to_home():
    """Of all elbow angles with the hand at x, the nearest to home."""
    robot = arm()
    home = home_posture(robot)
    x = home.platform[0, 3]
    here = place_robot(robot, pose={"tx": x})
    np.testing.assert_allclose(here.coordinates, home.coordinates, atol=EXACT)
    near = place_robot(robot, pose={"tx": x + 1e-4})
    step = near.coordinates - home.coordinates
    # least norm: along the gradient of x over both joints, to first order
    c = home.coordinates
    gradient = -np.array([
        0.5 * math.sin(c[0]) + 0.4 * math.sin(c[0] + c[1]),
        0.4 * math.sin(c[0] + c[1]),
    ])
    expected = gradient * 1e-4 / (gradient @ gradient)
    np.testing.assert_allclose(step[:2], expected, rtol=0, atol=1e-7)


def test_spherical_wrist_reaches_the_requested_rotation_vector():
    """Three driven axes z, y, z at one point reach any rotation."""
    half = math.pi / 2
    robot = Robot("wrist", "hand", (
        frame("yaw", **driven(0.2)),
        frame("pitch", "yaw", turn=(-half, 0, 0), **driven(0.7)),
        frame("roll", "pitch", turn=(half, 0, 0), **driven(-0.4)),
        frame("hand", "roll", (0, 0, 0.1)),
    ))  # fmt: skip
    goal = np.array([0.4, 0.9, -0.3])
    pose = dict(zip(("rx", "ry", "rz"), goal, strict=True))
    posture = place_robot(robot, pose=pose)
    R = rotation_matrix(goal)
    np.testing.assert_allclose(posture.platform[:3, :3], R, rtol=0, atol=EXACT)
    assert [posture.pose()[k] for k in pose] == pytest.approx(goal, abs=EXACT)
    # one component alone: the other two are free
    one = place_robot(robot, pose={"ry": 0.9})
    assert rotation_vector(one.platform[:3, :3])[1] == pytest.approx(0.9, abs=EXACT)


def test_target_half_a_turn_away_is_reached():
    """All components are given; the rotation vector changes its sign at half a turn."""
    robot = Robot("disc", "hand", (frame("q", **driven(0.1)), frame("hand", "q")))
    posture = place_robot(robot, pose={"rx": 0.0, "ry": 0.0, "rz": math.pi})
    assert abs(posture.coordinates[0]) == pytest.approx(math.pi, abs=EXACT)


def test_serial_arm_pose_is_the_product_of_its_transforms():
    """T = prod(fixed_i motion_i), multiplied here by hand."""
    robot = Robot("chain", "tool", (
        frame("a", at=(0.1, 0.2, 0.3), turn=(0.4, -0.2, 0.1), **driven(0.5)),
        frame("b", "a", (0.3, 0, 0.1), (0, 1.2, 0), joint="prismatic", actuated=True,
              position=0.15),
        frame("c", "b", (0, 0.2, 0), (1.0, 0.3, 0.2), **free(-0.7)),
        frame("tool", "c", (0, 0, 0.4), (0, 0, 0.9)),
    ))  # fmt: skip
    joints = {"a": 0.8, "b": -0.05}
    slide = transform([0, 0, -0.05], np.eye(3))
    T = np.eye(4)
    turns = {"a": 0.8, "c": -0.7}
    for f in robot.frames:
        T = T @ transform(f.translation, rotation_matrix(f.rotation))
        if f.name in turns:
            T = T @ transform(np.zeros(3), rotation_matrix([0, 0, turns[f.name]]))
        elif f.name == "b":
            T = T @ slide
    posture = place_robot(robot, joints=joints)
    np.testing.assert_allclose(posture.platform, T, rtol=0, atol=1e-14)


def test_slider_crank_position_equals_its_closed_form():
    """Passive prismatic joint: x = r cos q + sqrt(l^2 - r^2 sin^2 q)."""
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


@pytest.mark.parametrize("x", [-0.2, 0.05, 0.25])
def test_five_bar_drives_equal_the_inverse_kinematics(x):
    """Both legs by the law of cosines; the platform's rotation is unspecified."""
    y = 0.45
    robot = five_bar()
    posture = place_robot(robot, pose={"tx": x, "ty": y})
    for side, name in ((1, "right"), (-1, "left")):
        far = math.hypot(x - side * 0.1, y)
        aim = math.atan2(y, x - side * 0.1)
        inner = (far**2 + 0.35**2 - 0.4**2) / (2 * far * 0.35)
        q = posture.coordinates[robot.index(f"{name}.drive")]
        assert q == pytest.approx(aim - side * math.acos(inner), abs=EXACT)
    back = {f"{n}.drive": posture.coordinates[robot.index(f"{n}.drive")]
            for n in ("right", "left")}  # fmt: skip
    again = place_robot(robot, joints=back)
    np.testing.assert_allclose(
        again.platform[:3, 3], posture.platform[:3, 3], rtol=0, atol=EXACT
    )


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
def test_invalid_pose_or_joint_request_is_refused(given, message):
    with pytest.raises(BadInput) as caught:
        place_robot(arm(), **given)
    assert str(caught.value).startswith(message)
