"""Robots placed by pose and by joints, against closed forms."""

import math
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.nominal import Target, follow
from assembly.kinematics.posture import (
    home_posture,
    place_many,
    place_many_joints,
    place_robot,
    pose_components,
)
from assembly.model.robot import Frame, Robot
from assembly.robots import load_robot
from forcefit.inputs.table import BadInput
from stiffness.screws import rotation_matrix, rotation_vector, transform

EXACT = 1e-9  # closures are solved to 1e-10 of the longest body, all near 1 m here


def frame(name, parent="base", at=(0, 0, 0), turn=(0, 0, 0), **more):
    return Frame(name, parent, np.array(at, float), np.array(turn, float), **more)


def driven(position=0.0):
    return {"joint": "revolute", "actuated": True, "position": position}


def free(position=0.0, joint="revolute"):
    return {"joint": joint, "position": position}


CRANK, COUPLER, ROCKER, GROUND = 0.3, 0.7, 0.6, 0.8


def four_bar_angles(q, mode=1.0):
    """Coupler and rocker angles of the four-bar by the law of cosines."""
    elbow = np.array([CRANK * math.cos(q), CRANK * math.sin(q)])
    to_rocker = np.array([GROUND, 0.0]) - elbow
    far = float(np.hypot(*to_rocker))
    inner = (COUPLER**2 + far**2 - ROCKER**2) / (2 * COUPLER * far)
    coupler = math.atan2(to_rocker[1], to_rocker[0]) + mode * math.acos(inner)
    end = elbow + COUPLER * np.array([math.cos(coupler), math.sin(coupler)])
    return coupler, math.atan2(end[1], end[0] - GROUND), end


def four_bar(q=0.5, mode=1.0, order=None):
    """Planar four-bar whose platform is the end of its coupler."""
    coupler, rocker, _ = four_bar_angles(q, mode)
    frames = [
        frame("crank", **driven(q)),
        frame("elbow", "crank", (CRANK, 0, 0), **free(coupler - q + 0.05)),
        frame("end", "elbow", (COUPLER, 0, 0)),
        frame("rocker", at=(GROUND, 0, 0), **free(rocker - 0.05)),
        frame("wrist", "rocker", (ROCKER, 0, 0), **free(coupler - rocker)),
        frame("seat", "wrist"),
    ]
    order = range(len(frames)) if order is None else order
    return Robot("bars", "end", tuple(frames[i] for i in order), (("end", "seat"),))


@pytest.mark.parametrize("mode", [1.0, -1.0])
@pytest.mark.parametrize("q", [-2.0, 0.1, 1.5, 3.0, 5.0])
def test_a_four_bar_obeys_the_law_of_cosines_in_its_own_mode(q, mode):
    """The crank turns fully; both assembly modes exist and neither is left."""
    posture = place_robot(four_bar(mode=mode), joints={"crank": q})
    coupler, _, end = four_bar_angles(q, mode)
    np.testing.assert_allclose(posture.platform[:2, 3], end, rtol=0, atol=EXACT)
    along = [math.cos(coupler), math.sin(coupler), 0.0]
    np.testing.assert_allclose(posture.platform[:3, 0], along, rtol=0, atol=EXACT)
    assert posture.mismatch < EXACT


def test_a_four_bar_whose_guess_is_rough_still_closes_at_home():
    """Passive coordinates 0.05 rad off are solved, the driven one is held."""
    posture = home_posture(four_bar(0.5))
    assert posture.coordinates[0] == 0.5
    np.testing.assert_allclose(
        posture.platform[:2, 3], four_bar_angles(0.5)[2], rtol=0, atol=EXACT
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_order_of_frames_changes_nothing(seed):
    mixed = np.random.default_rng(seed).permutation(6)
    here = place_robot(four_bar(order=mixed), joints={"crank": 2.0})
    there = place_robot(four_bar(), joints={"crank": 2.0})
    np.testing.assert_allclose(here.platform, there.platform, rtol=0, atol=EXACT)
    parents = here.robot.parents
    assert all(parents < np.arange(6))


def test_a_crank_that_cannot_turn_fully_stops_where_the_triangle_is_flat():
    """Coupler and rocker of 0.3 m: stretched when the crank's end is 0.6 m away."""
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
    found = float(str(caught.value).split("holding ")[1].split(" %")[0])
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
def test_an_arm_reaches_a_pose_with_the_elbow_of_its_home(x):
    y = 0.2
    posture = place_robot(arm(), pose={"tx": x, "ty": y})
    far = (x**2 + y**2 - 0.5**2 - 0.4**2) / (2 * 0.5 * 0.4)
    np.testing.assert_allclose(posture.coordinates[1], math.acos(far), atol=EXACT)
    np.testing.assert_allclose(posture.platform[:2, 3], [x, y], rtol=0, atol=EXACT)


def test_a_pose_out_of_reach_is_refused_with_the_distance():
    """Home is straight ahead on x; the arm ends at 0.9 m, asked for is 1.2 m."""
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


def test_the_angle_that_is_missing_is_that_between_two_rotations():
    """A hinge about z asked to tilt: SciPy's angle from where it stops to the goal."""
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


@pytest.mark.parametrize("guess", [True, False])
def test_progress_is_one_where_a_target_is_reached(guess):
    robot = four_bar()
    start = home_posture(robot).coordinates
    near = np.full(len(start), np.nan)
    near[robot.index("crank")] = 0.6
    track = follow(robot, start, Target(coordinates=near[None]), guess)
    assert track.progress.tolist() == [1.0]
    assert track.reached.tolist() == [True]


def test_a_pose_outside_the_arms_plane_is_refused():
    with pytest.raises(BadInput, match="cannot be reached"):
        place_robot(arm(), pose={"tz": 0.1})


def test_components_not_given_stay_nearest_to_home():
    """Of all elbows with the hand at x, the one nearest to home, on the way there."""
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


def test_a_spherical_wrist_takes_a_rotation_vector():
    """Three driven axes z, y, z at one point: any rotation, read back the same."""
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


def test_a_target_half_a_turn_away_is_reached():
    """All three components given: no trouble where the rotation vector flips."""
    robot = Robot("disc", "hand", (frame("q", **driven(0.1)), frame("hand", "q")))
    posture = place_robot(robot, pose={"rx": 0.0, "ry": 0.0, "rz": math.pi})
    assert abs(posture.coordinates[0]) == pytest.approx(math.pi, abs=EXACT)


def test_a_serial_arm_is_its_transforms_multiplied():
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


def test_a_slider_crank_slides():
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


def five_bar():
    """Two driven proximal bars, two passive distal ones: reaches (x, y)."""
    robot = []
    x, y, b, l1, l2 = 0.0, 0.5, 0.1, 0.35, 0.4
    for side, name in ((1, "right"), (-1, "left")):
        far = math.hypot(x - side * b, y)
        aim = math.atan2(y, x - side * b)
        q = aim - side * math.acos((far**2 + l1**2 - l2**2) / (2 * far * l1))
        elbow = np.array([side * b + l1 * math.cos(q), l1 * math.sin(q)])
        bend = math.atan2(y - elbow[1], x - elbow[0])
        robot += [
            frame(f"{name}.drive", at=(side * b, 0, 0), **driven(q)),
            frame(f"{name}.elbow", f"{name}.drive", (l1, 0, 0), **free(bend - q)),
            frame(f"{name}.pin", f"{name}.elbow", (l2, 0, 0), **free(-bend)),
            frame(f"{name}.tip", f"{name}.pin"),
        ]
    closure = (("right.tip", "left.tip"),)
    return Robot("five_bar", "right.tip", tuple(robot), closure)


@pytest.mark.parametrize("x", [-0.2, 0.05, 0.25])
def test_a_parallel_robot_has_the_drives_of_its_inverse_kinematics(x):
    """Both legs by the law of cosines; the platform's turn is left near home."""
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


def test_a_parallel_robot_stops_where_a_leg_is_straight():
    """Straight up from home: a leg of 0.75 m from (0.1, 0) ends at y = 0.743303."""
    reach = math.sqrt(0.75**2 - 0.1**2)
    robot = five_bar()
    place_robot(robot, pose={"tx": 0.0, "ty": reach - 1e-3})
    with pytest.raises(BadInput, match="cannot be reached") as caught:
        place_robot(robot, pose={"tx": 0.0, "ty": 1.0})
    short = float(str(caught.value).split(" m short")[0].split(", ")[-1])
    assert short == pytest.approx(1.0 - reach, abs=1e-4)


def test_many_poses_are_those_placed_one_by_one():
    robot = five_bar()
    goals = np.full((3, 6), np.nan)
    goals[:, :2] = [[0.1, 0.5], [0.0, 2.0], [-0.1, 0.6]]
    postures, reasons = place_many(robot, goals)
    assert postures[1] is None
    assert "five_bar" not in reasons[0]
    assert reasons[0] == reasons[2] == ""
    assert "cannot be reached" in reasons[1]
    for i in (0, 2):
        one = place_robot(robot, pose={"tx": goals[i, 0], "ty": goals[i, 1]})
        np.testing.assert_allclose(
            postures[i].platform[:3, 3], one.platform[:3, 3], rtol=0, atol=EXACT
        )


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide"])
def test_a_long_way_ends_where_many_short_ones_do(name):
    """Home's assembly mode: through 40 targets on the line, each from the last."""
    robot = load_robot(name)
    home = home_posture(robot)
    given = (0, 2) if name == "irsbot2" else (0, 1, 2)
    signs = np.array(np.meshgrid(*[[-1, 1]] * len(given))).reshape(len(given), -1).T
    ends = pose_components(home.platform)[list(given)] + 0.12 * signs
    goals = np.full((len(ends), 6), np.nan)
    goals[:, given] = ends
    postures, _ = place_many(robot, goals)
    assert sum(posture is not None for posture in postures) > 1
    for goal, posture in zip(goals, postures, strict=True):
        if posture is None:
            continue
        at, pose = home.coordinates, np.full((1, 6), np.nan)
        begin = pose_components(home.platform)
        for share in np.linspace(0, 1, 41)[1:]:
            pose[0] = begin + share * (goal - begin)
            at = follow(robot, at, Target(pose=pose)).coordinates[0]
        np.testing.assert_allclose(posture.coordinates, at, rtol=0, atol=EXACT)


def test_a_ball_near_gimbal_lock_turns_on_as_it_did():
    """Beside the lock a long step ends half a turn about two of its axes away."""
    robot = load_robot("hexapod")
    home = home_posture(robot)
    goal = np.array([[0.475133, 0.004732, 0.078543, 0.384865, -0.20706, -0.37498]])
    begin, at = pose_components(home.platform), home.coordinates
    for share in np.linspace(0, 1, 81)[1:]:
        pose = begin + share * (goal - begin)
        at = follow(robot, at, Target(pose=pose)).coordinates[0]
    track = follow(robot, home.coordinates, Target(pose=goal))
    assert track.reached[0]
    np.testing.assert_allclose(track.coordinates[0], at, rtol=0, atol=EXACT)


def test_many_sets_of_joints_are_those_of_the_inverse_kinematics():
    """Law of cosines one way, the closure the other; flat outward the elbows are
    0.9 m apart and two bars of 0.4 m cannot meet."""
    robot = five_bar()
    goals = np.full((3, 8), np.nan)
    tips = np.array([[0.1, 0.45], [-0.05, 0.55]])
    for side, name in ((1, "right"), (-1, "left")):
        x, y = (tips - [side * 0.1, 0.0]).T
        far = np.hypot(x, y)
        inner = np.arccos((far**2 + 0.35**2 - 0.4**2) / (2 * far * 0.35))
        drive = robot.index(f"{name}.drive")
        goals[:2, drive] = np.arctan2(y, x) - side * inner
        goals[2, drive] = 0.0 if side == 1 else math.pi
    postures, reasons = place_many_joints(robot, goals)
    assert reasons[:2] == ["", ""]
    for posture, tip in zip(postures[:2], tips, strict=True):
        np.testing.assert_allclose(posture.platform[:2, 3], tip, rtol=0, atol=1e-9)
    assert postures[2] is None
    assert "cannot be reached" in reasons[2]


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
def test_a_request_that_makes_no_sense_is_refused(given, message):
    with pytest.raises(BadInput) as caught:
        place_robot(arm(), **given)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("name", ["arm6", "five_bar", "3rrr", "irsbot2"])
def test_what_a_pose_leaves_open_does_not_hang_on_rounding(name):
    """A target changed in its last digit, as another processor would change it."""
    robot = load_robot(name)
    tx = place_robot(robot).pose()["tx"] + 0.06
    first, *others = (
        place_robot(robot, {"tx": tx * (1 + k * np.finfo(float).eps)}).coordinates
        for k in range(5)
    )
    assert all(np.abs(first - other).max() < 1e-6 for other in others)
