"""Rotations of 3 by 3 matrices, compiled."""

import math

from assembly.solvers.compiled import Matrix, Vector, part
from assembly.solvers.vectors import matrix, vector


@part
def times_transposed(A: Matrix, B: Matrix) -> Matrix:
    """A B^T of 3 by 3 matrices."""
    C = matrix(3, 3)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                C[i, j] += A[i, k] * B[j, k]
    return C


@part
def rotation_log(R: Matrix) -> Vector:
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
    turn = vector(3)
    if sine >= 1e-300:
        # q and -q are the same rotation: the one of at most half a turn
        factor = 2.0 * math.atan2(sine, abs(q[3])) / sine
        for k in range(3):
            turn[k] = math.copysign(factor, q[3]) * q[k]
    return turn


@part
def rotation_exp(x: float, y: float, z: float) -> Matrix:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.0
    if angle >= 1e-8:
        a = math.sin(angle) / angle
        b = 2.0 * (math.sin(angle / 2.0) / angle) ** 2
    return _turned(x, y, z, a, b)


@part
def inverse_left_jacobian(r: Vector) -> Matrix:
    """Change of a rotation vector per small turn in fixed axes."""
    # Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, section 10.7
    angle = max(math.sqrt(r[0] ** 2 + r[1] ** 2 + r[2] ** 2), 1e-6)
    half = angle / 2.0
    return _turned(
        r[0], r[1], r[2], -0.5, (1.0 - half / math.tan(half)) / angle**2
    )  # fmt: skip


@part
def _turned(x: float, y: float, z: float, a: float, b: float) -> Matrix:
    """1 + a S + b S S with S the matrix of the cross product with (x, y, z)."""
    A = matrix(3, 3)
    A[0, 0] = 1.0 - b * (y * y + z * z)
    A[1, 1] = 1.0 - b * (x * x + z * z)
    A[2, 2] = 1.0 - b * (x * x + y * y)
    A[0, 1], A[1, 0] = b * x * y - a * z, b * x * y + a * z
    A[0, 2], A[2, 0] = b * x * z + a * y, b * x * z - a * y
    A[1, 2], A[2, 1] = b * y * z - a * x, b * y * z + a * x
    return A
