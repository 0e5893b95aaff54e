"""Problem (22) without loads, compiled from the frames' poses to the certified answer.

Points that this does not cover go to the fallback, with a code for the reason.  A point
counts as solved only if its certificate, computed from the wrenches on the problem
before any elimination, proves the gap asked for.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_reduction import (
    eliminate,
    eliminate_springs,
    least_motions,
    misfit_of,
    moved_by,
    rigid_rows,
    small_problem,
)
from assembly.linear.compiled_structure import own_springs, paths_of
from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import Solutions
from assembly.linear.thresholds import MISMATCH_FACTOR, OPEN, RANK
from assembly.solvers.compiled import kernel, part
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE
from assembly.solvers.dual_newton import Dual, dual_newton
from assembly.solvers.householder import turn
from assembly.solvers.interior import Programme, interior_point
from assembly.solvers.layouts import Indices, Matrices, Matrix, Vector
from assembly.solvers.vectors import (
    copy,
    divide,
    inner,
    into_cones,
    matrix,
    vector,
)

NEWTON, INTERIOR, RIGID, AMBIGUOUS, UNCERTIFIED, BOUNDED = range(6)
_STOP = 3e-3  # the solvers stop at this fraction of the accepted gap
# gap from which Newton's method finishes: of the energy, of that without clearance
_NEAR, _NEAR_WITHOUT_CLEARANCE = 1e-8, 1e-9
_STEPS_ALONE, _STEPS, _STEPS_LAST = 6, 20, 150  # of Newton's method
_FIRST_SIGMA = 1e6  # after the interior-point method, see dual_newton


@kernel
def assemble_all(
    s: Structure, T: NDArray, errors: NDArray, mismatch: NDArray,
    out: Solutions,
) -> None:  # fmt: skip
    """Solve every point; see :class:`~assembly.linear.solutions.Solutions`.

    Args:
        s: the robot.
        T: (k, n, 4, 4) frames.
        errors: (k, n, 6) [rad, m], or (1, n, 6) for all.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        out: arrays to fill.
    """
    for point in range(len(T)):
        own = errors[point if len(errors) > 1 else 0]
        tolerance = RANK + MISMATCH_FACTOR * mismatch[point]
        P = paths_of(T[point], s)
        reduced = eliminate(s, P, tolerance)
        if not reduced.decided:
            out.outcome[point] = AMBIGUOUS
            continue
        F, turns, diagonal, order, free = reduced.free
        Y, y_turns, y_diagonal, y_order, rank = reduced.springs
        Z, L = reduced.Z, reduced.L
        eliminate_springs(Z, Y, y_diagonal, y_order, rank)
        known = misfit_of(s, P, own)
        if rigid_rows(s, P, Z, rank, known, own, tolerance):
            out.outcome[point] = RIGID
            continue
        # the reduced problem in the clearances
        Gt, h = small_problem(s, P, Z, rank, known)
        u, v, y = vector(len(Gt)), vector(rank), vector(rank)
        outcome = _minimise(s, Gt, h, u, v, y)
        # back to the full problem
        _least_multipliers(Z, rank, y, out.multipliers[point])
        for c in range(len(u)):
            out.clearances[point, c] = u[c]
        spring = vector(Y.shape[1])
        copy(v, spring)
        turn(Y, y_turns, rank, spring)
        if len(out.elastic):
            own_springs(s, P, spring, out.elastic[point])
        out.energy[point] = 0.5 * inner(v, v)
        out.without_clearance[point] = 0.5 * inner(h, h)
        moved = moved_by(s, P, L, u, spring, known, out.platform_screw[point])
        motions = out.motions[point]
        least_motions(F, turns, diagonal, order, free, moved, motions)
        out.outcome[point] = _certify(point, s, P, own, moved, outcome, out)


@part
def _least_multipliers(Z: Matrix, rank: int, y: Vector, multipliers: Vector) -> None:
    """Multipliers of the closures, the least ones where they are not unique."""
    m = len(multipliers)
    for a in range(m):
        multipliers[a] = 0.0
        for i in range(rank):
            multipliers[a] += Z[i, a] * y[i]
    # nothing feels those along Z's other rows, made orthonormal here
    for i in range(rank, len(Z)):
        for l in range(rank, i):
            along = inner(Z[l], Z[i])
            for a in range(m):
                Z[i, a] -= along * Z[l, a]
        size = np.sqrt(inner(Z[i], Z[i]))
        along = inner(Z[i], multipliers) / (size * size)
        for a in range(m):
            multipliers[a] -= along * Z[i, a]
            Z[i, a] /= size


@part
def _certify(
    point: int, s: Structure, P: Matrices, errors: Matrix, moved: Vector, outcome: int,
    out: Solutions,
) -> int:  # fmt: skip
    """The certificate on the problem before elimination, and the platform screw."""
    m = len(moved)
    motions, screw = out.motions[point], out.platform_screw[point]
    for c in range(len(motions)):
        j, axis = s.free_frame[c], s.free_axis[c]
        if abs(motions[c]) > s.free_bound[c]:
            return BOUNDED
        for a in range(6):
            step = P[j, axis, a] * motions[c]
            if s.on_path[j]:
                screw[a] += step
            for k in range(m // 6):
                moved[6 * k + a] += s.patterns[s.pattern_of[j], k] * step
    for j in range(len(P)):
        if s.on_path[j]:
            for axis in range(6):
                for a in range(6):
                    screw[a] += P[j, axis, a] * errors[j, axis]
    for a in range(3, 6):
        screw[a] *= s.size
    residual, work = 0.0, 0.0
    for a in range(m):
        residual = max(residual, abs(moved[a]))
        work += abs(moved[a] * out.multipliers[point, a])
    out.residual[point] = residual
    gain, cost = _complementary(s, P, errors, out.multipliers[point], motions)
    # any multiple of the wrenches proves a bound: the best one, zero inside a zone
    factor = max(0.0, gain - work) / cost if cost > 0.0 else 0.0
    bound = 0.5 * factor * factor * cost
    for a in range(m):
        out.multipliers[point, a] *= factor
    out.bound[point] = bound
    energy = out.energy[point]
    allowed = GAP * energy + GAP_WITHOUT_CLEARANCE * out.without_clearance[point]
    # written so that NaN fails
    if energy - bound <= allowed and residual <= OPEN:
        return outcome
    return UNCERTIFIED


@part
def _complementary(
    s: Structure, P: Matrices, errors: Matrix, multipliers: Vector, motions: Vector
) -> tuple[float, float]:
    """Wrenches times f prove f gain - f^2 cost / 2: (gain, cost)."""
    # the complementary energy of assembly.linear.assembled.Assembly.bound
    n = len(P)
    wrenches = matrix(n, 6)
    at_platform = vector(6)
    total, cost = 0.0, 0.0
    for j in range(n):
        for a in range(6):
            at_platform[a] = 0.0
        for k in range(s.patterns.shape[1]):
            sign = s.patterns[s.pattern_of[j], k]
            if sign != 0.0:
                for a in range(6):
                    at_platform[a] += sign * multipliers[6 * k + a]
        for axis in range(6):
            for a in range(6):
                wrenches[j, axis] += P[j, axis, a] * at_platform[a]
            total -= wrenches[j, axis] * errors[j, axis]
    for c in range(len(s.springs)):
        component = 0.0
        for axis in range(6):
            component += s.springs[c, axis] * wrenches[s.spring_frame[c], axis]
        cost += component * component
    for c in range(len(s.starts) - 1):
        size = 0.0
        for i in range(s.starts[c], s.starts[c + 1]):
            component = s.cone_size[i] * wrenches[s.cone_frame[i], s.cone_axis[i]]
            size += component * component
        total -= np.sqrt(size)
    for c in range(len(motions)):
        total -= abs(wrenches[s.free_frame[c], s.free_axis[c]] * motions[c])
    return total, cost


@part
def _minimise(
    s: Structure, Gt: Matrix, h: Vector, u: Vector, v: Vector,
    y: Vector,
) -> int:  # fmt: skip
    """Least |G u + h|^2 / 2: u, v = G u + h, and the multipliers y (close to v)."""
    nu, r = Gt.shape
    outcome = NEWTON
    size = np.sqrt(inner(h, h))
    if nu == 0 or size == 0.0:
        copy(h, y)
        copy(h, v)
        return outcome
    for c in range(nu):
        size = max(size, np.sqrt(inner(Gt[c], Gt[c])))
    G, right = matrix(nu, r), divide(h, size)
    for c in range(nu):
        for i in range(r):
            G[c, i] = Gt[c, i] / size
    absolute = _STOP * GAP_WITHOUT_CLEARANCE * 0.5 * inner(right, right)
    outcome = small_answer(G, right, s.starts, _STOP * GAP, absolute, u, y)
    for i in range(r):
        v[i] = h[i]
        y[i] *= size
        for c in range(nu):
            v[i] += Gt[c, i] * u[c]
    return outcome


@part
def small_answer(
    Gt: Matrix, h: Vector, starts: Indices, relative: float,
    absolute: float, u: Vector, y: Vector,
) -> int:  # fmt: skip
    """Newton alone where all constraints are active, else after an interior point."""
    r, d = len(h), vector(len(u))
    dual = Dual(Gt, h, d, r, starts, relative, absolute)
    if dual_newton(dual, _STEPS_ALONE, 0.0, u, y) >= 0:
        return NEWTON
    G, H = np.ascontiguousarray(Gt.T), matrix(0, len(u))
    programme = Programme(G, h, d, H, vector(0), starts)
    near = _NEAR_WITHOUT_CLEARANCE * 0.5 * inner(h, h)
    # near a zone's edge the interior point stops early; Newton then takes longer
    for stop, most, steps in (
        (_NEAR, near, _STEPS), (relative, absolute, _STEPS_LAST)
    ):  # fmt: skip
        inside, _, _ = interior_point(programme, most, stop)
        copy(inside, u)
        into_cones(starts, u)
        if dual_newton(dual, steps, _FIRST_SIGMA, u, y) >= 0:
            break
    return INTERIOR
