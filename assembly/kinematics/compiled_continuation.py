"""Continuation from home to a target, compiled, for :mod:`assembly.kinematics.nominal`.

Everything is plain arrays: ``kinds`` 0 fixed, 1 revolute, 2 prismatic; ``carries`` 1 in
row i where joint j's motion moves frame i; ``pairs`` rows of each closure's frames.
"""

import math

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import (
    GivenIndices,
    GivenMatrices,
    IndexRows,
    Indices,
    Matrices,
    Matrix,
    Vector,
    kernel,
    part,
)
from assembly.solvers.vectors import indices, matrices, matrix, vector

_SOLVED = 1e-10  # scaled residual at which a configuration counts as solved
_ROUNDED = 1e-5  # scaled residual accepted where it cannot be made smaller
_JUMP = 0.4  # [rad or lengths] largest joint motion in a step: keeps the assembly mode
_SMALLEST_STEP = 1e-5
_NEWTON = 12  # iterations; quadratic convergence needs about 4


@kernel
def follow_all(
    parents: NDArray, kinds: NDArray, fixed: NDArray, carries: NDArray, pairs: NDArray,
    platform: int, start: NDArray, poses: NDArray, held: NDArray, size: float,
    steps: int, T: NDArray,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Follow every target along its straight line.

    Args:
        parents: (n,) rows, -1 for the base.
        kinds: (n,) of joints.
        fixed: (n, 4, 4) frames in their parents.
        carries: (n, n) 0 or 1.
        pairs: (closures, 2) rows.
        platform: its row.
        start: (n,) coordinates at home.
        poses: (k, 6) ``[tx ty tz rx ry rz]``, NaN where free; no rows if not asked.
        held: (k, n) coordinates, NaN where free.
        size: [m] reference length.
        steps: first number of steps; 1 takes any step, for a start that is a guess.
        T: (k, n, 4, 4) to fill: rotations and origins of all frames where tracks end.

    Returns:
        (k, n) coordinates where each track ends and (k,) progress, 1 where reached.
    """
    count, n = held.shape
    ends, progress = matrix(count, n), vector(count)
    pose = vector(6)
    for i in range(count):
        for k in range(6):
            pose[k] = poses[i, k] if len(poses) else np.nan
        progress[i] = _follow(
            parents, kinds, fixed, carries, pairs, platform, start, pose, held[i],
            size, steps, ends[i],
        )  # fmt: skip
        R, p = forward(parents, kinds, fixed, ends[i])
        for j in range(n):
            for k in range(3):
                T[i, j, k, 3] = p[j, k]
                for l in range(3):
                    T[i, j, k, l] = R[j, k, l]
    return ends, progress


@part
def _follow(
    parents: GivenIndices, kinds: Indices, fixed: GivenMatrices, carries: Matrix,
    pairs: IndexRows, platform: int, start: Vector, pose: Vector,
    held: Vector, size: float, steps: int, q: Vector,
) -> float:  # fmt: skip
    """One target, q: steps that halve where Newton fails, double where it does not."""
    for j in range(len(q)):
        q[j] = start[j]
    R, p = forward(parents, kinds, fixed, q)
    home_pose, turn = vector(6), rotation_log(R[platform])
    for k in range(3):
        home_pose[k], home_pose[3 + k] = p[platform, k], turn[k]
    done, step = 0.0, 1.0 / steps
    part, part_held = vector(6), vector(len(q))
    farthest = _JUMP * max(1.0, size)
    while done < 1.0 and step > _SMALLEST_STEP:
        goal = min(1.0, done + step)
        for i in range(6):
            part[i] = pose[i]
            if goal < 1.0:
                part[i] = home_pose[i] + goal * (pose[i] - home_pose[i])
        for j in range(len(q)):
            part_held[j] = held[j]
            if goal < 1.0:
                part_held[j] = start[j] + goal * (held[j] - start[j])
        tried, fine = _newton(
            parents, kinds, fixed, carries, pairs, platform, q, part, part_held, size
        )
        for j in range(len(q)):
            # a jump, or a coordinate that is NaN: another assembly mode
            fine = fine and (steps == 1 or abs(tried[j] - q[j]) < farthest)
        if fine or steps == 1:
            for j in range(len(q)):
                q[j] = tried[j]
        if steps == 1:
            return 1.0 if fine else 0.0
        if fine:
            done = goal
        step *= 2.0 if fine else 0.5
    return done


@part
def _newton(
    parents: GivenIndices, kinds: Indices, fixed: GivenMatrices, carries: Matrix,
    pairs: IndexRows, platform: int, begin: Vector, pose: Vector,
    held: Vector, size: float,
) -> tuple[Vector, bool]:  # fmt: skip
    """Damped Gauss-Newton of least norm on closures and pose; whether it converged."""
    n, count = len(begin), 0
    q, free, unit = vector(n), indices(n), vector(n)
    for j in range(n):
        given = np.isfinite(held[j])
        q[j] = held[j] if given else begin[j]
        if kinds[j] > 0 and not given:
            free[count], unit[count] = j, size if kinds[j] == 2 else 1.0
            count += 1
    free, unit = free[:count], unit[:count]
    rows = 6 * len(pairs) + 6
    r, J = vector(rows), matrix(rows, count)
    fine, before = False, np.inf
    for _ in range(_NEWTON):
        R, p = forward(parents, kinds, fixed, q)
        _equations(kinds, carries, pairs, platform, R, p, pose, free, unit, size, r, J)
        worst = _largest(r)
        x = _least_step(J, r)
        largest = _largest(x)
        still = largest < 1e-9
        # converged: solved, or as well as a rounded overconstrained file can be
        fine = worst < _SOLVED or (still and worst < _ROUNDED)
        limit = 0.5 / max(0.5, largest)
        for i in range(count):
            q[free[i]] -= x[i] * limit * unit[i]
        if worst < 1e-14 or still or not np.isfinite(worst):
            break
        if worst > _ROUNDED and worst > 0.7 * before:
            break  # it does not converge: try a smaller step
        before = worst
    return q, fine


@part
def forward(
    parents: GivenIndices, kinds: Indices, fixed: GivenMatrices, q: Vector
) -> tuple[Matrices, Matrix]:
    """Rotations (n, 3, 3) and origins (n, 3) of all frames before their own motion."""
    n = len(q)
    R, p = matrices(n, 3, 3), matrix(n, 3)
    after_R, after_p = matrices(n, 3, 3), matrix(n, 3)
    for i in range(n):
        j = parents[i]
        for k in range(3):
            p[i, k] = fixed[i, k, 3] if j < 0 else after_p[j, k]
            for l in range(3):
                R[i, k, l] = fixed[i, k, l] if j < 0 else 0.0
                if j >= 0:
                    p[i, k] += after_R[j, k, l] * fixed[i, l, 3]
                    for m in range(3):
                        R[i, k, l] += after_R[j, k, m] * fixed[i, m, l]
        slid = q[i] if kinds[i] == 2 else 0.0
        c, s = 1.0, 0.0
        if kinds[i] == 1:
            c, s = math.cos(q[i]), math.sin(q[i])
        for k in range(3):
            after_p[i, k] = p[i, k] + slid * R[i, k, 2]
            after_R[i, k, 0] = c * R[i, k, 0] + s * R[i, k, 1]
            after_R[i, k, 1] = c * R[i, k, 1] - s * R[i, k, 0]
            after_R[i, k, 2] = R[i, k, 2]
    return R, p


@part
def _equations(
    kinds: Indices, carries: Matrix, pairs: IndexRows, platform: int, R: Matrices,
    p: Matrix, pose: Vector, free: Indices, unit: Vector, size: float, r: Vector,
    J: Matrix,
) -> None:  # fmt: skip
    """Scaled residuals and their derivatives by the free joints."""
    for c in range(len(pairs)):
        a, b = pairs[c]
        row = 6 * c
        turn = rotation_log(_times_transposed(R[a], R[b]))
        for k in range(3):
            r[row + k], r[row + 3 + k] = turn[k], (p[a, k] - p[b, k]) / size
        for i in range(len(free)):
            j = free[i]
            sign = carries[a, j] - carries[b, j]
            _move(kinds[j], R[j], p[j], p[a], sign * unit[i], size, J, row, i)
    row = 6 * len(pairs)
    whole = True
    for k in range(3):
        whole = whole and np.isfinite(pose[3 + k])
    for i in range(len(free)):
        j = free[i]
        factor = carries[platform, j] * unit[i]
        _move(kinds[j], R[j], p[j], p[platform], factor, size, J, row, i)
    turn = rotation_log(R[platform])
    if whole:
        # regular near half a turn when the whole rotation is given
        asked = _rotation_exp(pose[3], pose[4], pose[5])
        turn = rotation_log(_times_transposed(R[platform], asked))
    else:
        left = _inverse_left_jacobian(turn)
        for i in range(len(free)):
            a0, a1, a2 = J[row, i], J[row + 1, i], J[row + 2, i]
            for k in range(3):
                J[row + k, i] = left[k, 0] * a0 + left[k, 1] * a1 + left[k, 2] * a2
        for k in range(3):
            turn[k] -= pose[3 + k]
    for k in range(3):
        r[row + k], r[row + 3 + k] = turn[k], (p[platform, k] - pose[k]) / size
    for k in range(6):
        if not np.isfinite(pose[(k + 3) % 6]):
            r[row + k] = 0.0
            for i in range(len(free)):
                J[row + k, i] = 0.0


@part
def _move(
    kind: int, R: Matrix, origin: Vector, point: Vector, factor: float, size: float,
    J: Matrix, row: int, column: int,
) -> None:  # fmt: skip
    """Screw of a unit joint motion at a point, scaled, into a column from a row on."""
    for k in range(3):
        l, m = (k + 1) % 3, (k + 2) % 3
        if kind == 1:
            J[row + k, column] = factor * R[k, 2]
            moment = R[l, 2] * (point[m] - origin[m])
            moment -= R[m, 2] * (point[l] - origin[l])
            J[row + 3 + k, column] = factor * moment / size
        else:
            J[row + k, column] = 0.0
            J[row + 3 + k, column] = factor * R[k, 2] / size


@part
def _largest(v: Vector) -> float:
    """Largest absolute component; NaN if one is NaN."""
    largest = 0.0
    for value in v:
        if not abs(value) <= largest:
            largest = abs(value)
            if largest != largest:
                break
    return largest


@part
def _least_step(J: Matrix, r: Vector) -> Vector:
    """Least-squares solution of J x = r, of least norm by damping at rounding level."""
    n = J.shape[1]
    N, x = matrix(n, n), vector(n)
    Jt = matrix(n, len(r))
    for i in range(n):
        for l in range(len(r)):
            Jt[i, l] = J[l, i]
            x[i] += Jt[i, l] * r[l]
        for j in range(i + 1):
            total = 0.0
            for l in range(len(r)):
                total += Jt[i, l] * Jt[j, l]
            N[i, j] = total
    damping = 1e-30
    for i in range(n):
        damping += 1e-13 * N[i, i]
    for i in range(n):
        N[i, i] += damping
        for j in range(i + 1):
            for l in range(j):
                N[i, j] -= N[i, l] * N[j, l]
            if j < i:
                N[i, j] /= N[j, j]
            else:
                N[i, i] = math.sqrt(max(N[i, i], 0.1 * damping))
    for i in range(n):
        for l in range(i):
            x[i] -= N[i, l] * x[l]
        x[i] /= N[i, i]
    for i in range(n - 1, -1, -1):
        for l in range(i + 1, n):
            x[i] -= N[l, i] * x[l]
        x[i] /= N[i, i]
    return x


@part
def _times_transposed(A: Matrix, B: Matrix) -> Matrix:
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
def _rotation_exp(x: float, y: float, z: float) -> Matrix:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(x * x + y * y + z * z)
    a, b = 1.0, 0.0
    if angle >= 1e-8:
        a = math.sin(angle) / angle
        b = 2.0 * (math.sin(angle / 2.0) / angle) ** 2
    return _turned(x, y, z, a, b)


@part
def _inverse_left_jacobian(r: Vector) -> Matrix:
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
