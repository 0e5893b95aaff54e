"""Screws and wrenches: small motions and loads at a point, in given axes.

All packages use one convention:

======  =====================  ==============================  ================
symbol  code                   order                           unit
======  =====================  ==============================  ================
s       screw ``(..., 6)``     ``[RX RY RZ TX TY TZ]``         rad, m
w       wrench ``(..., 6)``    ``[MX MY MZ FX FY FZ]``         N m, N
C       compliance             ``s = C @ w``                   rad/(N m) .. m/N
K       stiffness              ``w = K @ s``                   N m/rad .. N/m
======  =====================  ==============================  ================

Rotations are computed with NumPy, to machine precision as in SciPy (tests compare the
two), because importing SciPy's rotations would take a quarter of the time needed to
solve a posture.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

SCREW = ("RX", "RY", "RZ", "TX", "TY", "TZ")
WRENCH = ("MX", "MY", "MZ", "FX", "FY", "FZ")
SCREW_UNITS = ("rad", "rad", "rad", "m", "m", "m")
WRENCH_UNITS = ("N m", "N m", "N m", "N", "N", "N")
UNIT_VECTORS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def skew(vector: ArrayLike) -> NDArray:
    """Return the cross product matrix, with ``skew(a) @ b == cross(a, b)``.

    Args:
        vector: (..., 3) vectors in any unit.

    Returns:
        (..., 3, 3) antisymmetric matrices.
    """
    v = np.asarray(vector, dtype=float)
    S = np.zeros((*v.shape[:-1], 3, 3))
    S[..., (2, 0, 1), (1, 2, 0)] = v  # fails unless there are exactly three components
    return S - np.swapaxes(S, -1, -2)


def screw_map(offset: ArrayLike, rotation: ArrayLike | None = None) -> NDArray:
    """Return the matrix that transforms a screw to another point and axes.

    If a body moves by the small screw ``s`` at point ``q``, in the axes of a frame at
    ``q``, then ``screw_map(q - p, R) @ s`` is the same motion at point ``p``. The
    matrix is the block ``[R 0; [q - p]x R, R]`` of eqs. (13)-(15) in the paper, as
    corrected.

    Wrenches transform in the opposite direction.  A wrench ``w`` at ``p`` becomes
    ``screw_map(q - p, R).T @ w`` at ``q`` in the frame's axes, so the power ``w @ s``
    is the same at both points.

    Args:
        offset: (..., 3) [m] vector from the new point to the old point, in the new
            axes.
        rotation: (..., 3, 3) old axes in the new axes; the identity if None.

    Returns:
        (..., 6, 6) matrix A with ``new = A @ old``.
    """
    offset = np.asarray(offset, dtype=float)
    R = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    A = np.zeros((*np.broadcast_shapes(offset.shape[:-1], R.shape[:-2]), 6, 6))
    A[..., :3, :3] = A[..., 3:, 3:] = R
    A[..., 3:, :3] = skew(offset) @ R
    return A


def rotation_matrix(rotation_vector: ArrayLike) -> NDArray:
    """Convert rotation vectors to rotation matrices.

    Args:
        rotation_vector: (..., 3) [rad] axis times angle.

    Returns:
        (..., 3, 3) proper orthogonal matrices.
    """
    vectors = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    # Rodrigues' formula 1 + sin a / a S + (1 - cos a) / a^2 S^2, both quotients from
    # sinc
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    S = skew(vectors)
    return np.eye(3) + first * S + second * (S @ S)


def rotation_vector(rotation: ArrayLike) -> NDArray:
    """Convert rotation matrices to rotation vectors with angles of at most pi.

    Args:
        rotation: (..., 3, 3) proper orthogonal matrices.

    Returns:
        (..., 3) [rad] axis times angle.

    Sources:
        Shepperd (1978), Quaternion from rotation matrix, for the choice of row.
    """
    R = np.asarray(rotation, dtype=float)
    trace = np.trace(R, axis1=-2, axis2=-1)[..., None]
    # matrix 4 q q^T of the unit quaternion q = [x y z w]; the row with the largest norm
    # determines q with the smallest round-off error
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    products[..., [0, 1, 2], [0, 1, 2]] += 1.0 - trace
    twice_sine = R[..., [2, 0, 1], [1, 2, 0]] - R[..., [1, 2, 0], [2, 0, 1]]
    products[..., :3, 3] = products[..., 3, :3] = twice_sine
    products[..., 3, 3] = 1.0 + trace[..., 0]
    largest = np.diagonal(products, axis1=-2, axis2=-1).argmax(axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    q = np.where(q[..., 3:] < 0, -q, q)  # choose the smaller of the two angles
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.divide(angle, sine, out=np.zeros_like(sine), where=sine > 0)


def transform(translation: ArrayLike, rotation: ArrayLike) -> NDArray:
    """Return the homogeneous matrices ``T_a_b`` of the pose of frame b in frame a.

    Args:
        translation: (..., 3) [m] origin of b in the axes of a.
        rotation: (..., 3, 3) axes of b in the axes of a.

    Returns:
        (..., 4, 4) with ``T_a_c = T_a_b @ T_b_c``.
    """
    translation = np.asarray(translation, dtype=float)
    R = np.asarray(rotation, dtype=float)
    T = np.zeros((*np.broadcast_shapes(translation.shape[:-1], R.shape[:-2]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, translation, 1.0
    return T
