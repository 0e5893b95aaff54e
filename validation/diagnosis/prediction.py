"""Predict the readings of a robot.

The same function predicts readings in a diagnosis and in ``forcefit validation
predict``.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import (
    Prediction,
    predict,
    with_finite_motions,
)
from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.signatures import conditions_of


def finite_conditions(campaign: Campaign, rows: NDArray | None = None) -> Conditions:
    """Return the conditions of a campaign under finite motions.

    Args:
        campaign: campaign of R rows.
        rows: indices or mask of the rows to return.  None for all rows.

    Returns:
        The conditions of these rows.  For a robot with clearance, the conditions of the
        linear model are returned.
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
    """Return the predicted readings of a robot for the commands of a campaign.

    Args:
        campaign: campaign of R rows.  Its readings are not used.
        robot: robot with the same frames and closures as in the campaign.  None for the
            robot of the campaign.
        linear: whether to neglect finite motions.
    """
    campaign = replace(campaign, robot=campaign.robot if robot is None else robot)
    return predict((conditions_of if linear else finite_conditions)(campaign))


def residual_of(campaign: Campaign, robot: Robot, *, linear: bool = False) -> NDArray:
    """Return the measured minus the predicted readings (R, 6) [rad, m].

    Components that were not measured are NaN.
    """
    deviation = predicted(campaign, robot, linear=linear).deviation
    return np.asarray(campaign.measured - deviation)
