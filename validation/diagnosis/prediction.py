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


def predicted(campaign: Campaign, robot: Robot | None = None) -> Prediction:
    """What a robot reads for the commands of a campaign; its readings are not used.

    Args:
        campaign: of R rows.
        robot: other than the campaign's, of the same frames and closures.

    Returns:
        The readings, with the registration that the robot carries.
    """
    if robot is not None:
        campaign = replace(campaign, robot=robot)
    return predict(finite_conditions(campaign))


def residual_of(campaign: Campaign, robot: Robot, *, linear: bool = False) -> NDArray:
    """Readings minus what a robot reads.

    Args:
        campaign: of R rows.
        robot: of the same frames and closures as the campaign's.
        linear: whether motions are small, as of a model that lacks finite ones.

    Returns:
        (R, 6) [rad, m]; NaN where not measured.
    """
    if linear:
        conditions = conditions_of(replace(campaign, robot=robot))
        return np.asarray(campaign.measured - predict(conditions).deviation)
    return np.asarray(campaign.measured - predicted(campaign, robot).deviation)
