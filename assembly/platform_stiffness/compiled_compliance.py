r"""The classical compliance of many postures, compiled.

For a unit wrench e on the platform the closures carry lambda = lambda_e + Z' mu: the
first lets no free motion work, the second makes the springs' energy

    |y|^2 / 2,   y = B e + Y' mu,    Y = Z A_y,   B e = the springs under e and lambda_e

least.  Every spring's y under the six unit wrenches is its part of the compliance,
C = sum of y y' (Castigliano).  Built from :mod:`assembly.linear.compiled_reduction`, as
problem (22) is, and as exact: no compliances are added before anything is eliminated.
"""

from numpy.typing import NDArray

from assembly.linear.compiled_reduction import Triangle, eliminate
from assembly.linear.compiled_structure import paths_of
from assembly.linear.robot_structure import Structure
from assembly.linear.thresholds import MISMATCH_FACTOR, RANK
from assembly.solvers.compiled import kernel
from assembly.solvers.householder import turn, turn_back
from assembly.solvers.vectors import fill, matrix, vector

# FREE: a motion of the platform that nothing resists
SOLVED, FREE, AMBIGUOUS = range(3)
_STILL = 1e-9  # [-] of a unit wrench's work on a free motion that counts as none


@kernel(fastmath={"contract", "reassoc"})
def springs_of(s: Structure, P: NDArray, wrenches: NDArray, out: NDArray) -> None:
    """Scaled deformation of every spring under a unit wrench.

    Args:
        s: the robot.
        P: unit screws of all frames.
        wrenches: (np + 1, 6) the closures' wrench on each pattern, and the platform's.
        out: (ny,) to fill.
    """
    wrench = vector(6)
    last = -1
    for c in range(len(s.springs)):
        j = s.spring_frame[c]
        if j != last:
            # through the frame, in its axes: the same for all its springs
            for axis in range(6):
                work = 0.0
                for a in range(6):
                    through = wrenches[s.pattern_of[j], a]
                    through += s.on_path[j] * wrenches[len(wrenches) - 1, a]
                    work += P[j, axis, a] * through
                wrench[axis] = work
            last = j
        total = 0.0
        for axis in range(6):
            total += s.springs[c, axis] * wrench[axis]
        out[c] = total


@kernel(fastmath={"contract", "reassoc"})
def closure_wrenches(s: Structure, closing: NDArray, wrenches: NDArray) -> None:
    """The closures' wrench on frames of each pattern, into all rows but the last."""
    for g in range(len(s.patterns)):
        fill(wrenches[g], 0.0)
        for k in range(s.patterns.shape[1]):
            sign = s.patterns[g, k]
            if sign != 0.0:
                for a in range(6):
                    wrenches[g, a] += sign * closing[6 * k + a]


@kernel(fastmath={"contract", "reassoc"})
def hold_free_motions(
    s: Structure, P: NDArray, free: Triangle, row: int, closing: NDArray
) -> bool:
    """Closures' wrenches of least size with which a unit wrench moves nothing free.

    Args:
        s: the robot.
        P: unit screws of all frames.
        free: the free motions' columns.
        row: of the unit wrench.
        closing: (m,) to fill.

    Returns:
        Whether there are any.
    """
    fill(closing, 0.0)
    for i in range(len(free.columns)):
        j = s.free_frame[free.order[i]]
        left = -s.on_path[j] * P[j, s.free_axis[free.order[i]], row]
        for l in range(min(i, free.rank)):
            left -= free.columns[i, l] * closing[l]
        if i < free.rank:
            closing[i] = left / free.diagonal[i]
        elif abs(left) > _STILL:
            return False
    turn(free.columns, free.turns, free.rank, closing)
    return True


@kernel(fastmath={"contract", "reassoc"})
def comply(s: Structure, T: NDArray, mismatch: float, out: NDArray) -> int:
    """One posture: every spring under six unit wrenches, or why there is none.

    Args:
        s: the robot.
        T: (n, 4, 4) frames.
        mismatch: [rad, m] nominal closure error of the frames.
        out: (6, ny) [sqrt(2 J) per N m and N] to fill, translations and forces scaled.

    Returns:
        SOLVED, FREE, or AMBIGUOUS ranks.
    """
    P = paths_of(T, s)
    reduced = eliminate(s, P, RANK + MISMATCH_FACTOR * mismatch)
    if not reduced.decided:
        return AMBIGUOUS
    free, Z, L = reduced.free, reduced.Z, reduced.L
    Y, y_turns, y_diagonal, y_order, rank = reduced.springs
    m, groups, count = 6 * s.patterns.shape[1], len(s.groups) - 1, len(Z)
    closing, bent, mu = vector(m), vector(6 * groups), vector(count)
    wrenches = matrix(len(s.patterns) + 1, 6)
    for row in range(6):
        if not hold_free_motions(s, P, free, row, closing):
            return FREE
        fill(wrenches[len(wrenches) - 1], 0.0)
        wrenches[len(wrenches) - 1, row] = 1.0
        closure_wrenches(s, closing, wrenches)
        for g in range(groups):
            for b in range(6):
                total = 0.0
                for a in range(6):
                    through = wrenches[s.group_pattern[g], a]
                    through += s.group_on_path[g] * wrenches[len(wrenches) - 1, a]
                    total += L[g, a, b] * through
                bent[6 * g + b] = total
        # least squares by the triangle of Y: its rows are those of Z, reordered
        turn_back(Y, y_turns, rank, bent)
        for i in range(rank - 1, -1, -1):
            total = -bent[i]
            for l in range(i + 1, rank):
                total -= Y[l, i] * mu[l]
            mu[i] = total / y_diagonal[i]
        for i in range(rank):
            for a in range(m):
                closing[a] += mu[i] * Z[y_order[i], a]
        closure_wrenches(s, closing, wrenches)
        springs_of(s, P, wrenches, out[row])
    return SOLVED


@kernel(fastmath={"contract", "reassoc"})
def comply_all(
    s: Structure, T: NDArray, mismatch: NDArray, out: NDArray, status: NDArray
) -> None:
    """Many postures; see :func:`comply`.

    Args:
        s: the robot.
        T: (k, n, 4, 4) frames.
        mismatch: (k,) [rad, m].
        out: (k, 6, ny) to fill.
        status: (k,) to fill.
    """
    for point in range(len(T)):
        status[point] = comply(s, T[point], mismatch[point], out[point])
