"""Compliance of the platform along a path, nominal or under the loads of each instant.

The tangent is computed for a robot at rest under the d'Alembert loads of the instant.
These are dead loads: they remain constant while the platform moves.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.inertial_loads import InertialLoads
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import in_contact
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.inputs.table import BadInput, nearest, quoted

STATES = ("nominal", "contact", "exact")


def check_state(robot: Robot, state: str) -> None:
    """Reject an unknown state, and links with a mass in the state ``"exact"``.

    Args:
        robot: any robot.
        state: state in which the compliance is computed.

    Raises:
        BadInput: the state is not in :data:`STATES`; or the state is ``"exact"`` and a
            link has distributed inertia, for which there is no model of finite
            motions.
    """
    if state not in STATES:
        raise BadInput(f"--state: found {quoted(state[:60])}{nearest(state, STATES)}")
    heavy = [f.name for f in robot.frames if getattr(f.link, "density", 0.0)]
    if state == "exact" and heavy:
        raise BadInput(
            f"--state exact: found a link with a density at frame {quoted(heavy[0])}, "
            "whose inertia acts along it; expected masses of frames only, or --state "
            "contact"
        )


def compliances(
    postures: Posture, state: str, load: ArrayLike | None, loads: InertialLoads
) -> NDArray:
    """Return the compliance of the platform at k instants.

    Args:
        postures: k postures.
        state: ``"nominal"``, ``"contact"`` or ``"exact"``, as in
            :func:`forcefit.assembly.platform_stiffness.platform_stiffness.platform_stiffness`.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        loads: d'Alembert loads and weight at each instant.

    Returns:
        (k, 6, 6) [rad/(N m) .. m/N] compliance at the platform's origin, base axes; NaN
        without an equilibrium.  A clearance that touches its bound without a force is
        free.
    """
    if state == "nominal":
        many: Any = platform_stiffness(postures)  # Stiffnesses, as k postures are given
        return np.asarray(many.compliance)
    found = np.full((len(postures.transforms), 6, 6), np.nan)
    for i in range(len(found)):
        try:
            found[i] = _compliance(
                postures[i], state, load, loads.bodies[i], loads.carried[i]
            )
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
    return found


def _compliance(
    posture: Posture, state: str, load: ArrayLike | None, bodies: NDArray,
    carried: NDArray,
) -> NDArray:  # fmt: skip
    """Return the platform's compliance (6, 6) under loads on bodies and platform."""
    if state == "contact":
        assembly = solve_assembly(posture, load, bodies, carried=carried)
        return in_contact(assembly, "unloading").compliance
    exact = solve_exact(posture, load, bodies=bodies)
    tangent = exact_tangent(exact, "unloading")
    return tangent.at(exact.placement.platform[:3, 3]).compliance
