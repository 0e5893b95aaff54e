"""Propagate the uncertainty in a robot file to the platform deviation.

The covariance of the readings is J C J', where C is the parameter covariance in the
file (:mod:`forcefit.validation.diagnosis.saved_covariance`), and J is the derivative of
the readings by the parameters.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.functions import (
    in_session,
    inputs_of,
    is_loaded,
    value_of,
)
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.function import PLACES
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import READING
from forcefit.validation.diagnosis.responses import Responses, responses
from forcefit.validation.diagnosis.saved_covariance import (
    COMPLIANCE,
    ERROR,
    FUNCTION,
    Number,
    known_covariance,
)
from forcefit.validation.diagnosis.sensitivities import sensitivity_at

_STEP = 0.1  # step of the numerical derivative, in standard deviations


def deviation_spread(
    robot: Robot, conditions_for: Callable[[Robot], Conditions]
) -> NDArray:
    """Return the standard deviations of the predicted deviations at measured points.

    Args:
        robot: robot with its effects.
        conditions_for: function that returns the conditions of R rows for a robot.

    Returns:
        Standard deviations, (R, 6) [rad, m]; 0 if the file contains no uncertainty.
    """
    known = known_covariance(robot)
    conditions = conditions_for(robot)
    if not known.numbers:
        return np.zeros((len(conditions), 6))
    J = number_slopes(robot, conditions, known.numbers, known.std, conditions_for)
    variance = np.einsum("rik,kl,ril->ri", J, known.covariance, J, optimize=True)
    return np.sqrt(np.maximum(variance, 0.0))


def number_slopes(
    robot: Robot, conditions: Conditions, numbers: tuple[Number, ...], std: NDArray,
    conditions_for: Callable[[Robot], Conditions],
) -> NDArray:  # fmt: skip
    """Return the derivatives of the deviations with respect to robot parameters.

    Args:
        robot: robot with its effects.
        conditions: conditions of R rows for the robot.
        numbers: k parameters of the file.
        std: (k,) standard deviations of the parameters. The steps of the numerical
            derivatives are proportional to them.
        conditions_for: function that returns the conditions of the same rows for
            another robot.

    Returns:
        Derivatives (R, 6, k) [rad, m per unit of the parameter]; 0 for rows without a
        solution.
    """
    J = np.zeros((len(conditions), 6, len(numbers)))
    response = responses(conditions)
    middle: NDArray | None = None
    for k, number in enumerate(numbers):
        if number.kind in {ERROR, COMPLIANCE}:
            row, axis = conditions.robot.index(number.owner), READING.index(number.name)
            J[:, :, k] = response.screws[:, :, row, axis]
            if number.kind == COMPLIANCE:
                J[:, :, k] *= response.wrenches[:, row, axis, None]
        elif number.kind == FUNCTION and _is_direct(robot, number):
            J[:, :, k] = _of_function(robot, conditions, response, number, std[k])
        elif std[k] > 0.0:
            middle = predict(conditions).deviation if middle is None else middle
            other = conditions_for(number.moved(robot, _STEP * std[k]))
            J[:, :, k] = (predict(other).deviation - middle) / (_STEP * std[k])
    return np.nan_to_num(J, nan=0.0, posinf=0.0, neginf=0.0)


def _is_direct(robot: Robot, number: Number) -> bool:
    """Return whether the variables of a function do not depend on its own motion."""
    function = robot.functions[int(number.owner)]
    wrench = any(name.startswith("wrench.") for name in function.variables)
    alone = function.where not in PLACES and function.kind == "compliance"
    return (
        function.where != "load" and not wrench and (alone or not is_loaded(function))
    )


def _of_function(
    robot: Robot, conditions: Conditions, response: Responses, number: Number,
    sigma: float,
) -> NDArray:  # fmt: skip
    """Return the derivative of the deviation by a function parameter, (R, 6)."""
    one = robot.functions[int(number.owner)]
    step = _STEP * sigma if sigma > 0.0 else 1.0
    more = one.parameters[number.name] + step
    other = replace(one, parameters={**one.parameters, number.name: more})
    inputs = list(inputs_of(conditions, one).T)
    acts = in_session(conditions, one.session)
    slope = np.zeros((len(conditions), 6))
    robot, origin = conditions.robot, conditions.postures.platform[:, :3, 3]
    for component in one.components:
        change = value_of(other, component, inputs) - value_of(one, component, inputs)
        change = np.where(acts, change, 0.0) / step
        place = one.where, component, one.kind
        slope += sensitivity_at(*place, robot, response, origin) * change[:, None]
    return slope
