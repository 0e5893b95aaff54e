"""Accuracy of a written robot: comparison in random postures."""

import numpy as np

from assembly.exchange.as_robot import RobotAndMechanism
from assembly.exchange.mechanism import body_poses
from assembly.exchange.tree import place_frames
from assembly.kinematics.nominal import KINDS
from assembly.model.robot import BASE
from forcefit.inputs.errors import BadInput

FAITHFUL = 1e-12  # [rad, lengths] largest difference of a body's pose
_POSTURES = 100


def largest_difference(placed: RobotAndMechanism) -> float:
    """Return the largest difference of bodies' poses, in random postures.

    All joints of the trees are moved, within 1 rad or m of home; loops need not close.

    Args:
        placed: robot and mechanism, one of them read back from a file.

    Returns:
        Largest difference of any entry of a body's transform; lengths are divided by
        the largest distance from the base if that is above 1 m.

    Raises:
        BadInput: one of the two has joints that the other lacks.
    """
    robot, mechanism = placed.robot, placed.mechanism
    moving = [joint.name for joint in mechanism.joints if joint.kind != "fixed"]
    rows = {f.name: i for i, f in enumerate(robot.frames) if f.joint != "fixed"}
    lost = sorted(set(rows) ^ set(moving))
    if lost:
        raise BadInput(f"{robot.name}: joint {lost[0]} was lost in conversion")
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
            if frame == BASE:  # the root, independent of its name
                continue
            gap = (poses[name] - frames[frame] @ at)[:3] * scale
            worst = max(worst, float(np.abs(gap).max()))
    return worst
