"""Platform stiffness K_C at the points of a sweep.

Errors, loads and clearances do not affect the nominal K_C, so all draws at a posture
share one matrix. A tangent stiffness, in contrast, is computed for each point. It is
the tangent of either problem (22), with clearances free or in contact, or the exact
equilibrium with its internal forces.
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
    "nominal": "clearances held at zero",
    "contact": "tangent of (22), clearances free or pressed as they are",
    "exact": "tangent of the exact equilibrium, with its internal forces",
}
_FORCES = Part("", "forces")


def stiffness_parts(robot: Robot, state: str) -> tuple[str, ...]:
    """Return the names of the compliant parts, such as ``"leg1.distal link"``.

    Args:
        robot: robot of the sweep.
        state: one of :data:`STATES`.

    Returns:
        Links and joints; for a tangent stiffness also clearances in contact and
        internal forces.
    """
    return tuple(part.words for part in _parts(robot, state))


def _parts(robot: Robot, state: str) -> list[Part]:
    """Return the compliant parts."""
    joints = virtual_joints(robot)
    parts = list(dict.fromkeys(owners(joints)))
    if state == "contact":
        rows = np.unique(np.abs(joints.cones).argmax(axis=0) // 6)
        parts += [Part(shown_name(robot, row), "clearance") for row in rows.tolist()]
    return parts + [_FORCES] * (state == "exact")


def nominal_stiffnesses(
    posture: Posture,
) -> tuple[dict[str, NDArray], dict[int, str]]:
    """Compute the nominal K_C of k postures, without errors and loads.

    Args:
        posture: k postures.

    Returns:
        Quantities by name, each with k rows; and the free motions by row.
    """
    many: Any = platform_stiffness(posture)  # Stiffnesses, because k postures are given
    return many_quantities(many), {i: one.free_text for i, one in many.apart.items()}


def tangent_stiffnesses(
    conditions: Conditions, state: str
) -> tuple[dict[str, NDArray], dict[int, str]]:
    """Compute the tangent stiffnesses of k points under errors, loads and effects.

    Args:
        conditions: conditions with k rows.
        state: ``"contact"`` or ``"exact"``.

    Returns:
        The quantities of :func:`nominal_stiffnesses`, NaN without an equilibrium and 0
        along free motions; and a reason for each row without a tangent.
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
    """Compute the tangent stiffness at a point, the smaller one at a contact change."""
    if conditions.laws or any(not place.linear for place in conditions.yields):
        raise SolverFailed(
            "tangent",
            "the law of an effect is nonlinear, so that no tangent stiffness "
            "is computed",
        )
    assembly = assemble_row(replace(conditions, exact=state == "exact"), i)
    if isinstance(assembly, ExactAssembly):
        return exact_tangent(assembly, "unloading")
    return in_contact(assembly, "unloading")


def _unknown(parts: int) -> dict[str, NDArray]:
    """Return NaN for all stored quantities of a point without a tangent stiffness."""
    sizes = {
        "compliance": (6, 6), "stiffness": (6,), "eigen_stiffness": (6,),
        "stiffness_condition": (), "share": (parts, 6),
    }  # fmt: skip
    return {key: np.full(size, np.nan) for key, size in sizes.items()}
