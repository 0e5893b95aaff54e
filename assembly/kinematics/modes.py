"""Continuation from a singular home pose, where several operation modes meet.

At such a pose, neither drive coordinates nor a partially specified platform pose
determine the operation mode.  Unspecified pose components are therefore fixed at their
home values if possible: first all components, then the rotation, then the translation.
"""

from dataclasses import fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.track import Track
from forcefit.assembly.model.robot import Robot

# [rad, m] largest error of closures and pose for a reached target
_CLOSED = 1e-8
# pose components [tx ty tz rx ry rz] that each attempt fixes at their home values
_KEPT = (range(6), range(3, 6), range(3))


def follow_in_mode(
    robot: Robot, home: NDArray, pose: NDArray, target: Target, singular: bool
) -> Track:
    """Move the robot from home to many targets within one operation mode.

    Args:
        robot: robot of n frames.
        home: (n,) [rad or m] joint coordinates of the home pose.
        pose: (6,) ``[tx ty tz rx ry rz]`` [m, rad] of the platform at home.
        target: k poses or sets of coordinates.
        singular: whether home is a singular pose.  If False, unspecified components are
            fixed only at targets that cannot be reached otherwise.

    Returns:
        The end points of the motions, and the completed fraction of each path.
    """
    kept = _KEPT if target.pose is not None else _KEPT[1:]
    held = [_held(target, pose, components) for components in kept]
    tries = [*held, target] if singular else [target, *held[: target.pose is not None]]
    track = follow(robot, home, tries[0])
    for last, now in pairwise(tries):
        closed = np.inf if last is target else _CLOSED
        waiting = np.flatnonzero(~(track.reached & (track.mismatch < closed)))
        if not waiting.size:
            break
        _try(robot, home, now.rows(waiting), track, waiting, now is target)
    return track


def _held(target: Target, pose: NDArray, kept: range) -> Target:
    """Set selected unspecified components to their home values."""
    goal = np.full((len(target), 6), np.nan)
    if target.pose is not None:
        goal = np.array(target.pose, dtype=float)
    stays = np.isnan(goal) & np.isin(range(6), kept)
    return Target(np.where(stays, pose, goal), target.coordinates)


def _try(
    robot: Robot, home: NDArray, target: Target, track: Track, rows: NDArray,
    whatever: bool,
) -> None:  # fmt: skip
    """Move to modified targets, and store the reached targets."""
    found = follow(robot, home, target)
    good = whatever | (found.reached & (found.mismatch < _CLOSED))
    for one in fields(Track):
        getattr(track, one.name)[rows[good]] = getattr(found, one.name)[good]
