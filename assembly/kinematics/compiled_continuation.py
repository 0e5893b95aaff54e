"""Continuation to a target, compiled, for :mod:`assembly.kinematics.nominal`."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.compiled_rotations import (
    inverse_left_jacobian,
    rotation_between,
    rotation_exp,
    rotation_log,
)
from assembly.solvers.compiled import kernel, part
from assembly.solvers.layers import FAST
from assembly.solvers.layouts import IndexRows, Indices, Matrices, Matrix, Vector
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
_LEAST = 1e-13  # damping, of the normal matrix' trace, where all joints are determined
# where some are not: rounding moves those by its own size over the damping, and with
# less they would stand elsewhere on every processor
_SPREAD = 1e-9
_CLEAR = 1e4  # times the damping: a joint motion of its own
_SMALLEST_STEP = 1e-5
_WIDTH = 8  # numbers in a vector register
_NEWTON = 12  # iterations; quadratic convergence needs about 4


class Tree(NamedTuple):
    """A robot of n frames as arrays.

    Attributes:
        parents: (n,) rows, -1 for the base.
        kinds: (n,) of joints: 0 fixed, 1 revolute, 2 prismatic.
        fixed: (n, 4, 4) frames in their parents.
        pairs: (closures, 2) rows of each closure's frames.
        moves: (k, 2) joints whose motions move one frame of a closure, and the sign,
            -1 for the second frame; closure after closure, then the platform's.
        groups: (closures + 2,) where in these each begins, and k.
        platform: its row.
        size: [m] reference length.
    """

    parents: Indices
    kinds: Indices
    fixed: Matrices
    pairs: IndexRows
    moves: IndexRows
    groups: Indices
    platform: int
    size: float


class Free(NamedTuple):
    """The coordinates that are solved for.

    Attributes:
        joints: (m,) their rows.
        unit: (m,) reference length where they slide, else 1.
        columns: (n,) which of them a joint is, -1 for none.
    """

    joints: Indices
    unit: Vector
    columns: Indices


@kernel
def follow_all(
    tree: Tree, start: NDArray, poses: NDArray, held: NDArray, guess: bool,
    ends: NDArray, progress: NDArray, T: NDArray, still_open: NDArray,
) -> None:  # fmt: skip
    """Follow every target along its straight line.

    Args:
        tree: the robot, of n frames.
        start: (n,) coordinates at home.
        poses: (k, 6) ``[tx ty tz rx ry rz]``, NaN where free; no rows if not asked.
        held: (k, n) coordinates, NaN where free.
        guess: the start is one, and does not close: one step, of any length.
        ends: (k, n) to fill: coordinates where each track ends.
        progress: (k,) to fill: part of the way, 1 where the target was reached.
        T: (k, n, 4, 4) to fill: rotations and origins of all frames there.
        still_open: (k, closures) to fill [rad, m]: largest component of each closure.
    """
    count, n = held.shape
    pose, gap = vector(6), vector(6)
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
            rotation_between(R, a, R, b, gap, 0)
            for k in range(3):
                gap[3 + k] = p[a, k] - p[b, k]
            still_open[i, c] = _largest(gap)


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
            # the way is hard: by short steps from here on
            careful, jump = True, _JUMP * longest
            if not determined:
                # and where it ends depends on all of the way
                copy(start, q)
                done, step = 0.0, _FIRST_STEP
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
    joints, unit, columns = indices(n), vector(n), indices(n)
    ahead = 0.0
    for j in range(n):
        columns[j] = -1
        if np.isfinite(held[j]):
            ahead = max(ahead, abs(held[j] - q[j]))
            q[j] = held[j]
        elif tree.kinds[j] > 0:
            joints[count], unit[count] = j, tree.size if tree.kinds[j] == 2 else 1.0
            columns[j] = count
            count += 1
    joints, unit = joints[:count], unit[:count]
    free = Free(joints, unit, columns)
    rows = 6 * len(tree.pairs) + 6
    r, J = vector(rows), matrix(len(tree.moves), 6)
    before, first = np.inf, 0.0
    for iteration in range(_NEWTON):
        R, p = forward(tree, q)
        _equations(tree, R, p, pose, free, r, J)
        worst = _largest(r)
        if near and not careful and worst < _NEAR:
            return True, True, ahead
        x, determined = _least_step(tree, free, J, r, _SPREAD if careful else _LEAST)
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
    n, kinds = len(q), tree.kinds
    R, p = matrices(n, 3, 3), matrix(n, 3)
    after_R, after_p = matrices(n, 3, 3), matrix(n, 3)
    for i in range(n):
        j, fixed = tree.parents[i], tree.fixed[i]
        slid = q[i] if kinds[i] == 2 else 0.0
        c, s = 1.0, 0.0
        if kinds[i] == 1:
            c, s = math.cos(q[i]), math.sin(q[i])
        for k in range(3):
            x, y, z, t = fixed[k, 0], fixed[k, 1], fixed[k, 2], fixed[k, 3]
            if j >= 0:
                a, b, d = after_R[j, k, 0], after_R[j, k, 1], after_R[j, k, 2]
                x = a * fixed[0, 0] + b * fixed[1, 0] + d * fixed[2, 0]
                y = a * fixed[0, 1] + b * fixed[1, 1] + d * fixed[2, 1]
                z = a * fixed[0, 2] + b * fixed[1, 2] + d * fixed[2, 2]
                t = a * fixed[0, 3] + b * fixed[1, 3] + d * fixed[2, 3] + after_p[j, k]
            R[i, k, 0], R[i, k, 1], R[i, k, 2], p[i, k] = x, y, z, t
            after_R[i, k, 0], after_R[i, k, 1] = c * x + s * y, c * y - s * x
            after_R[i, k, 2], after_p[i, k] = z, t + slid * z
    return R, p


@part
def _equations(
    tree: Tree, R: Matrices, p: Matrix, pose: Vector, free: Free, r: Vector, J: Matrix
) -> None:
    """Scaled residuals and, a row for each of the tree's moves, their derivatives."""
    pairs, platform, size = tree.pairs, tree.platform, tree.size
    closures, groups = len(pairs), tree.groups
    for g in range(closures + 1):
        a = pairs[g, 0] if g < closures else platform
        if g < closures:
            b = pairs[g, 1]
            rotation_between(R, a, R, b, r, 6 * g)
            for k in range(3):
                r[6 * g + 3 + k] = (p[a, k] - p[b, k]) / size
        for e in range(groups[g], groups[g + 1]):
            j = tree.moves[e, 0]
            i = free.columns[j]
            if i >= 0:
                factor = tree.moves[e, 1] * free.unit[i]
                x, y, z = factor * R[j, 0, 2], factor * R[j, 1, 2], factor * R[j, 2, 2]
                if tree.kinds[j] == 1:
                    J[e, 0], J[e, 1], J[e, 2] = x, y, z
                    u, v, w = p[a, 0] - p[j, 0], p[a, 1] - p[j, 1], p[a, 2] - p[j, 2]
                    x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
                J[e, 3], J[e, 4], J[e, 5] = x / size, y / size, z / size
    first = groups[closures]
    row = 6 * closures
    whole, none = True, True
    for k in range(3):
        whole = whole and np.isfinite(pose[3 + k])
        none = none and not np.isfinite(pose[3 + k])
    turn = vector(3)
    if whole:
        # regular near half a turn when the whole rotation is given
        asked = rotation_exp(pose[3], pose[4], pose[5])
        rotation_between(R, platform, asked, 0, turn, 0)
    elif not none:
        turn[0], turn[1], turn[2] = rotation_log(R[platform])
        left = inverse_left_jacobian(turn[0], turn[1], turn[2])
        for e in range(first, len(J)):
            a0, a1, a2 = J[e, 0], J[e, 1], J[e, 2]
            for k in range(3):
                J[e, k] = left[0, k, 0] * a0 + left[0, k, 1] * a1 + left[0, k, 2] * a2
        for k in range(3):
            turn[k] -= pose[3 + k]
    for k in range(3):
        r[row + k], r[row + 3 + k] = turn[k], (p[platform, k] - pose[k]) / size
    for k in range(6):
        if not np.isfinite(pose[(k + 3) % 6]):
            r[row + k] = 0.0
            for e in range(first, len(J)):
                J[e, k] = 0.0


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
def _least_step(
    tree: Tree, free: Free, J: Matrix, r: Vector, damped: float
) -> tuple[Vector, bool]:
    """Least-squares step, of least norm by damping.

    Each equation moves with few joints: the normal matrix is summed closure by closure.
    Of its rows the upper part is kept, from a multiple of the vector registers on.

    Returns:
        (m,) the joint coordinates' step; whether it is determined without damping.
    """
    n, moves, columns = len(free.joints), tree.moves, free.columns
    width = n + -n % _WIDTH
    N, x, inverse = matrix(n, width), vector(n), vector(n)
    damping = 1e-30
    for g in range(len(tree.groups) - 1):
        first = tree.groups[g]
        for e in range(first, tree.groups[g + 1]):
            i = columns[moves[e, 0]]
            if i < 0:
                continue
            a, b, c, d, f, h = J[e, 0], J[e, 1], J[e, 2], J[e, 3], J[e, 4], J[e, 5]
            x[i] += a * r[6 * g] + b * r[6 * g + 1] + c * r[6 * g + 2]
            x[i] += d * r[6 * g + 3] + f * r[6 * g + 4] + h * r[6 * g + 5]
            for k in range(first, e + 1):
                j = columns[moves[k, 0]]
                if j >= 0:
                    total = a * J[k, 0] + b * J[k, 1] + c * J[k, 2]
                    N[j, i] += total + d * J[k, 3] + f * J[k, 4] + h * J[k, 5]
    for i in range(n):
        damping += damped * N[i, i]
    determined = True
    for i in range(0, n, 2):  # two pivots at once
        row, other = N[i], N[min(i + 1, n - 1)]
        determined = _pivot(row, i, damping, inverse) and determined
        if i + 1 < n:
            factor = row[i + 1]
            for j in range(i - i % _WIDTH, width):
                other[j] -= factor * row[j]
            determined = _pivot(other, i + 1, damping, inverse) and determined
        for k in range(i + 2, n):
            a, b, to = row[k], other[k], N[k]
            if a or b:
                for j in range(k - k % _WIDTH, width):
                    to[j] -= a * row[j] + b * other[j]
    for i in range(n):
        x[i] *= inverse[i]
        row, factor = N[i], x[i]
        for j in range(i + 1, n):
            x[j] -= factor * row[j]
    for i in range(n - 1, -1, -1):
        row, total = N[i], x[i]
        for j in range(i + 1, n):
            total -= row[j] * x[j]
        x[i] = total * inverse[i]
    return x, determined


@kernel(fastmath=FAST)
def _pivot(row: NDArray, i: int, damping: float, inverse: NDArray) -> bool:
    """Divide a row by the root of its pivot; whether that is more than damping."""
    pivot = row[i] + damping
    inverse[i] = 1.0 / math.sqrt(max(pivot, 0.1 * damping))
    for j in range(i - i % _WIDTH, len(row)):
        row[j] *= inverse[i]
    return pivot > _CLEAR * damping
