"""Poses of the frames of a robot at a posture, and maps of small screws.

======  ==================  ============  =========================================
symbol  code                shape         meaning
======  ==================  ============  =========================================
q       ``coordinates``     (..., n)      joint coordinates [rad or m]
T       ``transforms``      (..., n,4,4)  frames seen from the base, without own motion
M_j     ``paths``           (..., n,6,6)  eqs (13)-(15): map from a screw at frame j, in
                                          its axes, to the platform, in base axes
======  ==================  ============  =========================================

The index in eq. (14) of the paper is wrong by one, because the product down to h = j
maps a screw in frame ant(j). ``paths`` maps a screw in frame j, ``[R 0; [p_j - p]x R,
R]``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.closure_rates import redundant_drives
from forcefit.assembly.kinematics.modes import follow_in_mode
from forcefit.assembly.kinematics.nominal import NOT_CLOSED, Target, follow, size_of
from forcefit.assembly.kinematics.singular_posture import is_singular
from forcefit.assembly.kinematics.track import Track
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.results.display import (
    Figures,
    brief,
    html_table,
    pose_text,
    short_repr,
    show,
)
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, screw_map

POSE = ("tx", "ty", "tz", "rx", "ry", "rz")
_HOME_TOLERANCE = 1e-6  # [rad, m] largest mismatch at home due to rounded files
# largest mismatch relative to the reference length, for small robots
_SMALL = 1e-5


@dataclass(frozen=True, eq=False)
class Posture:
    """One or many postures at which the nominal geometry of a robot closes.

    The arrays of many postures, see :func:`together`, begin with a leading axis.

    Attributes:
        robot: the manipulator.
        coordinates: (..., n) [rad or m] coordinate of every joint, 0 for fixed joints.
        transforms: (..., n, 4, 4) frames seen from the base, without imperfections.
        mismatch: (...) [rad, m] largest nominal closure error, which is caused by
            rounded numbers in the file and neglected.
    """

    robot: Robot
    coordinates: NDArray
    transforms: NDArray
    mismatch: Any

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr
    show = show

    def _figures(self) -> Figures:
        """Return the pose of the platform and the coordinates of the drives."""
        if self.transforms.ndim > 3:
            return {"postures": str(self.transforms.shape[:-3])}
        frames = self.robot.frames
        drives = [
            f"{f.name} {x:.6g}" for f, x in zip(frames, self.coordinates, strict=True)
            if f.actuated
        ]  # fmt: skip
        return {
            "pose": pose_text(self.pose()),
            "drives": f"{brief(', '.join(drives)) or 'none'} [rad, m]",
            "frames": str(len(frames)),
            "nominal mismatch": f"{self.mismatch:.2g} rad, m",
        }

    def __getitem__(self, rows: Any) -> "Posture":
        """Return one of many postures by its index, or a selection."""
        mismatch = np.broadcast_to(self.mismatch, self.transforms.shape[:-3])[rows]
        return replace(
            self, coordinates=self.coordinates[rows], transforms=self.transforms[rows],
            mismatch=mismatch if np.ndim(mismatch) else float(mismatch),
        )  # fmt: skip

    @cached_property
    def platform(self) -> NDArray:
        """Nominal platform pose in base axes, (..., 4, 4)."""
        return self.transforms[..., self.robot.index(self.robot.platform), :, :]

    @cached_property
    def paths(self) -> NDArray:
        """Maps of screws at each frame to the platform, base axes, (..., n, 6, 6)."""
        platform = self.robot.index(self.robot.platform)
        if self.transforms.ndim > 3:
            return _paths(Unchanged(self.transforms), platform)
        return _maps_to(self.transforms, platform)

    @property
    def distinct(self) -> "tuple[Posture, NDArray]":
        """Distinct postures, and the index of each posture among them."""
        coordinates, transforms, which = _distinct(
            Unchanged(self.coordinates), Unchanged(self.transforms)
        )
        distinct = replace(self, coordinates=coordinates, transforms=transforms)
        return distinct, which

    def pose(self) -> dict[str, float]:
        """Return the nominal platform pose by component, with a rotation vector."""
        return dict(zip(POSE, pose_components(self.platform).tolist(), strict=True))


def together(postures: Sequence[Posture]) -> Posture:
    """Combine k postures of one robot into one object.

    Args:
        postures: k postures, k > 0.

    Returns:
        The postures with a leading axis.

    Raises:
        TypeError: a robot was passed instead of postures.
    """
    if isinstance(postures, Robot):
        raise TypeError(
            f"found the robot {quoted(postures.name)}, expected a posture of it, such "
            "as forcefit.place_robot(robot)"
        )
    return Posture(
        postures[0].robot, np.array([p.coordinates for p in postures]),
        np.array([p.transforms for p in postures]),
        np.array([p.mismatch for p in postures]),
    )  # fmt: skip


@dataclass(frozen=True)
class Unchanged:
    """Read-only array for cached results."""

    numbers: NDArray

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Unchanged) and other.numbers is self.numbers

    def __hash__(self) -> int:
        return id(self.numbers)


def _maps_to(transforms: NDArray, platform: int) -> NDArray:
    """Return the maps of screws at each frame to the platform, (..., n, 6, 6)."""
    offsets = transforms[..., :3, 3] - transforms[..., platform, None, :3, 3]
    return screw_map(offsets, transforms[..., :3, :3])


@lru_cache(maxsize=2)
def _paths(transforms: Unchanged, platform: int) -> NDArray:
    """Return the maps at many postures, cached by the transforms."""
    paths = _maps_to(transforms.numbers, platform)
    paths.flags.writeable = False
    return paths


@lru_cache(maxsize=8)
def _distinct(
    coordinates: Unchanged, transforms: Unchanged
) -> tuple[NDArray, NDArray, NDArray]:
    """Return the distinct postures, and the index of each given posture."""
    q = coordinates.numbers
    _, first, which = np.unique(q, axis=0, return_index=True, return_inverse=True)
    return q[first], transforms.numbers[first], which.reshape(-1)


@lru_cache(maxsize=8)
def _digest(array: Unchanged) -> bytes:
    """Return the hash of the numbers of an array."""
    return blake2b(np.ascontiguousarray(array.numbers).tobytes()).digest()


@dataclass(frozen=True)
class Content:
    """Cache key, equal for postures and arrays with equal numbers."""

    digest: bytes
    postures: Posture = field(compare=False)
    arrays: tuple[NDArray, ...] = field(compare=False)


def content_of(
    postures: Posture, arrays: tuple[NDArray, ...], names: object
) -> Content:
    """Return a cache key for results that depend only on postures and arrays.

    Args:
        postures: one or many postures; the key contains their transforms and the
            parents of their frames.
        arrays: arrays of numbers.
        names: other data on which the result depends, compared by ``repr``.

    Returns:
        The key with references to the given objects.
    """
    digest = blake2b(repr((names, [a.shape for a in arrays])).encode())
    for array in (postures.robot.parents, *arrays):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(_digest(Unchanged(postures.transforms)))
    return Content(digest.digest(), postures, arrays)


def pose_components(T: NDArray) -> NDArray:
    """Return ``[tx ty tz rx ry rz]`` (..., 6) of transforms, see :data:`POSE`."""
    return np.concatenate([T[..., :3, 3], rotation_vector(T[..., :3, :3])], axis=-1)


@lru_cache(maxsize=64)
def home_posture(robot: Robot) -> Posture:
    """Return the posture of a robot at home, with drives at their ``position``.

    Args:
        robot: any robot.

    Returns:
        The posture.

    Raises:
        BadInput: the mismatch of a closure exceeds 1e-6 rad or m, or 1e-5 times the
            length of the longest body if this is smaller.
    """
    actuated = np.array([f.actuated for f in robot.frames])
    held = np.where(actuated, robot.positions, np.nan)
    track = follow(robot, robot.positions, Target(coordinates=held[None]), guess=True)
    turned, shifted = _left_open(robot, track.transforms[0])
    least = min(_HOME_TOLERANCE, _SMALL * size_of(robot))
    beyond = ~((turned < _HOME_TOLERANCE) & (shifted < least))
    if beyond.any():
        excess = np.maximum(turned / _HOME_TOLERANCE, shifted / least)
        k = int(np.argmax(np.where(beyond, np.nan_to_num(excess, nan=np.inf), 0.0)))
        a, b = robot.closures[k]
        way_out = _way_out(robot, track.transforms[0], float(track.mismatch[0]))
        raise BadInput(
            f'{robot.name}: closure[{k + 1}] ("{a}", "{b}") is open in the home pose: '
            f"found a gap of {_either(turned[k], shifted[k], least)}"
            f"{way_out}; with --rest NAME, the gap becomes a geometric error of a frame"
        )
    return _posture(robot, track, 0)


def _left_open(robot: Robot, T: NDArray) -> tuple[NDArray, NDArray]:
    """Return the largest rotation error [rad] and translation error [m] of closures."""
    pairs = [[robot.index(name) for name in pair] for pair in robot.closures]
    first, second = (T[[pair[k] for pair in pairs]] for k in (0, 1))
    between = first[:, :3, :3] @ np.swapaxes(second[:, :3, :3], -1, -2)
    turned = np.abs(rotation_vector(between)).max(axis=-1, initial=0.0)
    return turned, np.abs(first[:, :3, 3] - second[:, :3, 3]).max(axis=-1, initial=0.0)


def _either(turned: float, shifted: float, least: float) -> str:
    """Format the translation or, if it is small, the rotation of a mismatch."""
    if shifted < least:
        return f"{turned:.3g} rad with locked drives, expected < 1e-06 rad"
    return f"{shifted:.3g} m with locked drives, expected < {least:.3g} m"


def _way_out(robot: Robot, T: NDArray, left_open: float = 0.0) -> str:
    """Return advice on redundant drives; empty if the robot has none."""
    count = redundant_drives(robot, T, left_open)
    if count <= 0:
        return ""
    drives = sum(f.actuated for f in robot.frames)
    return (
        f"; {count} of {drives} drives are redundant: with --mismatch spring, "
        "elastic drives close the gap"
    )


@lru_cache(maxsize=64)
def home_is_singular(robot: Robot) -> bool:
    """Return whether the home posture is singular."""
    home = home_posture(robot)
    return is_singular(robot, home.coordinates, home.transforms)


def place_robot(
    robot: Robot,
    pose: Mapping[str, float] | None = None,
    joints: Mapping[str, float] | None = None,
) -> Posture:
    """Return the posture for a nominal platform pose, or for actuated coordinates.

    The robot moves from the home pose along a straight line, so the assembly mode of
    the home pose is preserved. Undetermined components remain near their home values.
    If the home pose is singular, unspecified components are fixed at their home values
    if possible. The rotation is fixed before the translation.

    Args:
        robot: any robot.
        pose: translation ``tx ty tz`` [m] and rotation vector ``rx ry rz`` [rad] of the
            platform in base axes; unspecified components are free.
        joints: coordinates [rad or m] of actuated joints by frame; all other actuated
            joints stay at their ``position``.

    Returns:
        The posture.

    Raises:
        BadInput: both arguments are given, a name is unknown, a value is not finite, or
            the pose cannot be reached.
    """
    if pose and joints:
        raise BadInput("found both a pose and joints, expected only one of the two")
    if joints:
        target = joint_target(robot, joints)
    elif pose:
        target = pose_target(pose)
    else:
        return home_posture(robot)
    track = _follow(robot, target)
    if not track.reached[0]:
        raise BadInput(f"{robot.name}: {unreached(robot, track, target, 0)}")
    return _posture(robot, track, 0)


def pose_target(pose: Mapping[str, float]) -> Target:
    """Return a single platform pose as a target; see :func:`place_robot`."""
    goal = np.full((1, 6), np.nan)
    for name, value in pose.items():
        if name not in POSE:
            hint = nearest(name, POSE)
            raise BadInput(f'pose: unknown component "{name[:60]}"{hint}')
        goal[0, POSE.index(name)] = _finite(f"pose.{name}", value, LARGEST_LENGTH)
    return Target(pose=goal)


def joint_target(robot: Robot, joints: Mapping[str, float]) -> Target:
    """Return the actuated coordinates as a target; see :func:`place_robot`."""
    actuated = [f.name for f in robot.frames if f.actuated]
    goal = np.where([f.actuated for f in robot.frames], robot.positions, np.nan)
    for name, value in joints.items():
        if name not in actuated:
            hint = nearest(name, actuated)
            raise BadInput(f'joints: no actuated joint "{name[:60]}"{hint}')
        goal[robot.index(name)] = _finite(f"joint {name}", value, LARGEST_LENGTH)
    return Target(coordinates=goal[None])


def _finite(whose: str, value: float, largest: float) -> float:
    """Return the value; raise BadInput if it is not finite or too large."""
    if not np.isfinite(value):
        raise BadInput(f"{whose}: found {value}, expected a finite number")
    if abs(value) > largest:
        expected = f"expected a number of size at most {largest:g}"
        raise BadInput(f"{whose}: found {value:g}, {expected}")
    return float(value)


def place_many(
    robot: Robot, poses: ArrayLike
) -> tuple[list[Posture | None], list[str]]:
    """Return the postures of many nominal platform poses, computed together.

    Args:
        robot: any robot.
        poses: (k, 6) ``[tx ty tz rx ry rz]`` [m, rad], NaN for free components.

    Returns:
        Two lists with one entry for each pose: the posture, or None if the pose cannot
        be reached; and the reason for the failure, or an empty string.

    Raises:
        BadInput: a loop of the robot is open in its home pose.
    """
    return _follow_many(robot, Target(pose=np.asarray(poses, dtype=float)))


def place_many_joints(
    robot: Robot, coordinates: ArrayLike
) -> tuple[list[Posture | None], list[str]]:
    """Return the postures of many sets of actuated coordinates, computed together.

    Args:
        robot: robot of n frames.
        coordinates: (k, n) [rad or m] prescribed joint coordinates, NaN for free
            joints.

    Returns:
        Postures and reasons, see :func:`place_many`.

    Raises:
        BadInput: a loop of the robot is open in its home pose.
    """
    return _follow_many(robot, Target(coordinates=np.asarray(coordinates, dtype=float)))


def _follow_many(
    robot: Robot, target: Target
) -> tuple[list[Posture | None], list[str]]:
    """Return the posture of each target, or None, and the reason of each failure."""
    track = _follow(robot, target)
    postures = [
        _posture(robot, track, i) if reached else None
        for i, reached in enumerate(track.reached)
    ]
    reasons = [
        "" if reached else unreached(robot, track, target, i)
        for i, reached in enumerate(track.reached)
    ]
    return postures, reasons


def _follow(robot: Robot, target: Target) -> Track:
    """Move from home to the targets within one operation mode."""
    home = home_posture(robot)
    pose = pose_components(home.platform)
    singular = home_is_singular(robot)
    return follow_in_mode(robot, home.coordinates, pose, target, singular)


def unreached(robot: Robot, track: Track, target: Target, i: int) -> str:
    """Return a message about a target that was not reached."""
    if target.pose is None:
        remaining = (1.0 - track.progress[i]) * 100
        return (
            "these joint coordinates cannot be reached: the closures fail "
            f"{remaining:.3g} % of the path before the target; "
            f"{NOT_CLOSED}{_way_out(robot, home_posture(robot).transforms)}"
        )
    goal = target.pose[i]
    reached = pose_components(track.transforms[i, robot.index(robot.platform)])
    given = [k for k in range(6) if np.isfinite(goal[k])]
    asked = ", ".join(f"{POSE[k]}={goal[k]:.6g}" for k in given)
    why = NOT_CLOSED
    if len(given) < len(POSE) and home_is_singular(robot):
        why += "; home is a singular posture: specify all six components of the pose"
    gap = np.array([
        goal[k] - reached[k] if np.isfinite(goal[k]) else 0.0 for k in range(6)
    ])
    parts = []
    if any(k < 3 for k in given):
        parts.append(f"{np.linalg.norm(gap[:3]):.6g} m")
    if any(k >= 3 for k in given):
        between = rotation_matrix(goal[3:]) @ rotation_matrix(reached[3:]).T
        full = np.isfinite(goal[3:]).all()
        angle = np.linalg.norm(rotation_vector(between) if full else gap[3:])
        parts.append(f"{angle:.6g} rad")
    stop = ", ".join(f"{POSE[k]}={reached[k]:.6g}" for k in given)
    return (
        f"pose {asked} cannot be reached: on the straight line from home the platform "
        f"stops at {stop}, {' and '.join(parts)} short; {why}"
    )


def _posture(robot: Robot, track: Track, i: int) -> Posture:
    """Return the end of a track as a posture with read-only arrays."""
    q, T = track.coordinates[i].copy(), track.transforms[i].copy()
    q.setflags(write=False)
    T.setflags(write=False)
    mismatch = track.closure_mismatch[i].max(initial=0.0)
    return Posture(robot, q, T, float(mismatch))
