"""Ways to one target and to many: where they end, in which assembly mode."""

import math

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
from stiffness.screws import rotation_matrix, transform
from tests.linkages_for_tests import (
    CRANK,
    GROUND,
    five_bar,
)

EXACT = 1e-9  # closures are solved to 1e-10 of the longest body, all near 1 m here


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


def frames_of(robot, q):
    """Products of transforms, one after the other."""
    T, after = [], []
    for i, frame in enumerate(robot.frames):
        parent = robot.parents[i]
        before = np.eye(4) if parent < 0 else after[parent]
        T.append(before @ robot.fixed_transforms[i])
        motion = {
            "fixed": np.eye(4),
            "revolute": transform(np.zeros(3), rotation_matrix([0, 0, q[i]])),
            "prismatic": transform([0, 0, q[i]], np.eye(3)),
        }[frame.joint]
        after.append(T[i] @ motion)
    return np.array(T)


def held_at(robot, **coordinates):
    """One row of coordinates that are held, and those that are free."""
    held = np.full((1, len(robot.frames)), np.nan)
    for name, value in coordinates.items():
        held[0, robot.index(name)] = value
    return Target(coordinates=held)


def test_frames_and_what_is_open_are_those_of_the_end():
    """Per closure the largest of three turns and three gaps, by scipy."""
    turns = [[1e-3, -4e-3, 2e-3], [0.0, 0.0, -3e-7], [0.0, 0.0, 0.0]]
    gaps = [[1e-3, 0.0, -2e-3], [0.0, 2e-7, 1e-7], [3e-3, -7e-3, 5e-3]]
    seats = [
        Frame(f"b{k}", "a", gap, turn)
        for k, (gap, turn) in enumerate(zip(gaps, turns, strict=True))
    ]
    robot = Robot("open", "a", (
        Frame("arm", joint="prismatic", actuated=True), Frame("a", "arm", [1.0, 0, 0]),
        *seats,
    ), tuple(("a", seat.name) for seat in seats))  # fmt: skip
    held = np.full((2, 5), np.nan)
    held[:, 0] = 0.3, -0.4
    track = follow(robot, np.zeros(5), Target(coordinates=held), guess=True)
    for row in range(2):
        q = [held[row, 0], 0, 0, 0, 0]
        assert track.coordinates[row] == pytest.approx(q, abs=1e-15)
        assert track.transforms[row] == pytest.approx(frames_of(robot, q), abs=1e-14)
        assert track.closure_mismatch[row] == pytest.approx([4e-3, 3e-7, 7e-3])


def test_what_cannot_be_reached_stops_on_the_straight_line_to_it():
    """Of three hinges in a plane, place and turn: in parts as progress says.

    The last step is 1e-5 of the way, 1 m and 1 rad.
    """
    robot = Robot("arm", "hand", (
        Frame("a", joint="revolute", actuated=True, position=0.4),
        Frame("b", "a", [0.5, 0, 0], joint="revolute", actuated=True, position=0.9),
        Frame("c", "b", [0.4, 0, 0], joint="revolute", actuated=True, position=-0.6),
        Frame("hand", "c", [0.1, 0, 0]),
    ))  # fmt: skip
    home = frames_of(robot, robot.positions)[3]
    begin = np.array([home[0, 3], home[1, 3], 0.7])
    goal = begin + [0.8, -0.3, 0.5]
    pose = np.full((2, 6), np.nan)
    pose[:, [0, 1, 5]] = goal, begin + 0.1 * (goal - begin)
    track = follow(robot, robot.positions, Target(pose=pose))
    assert track.reached.tolist() == [False, True]
    assert 0.1 < track.progress[0] < 1
    wanted = begin + np.outer([track.progress[0], 0.1], goal - begin)
    T = track.transforms[:, 3]
    found = np.c_[T[:, 0, 3], T[:, 1, 3], np.arctan2(T[:, 1, 0], T[:, 0, 0])]
    assert found[1] == pytest.approx(wanted[1], abs=1e-9)
    assert found[0] == pytest.approx(wanted[0], abs=2e-4)
    # there the arm without its hand is straight
    wrist = T[0, :2, 3] - 0.1 * T[0, :2, 0]
    assert np.hypot(*wrist) == pytest.approx(0.9, abs=1e-4)


def test_both_poses_and_coordinates_are_followed_together():
    """A drive held and one component asked: the other drive closes."""
    robot = five_bar()
    home = follow(robot, robot.positions, Target(coordinates=np.full((1, 8), np.nan)))
    pose, held = np.full((1, 6), np.nan), np.full((1, 8), np.nan)
    pose[0, 0] = home.transforms[0, robot.index("right.tip"), 0, 3] + 0.02
    held[0, 0] = robot.positions[0] + 0.03
    track = follow(robot, robot.positions, Target(pose, held))
    assert track.reached[0]
    assert track.coordinates[0, 0] == held[0, 0]
    tip = track.transforms[0, robot.index("right.tip")]
    assert tip[0, 3] == pytest.approx(pose[0, 0], abs=1e-9)
    assert track.mismatch[0] < 1e-9


BALL = Robot("ball", "body", (
    *(
        Frame(f"slide{k}", f"slide{k - 1}" if k else "base", rotation=turn,
              joint="prismatic", actuated=True)
        for k, turn in enumerate([[0, np.pi / 2, 0], [-np.pi / 2, 0, 0], [0, 1.1, 0]])
    ),
    *(
        Frame(f"turn{k}", f"turn{k - 1}" if k else "slide2", rotation=turn,
              joint="revolute", actuated=True)
        for k, turn in enumerate([[0, 0.3, 0], [np.pi / 2, 0, 0], [0, np.pi / 2, 0]])
    ),
    Frame("body", "turn2", [0.1, 0.0, 0.2]),
))  # fmt: skip


@pytest.mark.parametrize("given", ["all", "turns", "place"])
def test_a_free_body_is_turned_and_put_where_it_is_told(given, rng):
    """Rotation vectors by scipy, from no turn to nearly half a turn about any axis."""
    robot = BALL
    axes = rng.normal(size=(60, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    angles = np.r_[0.0, 1e-9, 1e-4, 3.1, np.pi - 1e-7, rng.uniform(0.1, 3.0, 55)]
    wanted = np.full((60, 6), np.nan)
    if given != "turns":
        wanted[:, :3] = 0.3 * rng.normal(size=(60, 3))
    if given != "place":
        wanted[:, 3:] = axes * angles[:, None]
    track = follow(robot, np.zeros(7), Target(pose=wanted))
    # its own joints may be locked on the way; most are not
    assert track.reached.sum() > 40
    T = track.transforms[track.reached, robot.index("body")]
    wanted = wanted[track.reached]
    if given != "turns":
        np.testing.assert_allclose(T[:, :3, 3], wanted[:, :3], rtol=0, atol=EXACT)
    if given != "place":
        R = Rotation.from_rotvec(wanted[:, 3:]).as_matrix()
        np.testing.assert_allclose(T[:, :3, :3], R, rtol=0, atol=1e-8)


def test_one_component_of_a_turn_is_that_of_scipys_vector(rng):
    """The others are left open; beside a place."""
    robot = BALL
    wanted = np.full((12, 6), np.nan)
    wanted[:, :3] = 0.2 * rng.normal(size=(12, 3))
    wanted[np.arange(12), 3 + np.arange(12) % 3] = rng.uniform(-0.8, 0.8, 12)
    track = follow(robot, np.zeros(7), Target(pose=wanted))
    assert track.reached.sum() > 6
    T = track.transforms[track.reached, robot.index("body")]
    wanted = wanted[track.reached]
    vectors = Rotation.from_matrix(T[:, :3, :3]).as_rotvec()
    found = np.c_[T[:, :3, 3], vectors]
    asked = np.isfinite(wanted)
    np.testing.assert_allclose(found[asked], wanted[asked], rtol=0, atol=1e-8)


def test_nothing_is_reached_where_nothing_can_close():
    """The two bars are 0.1 m too short for the crank's place."""
    robot = Robot("short", "end", (
        Frame("crank", joint="revolute", actuated=True),
        Frame("elbow", "crank", [CRANK, 0, 0], joint="revolute"),
        Frame("end", "elbow", [0.2, 0, 0]),
        Frame("rocker", translation=[GROUND, 0, 0], joint="revolute",
              position=np.pi),
        Frame("wrist", "rocker", [0.2, 0, 0], joint="revolute", position=np.pi),
        Frame("seat", "wrist"),
    ), (("end", "seat"),))  # fmt: skip
    start = np.array(robot.positions) + [0, 0.1, 0, -0.1, 0, 0]
    for guess in (True, False):
        assert not follow(robot, start, held_at(robot, crank=0.0), guess).reached[0]


def test_what_a_target_leaves_open_is_still_followed():
    """Two drives of a five-bar and one coordinate asked: any elbow would do."""
    robot, pose = five_bar(), np.full((1, 6), np.nan)
    pose[0, 0] = 0.01
    track = follow(robot, robot.positions, Target(pose=pose))
    assert track.reached[0]
    assert track.transforms[0, robot.index("right.tip"), 0, 3] == pytest.approx(0.01)
    assert track.mismatch[0] < 1e-9
