"""Platform compliance along a path, nominal or under the loads at each instant.

The tangent compliance is computed for a robot at rest under the d'Alembert loads.
These loads are dead loads, which do not change if the platform moves.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.linear.energy import CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.yields import with_springs
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.path.conditions import equilibrium_of_row
from forcefit.assembly.path.inertial_loads import InertialLoads
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import in_contact
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.inputs.table import BadInput, nearest, quoted

STATES = ("nominal", "contact", "exact")


def check_state(robot: Robot, state: str) -> None:
    """Raise BadInput if the compliance cannot be computed in a state.

    Args:
        robot: any robot.
        state: state for which the compliance is computed.

    Raises:
        BadInput: the state is unknown, or it is ``"exact"`` and a link has a density,
            which is not supported for finite motions.
    """
    if state not in STATES:
        raise BadInput(f"--state: found {quoted(state[:60])}{nearest(state, STATES)}")
    heavy = [f.name for f in robot.frames if getattr(f.link, "density", 0.0)]
    if state == "exact" and heavy:
        raise BadInput(
            f"--state exact: found a link with a density at frame {quoted(heavy[0])}, "
            "which this state does not support; expected links without a density, or "
            "--state contact"
        )


def check_linear(conditions: Conditions, state: str) -> None:
    """Raise BadInput for a nonlinear effect in a state other than ``"nominal"``.

    Args:
        conditions: conditions at any instants.
        state: state for which the compliance is computed.

    Raises:
        BadInput: an effect is nonlinear.
    """
    places = [law.frame for law in conditions.laws]
    places += [place.frame for place in conditions.yields if not place.linear]
    if places and state != "nominal":
        raise BadInput(
            f"--state {state}: found an effect with a nonlinear law at frame "
            f"{quoted(places[0])}, which this state does not support; expected "
            "--state nominal, whose compliance omits this effect"
        )


def compliances(conditions: Conditions, state: str, loads: InertialLoads) -> NDArray:
    """Return the compliance of the platform at k instants.

    Args:
        conditions: conditions at k instants.
        state: ``"nominal"``, ``"contact"`` or ``"exact"``, as in
            :func:`forcefit.assembly.platform_stiffness.platform_stiffness.platform_stiffness`.
        loads: d'Alembert loads and weight at each instant.

    Returns:
        (k, 6, 6) [rad/(N m) .. m/N] compliance at the platform's origin, base axes; NaN
        without an equilibrium.  Contacts without a force are open.
    """
    if state == "nominal" and not conditions.yields:
        many: Any = platform_stiffness(conditions.postures)  # for k postures
        return np.asarray(many.compliance)
    found = np.full((len(conditions), 6, 6), np.nan)
    for i in range(len(found)):
        try:
            found[i] = _compliance(conditions, state, loads, i)
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
    return found


def _compliance(
    conditions: Conditions, state: str, loads: InertialLoads, i: int
) -> NDArray:
    """Return the compliance of the platform at one instant, (6, 6)."""
    if state == "contact":
        found = equilibrium_of_row(conditions, loads, i)
        return in_contact(found, "unloading").compliance
    posture = with_springs(conditions, i).posture(0)
    if state == "nominal":
        return platform_stiffness(posture).compliance
    exact = solve_exact(posture, conditions.load_at_origin()[i], bodies=loads.bodies[i])
    tangent = exact_tangent(exact, "unloading")
    return tangent.at(exact.placement.platform[:3, 3]).compliance
