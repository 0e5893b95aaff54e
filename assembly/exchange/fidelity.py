"""Comparison of a converted robot with the original in random postures."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.as_robot import RobotAndMechanism
from forcefit.assembly.exchange.mechanism import body_poses
from forcefit.assembly.exchange.tree import place_frames
from forcefit.assembly.kinematics.nominal import KINDS
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.inputs.errors import BadInput

FAITHFUL = 1e-12  # [rad, m] largest accepted difference of body poses
_POSTURES = 100


def largest_difference(placed: RobotAndMechanism) -> float:
    """Return the largest difference between body poses in random postures.

    All joints are moved by up to 1 rad or 1 m from the home pose.  The loops are not
    closed.

    Args:
        placed: robot and mechanism, one of which was read back from a file.

    Returns:
        Largest difference between entries of the body transforms.  Lengths are divided
        by the largest distance from the base if it exceeds 1 m.

    Raises:
        BadInput: a joint exists in only one of the two robots.
    """
    robot, mechanism = placed.robot, placed.mechanism
    moving = [joint.name for joint in mechanism.joints if joint.kind != "fixed"]
    rows = {f.name: i for i, f in enumerate(robot.frames) if f.joint != "fixed"}
    lost = sorted(set(rows) ^ set(moving))
    if lost:
        raise BadInput(
            f"{robot.name}: found joint {lost[0]} in only one of the two robots, "
            "expected it before and after the conversion"
        )
    random, worst = np.random.default_rng(0), 0.0
    kinds = np.array([KINDS[f.joint] for f in robot.frames])
    leads = np.array([f.lead for f in robot.frames])
    for _ in range(_POSTURES):
        shift = random.uniform(-1, 1, len(robot.frames))
        q = np.where(kinds > 0, robot.positions + shift, 0.0)
        _, after = place_frames(robot.parents, kinds, robot.fixed_transforms, q, leads)
        frames = dict(zip((f.name for f in robot.frames), after, strict=True))
        given = [q[rows[j.name]] if j.name in rows else 0.0 for j in mechanism.joints]
        poses = body_poses(mechanism, np.array(given))
        reach = max(1.0, max(np.abs(T[:3, 3]).max() for T in poses.values()))
        scale = np.array([[1.0, 1.0, 1.0, 1 / reach]])
        for name, (frame, at) in placed.places.items():
            if frame == BASE:
                continue
            gap = (poses[name] - frames[frame] @ at)[:3] * scale
            worst = max(worst, float(np.abs(gap).max()))
    return worst


def drawn_difference(robot: Robot, back: Robot, frames: Mapping[str, str]) -> float:
    """Return the largest difference between a robot and its file of format 2.

    Joints with a corresponding frame are moved at random, as in
    :func:`largest_difference`.  Ball, cylindrical and planar joints are not moved.

    Args:
        robot: robot that was written to a file of format 2.
        back: robot that was read back from this file.
        frames: names of joint frames in ``back``, by their names in ``robot``.

    Returns:
        Largest difference between joint positions, joint axes and platform positions.
        Positions are divided by the largest distance from the base if it exceeds 1 m.
    """
    homes = home_posture(robot).coordinates, home_posture(back).coordinates
    rows = [(robot.index(a), back.index(b)) for a, b in frames.items()]
    pairs = [(i, k) for i, k in rows if robot.frames[i].joint != "fixed"]
    same = [(i, k) for i, k in rows if _passes(robot, i, pairs, 0) ==
            _passes(back, k, pairs, 1)]  # fmt: skip
    ends = robot.index(robot.platform), back.index(back.platform)
    reached = _passes(robot, ends[0], pairs, 0) == _passes(back, ends[1], pairs, 1)
    random, worst = np.random.default_rng(0), 0.0
    for _ in range(_POSTURES):
        q, p = (home.copy() for home in homes)
        for i, k in pairs:
            step = random.uniform(-1, 1)
            q[i] += step
            p[k] += step
        T, U = _placed(robot, q), _placed(back, p)
        reach = max(1.0, float(np.abs(T[:, :3, 3]).max()))
        for i, k in [*same, *([ends] if reached else [])]:
            gap = np.abs(T[i, :3, 3] - U[k, :3, 3]).max() / reach
            z = T[i, :3, 2], U[k, :3, 2]
            turned = 0.0 if (i, k) == ends else np.abs(np.cross(*z)).max()
            worst = max(worst, float(gap), float(turned))
    return worst


def _passes(
    robot: Robot, row: int, pairs: Sequence[tuple[int, int]], which: int
) -> tuple[object, ...]:
    """Return the indices in ``pairs`` of all joints on the path from base to frame."""
    numbers = {pair[which]: k for k, pair in enumerate(pairs)}
    passed = np.flatnonzero(robot.on_path[row]).tolist()
    moving = [i for i in passed if i != row and robot.frames[i].joint != "fixed"]
    return tuple(numbers[i] for i in moving if i in numbers)


def _placed(robot: Robot, q: NDArray) -> NDArray:
    """Return the poses of the frames before the motion of their joints, (n, 4, 4)."""
    kinds = np.array([KINDS[f.joint] for f in robot.frames])
    leads = np.array([f.lead for f in robot.frames])
    return place_frames(robot.parents, kinds, robot.fixed_transforms, q, leads)[0]
