"""Screws (small motions) and wrenches (loads) at a point.

Convention:

======  =====================  ==============================  ================
symbol  code                   order                           unit
======  =====================  ==============================  ================
s       screw ``(..., 6)``     ``[RX RY RZ TX TY TZ]``         rad, m
w       wrench ``(..., 6)``    ``[MX MY MZ FX FY FZ]``         N m, N
C       compliance             ``s = C @ w``                   rad/(N m) .. m/N
K       stiffness              ``w = K @ s``                   N m/rad .. N/m
======  =====================  ==============================  ================

Rotations are computed with NumPy, because the import of SciPy's rotations is slow.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

SCREW = ("RX", "RY", "RZ", "TX", "TY", "TZ")
WRENCH = ("MX", "MY", "MZ", "FX", "FY", "FZ")
SCREW_UNITS = ("rad", "rad", "rad", "m", "m", "m")
WRENCH_UNITS = ("N m", "N m", "N m", "N", "N", "N")
UNIT_VECTORS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def skew(vector: ArrayLike) -> NDArray:
    """Return the cross product matrix of a vector: ``skew(a) @ b == cross(a, b)``.

    Args:
        vector: (..., 3) vectors.

    Returns:
        (..., 3, 3) antisymmetric matrices.
    """
    v = np.asarray(vector, dtype=float)
    S = np.zeros((*v.shape[:-1], 3, 3))
    S[..., (2, 0, 1), (1, 2, 0)] = v  # fails if there are not exactly three components
    return S - np.swapaxes(S, -1, -2)


def screw_map(offset: ArrayLike, rotation: ArrayLike | None = None) -> NDArray:
    """Return the matrix that transforms a screw to another point and other axes.

    If ``s`` is the screw of a body at point ``q``, in the axes of a frame with rotation
    matrix ``R``, then ``screw_map(q - p, R) @ s`` is the screw of the same body at
    point ``p``. The matrix is ``[R 0; [q - p]x R, R]``, as in the corrected eqs.
    (13)-(15) of the paper.

    The transposed matrix transforms a wrench from ``p`` to ``q``, so the power ``w @
    s`` is the same at both points.

    Args:
        offset: (..., 3) [m] vector from the new point to the old point, in the new
            axes.
        rotation: (..., 3, 3) rotation matrix whose columns are the old axes, expressed
            in the new axes. The default is the identity.

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
        rotation_vector: (..., 3) [rad] rotation axis times angle.

    Returns:
        (..., 3, 3) rotation matrices.
    """
    vectors = np.asarray(rotation_vector, dtype=float)
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    # Rodrigues' formula 1 + sin a / a S + (1 - cos a) / a^2 S^2
    first, second = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    S = skew(vectors)
    return np.eye(3) + first * S + second * (S @ S)


def rotation_vector(rotation: ArrayLike) -> NDArray:
    """Convert rotation matrices to rotation vectors.

    Args:
        rotation: (..., 3, 3) rotation matrices.

    Returns:
        (..., 3) [rad] rotation axis times angle, which is at most pi.

    Sources:
        Shepperd (1978), Quaternion from rotation matrix.
    """
    R = np.asarray(rotation, dtype=float)
    trace = np.trace(R, axis1=-2, axis2=-1)[..., None]
    # The matrix is 4 q q^T, where q = [x y z w] is the unit quaternion. The row with
    # the largest norm is used, because its round-off error is smallest.
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., :3, :3] = R + np.swapaxes(R, -1, -2)
    products[..., [0, 1, 2], [0, 1, 2]] += 1.0 - trace
    twice_sine = R[..., [2, 0, 1], [1, 2, 0]] - R[..., [1, 2, 0], [2, 0, 1]]
    products[..., :3, 3] = products[..., 3, :3] = twice_sine
    products[..., 3, 3] = 1.0 + trace[..., 0]
    largest = np.diagonal(products, axis1=-2, axis2=-1).argmax(axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    q = np.where(q[..., 3:] < 0, -q, q)  # select the smaller angle
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.divide(angle, sine, out=np.zeros_like(sine), where=sine > 0)


def transform(translation: ArrayLike, rotation: ArrayLike) -> NDArray:
    """Return the homogeneous matrices of the pose of frame b in frame a.

    Args:
        translation: (..., 3) [m] origin of b in the axes of a.
        rotation: (..., 3, 3) axes of b in the axes of a.

    Returns:
        (..., 4, 4) matrices ``T_a_b``, where ``T_a_c = T_a_b @ T_b_c``.
    """
    translation = np.asarray(translation, dtype=float)
    R = np.asarray(rotation, dtype=float)
    T = np.zeros((*np.broadcast_shapes(translation.shape[:-1], R.shape[:-2]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = R, translation, 1.0
    return T
