"""Compute finite rigid motions as 4 by 4 matrices, for the simulation only.

This module does not use :mod:`forcefit.stiffness.screws`, so that a mistake in the
placement of frames cannot affect both the model and the simulation.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation


def matrix(rotation: NDArray, translation: ArrayLike) -> NDArray:
    """Return the (4, 4) matrix of axes (3, 3) and origin (3,) [m]."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    return T


def turned(rotation_vector: ArrayLike) -> NDArray:
    """Return the (3, 3) rotation matrix of a rotation vector [rad]."""
    return Rotation.from_rotvec(np.array(rotation_vector, dtype=float)).as_matrix()


def turn_of(R: NDArray) -> NDArray:
    """Return the (3,) [rad] rotation vector, at most pi long, of a rotation (3, 3)."""
    # The quaternion is computed first, beginning with its largest component (Shepperd
    # 1978).
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        w, x, y, z = 1 + trace, zy - yz, xz - zx, yx - xy
    elif largest == xx:
        w, x, y, z = zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx
    elif largest == yy:
        w, x, y, z = xz - zx, xy + yx, 1 + yy - xx - zz, yz + zy
    else:
        w, x, y, z = yx - xy, xz + zx, yz + zy, 1 + zz - xx - yy
    size = math.hypot(x, y, z)
    angle = 2 * math.atan2(size, abs(w))
    factor = math.copysign(angle / size if size else 0.0, w)
    return np.array([factor * x, factor * y, factor * z])


def placement(rotation_vector: ArrayLike, translation: ArrayLike) -> NDArray:
    """Return the (4, 4) pose with a rotation vector [rad] and an origin [m]."""
    return matrix(turned(rotation_vector), translation)


def shifted(translation: ArrayLike) -> NDArray:
    """Return the (4, 4) motion of a pure translation."""
    return matrix(np.eye(3), translation)


def inverse(T: NDArray) -> NDArray:
    """Return the (4, 4) inverse motion."""
    return matrix(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


def exponential(screw: NDArray) -> NDArray:
    """Return the finite motion of a constant screw acting for unit time.

    Args:
        screw: (6,) ``[RX RY RZ TX TY TZ]`` [rad, m] screw.

    Returns:
        (4, 4) matrix of the motion.
    """
    return matrix(turned(screw[:3]), _mean_turn(screw[:3]) @ screw[3:])


def logarithm(T: NDArray) -> NDArray:
    """Return the constant screw that causes a finite motion in unit time.

    Args:
        T: (4, 4) motion with a rotation of less than pi.

    Returns:
        (6,) [rad, m] screw; the inverse of :func:`exponential`.
    """
    angles = turn_of(T[:3, :3])
    return np.concatenate([angles, np.linalg.solve(_mean_turn(angles), T[:3, 3])])


def _mean_turn(angles: NDArray) -> NDArray:
    """Return the (3, 3) mean of rotations by t times a rotation vector, 0 < t < 1."""
    a = float(np.linalg.norm(angles))
    x, y, z = angles
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # The closed form loses digits by cancellation; neglected terms of the series are
    # below 1e-15.
    if a < 1e-3:
        first, second = 1 / 2 - a**2 / 24, 1 / 6 - a**2 / 120
    else:
        first, second = 2 * (math.sin(a / 2) / a) ** 2, (a - math.sin(a)) / a**3
    return np.eye(3) + first * W + second * W @ W
