"""Platform stiffness K_C at the points of a sweep.

The nominal K_C depends only on the posture, so it is computed once for all draws. A
tangent stiffness is computed for each point, either for problem (22) with the present
contacts, or for the exact equilibrium with internal forces.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.energy import CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import assemble_row
from forcefit.assembly.model.joint_names import shown_name
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import in_contact, owners
from forcefit.assembly.platform_stiffness.matrices import Part, PlatformStiffness
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.tables import (
    many_quantities,
    tangent_quantities,
)
from forcefit.assembly.solvers.conic import SolverFailed

STATES = {
    "nominal": "without clearances",
    "contact": "tangent stiffness of problem (22) with the present contacts",
    "exact": "tangent stiffness of the exact equilibrium, including internal forces",
}
_FORCES = Part("", "forces")


def stiffness_parts(robot: Robot, state: str) -> tuple[str, ...]:
    """Return the names of the contributions to the compliance.

    Args:
        robot: robot of the sweep.
        state: one of :data:`STATES`.

    Returns:
        Names such as ``"leg1.distal link"``. For a tangent stiffness, they include
        clearances in contact and internal forces.
    """
    return tuple(part.words for part in _parts(robot, state))


def _parts(robot: Robot, state: str) -> list[Part]:
    """Return the names of contributions to the compliance."""
    joints = virtual_joints(robot)
    parts = list(dict.fromkeys(owners(joints)))
    if state == "contact":
        rows = np.unique(np.abs(joints.cones).argmax(axis=0) // 6)
        parts += [Part(shown_name(robot, row), "clearance") for row in rows.tolist()]
    return parts + [_FORCES] * (state == "exact")


def nominal_stiffnesses(
    posture: Posture,
) -> tuple[dict[str, NDArray], dict[int, str]]:
    """Compute the nominal K_C of k postures.

    Args:
        posture: the k postures.

    Returns:
        Quantities by name, each with k rows; and texts on free motions by row index.
    """
    many: Any = platform_stiffness(posture)  # Stiffnesses
    return many_quantities(many), {i: one.free_text for i, one in many.apart.items()}


def tangent_stiffnesses(
    conditions: Conditions, state: str
) -> tuple[dict[str, NDArray], dict[int, str]]:
    """Compute the tangent stiffness at k points with errors, loads and effects.

    Args:
        conditions: conditions with k rows.
        state: ``"contact"`` or ``"exact"``.

    Returns:
        The quantities of :func:`nominal_stiffnesses`, which are NaN for rows without an
        equilibrium; and the reasons for these rows, by row index.
    """
    parts = _parts(conditions.robot, state)
    rows, reasons = [], {}
    for i in range(len(conditions)):
        try:
            tangent = _tangent(conditions, i, state)
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            rows.append(_unknown(len(parts)))
            reasons[i] = f"no tangent: {error}"
            continue
        rows.append(tangent_quantities(tangent, parts))
        if tangent.free.size:
            reasons[i] = tangent.free_text
        elif not tangent.stable:
            reasons[i] = "the equilibrium is unstable"
    keys = rows[0]
    return {key: np.array([row[key] for row in rows]) for key in keys}, reasons


def _tangent(conditions: Conditions, i: int, state: str) -> PlatformStiffness:
    """Compute the tangent stiffness at a point, for unloading if a contact changes."""
    if conditions.laws or any(not place.linear for place in conditions.yields):
        raise SolverFailed(
            "tangent",
            "an effect is nonlinear, so the tangent stiffness is not computed",
        )
    assembly = assemble_row(replace(conditions, exact=state == "exact"), i)
    if isinstance(assembly, ExactAssembly):
        return exact_tangent(assembly, "unloading")
    return in_contact(assembly, "unloading")


def _unknown(parts: int) -> dict[str, NDArray]:
    """Return NaN for all quantities of a point without a tangent stiffness."""
    sizes = {
        "compliance": (6, 6), "stiffness": (6,), "eigen_stiffness": (6,),
        "stiffness_condition": (), "share": (parts, 6),
    }  # fmt: skip
    return {key: np.full(size, np.nan) for key, size in sizes.items()}
