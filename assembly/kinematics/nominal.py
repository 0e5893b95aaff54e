"""Solve the nominal closures for the joint coordinates.

The robot moves to each target along a straight line from the home pose, by damped
Gauss-Newton steps of minimum norm.  Coordinates that closures and target do not
determine therefore do not change.  The iterations are compiled, see
:mod:`forcefit.assembly.kinematics.continuation_side_by_side`.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.continuation_side_by_side import (
    follow_side_by_side,
    tree_of,
)
from forcefit.assembly.kinematics.track import Track
from forcefit.assembly.model.robot import Robot

# codes of joint types in C++; a helical joint is a revolute joint with a lead
KINDS = {"fixed": 0, "revolute": 1, "prismatic": 2, "helical": 1}
NOT_CLOSED = "expected a configuration in which all loops close"


@dataclass(frozen=True, eq=False)
class Target:
    """Targets of a motion from home: poses or coordinates, NaN for free components.

    Attributes:
        pose: (k, 6) ``[tx ty tz rx ry rz]`` [m, rad] of the platform, or None.
        coordinates: (k, n) [rad or m] prescribed joint coordinates, or None.
    """

    pose: NDArray | None = None
    coordinates: NDArray | None = None

    def __len__(self) -> int:
        given = self.pose if self.pose is not None else self.coordinates
        return 0 if given is None else len(given)

    def rows(self, which: NDArray) -> "Target":
        """Return a selection of the targets."""
        parts = (self.pose, self.coordinates)
        return Target(*(None if part is None else part[which] for part in parts))


def size_of(robot: Robot) -> float:
    """Return the length of the longest body [m], or 1 if all lengths are zero."""
    lengths = np.linalg.norm(robot.fixed_transforms[:, :3, 3], axis=1)
    return float(lengths.max()) or 1.0


def mobile(robot: Robot) -> NDArray:
    """Return a mask (n,) of joints that are not fixed."""
    return np.array([f.joint != "fixed" for f in robot.frames])


def motion_screws(robot: Robot, T: NDArray) -> NDArray:
    """Return the screws of unit joint motions at the base's origin.

    Args:
        robot: robot of n frames.
        T: (..., n, 4, 4) frames seen from the base.

    Returns:
        (..., n, 6) screws in base axes; zero for fixed joints.
    """
    z, p = T[..., :3, 2], T[..., :3, 3]
    prismatic = np.array([f.joint == "prismatic" for f in robot.frames])[:, None]
    turning = np.concatenate([z, np.cross(p, z)], axis=-1)
    sliding = np.concatenate([np.zeros_like(z), z], axis=-1)
    leads = np.array([f.lead for f in robot.frames])
    if leads.any():
        turning = turning + leads[:, None] * sliding
    return np.where(prismatic, sliding, turning) * mobile(robot)[:, None]


@lru_cache(maxsize=64)
def _tree(robot: Robot) -> dict[str, Any]:
    """Return the fields of the compiled tree of a robot."""
    pairs = [[robot.index(name) for name in pair] for pair in robot.closures]
    # A joint does not move its own frame.
    carries = robot.on_path - np.eye(len(robot.frames))
    moved = [carries[a] - carries[b] for a, b in pairs]
    moved.append(carries[robot.index(robot.platform)])
    moves = [(j, int(signs[j])) for signs in moved for j in np.flatnonzero(signs)]
    return dict(
        parents=np.array(robot.parents),
        kinds=np.array([KINDS[f.joint] for f in robot.frames]),
        fixed=np.array(robot.fixed_transforms),
        leads=np.array([f.lead for f in robot.frames]),
        pairs=np.array(pairs, dtype=int).reshape(-1, 2),
        moves=np.array(moves, dtype=int).reshape(-1, 2),
        groups=np.cumsum([0, *map(np.count_nonzero, moved)]),
        platform=robot.index(robot.platform),
        size=size_of(robot),
    )


@lru_cache(maxsize=64)
def _tree_side_by_side(robot: Robot) -> Any:
    """Return the C++ tree of a robot."""
    return tree_of(_tree(robot))


def follow(robot: Robot, start: NDArray, target: Target, guess: bool = False) -> Track:
    """Move the nominal robot from one configuration to many targets.

    Args:
        robot: robot of n frames.
        start: (n,) joint coordinates with closed loops.
        target: k poses or sets of prescribed coordinates.
        guess: whether the loops can be open at ``start``.  In this case, a single step
            is made.

    Returns:
        The end points of the motions, and the completed fraction of each path.
    """
    tree, start = _tree(robot), np.array(start, dtype=float)
    addresses = _tree_side_by_side(robot)
    count, n = len(target), len(robot.frames)
    held = np.full((count, n), np.nan)
    if target.coordinates is not None:
        held = np.where(tree["kinds"] > 0, target.coordinates, np.nan)
    poses = np.zeros((0, 6)) if target.pose is None else np.array(target.pose, float)
    track = Track(
        np.zeros((count, n)), np.zeros((count, n, 4, 4)), np.zeros(count),
        np.zeros((count, len(tree["pairs"]))),
    )  # fmt: skip
    track.transforms[..., 3, 3] = 1.0
    follow_side_by_side(addresses, start, poses, held, guess, track)
    return track
