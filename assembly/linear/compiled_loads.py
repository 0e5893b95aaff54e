r"""What loads do to a robot without clearances and errors: ``cpp/loads.h``, by numba.

Of problem (22) under loads,

    minimise  |y|^2 / 2 - f.y - c.u - g.q
    subject to  A_q q + A_u u + A_y y = -misfit,  |u_k| <= 1 for each cone k,

closures' wrenches w that hold the free motions, A_q' w = -g, and bend springs least
make  t = f + A_y' w  orthogonal to all that closures do to springs.  With y = t + ..,

    |t|^2 / 2  is stored beside  |G u + h|^2 / 2 - d.u,   d = c + A_u' w:

G and h are those without loads, and clearances feel what they carry when tight.
"""

from typing import NamedTuple

import numpy as np

from assembly.linear.compiled_reduction import Triangle
from assembly.linear.compiled_structure import spring_group
from assembly.linear.robot_structure import Structure
from assembly.solvers.compiled import part
from assembly.solvers.householder import triangulate, turn, turn_back
from assembly.solvers.layouts import Matrices, Matrix, Vector
from assembly.solvers.vectors import copy, indices, inner, matrix, vector

_STILL_OF_DRIVE = 1e-9  # of the largest force on a free motion


class Loaded(NamedTuple):
    """A tight robot under its loads.

    Attributes:
        tight: (ny,) [sqrt(2 J)] t.
        holding: (m,) w.
        drive: (nq,) g.
        on_play: (nu,) [J] c.
        d: (nu,) [J].
        left: (6 ng,) what rounding leaves of t in the springs of closures.
        stored: [J] half of t.t.
        driven: whether they drive a motion that nothing resists.
    """

    tight: Vector
    holding: Vector
    drive: Vector
    on_play: Vector
    d: Vector
    left: Vector
    stored: float
    driven: bool


@part
def unloaded(s: Structure, m: int) -> Loaded:
    """A robot that no load acts on.

    Args:
        s: the robot.
        m: 6 closures.

    Returns:
        Zeros.
    """
    nu, nq, ng = len(s.cone_frame), len(s.free_frame), len(s.groups) - 1
    tight, d, left = vector(len(s.springs)), vector(nu), vector(6 * ng)
    return Loaded(tight, vector(m), vector(nq), vector(nu), d, left, 0.0, False)


@part
def balance(
    s: Structure, P: Matrices, load: Matrices, free: Triangle, Z: Matrix,
    springs: Triangle,
) -> Loaded:  # fmt: skip
    """Springs, closures and clearances of the tight robot.

    Args:
        s: the robot.
        P: unit screws of all frames.
        load: (2, n, 6) [N m, N] on bodies and on joints, in the frames' axes.
        free: the free motions' columns.
        Z: the rows that springs enter, divided by the springs' triangle, first.
        springs: the springs' columns.

    Returns:
        What follows from the loads.
    """
    under = unloaded(s, Z.shape[1])
    tight, holding, drive, on_play, d = (
        under.tight, under.holding, under.drive, under.on_play, under.d
    )  # fmt: skip
    for c in range(len(drive)):
        drive[c] = load[1, s.free_frame[c], s.free_axis[c]]
    driven = _hold(free, drive, holding)
    own = vector(len(tight))
    for c in range(len(own)):
        for axis in range(6):
            force = load[s.of_joint[c], s.spring_frame[c], axis]
            own[c] += s.springs[c, axis] * force
    forces_on_springs(s, P, on_patterns(s, holding), tight)
    for c in range(len(own)):
        tight[c] += own[c]
    bent = _bent_groups(s, P, tight)
    turn_back(springs.columns, springs.turns, springs.rank, bent)
    for i in range(springs.rank):
        for a in range(len(holding)):
            holding[a] -= bent[i] * Z[i, a]
    on = on_patterns(s, holding)
    forces_on_springs(s, P, on, tight)
    for c in range(len(own)):
        tight[c] += own[c]
    for c in range(len(d)):
        j, axis = s.cone_frame[c], s.cone_axis[c]
        on_play[c] = s.cone_size[c] * load[1, j, axis]
        d[c] = on_play[c] + s.cone_size[c] * inner(P[j, axis], on[s.pattern_of[j]])
    left = _bent_groups(s, P, tight)
    turn_back(springs.columns, springs.turns, springs.rank, left)
    stored = 0.5 * inner(tight, tight)
    return Loaded(tight, holding, drive, on_play, d, left, stored, driven)


@part
def _hold(free: Triangle, drive: Vector, holding: Vector) -> bool:
    """The closures' least wrenches that hold free motions; whether one gets away."""
    most, driven = 0.0, False
    for c in range(len(drive)):
        most = max(most, abs(drive[c]))
    for i in range(len(drive)):
        left = -drive[free.order[i]]
        for l in range(min(i, free.rank)):
            left -= free.columns[i, l] * holding[l]
        if i < free.rank:
            holding[i] = left / free.diagonal[i]
        else:
            driven = driven or abs(left) > _STILL_OF_DRIVE * most
    turn(free.columns, free.turns, free.rank, holding)
    return driven


@part
def on_patterns(s: Structure, closing: Vector) -> Matrix:
    """(np, 6) closures' wrenches on frames of each pattern."""
    on = matrix(len(s.patterns), 6)
    for g in range(len(on)):
        for k in range(s.patterns.shape[1]):
            for a in range(6):
                on[g, a] += s.patterns[g, k] * closing[6 * k + a]
    return on


@part
def forces_on_springs(s: Structure, P: Matrices, on: Matrix, forces: Vector) -> None:
    """Generalised forces of the closures' wrenches, into (ny,) ``forces``."""
    for c in range(len(forces)):
        j = s.spring_frame[c]
        forces[c] = 0.0
        for axis in range(6):
            if s.springs[c, axis] != 0.0:
                through = inner(P[j, axis], on[s.pattern_of[j]])
                forces[c] += s.springs[c, axis] * through


@part
def _bent_groups(s: Structure, P: Matrices, tight: Vector) -> Vector:
    """(6 ng,) what t is of the groups' six springs."""
    bent = vector(6 * (len(s.groups) - 1))
    turns, diagonal, order = vector(6), vector(6), indices(6)
    for g in range(len(s.groups) - 1):
        rows = spring_group(s, P, g)
        rank = triangulate(rows, turns, diagonal, order, 0.0, 0.0, -1.0)
        own = vector(rows.shape[1])
        copy(tight[s.groups[g] : s.groups[g + 1]], own)
        turn_back(rows, turns, rank, own)
        for b in range(rank):
            bent[6 * g + b] = own[b]
    return bent


@part
def loaded_gap(
    s: Structure, P: Matrices, L: Matrices, under: Loaded, closing: Vector,
    strains: tuple[Vector, Vector], u: Vector, motions: Vector, multipliers: Vector,
) -> float:  # fmt: skip
    """How far energy minus work is above what the wrenches prove.

    On the problem before elimination: half the square of y - s, with s the springs'
    strains that balance the wrenches, and what clearances could still gain.  Loads
    bend both y and s by t, which cancels.

    Args:
        s: the robot.
        P: unit screws of all frames.
        L: the groups' springs.
        under: the loads.
        closing: (m,) closures' wrenches beside those that balance the loads.
        strains: (r,) G u + h, and the same as (6 ng,) of the groups' springs.
        u: (nu,) clearances.
        motions: (nq,) free motions.
        multipliers: (m,) the closures' wrenches.

    Returns:
        [J] the gap.
    """
    on, forces = on_patterns(s, closing), vector(len(under.tight))
    v, grouped = strains
    gap = 0.5 * inner(v, v)
    for g in range(len(L)):
        for a in range(6):
            strain = inner(L[g, a], grouped[6 * g : 6 * g + 6])
            gap -= strain * on[s.group_pattern[g], a]
    forces_on_springs(s, P, on, forces)
    gap = max(0.0, gap + 0.5 * inner(forces, forces))
    on = on_patterns(s, multipliers)
    for k in range(len(s.starts) - 1):
        squares, work = 0.0, 0.0
        for c in range(s.starts[k], s.starts[k + 1]):
            j = s.cone_frame[c]
            force = inner(P[j, s.cone_axis[c]], on[s.pattern_of[j]])
            force = under.on_play[c] + s.cone_size[c] * force
            squares += force * force
            work += force * u[c]
        gap += max(0.0, np.sqrt(squares) - work)
    for c in range(len(motions)):
        j = s.free_frame[c]
        through = inner(P[j, s.free_axis[c]], on[s.pattern_of[j]])
        work = motions[c] * (under.drive[c] + through)
        gap += abs(work) - work
    return gap
