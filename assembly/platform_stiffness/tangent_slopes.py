r"""Derivative of the platform compliance with respect to a parameter of the robot.

The tangent stiffness depends on a parameter p directly and through the equilibrium.
The equilibrium consists of the unknowns x, the multipliers lambda of the loop-closure
equations and the contact forces f in the closed clearances.  It changes by

    [ H   A'  N ] [ dx       ]     [ dg/dp ]
    [ A   0   0 ] [ -dlambda ] = - [ dr/dp ] dp
    [ N'  0   0 ] [ df       ]     [   0   ]

(:mod:`.active_set`).  Here g is the gradient of the Lagrangian, r the residual of the
loop-closure equations, and N the normals to the bounds of the closed clearances.  The
tangent stiffness is evaluated at p + dp and at p - dp, and its derivative is the
central difference.

At a change of contact, the tangent stiffness has no derivative, and the result is NaN.

Sources:
    Haftka, Adelman (1989), Recent developments in structural sensitivity analysis
    (semi-analytical derivatives).
    Fiacco (1983), Introduction to Sensitivity and Stability Analysis in Nonlinear
    Programming, chapter 2 (derivatives of solutions with active constraints).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.contact_qp import boundary_normals
from forcefit.assembly.exact.dead_load import dead_loads
from forcefit.assembly.exact.descent import Expansion, expand
from forcefit.assembly.exact.equilibrium import active_clearances
from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.exact.finite_robot import FiniteRobot
from forcefit.assembly.exact.placement import place
from forcefit.assembly.kinematics.pieces import cut_beams
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import Assembly, all_loads
from forcefit.assembly.linear.closure import VirtualJoints, linearise, virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.active_set import (
    bound_forces,
    bounded_unknowns,
    closure_rows,
    contacts,
    curvature,
    held_rows,
    newton_step,
    settle,
    unknowns,
    work_of_loads,
)
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import (
    Side,
    active_tangent,
    without_clearance,
)
from forcefit.assembly.platform_stiffness.matrices import PlatformStiffness, numbers_of
from forcefit.assembly.platform_stiffness.platform_stiffness import State


@dataclass(frozen=True)
class TangentState:
    """Arguments for the computation of a tangent stiffness.

    See
    :func:`forcefit.assembly.platform_stiffness.platform_stiffness.platform_stiffness`.

    Attributes:
        state: ``"nominal"``, ``"contact"`` or ``"exact"``.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        at: (3,) [m] reference point, in platform axes.
        side: behaviour of contacts without a force.
    """

    state: State = "nominal"
    load: ArrayLike | None = None
    gravity: ArrayLike | None = None
    at: ArrayLike = (0.0, 0.0, 0.0)
    side: Side = "loading"


_Moved = Callable[[Posture, float], tuple[PlatformStiffness, NDArray]]


def compliance_slope(
    posture: Posture, ahead: Posture, back: Posture, step: float, asked: TangentState
) -> NDArray:
    """Return the derivative of the compliance with respect to one parameter.

    Args:
        posture: the robot's configuration.
        ahead: the configuration with the parameter increased by a step.
        back: the configuration with the parameter decreased by a step.
        step: size of the step, in the unit of the parameter.
        asked: state and reference point of the stiffness.

    Returns:
        (6, 6) [rad/(N m) .. m/N per unit of the parameter], base axes.  All entries are
        NaN at a change of contact, and some are NaN if the platform can move freely.

    Raises:
        CannotAssemble: the loops cannot be closed with these errors.
        FreeMotion: a load acts on a motion without stiffness.
        SolverFailed: no equilibrium was found.
        BadInput: a point or a load does not consist of numbers.
    """
    offset = numbers_of("at", asked.at, 3, "m")
    moved = _STATES[asked.state](posture, ahead, back, step, asked)
    compliances = []
    for there, sign in ((ahead, 1.0), (back, -1.0)):
        tangent, platform = moved(there, sign * step)
        at = tangent.at(platform[:3, 3] + platform[:3, :3] @ offset)
        compliances.append(at.compliance)
    return (compliances[0] - compliances[1]) / (2 * step)


def _classical(
    posture: Posture, ahead: Posture, back: Posture, step: float, asked: TangentState
) -> _Moved:
    """Return a function that computes the classical stiffness of a changed robot."""
    return lambda there, by: (without_clearance(there), there.platform)


def _linear(
    posture: Posture, ahead: Posture, back: Posture, step: float, asked: TangentState
) -> _Moved:
    """Return a function that computes the stiffness (22) of a changed robot."""
    start = settle(solve_assembly(posture, asked.load, gravity=asked.gravity))
    pressed, touching = contacts(start)
    x, multipliers = unknowns(start), start.multipliers
    held = held_rows(start, pressed)
    bounded, count = bounded_unknowns(start.joints), len(multipliers)

    def neighbour(there: Posture, x: NDArray, multipliers: NDArray) -> Assembly:
        y, u, q = np.split(x, [bounded.start, bounded.stop])
        return replace(
            start, linearisation=linearise(there), elastic=y, clearances=u, motions=q,
            joints=_like(start.joints, there), multipliers=multipliers,
            frame_loads=all_loads(there, asked.load, None, asked.gravity),
        )  # fmt: skip

    def conditions(there: Posture) -> tuple[NDArray, NDArray]:
        other = neighbour(there, x, multipliers)
        rows = closure_rows(other.linearisation, other.joints)
        gradient = work_of_loads(other.frame_loads, other.joints)
        return rows @ x + other.linearisation.misfit, -gradient - rows.T @ multipliers

    closures, gradient = _difference(conditions, ahead, back, step)
    left = np.append(closures, np.zeros(len(held) - count))
    H = curvature(start.joints, bound_forces(start) * pressed)
    dx, forces = newton_step(H, held, left, gradient)

    def moved(there: Posture, by: float) -> tuple[PlatformStiffness, NDArray]:
        other = neighbour(there, x + by * dx, multipliers + by * forces[:count])
        tangent = active_tangent(other, asked.side)
        same = np.array_equal(contacts(other)[0], pressed) and not touching.any()
        return tangent if same else _unknown(tangent), there.platform

    return moved


def _like(joints: VirtualJoints, there: Posture) -> VirtualJoints:
    """Return the virtual joints of a robot with one changed parameter."""
    return virtual_joints(there.robot, bounded_motion=joints.bounded_motion)


def _exact(
    posture: Posture, ahead: Posture, back: Posture, step: float, asked: TangentState
) -> _Moved:
    """Return a function that computes the exact stiffness of a changed robot."""
    start = solve_exact(posture, asked.load, gravity=asked.gravity)
    local = start.expansion
    at, model = local.placement, local.placement.model
    active, force = active_clearances(local)
    N = np.zeros((len(at.x), int(active.sum())))
    N[model.bounded] = boundary_normals(at.x[model.bounded], active, model.joints.group)
    H = local.hessian.copy()
    H[model.bounded, model.bounded] += np.diag(force[model.joints.group])

    def expansion(there: Posture, x: NDArray, multipliers: NDArray) -> Expansion:
        cut = cut_beams(there.robot)
        placed = cut.cut(there) if cut.robot is not there.robot else there
        finite = FiniteRobot(placed, _like(model.joints, placed))
        loads = dead_loads(placed, asked.load, gravity=asked.gravity)
        return expand(place(finite, x), loads, multipliers)

    def conditions(there: Posture) -> tuple[NDArray, NDArray]:
        other = expansion(there, at.x, local.multipliers)
        gradient = other.gradient - other.placement.rows.T @ local.multipliers
        return other.placement.residual, gradient

    closures, gradient = _difference(conditions, ahead, back, step)
    unit = model.units
    held = np.vstack([at.rows, N.T]) * unit
    left = np.append(closures, np.zeros(N.shape[1]))
    dz, forces = newton_step(unit[:, None] * H * unit, held, left, unit * gradient)
    dx, multipliers = unit * dz, forces[: len(closures)]

    def moved(there: Posture, by: float) -> tuple[PlatformStiffness, NDArray]:
        other = expansion(there, at.x + by * dx, local.multipliers + by * multipliers)
        neighbour: ExactAssembly = replace(
            start, whole=there, cut=cut_beams(there.robot), expansion=other
        )
        tangent = exact_tangent(neighbour, asked.side)
        same = np.array_equal(active_clearances(other)[0], active)
        return tangent if same else _unknown(tangent), other.placement.platform

    return moved


_STATES = {"nominal": _classical, "contact": _linear, "exact": _exact}


def _difference(
    conditions: Callable[[Posture], tuple[NDArray, NDArray]],
    ahead: Posture, back: Posture, step: float,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Return the derivatives of both equilibrium conditions by central differences."""
    there, behind = conditions(ahead), conditions(back)
    return (there[0] - behind[0]) / (2 * step), (there[1] - behind[1]) / (2 * step)


def _unknown(tangent: PlatformStiffness) -> PlatformStiffness:
    """Return a stiffness whose entries are NaN."""
    return replace(tangent, root=np.full_like(tangent.root, np.nan))
