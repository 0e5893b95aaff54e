"""Continuation to a target, compiled, for :mod:`assembly.kinematics.nominal`."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.compiled_rotations import (
    inverse_left_jacobian,
    rotation_exp,
    rotation_log,
    times_transposed,
)
from assembly.solvers.compiled import (
    IndexRows,
    Indices,
    Matrices,
    Matrix,
    Vector,
    kernel,
    part,
)
from assembly.solvers.layers import FAST, LANES
from assembly.solvers.vectors import copy, indices, matrices, matrix, vector

_SOLVED = 1e-10  # scaled residual at which a configuration counts as solved
_ROUNDED = 1e-5  # scaled residual accepted where it cannot be made smaller
_NEAR = 1e-4  # scaled residual accepted on the way
_JUMP = 0.4  # [rad or lengths] largest joint motion in a step: keeps the assembly mode
_FAR = 1.0  # the same where the tangent is a guide to the whole step
_LONG = 0.7  # of it: the step that is tried, by the tangent
_SHORT = 0.03  # of the way: where long steps lead nowhere
_FIRST_STEP = 0.125  # there, and where the target does not determine all joints
_CURVED = 0.25  # of the tangent's step: largest correction of it
_CLEAR = 1e4  # times the damping: a joint motion of its own
_SMALLEST_STEP = 1e-5
_NEWTON = 12  # iterations; quadratic convergence needs about 4


class Tree(NamedTuple):
    """A robot of n frames as arrays.

    Attributes:
        parents: (n,) rows, -1 for the base.
        kinds: (n,) of joints: 0 fixed, 1 revolute, 2 prismatic.
        fixed: (n, 4, 4) frames in their parents.
        carries: (n, n) 1 in row i where joint j's motion moves frame i, else 0.
        pairs: (closures, 2) rows of each closure's frames.
        platform: its row.
        size: [m] reference length.
    """

    parents: Indices
    kinds: Indices
    fixed: Matrices
    carries: Matrix
    pairs: IndexRows
    platform: int
    size: float


class Free(NamedTuple):
    """The coordinates that are solved for.

    Attributes:
        joints: (m,) their rows.
        unit: (m,) reference length where they slide, else 1.
    """

    joints: Indices
    unit: Vector


@kernel
def follow_all(
    tree: Tree, start: NDArray, poses: NDArray, held: NDArray, guess: bool, T: NDArray,
    still_open: NDArray,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Follow every target along its straight line.

    Args:
        tree: the robot, of n frames.
        start: (n,) coordinates at home.
        poses: (k, 6) ``[tx ty tz rx ry rz]``, NaN where free; no rows if not asked.
        held: (k, n) coordinates, NaN where free.
        guess: the start is one, and does not close: one step, of any length.
        T: (k, n, 4, 4) to fill: rotations and origins of all frames where tracks end.
        still_open: (k, closures) to fill [rad, m]: largest component of each closure.

    Returns:
        (k, n) coordinates where each track ends and (k,) progress, 1 where reached.
    """
    count, n = held.shape
    ends, progress = matrix(count, n), vector(count)
    pose = vector(6)
    for i in range(count):
        for k in range(6):
            pose[k] = poses[i, k] if len(poses) else np.nan
        progress[i] = _follow(tree, start, pose, held[i], guess, ends[i])
        R, p = forward(tree, ends[i])
        for j in range(n):
            for k in range(3):
                T[i, j, k, 3] = p[j, k]
                for l in range(3):
                    T[i, j, k, l] = R[j, k, l]
        for c in range(len(tree.pairs)):
            a, b = tree.pairs[c]
            turn = rotation_log(times_transposed(R[a], R[b]))
            for k in range(3):
                most = max(abs(turn[k]), abs(p[a, k] - p[b, k]))
                # written so that NaN stays
                if not most <= still_open[i, c]:
                    still_open[i, c] = most
    return ends, progress


@part
def _follow(
    tree: Tree, start: Vector, pose: Vector, held: Vector, guess: bool, q: Vector
) -> float:
    """One target, q: as far a step as the tangent allows, half of it where it fails."""
    n = len(q)
    copy(start, q)
    R, p = forward(tree, q)
    home_pose, turn = vector(6), rotation_log(R[tree.platform])
    for k in range(3):
        home_pose[k], home_pose[3 + k] = p[tree.platform, k], turn[k]
    part, part_held, tried = vector(6), vector(n), vector(n)
    longest = max(1.0, tree.size)
    jump = np.inf if guess else _FAR * longest
    done, step, careful = 0.0, 1.0, guess
    while done < 1.0 and step > _SMALLEST_STEP:
        goal = min(1.0, done + step)
        for i in range(6):
            part[i] = pose[i]
            if goal < 1.0:
                part[i] = home_pose[i] + goal * (pose[i] - home_pose[i])
        for j in range(n):
            part_held[j] = held[j]
            if goal < 1.0:
                part_held[j] = start[j] + goal * (held[j] - start[j])
            tried[j] = q[j]
        fine, determined, ahead = _newton(
            tree, tried, part, part_held, goal < 1.0, jump, careful
        )
        if not careful and (not determined or step < _SHORT):
            # where it ends depends on the way, or the way is hard: by short steps
            copy(start, q)
            done, step, careful, jump = 0.0, _FIRST_STEP, True, _JUMP * longest
            continue
        for j in range(n):
            # a jump, or a coordinate that is NaN: another assembly mode
            fine = fine and abs(tried[j] - q[j]) < jump
        if fine or guess:
            copy(tried, q)
        if guess:
            return 1.0 if fine else 0.0
        if fine:
            done = goal
        factor = 2.0 if fine else 0.5
        if not careful and (fine or ahead > jump):
            factor = min(4.0, _LONG * jump / max(ahead, 1e-9))
        step *= factor
    return done


@part
def _newton(
    tree: Tree, q: Vector, pose: Vector, held: Vector, near: bool, jump: float,
    careful: bool,
) -> tuple[bool, bool, float]:  # fmt: skip
    """Damped Gauss-Newton of least norm on closures and pose.

    Returns:
        Whether q converged, or is near enough; whether the target determines it, if
        that was asked; how far the tangent moves a joint.
    """
    n, count = len(q), 0
    joints, unit = indices(n), vector(n)
    ahead = 0.0
    for j in range(n):
        if np.isfinite(held[j]):
            ahead = max(ahead, abs(held[j] - q[j]))
            q[j] = held[j]
        elif tree.kinds[j] > 0:
            joints[count], unit[count] = j, tree.size if tree.kinds[j] == 2 else 1.0
            count += 1
    joints, unit = joints[:count], unit[:count]
    free = Free(joints, unit)
    rows = 6 * len(tree.pairs) + 6
    # columns as rows, padded with zeros to a multiple of the vector registers
    r, J = vector(rows + -rows % LANES), matrix(count, rows + -rows % LANES)
    before, first = np.inf, 0.0
    for iteration in range(_NEWTON):
        R, p = forward(tree, q)
        _equations(tree, R, p, pose, free, r, J)
        worst = _largest(r)
        if near and not careful and worst < _NEAR:
            return True, True, ahead
        x, determined = _least_step(J, r)
        largest = _largest(x)
        still = largest < 1e-9
        if iteration == 0 and not careful:
            for i in range(count):
                ahead = max(ahead, abs(x[i] * unit[i]))
            if ahead > jump or not determined:
                return False, determined, ahead
        if iteration == 1 and not careful and largest > _CURVED * first:
            return False, True, ahead  # the tangent is no guide: a shorter step
        first = max(first, largest)
        limit = 0.5 / max(0.5, largest)
        for i in range(count):
            q[joints[i]] -= x[i] * limit * unit[i]
        if worst < 1e-14 or still or not np.isfinite(worst):
            # solved, or as well as a rounded overconstrained file can be
            return worst < _SOLVED or (still and worst < _ROUNDED), True, ahead
        if worst > _ROUNDED and worst > 0.7 * before:
            return False, True, ahead  # it does not converge: try a smaller step
        before = worst
    return before < _SOLVED, True, ahead


@part
def forward(tree: Tree, q: Vector) -> tuple[Matrices, Matrix]:
    """Rotations (n, 3, 3) and origins (n, 3) of all frames before their own motion."""
    n, parents, kinds, fixed = len(q), tree.parents, tree.kinds, tree.fixed
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
    tree: Tree, R: Matrices, p: Matrix, pose: Vector, free: Free, r: Vector, J: Matrix
) -> None:
    """Scaled residuals and, a row for each free joint, their derivatives."""
    kinds, carries, pairs = tree.kinds, tree.carries, tree.pairs
    platform, size = tree.platform, tree.size
    joints, unit = free.joints, free.unit
    for c in range(len(pairs)):
        a, b = pairs[c]
        row = 6 * c
        turn = rotation_log(times_transposed(R[a], R[b]))
        for k in range(3):
            r[row + k], r[row + 3 + k] = turn[k], (p[a, k] - p[b, k]) / size
        for i in range(len(joints)):
            j = joints[i]
            sign = carries[a, j] - carries[b, j]
            if sign != 0.0:
                _move(
                    kinds[j],
                    R[j],
                    p[j],
                    p[a],
                    sign * unit[i],
                    size,
                    J[i, row : row + 6],
                )
    row = 6 * len(pairs)
    whole, none = True, True
    for k in range(3):
        whole = whole and np.isfinite(pose[3 + k])
        none = none and not np.isfinite(pose[3 + k])
    for i in range(len(joints)):
        j = joints[i]
        if carries[platform, j] != 0.0:
            out = J[i, row : row + 6]
            _move(kinds[j], R[j], p[j], p[platform], unit[i], size, out)
    turn = vector(3)
    if whole:
        # regular near half a turn when the whole rotation is given
        asked = rotation_exp(pose[3], pose[4], pose[5])
        turn = rotation_log(times_transposed(R[platform], asked))
    elif not none:
        turn = rotation_log(R[platform])
        left = inverse_left_jacobian(turn)
        for i in range(len(joints)):
            a0, a1, a2 = J[i, row], J[i, row + 1], J[i, row + 2]
            for k in range(3):
                J[i, row + k] = left[k, 0] * a0 + left[k, 1] * a1 + left[k, 2] * a2
        for k in range(3):
            turn[k] -= pose[3 + k]
    for k in range(3):
        r[row + k], r[row + 3 + k] = turn[k], (p[platform, k] - pose[k]) / size
    for k in range(6):
        if not np.isfinite(pose[(k + 3) % 6]):
            r[row + k] = 0.0
            for i in range(len(joints)):
                J[i, row + k] = 0.0


@part
def _move(
    kind: int, R: Matrix, origin: Vector, point: Vector, factor: float, size: float,
    screw: Vector,
) -> None:  # fmt: skip
    """Screw of a unit joint motion at a point, scaled."""
    for k in range(3):
        l, m = (k + 1) % 3, (k + 2) % 3
        if kind == 1:
            screw[k] = factor * R[k, 2]
            moment = R[l, 2] * (point[m] - origin[m])
            moment -= R[m, 2] * (point[l] - origin[l])
            screw[3 + k] = factor * moment / size
        else:
            screw[k] = 0.0
            screw[3 + k] = factor * R[k, 2] / size


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


@part(fastmath=FAST)
def _least_step(J: Matrix, r: Vector) -> tuple[Vector, bool]:
    """Least-squares x of J^T x = r, of least norm by damping at rounding level.

    Returns:
        x; whether it is determined without that.
    """
    n = len(J)
    N, x = matrix(n, n), vector(n)
    damping = 1e-30
    for i in range(n):
        row, right = J[i], 0.0
        for l in range(len(r)):
            right += row[l] * r[l]
        x[i] = right
        for j in range(i + 1):
            other, total = J[j], 0.0
            for l in range(len(r)):
                total += row[l] * other[l]
            N[i, j] = total
        damping += 1e-13 * N[i, i]
    determined = True
    for i in range(n):
        N[i, i] += damping
        row = N[i]
        for j in range(i + 1):
            other, total = N[j], row[j]
            for l in range(j):
                total -= row[l] * other[l]
            if j < i:
                row[j] = total * other[j]
            else:  # kept as its inverse
                determined = determined and total > _CLEAR * damping
                row[j] = 1.0 / math.sqrt(max(total, 0.1 * damping))
    for i in range(n):
        for l in range(i):
            x[i] -= N[i, l] * x[l]
        x[i] *= N[i, i]
    for i in range(n - 1, -1, -1):
        x[i] *= N[i, i]
        for l in range(i):
            x[l] -= N[i, l] * x[i]
    return x, determined
