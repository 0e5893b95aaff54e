"""The platform's stiffness matrix K_C at a posture, in the state that is asked for."""

from typing import Literal, get_args

from numpy.typing import ArrayLike

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import Posture
from assembly.linear.energy import solve_assembly
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.platform_stiffness.linear_tangent import (
    Side,
    in_contact,
    without_clearance,
)
from assembly.platform_stiffness.matrices import PlatformStiffness, numbers_of
from assembly.solvers.method import Method, check_method

State = Literal["without clearance", "in contact", "exact"]


def platform_stiffness(
    posture: Posture,
    state: State = "without clearance",
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    at: ArrayLike = (0.0, 0.0, 0.0),
    side: Side = "holding",
    method: Method = "compiled",
) -> PlatformStiffness:
    """How stiff the platform is: the tangent of its small motion under a small wrench.

    Args:
        posture: where the robot stands.
        state: ``"without clearance"``, the classical virtual-joint model of the nominal
            robot, every clearance held at zero; ``"in contact"``, the tangent of
            problem (22) with the robot's errors, clearances and loads; ``"exact"``, the
            tangent of the exact equilibrium, with the stiffness that internal forces
            and loads add.
        load: (6,) [N m, N] on the platform at its origin, base axes; without effect on
            the classical model.
        gravity: (3,) [m/s^2] base axes; likewise.
        at: (3,) [m] of the platform, in its axes: where screws and wrenches are read.
        side: of a change of contact, where a clearance touches its bound without a
            force: ``"holding"`` or ``"letting go"``.
        method: of :func:`assembly.linear.energy.solve_assembly`, state
            ``"in contact"``, or of :func:`assembly.exact.exact.solve_exact`; the
            classical model is numpy alone at one posture.

    Returns:
        Stiffness, compliance, free motions and shares at that point, base axes.

    Raises:
        CannotAssemble: the errors cannot be closed.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: no equilibrium was found.
        BadInput: a point or a load that is no number.
        ValueError: no such state, side or method.
    """
    check_method(method)
    offset = numbers_of("at", at, 3, "m")
    if load is not None:
        load = numbers_of("load", load, 6, "N m, N")
    if side not in get_args(Side):
        raise ValueError(f"platform_stiffness: no side {side!r}")
    if state == "without clearance":
        tangent, platform = without_clearance(posture), posture.platform
    elif state == "in contact":
        linear = solve_assembly(posture, load, gravity=gravity, method=method)
        tangent, platform = in_contact(linear, side), posture.platform
    elif state == "exact":
        exact = solve_exact(posture, load, gravity=gravity, method=method)
        tangent, platform = exact_tangent(exact, side), exact.placement.platform
    else:
        raise ValueError(f"platform_stiffness: no state {state!r}")
    return tangent.at(platform[:3, 3] + platform[:3, :3] @ offset)
