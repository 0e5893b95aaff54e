r"""Quadratic energies in the clearances, convex or not, within their cones.

A step of the exact equilibrium asks for the change v of the clearances u that makes

    s . v + v . S v / 2  least  with  |u_k + v_k| <= 1,  H (u + v) = k,

where S has directions of negative curvature: across the rims that joints press on,
which is harmless, and now and then elsewhere.  Far from the answer S is made convex
and :mod:`assembly.solvers.conic` is asked; near it Newton's method along the rims is
exact to rounding, where the conic solver stops at half of the digits.

======  ===========  =========  =====================================================
symbol  code         shape      meaning
======  ===========  =========  =====================================================
S s     ``S s``      (nu, ...)  [J] curvature and gradient of the energy at u
u       ``start``    (nu,)      clearances in units of their cones
H k     ``rows`` ..  (p, nu)    closures that only clearances can shut
f       ``pressed``  (cones,)   [J] force on the rim of each cone, 0 inside
======  ===========  =========  =====================================================

Sources:
    Nocedal, Wright (2006), Numerical Optimization, sections 16.5 and 18.1 (active
    sets, Newton's method on the conditions of a constrained minimum).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.conic import cone_sizes, minimise_energy

AT_RIM = 1e-5  # [-] below size 1 within which a cone counts as at its rim
_INNER = 15  # steps along the rims
_STILL = 1e-6  # [-] size of the last, in sizes of the cones
_NO_FORCE = 1e-11  # of the largest on a rim: pulls as small do not leave it
_FARTHEST = 0.3  # [-] of a step along a rim, which is round
_SHIFTS = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5)  # of the largest curvature, to get there
_FLAT = 1e-10  # of the largest curvature: what less counts as


@dataclass(frozen=True, eq=False)
class PlayProblem:
    """What is asked; see the head of this module.

    Attributes:
        S: (nu, nu) symmetric.
        s: (nu,).
        start: (nu,) within the cones.
        group: (nu,) cone of each clearance.
        rows: (p, nu) independent.
        right: (p,).
    """

    S: NDArray
    s: NDArray
    start: NDArray
    group: NDArray
    rows: NDArray
    right: NDArray

    @property
    def pressed(self) -> NDArray:
        """(cones,) [J] force on the rim of each cone, 0 inside, at the start."""
        force = rim_forces(self.start, self.s, self.group)
        return np.where(force > 1e-9 * force.max(initial=0.0), force, 0.0)


def rim_forces(u: NDArray, pull: NDArray, group: NDArray) -> NDArray:
    """(cones,) [J] outward force on cones at their rims, from the energy's gradient."""
    force = -np.bincount(group, weights=pull * u)
    return np.where(cone_sizes(u, group) >= 1.0 - AT_RIM, np.maximum(force, 0.0), 0.0)


def across_rims(u: NDArray, rim: NDArray, group: NDArray) -> NDArray:
    """(nu, rims) directions across the rims of the cones marked."""
    return np.where(group[:, None] == np.flatnonzero(rim), u[:, None], 0.0)


def move_play(problem: PlayProblem, near: bool) -> tuple[NDArray, NDArray] | None:
    """Change of the clearances by which the energy falls most within the cones.

    Args:
        problem: what is asked.
        near: whether the answer is near enough for Newton's method to be tried.

    Returns:
        The change (nu,) and the multipliers (p,) of ``rows``; None if no play within
        the cones satisfies them.
    """
    found = _newton(problem) if near else None
    return found or _convex(problem)


def _convex(p: PlayProblem) -> tuple[NDArray, NDArray] | None:
    """The answer with S made convex, first where that costs nothing."""
    least = float(np.linalg.eigvalsh(p.S).min(initial=0.0))
    pressed = p.pressed[p.group]
    if least >= 0.0 or not pressed.any():
        return _conic(p, p.S, p.s)
    # f (|u_k|^2 - 1) / 2 vanishes at the rim, and across it nothing moves to first
    # order: both make S convex where it matters, and leave the minimum where it is
    across = across_rims(p.start, p.pressed > 0.0, p.group)
    held = 0.99 * pressed
    convex = p.S + np.diag(held) - 10.0 * least * across @ across.T
    found = _conic(p, convex, p.s + held * p.start)
    if found is None:
        return None
    left = cone_sizes(p.start + found[0], p.group) < 0.999
    return _conic(p, p.S, p.s) if pressed[left[p.group]].any() else found


def _conic(p: PlayProblem, S: NDArray, s: NDArray) -> tuple[NDArray, NDArray] | None:
    """The answer of the conic solver; negative curvature counts as none."""
    values, vectors = np.linalg.eigh(S)
    floor = _FLAT * max(float(np.abs(values).max(initial=0.0)), 1e-150)
    G = np.sqrt(np.maximum(values, floor))[:, None] * vectors.T
    least = minimise_energy(G, -G @ p.start, -s, p.rows, p.right, p.group)
    if not least.feasible:
        return None
    return least.clearances - p.start, least.rigid_multipliers


def _newton(p: PlayProblem) -> tuple[NDArray, NDArray] | None:
    """Newton's method along the rims of the cones pressed; None if that fails."""
    u, rim = p.start, p.pressed > 0.0
    for _ in range(_INNER):
        pull = p.s + p.S @ (u - p.start)
        force = rim_forces(u, pull, p.group) * rim
        found = _along_rims(p, p.S + np.diag(force[p.group]), pull, u, rim)
        if found is None:
            return None
        change, forces, rigid = found
        u = u + change
        sizes = cone_sizes(u, p.group)
        over, slack = ~rim & (sizes > 1.0), rim.copy()
        slack[rim] = forces < -_NO_FORCE * forces.max(initial=0.0)
        u = u / np.where(rim | over, sizes, 1.0)[p.group]
        if not (over | slack).any() and np.abs(change).max(initial=0.0) < _STILL:
            v = u - p.start
            rise, size = p.s @ v + v @ p.S @ v / 2, np.abs(p.S).max(initial=0.0)
            return None if rise > 1e-12 * size else (v, rigid)
        rim = (rim | over) & ~slack
    return None


def _along_rims(
    p: PlayProblem, S: NDArray, pull: NDArray, u: NDArray, rim: NDArray
) -> tuple[NDArray, NDArray, NDArray] | None:
    """One step: change, forces on rims, multipliers; None where there is no minimum."""
    C = np.hstack([across_rims(u, rim, p.group), p.rows.T])
    count, rims = C.shape[1], int(rim.sum())
    if count > len(u):
        return None
    Q, R = np.linalg.qr(C, mode="complete")
    if np.abs(np.diag(R)).min(initial=1.0) < 1e-9:
        return None
    onto = (1.0 - cone_sizes(u, p.group)[rim] ** 2) / 2
    wanted = np.concatenate([onto, p.right - p.rows @ u])
    normal = Q[:, :count] @ np.linalg.solve(R[:count].T, wanted)
    values, vectors = np.linalg.eigh(Q[:, count:].T @ S @ Q[:, count:])
    Z = Q[:, count:] @ vectors
    largest = np.abs(values).max(initial=1e-100)
    if values.min(initial=0.0) < -1e-9 * largest:
        return None
    slope = Z.T @ (pull + S @ normal)
    for shift in _SHIFTS:
        stiff = np.maximum(values, _FLAT * largest) + shift * largest
        change = normal - Z @ (slope / stiff)
        if cone_sizes(change, p.group)[rim].max(initial=0.0) <= _FARTHEST:
            break
    else:
        return None
    forces = np.linalg.solve(R[:count], Q[:, :count].T @ -(pull + S @ change))
    return change, forces[:rims], -forces[rims:]
