"""Continuation to several targets side by side: where each ends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.nominal import Target, follow
from assembly.kinematics.posture import home_posture, pose_components
from assembly.model.robot import Frame, Robot
from assembly.robots import BUILT_IN


def targets_of(home, rng, count=40):
    """Drives, the poses to which they lead, parts of these, and poses of any kind."""
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
def test_every_target_that_is_reached_is_where_it_was_sent(name, rng):
    """With closures that hold; reached again from there in one step."""
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
    """Coordinates and places of the platform that are held are attained."""
    platform = track.transforms[:, robot.index(robot.platform), :3, 3]
    held = [] if target.pose is None else [target.pose[:, :3] - platform]
    if target.coordinates is not None:
        held.append(target.coordinates - track.coordinates)
    for off in held:
        assert np.nanmax(np.abs(off[track.reached]), initial=0.0) < 1e-6


def test_a_target_does_not_depend_on_its_neighbours(rng):
    """To the last bit: alone, in another order, among others that ask for more."""
    home = home_posture(BUILT_IN["irsbot2"]())
    poses = targets_of(home, rng)[
        2
    ].pose  # which parts are free differs from row to row
    together = follow(home.robot, home.coordinates, Target(pose=poses))
    order = rng.permutation(len(poses))
    shuffled = follow(home.robot, home.coordinates, Target(pose=poses[order]))
    assert np.array_equal(shuffled.coordinates, together.coordinates[order])
    assert np.array_equal(shuffled.transforms, together.transforms[order])
    for i in range(0, len(poses), 7):
        alone = follow(home.robot, home.coordinates, Target(pose=poses[i : i + 1]))
        assert np.array_equal(alone.coordinates[0], together.coordinates[i])
        assert alone.progress[0] == together.progress[i]


def test_joints_turn_as_far_as_they_are_told(rng):
    """Scipy's rotation about z, from no turn to more than the polynomials carry."""
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


def test_no_targets_are_no_tracks():
    home = home_posture(BUILT_IN["five_bar"]())
    track = follow(home.robot, home.coordinates, Target(pose=np.zeros((0, 6))))
    assert track.coordinates.shape == (0, len(home.robot.frames))
    assert track.reached.shape == (0,)
