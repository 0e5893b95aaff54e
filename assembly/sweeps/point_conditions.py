"""Conditions at the points of a sweep: load, gravity and the effects of the robot.

Points are solved together by compiled functions, under loads and with effects that
change errors, springs or clearances.  Where places give by laws of their own each is
solved by itself, which takes some milliseconds.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_known
from assembly.kinematics.closure_rates import closure_signs
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.linear.assembled import Assembly
from assembly.linear.assemblies import Assemblies, solve_each
from assembly.linear.energy import minimise_under_loads
from assembly.linear.load import loads_with_weight
from assembly.measurement.conditions import Conditions, as_declared
from assembly.measurement.predict import assemble_row
from assembly.model.robot import Robot
from assembly.sweeps.quantities import Question
from stiffness.screws import screw_map


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


def assemble_rows(conditions: Conditions) -> tuple[Assemblies, NDArray, NDArray]:
    """Least energies of all rows under loads.

    Args:
        conditions: k rows of a robot of n frames.

    Returns:
        Assemblies, screws and certificates in the order given; the (k, n, 6) [N m, N]
        wrenches of the links' springs; and (k, n, 6) of these the part that is the
        links' own weight.
    """
    c = conditions

    def one(i: int) -> Assembly:
        assembly = assemble_row(c, i)
        assert isinstance(assembly, Assembly)
        return assembly

    if c.laws or c.yields:
        wrenches, at_tips = np.full((2, len(c), len(c.robot.frames), 6), np.nan)

        def noted(i: int) -> Assembly:
            assembly = one(i)
            wrenches[i] = assembly.wrenches
            at_tips[i] = assembly.frame_loads.at_tips
            return assembly

        return solve_each(c.robot, len(c), noted), wrenches, at_tips
    loads = loads_with_weight(c.postures, c.load_at_origin(), c.gravity)
    energies = minimise_under_loads(
        c.robot, c.transforms, loads, one, c.errors, c.mismatch
    )
    through = wrenches_of(c.robot, c.transforms, energies.multipliers)
    at_tips = np.broadcast_to(loads.at_tips, through.shape)
    return energies, through + loads.body.reshape(through.shape), at_tips


def wrenches_of(robot: Robot, T: NDArray, multipliers: NDArray) -> NDArray:
    """Wrenches through every frame that closures cause.

    Args:
        robot: of n frames.
        T: (k, n, 4, 4) frames seen from the base.
        multipliers: (k, 6 closures) of the scaled closure rows.

    Returns:
        (k, n, 6) [N m, N] at each frame's origin, in its axes.
    """
    size = size_of(robot)
    closures = multipliers.reshape(len(T), -1, 6) / ([1] * 3 + [size] * 3)
    at_platform = np.einsum("cf,kcs->kfs", closure_signs(robot), closures)
    origin = T[:, None, robot.index(robot.platform), :3, 3]
    paths = screw_map(T[..., :3, 3] - origin, T[..., :3, :3])
    return np.einsum("kfji,kfj->kfi", paths, at_platform)
