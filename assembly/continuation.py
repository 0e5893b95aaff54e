"""The compiled heart of :mod:`assembly.nominal`: one target followed from home.

Everything is plain arrays: ``kinds`` 0 fixed, 1 revolute, 2 prismatic; ``carries`` 1 in
row i where joint j's motion moves frame i; ``pairs`` rows of each closure's frames.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

_SOLVED = 1e-10  # scaled residual at which a configuration counts as solved
_ROUNDED = 1e-5  # scaled residual accepted where it cannot be made smaller
_JUMP = 0.4  # [rad or lengths] largest joint motion in a step: keeps the assembly mode
_SMALLEST_STEP = 1e-5
_NEWTON = 12  # iterations; quadratic convergence needs about 4


@njit(cache=True, error_model="numpy")
def follow_all(
    parents: NDArray, kinds: NDArray, fixed: NDArray, carries: NDArray, pairs: NDArray,
    platform: int, start: NDArray, poses: NDArray, held: NDArray, size: float,
    steps: int,
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

    Returns:
        (k, n) coordinates where each track ends and (k,) progress, 1 where reached.
    """
    count, n = held.shape
    ends, progress = np.empty((count, n)), np.empty(count)
    for i in range(count):
        ends[i], progress[i] = _follow(
            parents, kinds, fixed, carries, pairs, platform, start,
            poses[i] if len(poses) else np.full(6, np.nan), held[i], size, steps,
        )  # fmt: skip
    return ends, progress


@njit(cache=True, error_model="numpy")
def _follow(
    parents: NDArray, kinds: NDArray, fixed: NDArray, carries: NDArray, pairs: NDArray,
    platform: int, start: NDArray, pose: NDArray, held: NDArray, size: float,
    steps: int,
) -> tuple[NDArray, float]:  # fmt: skip
    """One target: steps that halve where Newton fails and double where it does not."""
    q = start.copy()
    R, p = forward(parents, kinds, fixed, q)
    home_pose = np.empty(6)
    home_pose[:3] = p[platform]
    home_pose[3:] = rotation_log(R[platform])
    done, step = 0.0, 1.0 / steps
    part, part_held = np.empty(6), np.empty(len(q))
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
        if steps == 1:
            return tried, 1.0 if fine else 0.0
        fine = fine and np.abs(tried - q).max() < farthest
        if fine:
            q, done = tried, goal
        step *= 2.0 if fine else 0.5
    return q, done


@njit(cache=True, error_model="numpy")
def _newton(
    parents: NDArray, kinds: NDArray, fixed: NDArray, carries: NDArray, pairs: NDArray,
    platform: int, begin: NDArray, pose: NDArray, held: NDArray, size: float,
) -> tuple[NDArray, bool]:  # fmt: skip
    """Damped Gauss-Newton of least norm on closures and pose; whether it converged."""
    q = begin.copy()
    for j in range(len(q)):
        if np.isfinite(held[j]):
            q[j] = held[j]
    free = np.flatnonzero((kinds > 0) & ~np.isfinite(held))
    unit = np.where(kinds[free] == 2, size, 1.0)
    rows = 6 * len(pairs) + 6
    r, J = np.empty(rows), np.empty((rows, len(free)))
    fine, before = False, np.inf
    for _ in range(_NEWTON):
        R, p = forward(parents, kinds, fixed, q)
        _equations(kinds, carries, pairs, platform, R, p, pose, free, unit, size, r, J)
        worst = np.abs(r).max()
        x = _least_step(J, r)
        largest = np.abs(x).max() if len(x) else 0.0
        still = largest < 1e-9
        # at rest: solved, or as well as a rounded overconstrained file can be
        fine = worst < _SOLVED or (still and worst < _ROUNDED)
        limit = 0.5 / max(0.5, largest)
        for i in range(len(free)):
            q[free[i]] -= x[i] * limit * unit[i]
        if worst < 1e-14 or still or not np.isfinite(worst):
            break
        if worst > _ROUNDED and worst > 0.7 * before:
            break  # it does not converge: a smaller step will
        before = worst
    return q, fine


@njit(cache=True, error_model="numpy")
def forward(
    parents: NDArray, kinds: NDArray, fixed: NDArray, q: NDArray
) -> tuple[NDArray, NDArray]:
    """Rotations (n, 3, 3) and origins (n, 3) of all frames before their own motion."""
    n = len(q)
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    after_R, after_p = np.empty((n, 3, 3)), np.empty((n, 3))
    for i in range(n):
        if parents[i] < 0:
            R[i], p[i] = fixed[i, :3, :3], fixed[i, :3, 3]
        else:
            A, a = after_R[parents[i]], after_p[parents[i]]
            for k in range(3):
                p[i, k] = a[k]
                for l in range(3):
                    p[i, k] += A[k, l] * fixed[i, l, 3]
                    R[i, k, l] = 0.0
                    for m in range(3):
                        R[i, k, l] += A[k, m] * fixed[i, m, l]
        after_R[i], after_p[i] = R[i], p[i]
        if kinds[i] == 2:
            after_p[i] += q[i] * R[i, :, 2]
        elif kinds[i] == 1:
            c, s = math.cos(q[i]), math.sin(q[i])
            for k in range(3):
                after_R[i, k, 0] = c * R[i, k, 0] + s * R[i, k, 1]
                after_R[i, k, 1] = c * R[i, k, 1] - s * R[i, k, 0]
    return R, p


@njit(cache=True, error_model="numpy")
def _equations(
    kinds: NDArray, carries: NDArray, pairs: NDArray, platform: int, R: NDArray,
    p: NDArray, pose: NDArray, free: NDArray, unit: NDArray, size: float, r: NDArray,
    J: NDArray,
) -> None:  # fmt: skip
    """Scaled residuals and their derivatives by the free joints."""
    J[:] = 0.0
    for c in range(len(pairs)):
        a, b = pairs[c]
        row = 6 * c
        r[row : row + 3] = rotation_log(_times_transposed(R[a], R[b]))
        r[row + 3 : row + 6] = (p[a] - p[b]) / size
        for i in range(len(free)):
            j = free[i]
            sign = carries[a, j] - carries[b, j]
            if sign != 0.0:
                _move(kinds[j], R[j, :, 2], p[a] - p[j], sign * unit[i], size,
                      J[row : row + 6, i])  # fmt: skip
    row = 6 * len(pairs)
    asked = np.isfinite(pose)
    r[row:] = 0.0
    if not asked.any():
        return
    for i in range(len(free)):
        j = free[i]
        if carries[platform, j] > 0.0:
            _move(kinds[j], R[j, :, 2], p[platform] - p[j], unit[i], size,
                  J[row : row + 6, i])  # fmt: skip
    turn = rotation_log(R[platform])
    left = np.eye(3)
    if asked[3:].all():
        # no trouble near half a turn when the whole rotation is given
        r[row : row + 3] = rotation_log(
            _times_transposed(R[platform], _rotation_exp(pose[3:]))
        )
    else:
        r[row : row + 3] = turn - pose[3:]
        left = _inverse_left_jacobian(turn)
    r[row + 3 :] = (p[platform] - pose[:3]) / size
    for i in range(len(free)):
        a0, a1, a2 = J[row, i], J[row + 1, i], J[row + 2, i]
        for k in range(3):
            J[row + k, i] = left[k, 0] * a0 + left[k, 1] * a1 + left[k, 2] * a2
    for k in range(3):
        for at, given in ((row + k, asked[3 + k]), (row + 3 + k, asked[k])):
            if not given:
                r[at] = 0.0
                J[at] = 0.0


@njit(cache=True, inline="always", error_model="numpy")
def _move(
    kind: int, z: NDArray, arm: NDArray, factor: float, size: float, column: NDArray
) -> None:
    """Screw of a unit joint motion at a point ``arm`` away, scaled, into a column."""
    if kind == 1:
        column[:3] = factor * z
        column[3] = factor * (z[1] * arm[2] - z[2] * arm[1]) / size
        column[4] = factor * (z[2] * arm[0] - z[0] * arm[2]) / size
        column[5] = factor * (z[0] * arm[1] - z[1] * arm[0]) / size
    else:
        column[3:] = factor * z / size


@njit(cache=True, error_model="numpy")
def _least_step(J: NDArray, r: NDArray) -> NDArray:
    """Least-squares solution of J x = r, of least norm by damping at rounding level."""
    n = J.shape[1]
    N, x = np.empty((n, n)), np.zeros(n)
    Jt = np.ascontiguousarray(J.T)
    for i in range(n):
        for l in range(len(r)):
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


@njit(cache=True, error_model="numpy")
def _times_transposed(A: NDArray, B: NDArray) -> NDArray:
    """A B^T of 3 by 3 matrices."""
    C = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                C[i, j] += A[i, k] * B[j, k]
    return C


@njit(cache=True, error_model="numpy")
def rotation_log(R: NDArray) -> NDArray:
    """Rotation vector of a rotation matrix, by its quaternion."""
    # the quaternion's largest component first, so that nothing cancels:
    # Shepperd (1978), Quaternion from rotation matrix
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    best = 3
    largest = trace
    for i in range(3):
        if R[i, i] > largest:
            best, largest = i, R[i, i]
    q = np.empty(4)  # x, y, z, w
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
    if q[3] < 0.0:
        q = -q
    sine = math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2)
    if sine < 1e-300:
        return np.zeros(3)
    return q[:3] * (2.0 * math.atan2(sine, q[3]) / sine)


@njit(cache=True, error_model="numpy")
def _rotation_exp(r: NDArray) -> NDArray:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = math.sqrt(r[0] ** 2 + r[1] ** 2 + r[2] ** 2)
    S = _cross_matrix(r)
    if angle < 1e-8:
        return np.eye(3) + S
    a = math.sin(angle) / angle
    b = 2.0 * (math.sin(angle / 2.0) / angle) ** 2
    return np.eye(3) + a * S + b * (S @ S)


@njit(cache=True, error_model="numpy")
def _inverse_left_jacobian(r: NDArray) -> NDArray:
    """Change of a rotation vector per small turn in fixed axes."""
    # Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, section 10.7
    angle = max(math.sqrt(r[0] ** 2 + r[1] ** 2 + r[2] ** 2), 1e-6)
    S = _cross_matrix(r)
    half = angle / 2.0
    b = (1.0 - half / math.tan(half)) / angle**2
    return np.eye(3) - S / 2.0 + b * (S @ S)


@njit(cache=True, error_model="numpy")
def _cross_matrix(r: NDArray) -> NDArray:
    """Matrix of the cross product with r."""
    S = np.zeros((3, 3))
    S[0, 1], S[0, 2], S[1, 2] = -r[2], r[1], -r[0]
    S[1, 0], S[2, 0], S[2, 1] = r[2], -r[1], r[0]
    return S
