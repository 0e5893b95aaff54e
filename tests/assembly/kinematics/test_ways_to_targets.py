"""End points and assembly modes of motions to one or many targets."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import (
    home_posture,
    place_many,
    place_many_joints,
    place_robot,
    pose_components,
)
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots import BUILT_IN, load_robot
from tests.linkages_for_tests import five_bar

# [rad, m] closure tolerance, 1e-10 of the longest body, with a margin of 10
EXACT = 1e-9


def test_postures_of_many_targets_equal_single_postures():
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
def test_direct_motion_ends_at_the_same_posture_as_short_motions(name):
    """A direct motion has the same end as 40 successive short motions."""
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


def test_ball_joint_angles_near_gimbal_lock_are_continuous():
    """Near gimbal lock, a large step could change two angles by half a turn."""
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


def test_poses_for_joint_targets_agree_with_inverse_kinematics():
    """The poses follow from the law of cosines.

    With both arms outward, the elbows are 0.9 m apart, and two bars of 0.4 m are too
    short.
    """
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
def test_unspecified_pose_components_do_not_depend_on_round_off(name):
    """The targets differ by round-off."""
    robot = load_robot(name)
    tx = place_robot(robot).pose()["tx"] + 0.06
    first, *others = (
        place_robot(robot, {"tx": tx * (1 + k * np.finfo(float).eps)}).coordinates
        for k in range(5)
    )
    assert all(np.abs(first - other).max() < 1e-6 for other in others)


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
def test_free_body_reaches_the_requested_pose(given, rng):
    """Rotations are up to nearly half a turn about any axis."""
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
    # Some targets cannot be reached because of gimbal lock.
    assert track.reached.sum() > 40
    T = track.transforms[track.reached, robot.index("body")]
    wanted = wanted[track.reached]
    if given != "turns":
        np.testing.assert_allclose(T[:, :3, 3], wanted[:, :3], rtol=0, atol=EXACT)
    if given != "place":
        R = Rotation.from_rotvec(wanted[:, 3:]).as_matrix()
        np.testing.assert_allclose(T[:, :3, :3], R, rtol=0, atol=1e-8)


def targets_of(home, rng, count=40):
    """Return drive coordinates, the resulting poses, partial and arbitrary poses."""
    robot, n = home.robot, len(home.robot.frames)
    moving = [j for j, frame in enumerate(robot.frames) if frame.joint != "fixed"]
    driven = [j for j in moving if robot.frames[j].actuated] or moving[:2]
    drives = np.full((count, n), np.nan)
    drives[:, driven] = home.coordinates[driven] + 0.3 * rng.normal(
        size=(count, len(driven))
    )
    track = follow(robot, home.coordinates, Target(coordinates=drives))
    poses = pose_components(track.transforms[:, robot.index(robot.platform)])
    some = poses.copy()
    some[:, rng.permutation(6)[:3]] = np.nan
    mixed = np.where(rng.random(poses.shape) < 0.3, np.nan, poses)
    anywhere = poses + rng.normal(size=(count, 6)) * [*[0.1] * 3, *[0.3] * 3]
    return [Target(pose=p) for p in (poses, some, mixed, anywhere)] + [
        Target(coordinates=drives), Target(pose=some, coordinates=drives)
    ]  # fmt: skip


@pytest.mark.parametrize("name", BUILT_IN)
def test_reached_targets_satisfy_the_request_and_the_closures(name, rng):
    """A second motion from the reached posture requires a single step."""
    home = home_posture(BUILT_IN[name]())
    reached = 0
    for target in targets_of(home, rng):
        track = follow(home.robot, home.coordinates, target)
        assert_sent_there(home.robot, target, track)
        assert track.mismatch[track.reached].max(initial=0.0) < 1e-9
        reached += np.count_nonzero(track.reached)
        for i in np.flatnonzero(track.reached)[::9].tolist():
            own = target.rows(np.array([i]))
            again = follow(home.robot, track.coordinates[i], own, guess=True)
            assert again.reached[0]
            gap = np.abs(again.coordinates[0] - track.coordinates[i])
            assert gap.max() < 1e-6
    assert reached


def assert_sent_there(robot, target, track):
    """Assert that all prescribed coordinates and pose components are reached."""
    platform = track.transforms[:, robot.index(robot.platform), :3, 3]
    held = [] if target.pose is None else [target.pose[:, :3] - platform]
    if target.coordinates is not None:
        held.append(target.coordinates - track.coordinates)
    for off in held:
        assert np.nanmax(np.abs(off[track.reached]), initial=0.0) < 1e-6


def test_end_point_does_not_depend_on_other_targets(rng):
    """End points are bit-identical for single targets and in another order."""
    home = home_posture(BUILT_IN["irsbot2"]())
    # The free components differ between targets.
    poses = targets_of(home, rng)[2].pose
    together = follow(home.robot, home.coordinates, Target(pose=poses))
    order = rng.permutation(len(poses))
    shuffled = follow(home.robot, home.coordinates, Target(pose=poses[order]))
    assert np.array_equal(shuffled.coordinates, together.coordinates[order])
    assert np.array_equal(shuffled.transforms, together.transforms[order])
    for i in range(0, len(poses), 7):
        alone = follow(home.robot, home.coordinates, Target(pose=poses[i : i + 1]))
        assert np.array_equal(alone.coordinates[0], together.coordinates[i])
        assert alone.progress[0] == together.progress[i]


def test_joint_rotation_equals_scipy_for_any_angle(rng):
    """Angles outside the range of the polynomials are included."""
    robot = Robot("wheel", "rim", (Frame("rim", joint="revolute"), Frame("end", "rim")))
    angles = np.r_[
        rng.uniform(-10, 10, 200), rng.uniform(-9e4, 9e4, 200), 0.0, 1e-300,
        np.pi * np.arange(-8, 9) / 4, 3e5, -1e9,
    ]  # fmt: skip
    held = np.full((len(angles), 2), np.nan)
    held[:, 0] = angles
    track = follow(robot, np.zeros(2), Target(coordinates=held), guess=True)
    expected = Rotation.from_rotvec(angles[:, None] * [0.0, 0.0, 1.0]).as_matrix()
    np.testing.assert_allclose(track.transforms[:, 1, :3, :3], expected, atol=4e-16)
