"""Conditions at the points of a sweep: load, gravity and the effects of the robot.

Without load the points are solved together by compiled functions, with effects that
change errors, springs or clearances too.  Under load each is solved by itself, which
takes some milliseconds.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_known
from assembly.kinematics.posture import Posture
from assembly.linear.assembled import Assembly
from assembly.linear.assemblies import Assemblies, solve_each
from assembly.measurement.conditions import Conditions, as_declared
from assembly.measurement.predict import assemble_row
from assembly.model.robot import Robot
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


def assemble_rows(conditions: Conditions) -> tuple[Assemblies, NDArray]:
    """Least energies of all rows, one by one.

    Args:
        conditions: k rows of a robot of n frames.

    Returns:
        Assemblies, screws and certificates in the order given; and the (k, n, 6)
        [N m, N] wrenches through the bodies.
    """
    wrenches = np.full((len(conditions), len(conditions.robot.frames), 6), np.nan)

    def one(i: int) -> Assembly:
        assembly = assemble_row(conditions, i)
        assert isinstance(assembly, Assembly)
        wrenches[i] = assembly.wrenches
        return assembly

    return solve_each(conditions.robot, len(conditions), one), wrenches
