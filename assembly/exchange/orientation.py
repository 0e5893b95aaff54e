"""Conversion of roll-pitch-yaw angles, quaternions and Euler angles to rotations.

Sources:
    Shoemake (1994), Euler angle conversion, Graphics Gems IV.  The third angle is
    computed from the first, because this is accurate if the second is 90 degrees.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.stiffness.screws import rotation_matrix, rotation_vector

_UNIT = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def from_roll_pitch_yaw(angles: ArrayLike) -> NDArray:
    """Return the rotation by three angles [rad] about fixed axes x, y and z, (3, 3)."""
    roll, pitch, yaw = np.asarray(angles, dtype=float)
    return _about("z", yaw) @ _about("y", pitch) @ _about("x", roll)


def to_roll_pitch_yaw(R: NDArray) -> tuple[float, float, float]:
    """Return the roll, pitch and yaw angles [rad] of a rotation (3, 3)."""
    roll = math.atan2(R[2, 1], R[2, 2])
    c, s = math.cos(roll), math.sin(roll)
    pitch = math.atan2(-R[2, 0], s * R[2, 1] + c * R[2, 2])
    yaw = math.atan2(s * R[0, 2] - c * R[0, 1], c * R[1, 1] - s * R[1, 2])
    return roll, pitch, yaw


def from_quaternion(q: ArrayLike) -> NDArray:
    """Return the rotation (3, 3) of a nonzero quaternion ``[w x y z]``."""
    w, x, y, z = np.asarray(q, dtype=float) / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def to_quaternion(R: NDArray) -> tuple[float, float, float, float]:
    """Return the unit quaternion ``[w x y z]`` of a rotation (3, 3)."""
    turn = rotation_vector(R)
    angle = float(np.linalg.norm(turn))
    half = np.sinc(angle / (2 * np.pi)) / 2 * turn  # sin(angle / 2) * unit axis
    return math.cos(angle / 2), float(half[0]), float(half[1]), float(half[2])


def from_euler(angles: ArrayLike, sequence: str) -> NDArray:
    """Return the rotation by three Euler angles.

    Args:
        angles: angles in the order of the sequence, (3,) [rad].
        sequence: three axes such as ``"xyz"``; lower-case letters denote body axes,
            capital letters fixed axes.

    Returns:
        Rotation matrix (3, 3).
    """
    R = np.eye(3)
    for axis, angle in zip(sequence, np.asarray(angles, dtype=float), strict=True):
        turn = _about(axis.lower(), float(angle))
        R = R @ turn if axis.islower() else turn @ R
    return R


def onto(axis: ArrayLike) -> NDArray:
    """Return the smallest rotation that maps z to a unit vector, (3, 3)."""
    x, y, z = np.asarray(axis, dtype=float)
    sine = math.hypot(x, y)
    if sine == 0.0:
        return np.diag([1.0, 1.0 if z > 0 else -1.0, 1.0 if z > 0 else -1.0])
    angle = math.atan2(sine, z)
    return rotation_matrix([-y / sine * angle, x / sine * angle, 0.0])


def _about(axis: str, angle: float) -> NDArray:
    """Return the rotation (3, 3) about a coordinate axis."""
    return rotation_matrix(angle * np.array(_UNIT[axis]))
