"""A robot's paths, free motions and springs at a posture, compiled.

``P`` (n, 6, 6): row ``axis`` is the unit screw of frame j along it, read at the
platform in base axes, translations by the reference length.
"""

from assembly.linear.robot_structure import Structure
from assembly.solvers.compiled import part
from assembly.solvers.householder import triangulate, turn
from assembly.solvers.layouts import Matrices, Matrix, Vector
from assembly.solvers.vectors import (
    fill,
    indices,
    matrices,
    matrix,
    vector,
)


@part
def paths_of(T: Matrices, s: Structure) -> Matrices:
    """Unit screws of every frame at the platform, see ``P``."""
    n = len(T)
    P = matrices(n, 6, 6)
    for j in range(n):
        x = (T[j, 0, 3] - T[s.platform, 0, 3]) / s.size
        y = (T[j, 1, 3] - T[s.platform, 1, 3]) / s.size
        z = (T[j, 2, 3] - T[s.platform, 2, 3]) / s.size
        for axis in range(3):
            a, b, c = T[j, 0, axis], T[j, 1, axis], T[j, 2, axis]
            turned, slid = P[j, axis], P[j, 3 + axis]
            turned[0], turned[1], turned[2] = a, b, c
            turned[3], turned[4] = y * c - z * b, z * a - x * c
            turned[5] = x * b - y * a
            slid[3], slid[4], slid[5] = a / s.size, b / s.size, c / s.size
    return P


@part
def free_columns(s: Structure, P: Matrices, m: int) -> Matrix:
    """Closure columns of the free motions, as rows."""
    F = matrix(len(s.free_frame), m)
    for c in range(len(F)):
        j = s.free_frame[c]
        for k in range(m // 6):
            sign = s.patterns[s.pattern_of[j], k]
            if sign != 0.0:
                for a in range(6):
                    F[c, 6 * k + a] = sign * P[j, s.free_axis[c], a]
    return F


@part
def grouped_springs(s: Structure, P: Matrices) -> Matrices:
    """Springs that act together, combined into six with the same sum of squares."""
    count = len(s.groups) - 1
    L = matrices(count, 6, 6)
    turns, diagonal = vector(6), vector(6)
    order = indices(6)
    for g in range(count):
        rows = spring_group(s, P, g)
        rank = triangulate(rows, turns, diagonal, order, 0.0, 0.0, -1.0)
        for i in range(6):
            for l in range(min(i, rank)):
                L[g, order[i], l] = rows[i, l]
            if i < rank:
                L[g, order[i], i] = diagonal[i]
    return L


@part
def spring_group(s: Structure, P: Matrices, g: int) -> Matrix:
    """(6, springs, or 6 if they are fewer) columns of a group's springs."""
    a, b = s.groups[g], s.groups[g + 1]
    rows = matrix(6, max(b - a, 6))
    for c in range(a, b):
        j = s.spring_frame[c]
        for axis in range(6):
            weight = s.springs[c, axis]
            if weight != 0.0:
                for i in range(6):
                    rows[i, c - a] += weight * P[j, axis, i]
    return rows


@part
def own_springs(s: Structure, P: Matrices, grouped: Vector, elastic: Vector) -> None:
    """Deformation of every spring, from that of the groups' six."""
    turns, diagonal = vector(6), vector(6)
    order = indices(6)
    for g in range(len(s.groups) - 1):
        a, b = s.groups[g], s.groups[g + 1]
        rows = spring_group(s, P, g)
        rank = triangulate(rows, turns, diagonal, order, 0.0, 0.0, -1.0)
        own = vector(rows.shape[1])
        for i in range(rank):
            own[i] = grouped[6 * g + i]
        turn(rows, turns, rank, own)
        for c in range(a, b):
            elastic[s.spring_order[c]] = own[c - a]


@part
def largest_spring(s: Structure, P: Matrices) -> float:
    """Largest entry of the springs' closure columns, for the noise floor."""
    largest = 0.0
    column = vector(6)
    for c in range(s.groups[len(s.groups) - 1]):
        fill(column, 0.0)
        for axis in range(6):
            weight = s.springs[c, axis]
            if weight != 0.0:
                for i in range(6):
                    column[i] += weight * P[s.spring_frame[c], axis, i]
        for i in range(6):
            largest = max(largest, abs(column[i]))
    return largest
