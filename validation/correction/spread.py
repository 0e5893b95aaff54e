"""How far a robot may be from what its file says, by what the file says of that.

Standard deviations of geometric errors (``tolerance``) and of functions' parameters
(``std``), to first order and as if independent: a file holds no correlations.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.linear.without_clearance import flexibility
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from assembly.measurement.settled_clearance import without_joint_clearances
from assembly.model.robot import Robot


def deviation_spread(
    robot: Robot, conditions_for: Callable[[Robot], Conditions]
) -> NDArray:
    """Standard deviation of the platform's deviation at the points measured.

    Args:
        robot: with its effects.
        conditions_for: R rows of it, or of one with other numbers.

    Returns:
        (R, 6) [rad, m]; zero where the file says nothing.
    """
    conditions = conditions_for(robot)
    variance = _of_errors(conditions, robot)
    uncertain = [(f, name) for f in robot.functions for name in f.std]
    if not uncertain:
        return np.sqrt(variance)
    middle = predict(conditions).deviation
    for function, name in uncertain:
        value = function.parameters[name] + function.std[name]
        changed = replace(function, parameters={**function.parameters, name: value})
        others = tuple(changed if f is function else f for f in robot.functions)
        other = conditions_for(replace(robot, functions=others))
        variance += np.nan_to_num(predict(other).deviation - middle) ** 2
    return np.sqrt(variance)


def _of_errors(conditions: Conditions, robot: Robot) -> NDArray:
    """(R, 6) variance by the tolerances of frames."""
    tight = without_joint_clearances(conditions.robot)
    sigma = np.zeros((len(tight.frames), 6))
    for frame in robot.frames:
        if frame.tolerance is not None:
            sigma[tight.index(frame.name)] = frame.tolerance
    chosen = np.flatnonzero(sigma)
    if not chosen.size:
        return np.zeros((len(conditions), 6))
    distinct, which = replace(conditions.postures, robot=tight).distinct
    columns = np.eye(sigma.size)[:, chosen] * sigma.ravel()[chosen]
    moved = flexibility(distinct).platform_of(columns)[which]
    moved[:, 3:] += np.cross(
        moved[:, :3], conditions.measured_arms[:, :, None], axisa=1, axisb=1, axisc=1
    )
    return np.sum(moved**2, axis=2)
