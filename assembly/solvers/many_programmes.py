"""Compiled solution of cone programs that differ only in their right-hand sides.

Each program has the form of :func:`forcefit.assembly.solvers.conic.minimise_energy` and
is solved in one lane of the processor's vector registers.  Programs without certified
solution are solved again one by one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts
from forcefit.assembly.solvers.conic import (
    GAP,
    GAP_WITHOUT_CLEARANCE,
    SolverFailed,
    minimise_energy,
)

# fraction of GAP that is required here, because the duality gap of the problem before
# elimination of the springs is larger
_SHARE = 0.1
_RESIDUAL = 1e-11  # largest residual of H u = k
# smallest contact force that is not round-off, relative to the force without clearance
_LOADED = 1e-9


class Minima(NamedTuple):
    """Solutions of :func:`minimise_energies`.

    Attributes:
        clearances: (n, nu) clearances relative to their bounds.
        rigid_multipliers: (n, p) [J] multipliers of the equations H u = k.
        feasible: (n,) bool, True if H u = k has a solution within the cones.
    """

    clearances: NDArray
    rigid_multipliers: NDArray
    feasible: NDArray


def minimise_energies(
    G: NDArray, h: NDArray, d: NDArray, H: NDArray, k: NDArray, group: NDArray
) -> Minima:
    """Minimise |G u + h|^2 / 2 - d.u subject to H u = k and |u_c| <= 1 for each cone.

    Args:
        G: (r, nu) [sqrt(2 J)] matrix.
        h: (n, r) [sqrt(2 J)] vectors.
        d: (n, nu) [J] vectors.
        H: (p, nu) matrix of full row rank.
        k: (n, p) vectors.
        group: (nu,) cone of each column, counted from 0.

    Returns:
        The minimisers, whose duality gaps are certified.

    Raises:
        SolverFailed: no usable solution was found for one of the programs.
    """
    rows = np.linalg.norm(H, axis=1)
    unit, sides = H / rows[:, None], k / rows
    u, y = np.zeros_like(d), np.zeros((len(h), len(G) + len(H)))
    given = (np.ascontiguousarray(a, dtype=float) for a in (G, h, d, unit, sides))
    kernels.minimise_all(*given, cone_starts(group), u, y)
    u, n = into_cones_of_each(u, group), y[:, len(G) :]
    proved = _proved((G, h, d, unit, sides, group), u, n)
    minima = Minima(u, -n / rows, np.ones(len(h), dtype=bool))
    for i in np.flatnonzero(~proved).tolist():
        least = minimise_energy(G, h[i], d[i], H, k[i], group)
        u[i], minima.feasible[i] = least.clearances, least.feasible
        minima.rigid_multipliers[i] = least.rigid_multipliers
    return minima


def into_cones_of_each(u: NDArray, group: NDArray) -> NDArray:
    """Project vectors (n, nu) onto the unit cones."""
    return u / np.maximum(1.0, cone_sizes(u, group))[:, group]


def _proved(problem: tuple[NDArray, ...], u: NDArray, n: NDArray) -> NDArray:
    """Return a mask (n,) of solutions with small residuals and small duality gaps.

    The lower bound is that of :func:`forcefit.assembly.solvers.conic.minimise_energy`
    for y = G u + h, or for the best multiple of y and n if no load acts.
    """
    G, h, d, H, k, group = problem
    y = u @ G.T + h
    cost = np.vecdot(y, y)
    value = cost / 2 - np.vecdot(d, u)
    gain = np.vecdot(y, h) - np.vecdot(n, k)
    gain -= cone_sizes(y @ G - d + n @ H, group).sum(axis=1)
    factor = np.clip(gain, 0.0, None) / np.where(cost > 0.0, cost, 1.0)
    unloaded = ~d.any(axis=1)
    bound = np.where(unloaded, factor**2 * cost / 2, gain - cost / 2)
    allowed = GAP * np.abs(value) + GAP_WITHOUT_CLEARANCE * np.vecdot(h, h) / 2
    residual = np.abs(u @ H.T - k).max(axis=1, initial=0.0)
    return (value - bound <= _SHARE * allowed) & (residual <= _RESIDUAL)


def closest_of_same_energy(
    minima: Minima, last: NDArray, rows: NDArray, problem: tuple[NDArray, ...]
) -> NDArray:
    """Return the minimisers that are closest to given points.

    Args:
        minima: n solutions of :func:`minimise_energies`.
        last: (n, nu) given points.
        rows: (p, nu) orthonormal rows of equations that the minimisers satisfy.
        problem: G, h, d, H and group of :func:`minimise_energies`.

    Returns:
        (n, nu) clearances of the closest minimisers.
    """
    G, h, d, H, group = problem
    u = minima.clearances
    forces = (u @ G.T + h) @ G - d - minima.rigid_multipliers @ H
    size, slack = cone_sizes(forces, group), 1.0 - cone_sizes(u, group)
    scale = (np.abs(h) @ np.abs(G) + np.abs(d)).max(axis=1, initial=0.0)[:, None]
    # A clearance with a contact force is at its bound. In the computed solution, either
    # the force or the distance from the bound is nearly zero.
    kept = (size > scale * slack) & (size > _LOADED * scale) & (scale > 0.0)
    closest, solved = np.array(u, order="C"), np.zeros(len(u), dtype=np.int64)
    starts = cone_starts(group)
    given = (np.ascontiguousarray(a, dtype=float) for a in (last, kept[:, group]))
    kernels.closest_points(np.ascontiguousarray(rows), starts, *given, closest, solved)
    for i in np.flatnonzero(solved == 0).tolist():
        closest[i] = _closest(u[i], last[i], rows, group)
    return closest


def _closest(u: NDArray, last: NDArray, rows: NDArray, group: NDArray) -> NDArray:
    """Return the minimiser that is closest to a given point, for one program."""
    eye, zero = np.eye(len(u)), np.zeros(len(u))
    try:
        found = minimise_energy(eye, -last, zero, rows, rows @ u, group)
    except SolverFailed:
        return u
    return found.clearances if found.feasible else u
