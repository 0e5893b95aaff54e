"""Conditions at the points of a sweep: loads, gravity and effects.

All points are solved together by compiled functions, except points with nonlinear
compliances, which are solved separately.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import apply_known
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    solve_assembly,
    together_at,
)
from forcefit.assembly.linear.load import driven
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.conditions import Conditions, as_declared
from forcefit.assembly.measurement.predict import assemble_row
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.sweeps.quantities import Question


def point_conditions(
    question: Question, robot: Robot, postures: list[Posture], errors: NDArray | None
) -> Conditions:
    """Return the conditions at points of one design after applying effects.

    Args:
        question: load, gravity and covariates of the sweep.
        robot: robot of the design.
        postures: k postures.
        errors: (k, n, 6) [rad, m] random errors; None for the errors in the robot file.

    Returns:
        Conditions with k rows.
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
    """Return whether there are loads, weights, elastic effects or contacts."""
    loaded = conditions.load.any() or conditions.gravity.any()
    compliant = conditions.laws or conditions.yields
    return bool(loaded or driven(conditions.robot) or compliant)


def assemble_rows(conditions: Conditions) -> tuple[Assembly, NDArray, NDArray]:
    """Solve problem (22), the minimum energy, for all rows of conditions.

    Args:
        conditions: conditions with k rows, for a robot of n frames.

    Returns:
        Assemblies in the order of the rows, wrenches of the links' springs, (k, n, 6)
        [N m, N], and the part of these wrenches due to distributed weight, (k, n, 6) [N
        m, N].
    """
    c = conditions
    if not (c.laws or c.yields):
        load, gravity = c.load_at_origin(), c.gravity
        found = solve_assembly(c.postures, load, gravity=gravity, errors=c.errors)
        at_tips = np.broadcast_to(found.frame_loads.at_tips, found.wrenches.shape)
        return found, found.wrenches, at_tips
    points = [_assembled(c, i) for i in range(len(c))]
    wrenches, at_tips = np.full((2, len(c), len(c.robot.frames), 6), np.nan)
    for i, point in enumerate(points):
        if isinstance(point, Assembly):
            wrenches[i], at_tips[i] = point.wrenches, point.frame_loads.at_tips
    return together_at(c.postures, points), wrenches, at_tips


def _assembled(conditions: Conditions, i: int) -> Assembly | Exception:
    """Return the solution at one point, or the exception raised by the solver."""
    try:
        assembly = assemble_row(conditions, i)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return error
    assert isinstance(assembly, Assembly)
    return assembly
