"""Equilibrium of partly assembled robots with minimum energy.

The small screws of all frames are s = e + E y + U u + F q, where e are the errors, y
the springs, u the motions within clearances and q the free motions
(:mod:`forcefit.assembly.linear.closure`).  They satisfy the constraints

    R s + L y_f = b

of all fixtures and of all joined closures, where y_f are the springs of the fixtures.
The equilibrium minimises y.y / 2 minus the work of the loads.  Its multipliers are the
constraint wrenches.

Minimum energy may not determine all u and q.  The values closest to those after the
previous step are then used.  The distance is the sum of squares, with u divided by the
clearances and lengths divided by the reference length.
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

_OPEN = 1e-12  # [rad, reference lengths] tolerance of closed loops
_ROUNDING = 1e-14  # [-] round-off of the equations, relative to the right-hand side
_SOLVED = 1e-11  # [-] round-off of the springs, relative to the summands
_DRIVEN = 1e-8  # [-] tolerance for zero loads on free motions, relative to the load


class Held(NamedTuple):
    """Constraints of k partly assembled machines.

    Attributes:
        rows: (m, 6n) coefficients of the screws of all frames, with lengths in
            reference lengths.
        right: (k, m) right-hand sides.
        roots: (m, nf) coefficients of the fixtures' springs, whose energy is y.y / 2.
    """

    rows: NDArray
    right: NDArray
    roots: NDArray


class Movable(NamedTuple):
    """Motions that are not bolted, and the loads on them.

    Attributes:
        springs: (6n, ny) screws of links and joint springs, whose energy is y.y / 2.
        cones: (6n, nu) screws of motions within clearances, for the full clearance.
        group: (nu,) index of the cone to which each motion belongs.
        free: (6n, nq) screws of free motions, with lengths in reference lengths.
        on_springs: (k, ny) [sqrt(2 J)] loads on the springs, equal for all machines.
        on_cones: (k, nu) [J] loads on the motions within clearances.
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
        clearances: (k, nu) motions within the clearances, divided by the clearance.
        motions: (k, nq) free motions.
        multipliers: (k, m) [J] multipliers of the constraints, which are derivatives of
            the energy with respect to the right-hand sides.
    """

    springs: NDArray
    fixtures: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray

    @property
    def energy(self) -> NDArray:
        """Energy of all springs, including those of fixtures, (k,) [J]."""
        links = np.vecdot(self.springs, self.springs)
        return (links + np.vecdot(self.fixtures, self.fixtures)) / 2


class _Split(NamedTuple):
    """Constraint equations, separated into combinations with and without springs."""

    basis: NDArray
    values: NDArray
    elastic: NDArray
    rigid: NDArray
    spread: NDArray


def equilibrium(
    held: Held, movable: Movable, last: tuple[NDArray, NDArray], tolerance: float = RANK
) -> Equilibrium:
    """Return the minimum-energy equilibrium that is closest to the previous state.

    Args:
        held: constraints.
        movable: motions that are not bolted, and the loads on them.
        last: previous motions within clearances (k, nu) and free motions (k, nq).
        tolerance: tolerance for zero singular values, relative to the largest.

    Returns:
        The equilibrium.

    Raises:
        CannotAssemble: constraints without springs contradict each other.
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
    """Return the motions and loads without weights that act on unconstrained motions.

    It is assumed that the weight of a body that can still move freely is supported.

    Args:
        movable: motions that are not bolted, and the loads on them.
        weight: (nq,) [J] loads on the free motions due to weight.
        rows: (m, 6n) constraint rows.

    Returns:
        The motions with reduced loads.
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
    """Return multipliers that balance the loads on the free motions, (k, m)."""
    if not drive.any():
        return np.zeros((len(drive), len(B_q)))
    start = np.linalg.lstsq(B_q.T, -drive.T, rcond=RANK)[0].T
    left = np.abs(start @ B_q + drive).max()
    if left > _DRIVEN * np.abs(drive).max():
        raise FreeMotion("a load acts on a free motion, which nothing resists")
    return start


def _split(A: NDArray, tolerance: float, noise: float) -> _Split:
    """Separate the constraint equations into combinations with and without springs."""
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
    """Return motions within clearances, spring deformations and multipliers."""
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
        raise CannotAssemble(
            "the loops cannot be closed by deformations of springs and by motions "
            "within the clearances"
        )
    u = _closest(G, h, d, H, least, last, movable.group)
    strains = u @ G.T + h
    terms = np.abs(u) @ np.abs(G).T + np.abs(h)
    solved = _SOLVED * terms.max(axis=1, initial=0.0)
    strains[np.abs(strains) <= solved[:, None]] = 0.0
    inner = (strains / S) @ split.elastic.T
    inner += least.rigid_multipliers @ (split.rigid @ U[:, :rank]).T
    return u, strains, inner


def _check_closed(rigid: NDArray, right: NDArray) -> None:
    """Raise CannotAssemble if a loop without springs and clearances is open."""
    left = np.abs(rigid).max(initial=0.0)
    if left > _OPEN + 1e-9 * np.abs(right).max(initial=0.0):
        raise CannotAssemble(
            f"a rigid loop stays open by {left:.3g} rad or reference lengths, because "
            "it has no clearance or spring in this direction"
        )


def _closest(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, least: Minima, last: NDArray,
    group: NDArray,
) -> NDArray:  # fmt: skip
    """Return the minimum-energy motions closest to the previous ones, (k, nu)."""
    rows = np.vstack([G, H, d[:1]])  # the loads d are equal for all machines
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0] / size[size > 0, None]
    u = least.clearances
    _, S, Vt = np.linalg.svd(rows) if len(rows) else (0, np.zeros(0), np.eye(len(d.T)))
    kept = Vt[: rank_of(S, ROWS_RANK)]
    if len(kept) == len(Vt):
        return u
    return closest_of_same_energy(least, last, kept, (G, h, d, H, group))


def _moved(B_q: NDArray, right: NDArray, last: NDArray) -> NDArray:
    """Return the free motions closest to the last ones that satisfy the constraints."""
    if not B_q.shape[1]:
        return last
    return last + (right - last @ B_q.T) @ np.linalg.pinv(B_q, rcond=RANK).T
