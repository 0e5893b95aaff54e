"""Conditions at the points of a sweep: load, gravity and the effects of the robot.

Without load the points are solved together by compiled functions, with effects that
change errors, springs or clearances too.  Under load each is solved by itself, which
takes some milliseconds.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_postures import Energies
from assembly.effects import apply_known
from assembly.kinematics.posture import Posture
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import Assembly, CannotAssemble
from assembly.linear.reduction import FreeMotion
from assembly.measurement.conditions import Conditions, as_declared
from assembly.measurement.predict import assemble_row
from assembly.model.robot import Robot
from assembly.report.results import failure_status
from assembly.solvers.conic import SolverFailed
from assembly.sweeps.quantities import Question


def point_conditions(
    question: Question, robot: Robot, postures: list[Posture], errors: NDArray | None
) -> Conditions:
    """Conditions at points of one design, effects applied.

    Args:
        question: of the sweep: load, gravity and covariates.
        robot: of the design.
        postures: k of them.
        errors: (k, n, 6) [rad, m] drawn; None for the robot's own.

    Returns:
        k rows.
    """
    many = Posture(
        robot.without_effects(),
        np.array([posture.coordinates for posture in postures]),
        np.array([posture.transforms for posture in postures]),
        max(posture.mismatch for posture in postures),
    )
    mismatch = [posture.mismatch for posture in postures]
    conditions = as_declared(
        many,
        question.load,
        mismatch=mismatch,
        gravity=question.gravity,
        covariates=question.under,
    )
    if errors is not None:
        conditions = replace(conditions, errors=errors)
    return apply_known(conditions, robot)


def is_loaded(conditions: Conditions) -> bool:
    """Whether there are loads, weights, or compliances of effects and contacts."""
    loaded = conditions.load.any() or conditions.gravity.any()
    return bool(loaded or conditions.laws or conditions.yields)


def assemble_rows(conditions: Conditions) -> tuple[Energies, NDArray]:
    """Least energies of all rows, one by one.

    Args:
        conditions: k rows of a robot of n frames.

    Returns:
        Energies, screws and certificates in the order given; and the (k, n, 6)
        [N m, N] wrenches through the bodies.
    """
    k, n = len(conditions), len(conditions.robot.frames)
    joints = virtual_joints(conditions.robot)

    def unknown(*shape: int) -> NDArray:
        return np.full((k, *shape), np.nan)

    energies = Energies(
        energy=unknown(),
        bound=unknown(),
        energy_without_clearance=unknown(),
        platform_screw=unknown(6),
        closure_residual=unknown(),
        clearance_excess=unknown(),
        clearances=unknown(joints.cones.shape[1]),
        motions=unknown(joints.free.shape[1]),
        multipliers=unknown(6 * len(conditions.robot.closures)),
        outcome=np.zeros(k, dtype=int),
        status=np.full(k, "ok", dtype=object),
        reason=np.full(k, "", dtype=object),
        joints=joints,
    )
    wrenches = unknown(n, 6)
    for i in range(k):
        try:
            assembly = assemble_row(conditions, i)
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            energies.status[i], energies.reason[i] = failure_status(error), str(error)
            continue
        assert isinstance(assembly, Assembly)
        energies.energy[i] = assembly.energy
        energies.bound[i] = assembly.energy - assembly.duality_gap()
        energies.energy_without_clearance[i] = assembly.energy_without_clearance
        energies.platform_screw[i] = assembly.platform_screw
        energies.closure_residual[i] = assembly.closure_residual()
        energies.clearance_excess[i] = assembly.clearance_excess()
        energies.multipliers[i] = assembly.multipliers
        wrenches[i] = assembly.wrenches
    return energies, wrenches
