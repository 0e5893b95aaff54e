r"""Newton's method for an equilibrium with known contacts within clearances.

A clearance is called closed if the joint is at the bound of its clearance with a
nonzero contact force.  A cone program is solved to a relative accuracy of about 1e-6.
Once the closed clearances are known, the equilibrium is the solution of the equations

    [ H   A'  N ] [ dx       ]     [ g ]      g = H_y y - loads - A' lambda + N f
    [ A   0   0 ] [ -dlambda ] = - [ r ],     r = A x + misfit
    [ N'  0   0 ] [ df       ]     [ c ]      c = (|u_k|^2 - 1) / 2

which Newton's method solves to machine precision.  The columns of N are the unit
normals u_k to the bounds of the closed clearances.

Sources:
    Nocedal, Wright (2006), Numerical Optimization, sections 16.2 and 18.1.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from forcefit.assembly.exact.contact_qp import boundary_normals
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import Linearisation, VirtualJoints
from forcefit.assembly.linear.load import FrameLoads
from forcefit.assembly.solvers.cones import cone_sizes

AT_BOUND = 1e-6  # [-] tolerance of a contact, relative to the clearance
# [-] largest distance from the bound, relative to the clearance, at which a contact
# force is possible
_NEAR_BOUND = 1e-3
_PRESSED = 1e-8  # [-] tolerance for zero forces, relative to the largest force
# [-] tolerance for zero forces, relative to the energy without clearance
_ROUNDING = 1e-12
_RANK = 1e-10  # [-] tolerance for zero singular values, relative to the largest
_FLAT = 1e-12  # [-] tolerance for zero curvatures, relative to the largest
_STEPS = 4  # maximum number of Newton steps
_SETTLED = 1e-14  # [-] tolerance by which a motion may exceed its clearance
_GUESSES = 3  # maximum number of trial sets of closed clearances


def contacts(assembly: Assembly) -> tuple[NDArray, NDArray]:
    """Return the contacts with a force, and the contacts without a force.

    A joint is in contact if its distance from the bound is at most 1e-6 of the
    clearance.  If there is a contact force, distances of up to 1e-3 are accepted,
    because a cone solver is inexact.

    Args:
        assembly: minimum-energy assembly.

    Returns:
        Two boolean arrays (cones,): contacts with a force and contacts without one.
    """
    force = bound_forces(assembly)
    gap = 1.0 - cone_sizes(assembly.clearances, assembly.joints.group)
    largest = force.max(initial=0.0)
    at_bound = gap <= AT_BOUND
    least = max(_PRESSED * largest, _ROUNDING * assembly.energy_without_clearance)
    scale = max(largest, assembly.stored)
    near = at_bound | ((gap <= _NEAR_BOUND) & (force > gap * scale))
    pressed = near & (force > least)
    return pressed, at_bound & ~pressed


def bound_forces(assembly: Assembly) -> NDArray:
    """Return the product of contact force and clearance, (cones,) [J]."""
    forces = assembly.joints.cones.T @ assembly.joint_wrenches.ravel()
    return cone_sizes(forces, assembly.joints.group)


def settle(assembly: Assembly) -> Assembly:
    """Refine an equilibrium of problem (22) to machine precision by Newton's method.

    Args:
        assembly: minimum-energy assembly computed by a cone solver.

    Returns:
        The refined assembly.  The given assembly is returned if no clearance is closed,
        or if the closed clearances cannot be identified.
    """
    pressed, _ = contacts(assembly)
    for _ in range(_GUESSES):
        if not pressed.any():
            break
        settled = _settled(assembly, pressed)
        size = cone_sizes(settled.clearances, settled.joints.group)
        if np.array_equal(contacts(settled)[0], pressed) and np.all(size <= 1 + 1e-9):
            return settled
        # a joint beyond its bound must have a contact force
        beyond = size > 1.0 + 1e-9
        if not (beyond & ~pressed).any():
            break
        pressed = pressed | beyond
    return assembly


def _settled(assembly: Assembly, pressed: NDArray) -> Assembly:
    """Return the equilibrium for given closed clearances."""
    joints, group = assembly.joints, assembly.joints.group
    x, multipliers = unknowns(assembly), assembly.multipliers
    bounded = bounded_unknowns(joints)
    rows = closure_rows(assembly.linearisation, joints)
    misfit = assembly.linearisation.misfit
    loads = work_of_loads(assembly.frame_loads, joints)
    for _ in range(_STEPS):
        u = x[bounded]
        force = np.bincount(group, (loads + rows.T @ multipliers)[bounded] * u)
        H = curvature(joints, force * pressed)
        held = np.vstack([rows, _normals(joints, u, pressed).T])
        beyond = (cone_sizes(u, group)[pressed] ** 2 - 1) / 2
        left = np.append(rows @ x + misfit, beyond)
        gradient = H @ x - loads - rows.T @ multipliers
        dx, forces = newton_step(H, held, left, gradient)
        x, multipliers = x + dx, multipliers + forces[: len(rows)]
        if np.abs(beyond).max() <= _SETTLED:
            break
    y, u, q = np.split(x, [bounded.start, bounded.stop])
    return replace(
        assembly, elastic=y, clearances=u, motions=q, multipliers=multipliers
    )


def unknowns(assembly: Assembly) -> NDArray:
    """Return the unknowns (N,): springs, clearances and free motions."""
    parts = (assembly.elastic, assembly.clearances, assembly.motions)
    return np.concatenate(parts)


def bounded_unknowns(joints: VirtualJoints) -> slice:
    """Return the slice of the clearances among the unknowns."""
    springs = joints.elastic.shape[1]
    return slice(springs, springs + len(joints.group))


def closure_rows(lin: Linearisation, joints: VirtualJoints) -> NDArray:
    """Return the coefficients of the loop-closure equations, (6 closures, N)."""
    return lin.rows @ np.hstack([joints.elastic, joints.cones, joints.free])


def work_of_loads(loads: FrameLoads, joints: VirtualJoints) -> NDArray:
    """Return the work of the loads per unit of each unknown, (N,) [J]."""
    of_links, of_joints = (joints.elastic.T @ w for w in (loads.body, loads.joint))
    springs = np.where(joints.links, of_links, of_joints)
    others = (columns.T @ loads.joint for columns in (joints.cones, joints.free))
    return np.concatenate([springs, *others])


def curvature(joints: VirtualJoints, force: NDArray) -> NDArray:
    """Return the second derivative of the Lagrangian, (N, N) [J].

    Contributions are those of springs, and of contact forces on curved bounds.
    """
    diagonal = [np.ones(joints.elastic.shape[1]), force[joints.group]]
    return np.diag(np.concatenate([*diagonal, np.zeros(joints.free.shape[1])]))


def _normals(joints: VirtualJoints, u: NDArray, pressed: NDArray) -> NDArray:
    """Return the normals to the bounds of the closed clearances, (N, pressed)."""
    normals = np.zeros((_count(joints), int(pressed.sum())))
    normals[bounded_unknowns(joints)] = boundary_normals(u, pressed, joints.group)
    return normals


def _count(joints: VirtualJoints) -> int:
    """Return the number of unknowns."""
    return bounded_unknowns(joints).stop + joints.free.shape[1]


def held_rows(assembly: Assembly, pressed: NDArray) -> NDArray:
    """Return the derivatives of the constraints, (6 closures + pressed, N)."""
    normals = _normals(assembly.joints, assembly.clearances, pressed)
    return np.vstack([closure_rows(assembly.linearisation, assembly.joints), normals.T])


def newton_step(
    H: NDArray, held: NDArray, left: NDArray, gradient: NDArray
) -> tuple[NDArray, NDArray]:
    """Solve for the Newton step of the equations in the module docstring.

    Args:
        H: (N, N) [J] second derivative of the Lagrangian.
        held: (m, N) derivatives of the constraints.
        left: (m,) residuals of the constraints.
        gradient: (N,) [J] gradient of the Lagrangian.

    Returns:
        Change of the unknowns (N,) and of the multipliers (m,).  The minimum-norm
        solution is returned if the solution is not unique.
    """
    closing = -np.linalg.lstsq(held, left, rcond=_RANK)[0]
    Z = null_space(held, rcond=_RANK) if len(held) else np.eye(len(H))
    K, load = Z.T @ H @ Z, Z.T @ (gradient + H @ closing)
    dx = closing - Z @ (np.linalg.pinv(K, rcond=_FLAT, hermitian=True) @ load)
    return dx, np.linalg.lstsq(held.T, gradient + H @ dx, rcond=_RANK)[0]
