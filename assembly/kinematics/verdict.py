"""Check a posture for joint limits and singularities."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import locked_ranks
from forcefit.assembly.kinematics.crossing import beyond_singularity, home_rank
from forcefit.assembly.kinematics.nominal import Target, size_of
from forcefit.assembly.kinematics.posture import (
    Posture,
    home_is_singular,
    home_posture,
    pose_components,
)
from forcefit.assembly.kinematics.singular_posture import is_singular
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import BEYOND_LIMITS, BEYOND_SINGULARITY, SINGULAR

SINGULAR_WORDS = "singular posture: the first-order analysis is inconclusive"
_FAR_SIDE = "not connected to home without passing a singularity"
# [rad, reference lengths] largest accepted excess over a joint limit
_ROUNDING = 1e-8


def verdicts(
    robot: Robot, target: Target, q: NDArray, T: NDArray, near: NDArray | None = None
) -> list[tuple[str, str]]:
    """Return a status and a reason for each posture that was reached.

    Args:
        robot: robot of n frames.
        target: k poses or sets of coordinates.
        q: (k, n) [rad or m] coordinates at the targets.
        T: (k, n, 4, 4) frames at the targets.
        near: (k,) bool, True for postures that are tested for a singularity; None for
            all.

    Returns:
        For each posture :data:`BEYOND_LIMITS`, :data:`SINGULAR` or
        :data:`BEYOND_SINGULARITY`, and the reason; both empty if the posture is usable.
    """
    limits = [limits_passed(robot, coordinates) for coordinates in q]
    near = np.ones(len(q), dtype=bool) if near is None else near
    singular = _singular(robot, q, T, near)
    far = beyond_singularity(robot, target, T)
    texts = []
    for passed, here, there in zip(limits, singular, far, strict=True):
        status, reason = "", ""
        if passed:
            status, reason = BEYOND_LIMITS, passed
        elif here:
            status, reason = SINGULAR, SINGULAR_WORDS
        elif there:
            status, reason = BEYOND_SINGULARITY, _FAR_SIDE
        texts.append((status, reason))
    return texts


def _singular(robot: Robot, q: NDArray, T: NDArray, near: NDArray) -> NDArray:
    """Return True for singular postures, (k,)."""
    singular = near.copy()
    if near.any():
        singular[near] = locked_ranks(robot, T[near]) < home_rank(robot)
    for i in np.flatnonzero(singular).tolist():
        singular[i] = is_singular(robot, q[i], T[i])
    return singular


def limits_passed(robot: Robot, q: NDArray) -> str:
    """Describe the joints that are beyond their limits.

    Args:
        robot: robot of n frames.
        q: (n,) [rad or m] coordinates.

    Returns:
        A text such as ``"leg1.rail at 0.3 m, limits -0.2 to 0.2"``; empty if no joint
        is beyond its limits.
    """
    texts = []
    for frame, value in zip(robot.frames, q.tolist(), strict=True):
        if frame.limits is None:
            continue
        slides = frame.joint == "prismatic"
        room = _ROUNDING * (size_of(robot) if slides else 1.0)
        low, high = frame.limits[0] - room, frame.limits[1] + room
        if frame.passive and frame.joint == "revolute":
            # Full turns are subtracted from the coordinate of a passive joint.
            value -= 2 * np.pi * np.floor((value - low) / (2 * np.pi))
        if not low <= value <= high:
            texts.append(
                f"{frame.name} at {value:.6g} {'m' if slides else 'rad'}, limits "
                f"{frame.limits[0]:g} to {frame.limits[1]:g}"
            )
    return "; ".join(texts)


def posture_remarks(posture: Posture) -> list[str]:
    """Return remarks on a posture, one sentence each.

    Args:
        posture: posture of a robot.

    Returns:
        Remarks on the operation mode if home is singular, on joints beyond their
        limits, and on a singularity between home and the posture.
    """
    robot, q, T = posture.robot, posture.coordinates, posture.transforms
    remarks = []
    home = home_posture(robot)
    if home_is_singular(robot) and np.abs(q - home.coordinates).max() > _ROUNDING:
        remarks.append(
            "home is a singular posture, where operation modes meet; this "
            f"posture belongs to {_mode(home, posture)} (specify the remaining "
            "pose components to select another mode)"
        )
    if passed := limits_passed(robot, q):
        remarks.append(f"beyond the limits of its joints: {passed}")
    target = Target(pose=pose_components(posture.platform)[None])
    if beyond_singularity(robot, target, T[None])[0]:
        remarks.append(f"this posture is {_FAR_SIDE}")
    return remarks


def _mode(home: Posture, posture: Posture) -> str:
    """Describe the operation mode between home and a posture."""
    moved = posture.platform @ np.linalg.inv(home.platform)
    turned = np.abs(moved[:3, :3] - np.eye(3)).max() > _ROUNDING
    shift = posture.platform[:3, 3] - home.platform[:3, 3]
    shifted = np.abs(shift).max() > _ROUNDING * size_of(posture.robot)
    if turned and shifted:
        return "the mode in which the platform rotates and translates"
    return "pure rotation" if turned else "pure translation"
