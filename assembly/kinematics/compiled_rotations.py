"""Rotations of 3 by 3 matrices, compiled."""

import math

from assembly.solvers.compiled import part
from assembly.solvers.layouts import Matrices, Matrix, Vector
from assembly.solvers.vectors import matrices, matrix, vector


@part
def rotation_between(
    A: Matrices, a: int, B: Matrices, b: int, turn: Vector, at: int
) -> None:
    """Rotation vector of A_a B_b^T, of 3 by 3 rotation matrices.

    Args:
        A: some.
        a: which of them.
        B: others.
        b: which of these.
        turn: filled with the three components.
        at: place of the first.
    """
    x = y = z = trace = 0.0
    for k in range(3):
        p, q, r = A[a, 0, k], A[a, 1, k], A[a, 2, k]
        l, m, n = B[b, 0, k], B[b, 1, k], B[b, 2, k]
        x, y, z = x + r * m - q * n, y + p * n - r * l, z + q * l - p * m
        trace += p * l + q * m + r * n
    if trace < 1.0:  # beyond a quarter turn these could cancel
        C = matrix(3, 3)
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    C[i, j] += A[a, i, k] * B[b, j, k]
        x, y, z = rotation_log(C)
    else:
        sine = math.sqrt(x * x + y * y + z * z)  # twice
        factor = math.atan2(sine, trace - 1.0) / sine if sine >= 1e-300 else 0.0
        x, y, z = factor * x, factor * y, factor * z
    turn[at], turn[at + 1], turn[at + 2] = x, y, z


@part
def rotation_log(R: Matrix) -> tuple[float, float, float]:
    """Rotation vector of a rotation matrix, by its quaternion."""
    # the quaternion's largest component first, so that nothing cancels:
    # Shepperd (1978), Quaternion from rotation matrix
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    best = 3
    largest = trace
    for i in range(3):
        if R[i, i] > largest:
            best, largest = i, R[i, i]
    q = vector(4)  # x, y, z, w
    if best == 3:
        q[0] = R[2, 1] - R[1, 2]
        q[1] = R[0, 2] - R[2, 0]
        q[2] = R[1, 0] - R[0, 1]
        q[3] = 1.0 + trace
    else:
        i, j, k = best, (best + 1) % 3, (best + 2) % 3
        q[i] = 1.0 - trace + 2.0 * R[i, i]
        q[j] = R[j, i] + R[i, j]
        q[k] = R[k, i] + R[i, k]
        q[3] = R[k, j] - R[j, k]
    sine = math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2)
    if sine < 1e-300:
        return 0.0, 0.0, 0.0
    # q and -q are the same rotation: the one of at most half a turn
    factor = math.copysign(2.0 * math.atan2(sine, abs(q[3])) / sine, q[3])
    return factor * q[0], factor * q[1], factor * q[2]


@part
def rotation_exp(x: float, y: float, z: float) -> Matrices:
    """(1, 3, 3) rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.0
    if angle >= 1e-8:
        a = math.sin(angle) / angle
        b = 2.0 * (math.sin(angle / 2.0) / angle) ** 2
    return _turned(x, y, z, a, b)


@part
def inverse_left_jacobian(x: float, y: float, z: float) -> Matrices:
    """(1, 3, 3) change of a rotation vector per small turn in fixed axes."""
    # Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, section 10.7
    angle = max(math.sqrt(x * x + y * y + z * z), 1e-6)
    half = angle / 2.0
    return _turned(x, y, z, -0.5, (1.0 - half / math.tan(half)) / angle**2)


@part
def _turned(x: float, y: float, z: float, a: float, b: float) -> Matrices:
    """(1, 3, 3) 1 + a S + b S S, S the matrix of the cross product with (x, y, z)."""
    A = matrices(1, 3, 3)
    A[0, 0, 0] = 1.0 - b * (y * y + z * z)
    A[0, 1, 1] = 1.0 - b * (x * x + z * z)
    A[0, 2, 2] = 1.0 - b * (x * x + y * y)
    A[0, 0, 1], A[0, 1, 0] = b * x * y - a * z, b * x * y + a * z
    A[0, 0, 2], A[0, 2, 0] = b * x * z + a * y, b * x * z - a * y
    A[0, 1, 2], A[0, 2, 1] = b * y * z - a * x, b * y * z + a * x
    return A
