"""Problem (22), compiled from the frames' poses to the certified answer.

Points that this does not cover go to the fallback, with a code for the reason.  A point
counts as solved only if its certificate, computed from the wrenches on the problem
before any elimination, proves the gap asked for.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_loads import Loaded, balance, loaded_gap, unloaded
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

NEWTON, INTERIOR, RIGID, AMBIGUOUS, UNCERTIFIED, BOUNDED, DRIVEN = range(7)
_STOP = 3e-3  # the solvers stop at this fraction of the accepted gap
# gap from which Newton's method finishes: of the energy, of that without clearance
_NEAR, _NEAR_WITHOUT_CLEARANCE = 1e-8, 1e-9
_STEPS_ALONE, _STEPS, _STEPS_LAST = 6, 20, 150  # of Newton's method
_FIRST_SIGMA = 1e6  # after the interior-point method, see dual_newton


@kernel
def assemble_all(
    s: Structure, T: NDArray, errors: NDArray, mismatch: NDArray, loads: NDArray,
    out: Solutions,
) -> None:  # fmt: skip
    """Solve every point; see :class:`~assembly.linear.solutions.Solutions`.

    Args:
        s: the robot.
        T: (k, n, 4, 4) frames.
        errors: (k, n, 6) [rad, m], or (1, n, 6) for all.
        mismatch: (k,) [rad, m] nominal closure error of the frames.
        loads: (k, 2, n, 6) [N m, N] on bodies and on joints in the frames' axes; no
            rows if there are none.
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
        under = unloaded(s, Z.shape[1])
        if len(loads):
            under = balance(s, P, loads[point], reduced.free, Z, reduced.springs)
        if under.driven:
            out.outcome[point] = DRIVEN
            continue
        u, v, y = vector(len(Gt)), vector(rank), vector(rank)
        outcome = _minimise(s, Gt, h, under, u, v, y)
        # back to the full problem
        closing = vector(Z.shape[1])
        for i in range(rank):
            for a in range(len(closing)):
                closing[a] += Z[i, a] * y[i]
        multipliers = out.multipliers[point]
        for a in range(len(closing)):
            multipliers[a] = closing[a] + under.holding[a]
        _least_multipliers(Z, rank, multipliers)
        for c in range(len(u)):
            out.clearances[point, c] = u[c]
        for i in range(rank):
            v[i] -= under.left[i]
        spring = vector(Y.shape[1])
        copy(v, spring)
        turn(Y, y_turns, rank, spring)
        if len(out.elastic):
            own_springs(s, P, spring, out.elastic[point])
            for c in range(len(under.tight)):
                out.elastic[point, s.spring_order[c]] += under.tight[c]
        out.energy[point] = 0.5 * inner(v, v) + under.stored + inner(v, under.left)
        out.without_clearance[point] = 0.5 * inner(h, h) + under.stored
        moved = moved_by(s, P, L, u, spring, known, out.platform_screw[point])
        if len(loads):
            _move_tight(s, P, under.tight, moved, out.platform_screw[point])
        motions = out.motions[point]
        least_motions(F, turns, diagonal, order, free, moved, motions)
        if len(loads):
            # t is orthogonal to what closures do to springs
            work = 2.0 * under.stored + inner(under.d, u)
            out.work[point] = work + inner(under.holding, known)
        gap = -1.0  # without loads the best multiple of the wrenches says it
        if len(loads):
            strains = v, spring
            gap = loaded_gap(s, P, L, under, closing, strains, u, motions, multipliers)
        out.outcome[point] = _certify(point, s, P, own, moved, outcome, gap, out)


@part
def _move_tight(
    s: Structure, P: Matrices, tight: Vector, moved: Vector, screw: Vector
) -> None:
    """Adds what loads alone bend to what closures are open, and to the screw."""
    for c in range(len(tight)):
        j = s.spring_frame[c]
        for axis in range(6):
            strain = s.springs[c, axis] * tight[c]
            if strain != 0.0:
                for a in range(6):
                    step = P[j, axis, a] * strain
                    screw[a] += s.on_path[j] * step
                    for k in range(len(moved) // 6):
                        moved[6 * k + a] += s.patterns[s.pattern_of[j], k] * step


@part
def _least_multipliers(Z: Matrix, rank: int, multipliers: Vector) -> None:
    """Multipliers of the closures, the least ones where they are not unique."""
    m = len(multipliers)
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
    gap: float, out: Solutions,
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
    residual, slip = 0.0, 0.0
    for a in range(m):
        residual = max(residual, abs(moved[a]))
        slip += abs(moved[a] * out.multipliers[point, a])
    out.residual[point] = residual
    energy = out.energy[point]
    bound = energy - gap - slip
    if gap < 0.0:
        gain, cost = _complementary(s, P, errors, out.multipliers[point], motions)
        # any multiple of the wrenches proves a bound: the best one, zero inside a zone
        factor = max(0.0, gain - slip) / cost if cost > 0.0 else 0.0
        bound = 0.5 * factor * factor * cost
        for a in range(m):
            out.multipliers[point, a] *= factor
    out.bound[point] = bound
    largest = out.without_clearance[point] + abs(out.work[point])
    allowed = GAP * energy + GAP_WITHOUT_CLEARANCE * largest
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
    s: Structure, Gt: Matrix, h: Vector, under: Loaded, u: Vector, v: Vector,
    y: Vector,
) -> int:  # fmt: skip
    """Least |G u + h|^2 / 2 - d.u: u, v = G u + h, and multipliers y (close to v)."""
    nu, r = Gt.shape
    outcome = NEWTON
    size, most = np.sqrt(inner(h, h)), 0.0
    for c in range(nu):
        most = max(most, abs(under.d[c]))
    if nu == 0 or size + most == 0.0:
        copy(h, y)
        copy(h, v)
        return outcome
    for c in range(nu):
        size = max(size, np.sqrt(inner(Gt[c], Gt[c])))
    size = max(size, np.sqrt(most))
    G, right, d = matrix(nu, r), divide(h, size), divide(under.d, size * size)
    for c in range(nu):
        for i in range(r):
            G[c, i] = Gt[c, i] / size
    without, bent = 0.5 * inner(right, right), under.stored / (size * size)
    limits = limits_of(_STOP, without, bent)
    outcome = small_answer(G, right, d, s.starts, limits, u, y)
    for i in range(r):
        v[i] = h[i]
        y[i] *= size
        for c in range(nu):
            v[i] += Gt[c, i] * u[c]
    return outcome


class Limits(NamedTuple):
    """Gaps asked for.

    Attributes:
        relative: of the strains' energy ..
        absolute: .. plus this.
        near: gap beside 1e-8 of that energy from which Newton's method finishes.
    """

    relative: float
    absolute: float
    near: float


@part
def limits_of(stop: float, without: float, bent: float) -> Limits:
    """Of a fraction of the accepted gap, energies without clearances and of loads."""
    absolute = GAP_WITHOUT_CLEARANCE * without + (GAP + GAP_WITHOUT_CLEARANCE) * bent
    near = _NEAR_WITHOUT_CLEARANCE * without + (_NEAR + _NEAR_WITHOUT_CLEARANCE) * bent
    return Limits(stop * GAP, stop * absolute, near)


@part
def small_answer(
    Gt: Matrix, h: Vector, d: Vector, starts: Indices, limits: Limits, u: Vector,
    y: Vector,
) -> int:  # fmt: skip
    """Newton alone where all constraints are active, else after an interior point."""
    relative, absolute, near = limits
    dual = Dual(Gt, h, d, len(h), starts, relative, absolute)
    if dual_newton(dual, _STEPS_ALONE, 0.0, u, y) >= 0:
        return NEWTON
    G, H = np.ascontiguousarray(Gt.T), matrix(0, len(u))
    programme = Programme(G, h, d, H, vector(0), starts)
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
