"""Readings of a saved robot: the one function by which robots are fitted and judged.

A diagnosis fits a robot through it, prints the errors of that robot through it, and
``forcefit validation predict`` prints readings of the saved file through it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.linear.closure import virtual_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import Prediction, predict, with_finite_motions
from assembly.model.robot import Robot
from validation.campaign.campaign import Campaign
from validation.diagnosis.signatures import conditions_of


def finite_conditions(campaign: Campaign, rows: NDArray | None = None) -> Conditions:
    """What acts in a campaign, motions finite as those of a machine are.

    Args:
        campaign: of R rows.
        rows: some of them, by numbers or a mask; what they read may depend on others
            before them.

    Returns:
        Their conditions; of a robot with clearance the linear model's, since where it
        rests without a load is open.
    """
    conditions = conditions_of(campaign)
    if rows is not None:
        conditions = conditions.take(rows)
    if conditions.exact or virtual_joints(conditions.robot).cones.shape[1]:
        return conditions
    return with_finite_motions(conditions)


def predicted(
    campaign: Campaign, robot: Robot | None = None, *, linear: bool = False
) -> Prediction:
    """What a robot reads for the commands of a campaign.

    Args:
        campaign: of R rows; its readings are not used.
        robot: other than the campaign's, of the same frames and closures.
        linear: whether motions are small, as of a model that lacks finite ones.

    Returns:
        The readings, with the registration that the robot carries.
    """
    campaign = replace(campaign, robot=campaign.robot if robot is None else robot)
    return predict((conditions_of if linear else finite_conditions)(campaign))


def residual_of(campaign: Campaign, robot: Robot, *, linear: bool = False) -> NDArray:
    """(R, 6) [rad, m] readings minus what :func:`predicted` is; NaN not measured."""
    deviation = predicted(campaign, robot, linear=linear).deviation
    return np.asarray(campaign.measured - deviation)
