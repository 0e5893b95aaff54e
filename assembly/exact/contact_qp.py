r"""Minimise a quadratic energy over clearances that satisfy cone constraints.

A step towards the exact equilibrium changes the clearances u by the v that minimises

        s . v + v . S v / 2   subject to   |u_k + v_k| <= 1,  H (u + v) = k.

S can be indefinite.  Far from the solution, S is replaced by a convex matrix, and
:mod:`forcefit.assembly.solvers.conic` solves the problem.  Near the solution, Newton's
method on the active constraints is accurate to machine precision.

======  ===========  =========  =====================================================
symbol  code         shape      meaning
======  ===========  =========  =====================================================
S s     ``S s``      (nu, ...)  [J] second derivative and gradient of the energy at u
u       ``start``    (nu,)      motions within the clearances, divided by the bounds
H k     ``rows`` ..  (p, nu)    loop-closure equations without springs and free joints
f       ``active``   (cones,)   [J] multiplier of each cone, 0 if inactive
======  ===========  =========  =====================================================

Sources:
    Nocedal, Wright (2006), Numerical Optimization, sections 16.5 and 18.1 (active
    sets, Newton's method on the optimality conditions).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.solvers.cones import cone_sizes
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.solvers.method import Method

AT_BOUNDARY = 1e-5  # [-] largest distance of an active constraint from its boundary
_STEPS = 15  # maximum number of Newton steps
_STILL = 1e-6  # [-] convergence tolerance on the step, relative to the clearances
# [-] tolerance for zero multipliers, relative to the largest multiplier
_ZERO_MULTIPLIER = 1e-11
_LONGEST = 0.3  # [-] longest step along a boundary, relative to its radius
# [-] trial values added to the curvature, relative to the largest curvature
_SHIFTS = (
    0.0,
    1e-9,
    1e-8,
    1e-7,
    1e-6,
    1e-5,
)
_LEAST_CURVATURE = 1e-10  # [-] lower bound of the curvature, relative to the largest


@dataclass(frozen=True, eq=False)
class ClearanceProblem:
    """Quadratic problem of a step; see the module docstring for the symbols.

    Attributes:
        S: (nu, nu) symmetric second derivative of the energy.
        s: (nu,) gradient of the energy.
        start: (nu,) motions within the clearances at the start.
        group: (nu,) index of the cone to which each motion belongs.
        rows: (p, nu) independent rows of the loop-closure equations.
        right: (p,) right-hand side of the loop-closure equations.
    """

    S: NDArray
    s: NDArray
    start: NDArray
    group: NDArray
    rows: NDArray
    right: NDArray

    @cached_property
    def multipliers(self) -> tuple[NDArray, NDArray]:
        """Multipliers of the cones (cones,) [J] and of ``rows`` (p,) at the start."""
        touching = cone_sizes(self.start, self.group) >= 1.0 - AT_BOUNDARY
        normals = boundary_normals(self.start, touching, self.group)
        balance = np.linalg.lstsq(np.hstack([normals, self.rows.T]), -self.s)[0]
        force = np.zeros(len(touching))
        force[touching] = np.maximum(balance[: normals.shape[1]], 0.0)
        return (
            np.where(force > 1e-9 * force.max(initial=0.0), force, 0.0),
            -balance[normals.shape[1] :],
        )


def cone_multipliers(u: NDArray, gradient: NDArray, group: NDArray) -> NDArray:
    """Return the multipliers of the cones for a given gradient, (cones,) [J]."""
    force = -np.bincount(group, weights=gradient * u)
    at_boundary = cone_sizes(u, group) >= 1.0 - AT_BOUNDARY
    return np.where(at_boundary, np.maximum(force, 0.0), 0.0)


def boundary_normals(u: NDArray, active: NDArray, group: NDArray) -> NDArray:
    """Return the normals to the boundaries of the active cones, (nu, active)."""
    return np.where(group[:, None] == np.flatnonzero(active), u[:, None], 0.0)


def clearance_step(
    problem: ClearanceProblem, near: bool, method: Method = "compiled"
) -> tuple[NDArray, NDArray] | None:
    """Return the step that minimises the energy subject to the cone constraints.

    Args:
        problem: the quadratic problem.
        near: whether to try Newton's method first, because the solution is close.
        method: method of :func:`forcefit.assembly.solvers.conic.minimise_energy`.

    Returns:
        The step (nu,) and the multipliers (p,) of ``rows``, or None if the problem is
        infeasible.
    """
    step = _newton(problem) if near else None
    return step or _convex(problem, method)


def _convex(p: ClearanceProblem, method: Method) -> tuple[NDArray, NDArray] | None:
    """Return the step that a convex approximation of S gives."""
    least = float(np.linalg.eigvalsh(p.S).min(initial=0.0))
    force, _ = p.multipliers
    active = force[p.group]
    if least >= 0.0 or not active.any():
        return _conic(p, p.S, p.s, method)
    # adding f (|u_k|^2 - 1) / 2 makes S convex; it is zero at the boundary, so the
    # minimum does not change
    normals = boundary_normals(p.start, force > 0.0, p.group)
    held = 0.99 * active
    convex = p.S + np.diag(held) - 10.0 * least * normals @ normals.T
    step = _conic(p, convex, p.s + held * p.start, method)
    if step is None:
        return None
    inside = cone_sizes(p.start + step[0], p.group) < 0.999
    free = active[inside[p.group]].any()
    return _conic(p, p.S, p.s, method) if free else step


def _conic(
    p: ClearanceProblem, S: NDArray, s: NDArray, method: Method
) -> tuple[NDArray, NDArray] | None:
    """Return the step computed by the conic solver."""
    values, vectors = np.linalg.eigh(S)
    floor = _LEAST_CURVATURE * max(float(np.abs(values).max(initial=0.0)), 1e-150)
    G = np.sqrt(np.maximum(values, floor))[:, None] * vectors.T
    least = minimise_energy(G, -G @ p.start, -s, p.rows, p.right, p.group, method)
    if not least.feasible:
        return None
    return least.clearances - p.start, least.rigid_multipliers


def _newton(p: ClearanceProblem) -> tuple[NDArray, NDArray] | None:
    """Return the step computed by Newton's method, or None if it fails."""
    force, rigid = p.multipliers
    u, active = p.start, force > 0.0
    for _ in range(_STEPS):
        gradient = p.s + p.S @ (u - p.start)
        force = cone_multipliers(u, gradient - p.rows.T @ rigid, p.group) * active
        step = _active_step(p, p.S + np.diag(force[p.group]), gradient, u, active)
        if step is None:
            return None
        change, forces, rigid = step
        u = u + change
        sizes = cone_sizes(u, p.group)
        exceeded, released = ~active & (sizes > 1.0), active.copy()
        released[active] = forces < -_ZERO_MULTIPLIER * forces.max(initial=0.0)
        u = u / np.where(active | exceeded, sizes, 1.0)[p.group]
        if not (exceeded | released).any() and np.abs(change).max(initial=0.0) < _STILL:
            v = u - p.start
            rise, size = p.s @ v + v @ p.S @ v / 2, np.abs(p.S).max(initial=0.0)
            return None if rise > 1e-12 * size else (v, rigid)
        active = (active | exceeded) & ~released
    return None


def _active_step(
    p: ClearanceProblem, S: NDArray, gradient: NDArray, u: NDArray, active: NDArray
) -> tuple[NDArray, NDArray, NDArray] | None:
    """Return the step and the multipliers for given active cones, or None."""
    C = np.hstack([boundary_normals(u, active, p.group), p.rows.T])
    count, boundaries = C.shape[1], int(active.sum())
    if count > len(u):
        return None
    Q, R = np.linalg.qr(C, mode="complete")
    if np.abs(np.diag(R)).min(initial=1.0) < 1e-9:
        return None
    to_boundary = (1.0 - cone_sizes(u, p.group)[active] ** 2) / 2
    wanted = np.concatenate([to_boundary, p.right - p.rows @ u])
    normal = Q[:, :count] @ np.linalg.solve(R[:count].T, wanted)
    values, vectors = np.linalg.eigh(Q[:, count:].T @ S @ Q[:, count:])
    Z = Q[:, count:] @ vectors
    largest = np.abs(values).max(initial=1e-100)
    if values.min(initial=0.0) < -1e-9 * largest:
        return None
    slope = Z.T @ (gradient + S @ normal)
    for shift in _SHIFTS:
        curvature = np.maximum(values, _LEAST_CURVATURE * largest) + shift * largest
        change = normal - Z @ (slope / curvature)
        if cone_sizes(change, p.group)[active].max(initial=0.0) <= _LONGEST:
            break
    else:
        return None
    forces = np.linalg.solve(R[:count], Q[:, :count].T @ -(gradient + S @ change))
    return change, forces[:boundaries], -forces[boundaries:]
