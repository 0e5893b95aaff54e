"""Minimum energy of a partly assembled robot, for many sets of errors at once.

The small screws of all frames are s = e + E y + U u + F q. Here e are the errors, y the
springs, u the clearances and q the free motions
(:mod:`forcefit.assembly.linear.closure`).  At each assembly step, the rows

    R s + L y_f = b

of all fixtures and of all closures joined so far hold, where y_f are the springs of the
fixtures.  The equilibrium minimises y.y / 2 minus the work of the loads, and its
multipliers are the wrenches of the rows. The unknowns are eliminated as in
:mod:`forcefit.assembly.linear.reference.reduction`.

Clearances and free motions that the energy leaves undetermined stay as close as
possible to their values after the preceding step. Distance means the sum of squares,
with clearances in units of their bounds and lengths in reference lengths.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

from forcefit.assembly.kinematics.ranks import RANK, ROWS_RANK, noise_of, rank_of
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion, complement
from forcefit.assembly.solvers.many_programmes import (
    Minima,
    closest_of_same_energy,
    minimise_energies,
)

_OPEN = 1e-12  # [rad, reference lengths] closure error that counts as round-off
_ROUNDING = 1e-14  # round-off error of the equations relative to the right-hand side
_SOLVED = 1e-11  # strains below this fraction of their summands are solver round-off
_DRIVEN = 1e-8  # a smaller fraction of a load along a free motion is round-off


class Held(NamedTuple):
    """Constraint equations of k partly assembled machines, m rows each.

    Attributes:
        rows: (m, 6n) rows on the screws of all frames, lengths in reference lengths.
        right: (k, m) right-hand sides.
        roots: (m, nf) columns of the fixtures' springs, whose energy is y.y / 2.
    """

    rows: NDArray
    right: NDArray
    roots: NDArray


class Movable(NamedTuple):
    """Columns of the screws that may move, and the loads on them.

    Attributes:
        springs: (6n, ny) columns of links and joint springs, whose energy is y.y / 2.
        cones: (6n, nu) columns of clearances, in units of their bounds.
        group: (nu,) cone number of each clearance, from 0.
        free: (6n, nq) columns of free motions, lengths in reference lengths.
        on_springs: (k, ny) [sqrt(2 J)] loads on the springs. All machines have equal
            loads.
        on_cones: (k, nu) [J] loads on the clearances.
        on_free: (k, nq) [J] loads on the free motions.
    """

    springs: NDArray
    cones: NDArray
    group: NDArray
    free: NDArray
    on_springs: NDArray
    on_cones: NDArray
    on_free: NDArray


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """Unknowns of k machines at minimum energy.

    Attributes:
        springs: (k, ny) [sqrt(2 J)] scaled deformations of links and joints.
        fixtures: (k, nf) [sqrt(2 J)] scaled deformations of the fixtures.
        clearances: (k, nu) clearances in units of their bounds.
        motions: (k, nq) free motions.
        multipliers: (k, m) [J] multipliers of the rows: derivatives of the energy with
            respect to their right-hand sides.
    """

    springs: NDArray
    fixtures: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray

    @property
    def energy(self) -> NDArray:
        """(k,) [J] energy of all springs, including those of fixtures."""
        links = np.vecdot(self.springs, self.springs)
        return (links + np.vecdot(self.fixtures, self.fixtures)) / 2


class _Split(NamedTuple):
    """Constraint rows, split into rows with springs and rows without springs."""

    basis: NDArray
    values: NDArray
    elastic: NDArray
    rigid: NDArray
    spread: NDArray


def equilibrium(
    held: Held, movable: Movable, last: tuple[NDArray, NDArray], tolerance: float = RANK
) -> Equilibrium:
    """Find the minimum-energy equilibrium closest to the last state.

    Args:
        held: rows that hold, with fixed screws subtracted from their right-hand sides.
        movable: columns that may move, and the loads on them.
        last: preceding clearances (k, nu) and free motions (k, nq).
        tolerance: relative size below which a singular value counts as zero.

    Returns:
        The equilibrium.

    Raises:
        CannotAssemble: rows without springs contradict each other.
        FreeMotion: a load acts along a motion that nothing resists.
        SolverFailed: the solver for the clearances did not converge.
    """
    R = held.rows
    B_q, B_u = R @ movable.free, R @ movable.cones
    B_y = np.hstack([R @ movable.springs, held.roots])
    ny = movable.springs.shape[1]
    Z = complement(B_q, tolerance) if B_q.shape[1] else np.eye(len(R))
    start = _balancing(B_q, movable.on_free)
    loaded = np.zeros((len(start), B_y.shape[1]))
    loaded[:, :ny] = movable.on_springs
    loaded += start @ B_y
    right = (held.right - loaded @ B_y.T) @ Z
    rounding = _ROUNDING * np.abs(held.right).max(axis=1, initial=0.0)
    right[np.abs(right) <= rounding[:, None]] = 0.0
    split = _split(Z.T @ B_y, tolerance, noise_of(B_y))
    u, strains, inner = _least(
        split, Z.T @ B_u, right, movable, start @ B_u, last[0], noise_of(B_u)
    )
    y = loaded + strains @ split.spread.T
    q = _moved(B_q, held.right - y @ B_y.T - u @ B_u.T, last[1])
    return Equilibrium(y[:, :ny], y[:, ny:], u, q, start + inner @ Z.T)


def without_idle_weight(movable: Movable, weight: NDArray, rows: NDArray) -> Movable:
    """Remove the weight along motions that nothing resists from the loads.

    Args:
        movable: columns that may move, and the loads on them.
        weight: (nq,) [J] part of the loads on the free motions due to weight.
        rows: (m, 6n) rows that hold.

    Returns:
        The columns with reduced loads, because the fitter carries parts that are still
        free.
    """
    if not len(weight):
        return movable
    _, S, Vt = (
        np.linalg.svd(rows @ movable.free)
        if len(rows)
        else (0, (), np.eye(len(weight)))
    )
    idle = Vt[rank_of(np.asarray(S), RANK) :]
    return movable._replace(on_free=movable.on_free - weight @ idle.T @ idle)


def _balancing(B_q: NDArray, drive: NDArray) -> NDArray:
    """Return multipliers (k, m) that balance the loads on the free motions."""
    if not drive.any():
        return np.zeros((len(drive), len(B_q)))
    start = np.linalg.lstsq(B_q.T, -drive.T, rcond=RANK)[0].T
    left = np.abs(start @ B_q + drive).max()
    if left > _DRIVEN * np.abs(drive).max():
        raise FreeMotion("a load drives a motion that nothing resists")
    return start


def _split(A: NDArray, tolerance: float, noise: float) -> _Split:
    """Split constraint rows by singular values: with springs, without springs."""
    if not A.size:
        count = A.shape[0]
        none = np.zeros((count, 0)), np.eye(count), np.zeros((A.shape[1], 0))
        return _Split(A, np.zeros(0), *none)
    U, S, Vt = svd(A, full_matrices=True)
    rank = rank_of(S, tolerance, noise)
    return _Split(A, S[:rank], U[:, :rank], U[:, rank:], Vt[:rank].T)


def _least(
    split: _Split, A_u: NDArray, right: NDArray, movable: Movable, by_motions: NDArray,
    last: NDArray, noise: float,
) -> tuple[NDArray, NDArray, NDArray]:  # fmt: skip
    """Compute clearances, strains and multipliers of constraint rows with springs."""
    S = split.values
    h, rigid = right @ split.elastic / S, right @ split.rigid
    if not A_u.shape[1]:
        _check_closed(rigid, right)
        return np.zeros((len(right), 0)), h, h / S @ split.elastic.T
    G = -(split.elastic.T @ A_u) / S[:, None]
    U, values, _ = svd(split.rigid.T @ A_u, full_matrices=True)
    rank = rank_of(values, ROWS_RANK, noise)
    _check_closed(rigid @ U[:, rank:], right)
    H, k = U[:, :rank].T @ split.rigid.T @ A_u, rigid @ U[:, :rank]
    d = movable.on_cones + by_motions
    least = minimise_energies(G, h, d, H, k, movable.group)
    if not least.feasible.all():
        raise CannotAssemble("neither springs nor clearances can close the loops")
    u = _closest(G, h, d, H, least, last, movable.group)
    strains = u @ G.T + h
    terms = np.abs(u) @ np.abs(G).T + np.abs(h)
    solved = _SOLVED * terms.max(axis=1, initial=0.0)
    strains[np.abs(strains) <= solved[:, None]] = 0.0
    inner = (strains / S) @ split.elastic.T
    inner += least.rigid_multipliers @ (split.rigid @ U[:, :rank]).T
    return u, strains, inner


def _check_closed(rigid: NDArray, right: NDArray) -> None:
    """Reject constraint rows that neither springs nor clearances can satisfy."""
    left = np.abs(rigid).max(initial=0.0)
    if left > _OPEN + 1e-9 * np.abs(right).max(initial=0.0):
        raise CannotAssemble(
            f"a rigid part stays open by {left:.3g} rad or reference lengths: no "
            "clearance or spring acts there"
        )


def _closest(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, least: Minima, last: NDArray,
    group: NDArray,
) -> NDArray:  # fmt: skip
    """Find the minimum-energy clearances closest to the preceding ones."""
    rows = np.vstack([G, H, d[:1]])  # one row of d: machines have equal loads
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0] / size[size > 0, None]
    u = least.clearances
    _, S, Vt = np.linalg.svd(rows) if len(rows) else (0, np.zeros(0), np.eye(len(d.T)))
    kept = Vt[: rank_of(S, ROWS_RANK)]
    if len(kept) == len(Vt):
        return u
    return closest_of_same_energy(least, last, kept, (G, h, d, H, group))


def _moved(B_q: NDArray, right: NDArray, last: NDArray) -> NDArray:
    """Find the free motions closest to the last ones that satisfy all constraints."""
    if not B_q.shape[1]:
        return last
    return last + (right - last @ B_q.T) @ np.linalg.pinv(B_q, rcond=RANK).T
