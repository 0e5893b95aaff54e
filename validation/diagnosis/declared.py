"""Predict the readings of the machine that a robot file describes."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import (
    predict,
    with_finite_motions,
    with_rest_positions,
    with_second_order,
)
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.derivatives import Derivatives
from forcefit.validation.diagnosis.signatures import conditions_of, whiten


@dataclass(frozen=True, eq=False)
class Declared:
    """Predictions for the machine in the robot file, before any fit.

    Attributes:
        conditions: conditions of all rows, before the pose of the device is fitted.
        finite: whether the declared model computes finite motions.
    """

    conditions: Conditions
    finite: bool

    @cached_property
    def derivatives(self) -> Derivatives:
        """Derivatives of predicted readings, with joints at rest positions."""
        return Derivatives(at_rest(self.conditions))

    def bent(
        self, campaign: Campaign, conditions: Conditions, errors: NDArray, least: float
    ) -> Conditions | None:
        """Add the second-order change due to geometric errors to measuring conditions.

        Args:
            campaign: campaign of R rows.
            conditions: conditions of these rows.
            errors: (n, 6) [rad, m] geometric errors in addition to the declared ones.
            least: [sigma] smallest second-order change of a reading.

        Returns:
            The new conditions, or None if all second-order changes are smaller than
            ``least``.
        """
        if not errors.any():
            return None
        own = [conditions.robot.index(frame.name) for frame in campaign.robot.frames]
        whole = conditions.errors.copy()
        whole[:, own] += errors
        complete = with_finite_motions if self.finite else with_second_order
        added = complete(replace(conditions, errors=whole)).second_order
        bent = replace(conditions, second_order=added)
        change = predict(bent).deviation - predict(conditions).deviation
        largest = np.nanmax(np.abs(whiten(campaign, change)), initial=0.0)
        return bent if largest > least else None


def declared(campaign: Campaign, *, finite: bool = False) -> Declared:
    """Return the declared model of a campaign.

    Args:
        campaign: campaign of R rows.
        finite: whether to compute finite instead of first-order motions. The robot file
            can also request this.

    Returns:
        The declared model, which does not depend on the readings.
    """
    conditions = conditions_of(campaign)
    finite = finite or conditions.exact
    whole = with_finite_motions if finite else with_second_order
    return Declared(whole(conditions), finite)


def at_rest(conditions: Conditions) -> Conditions:
    """Move the joints of closed chains to rest positions within their clearances."""
    if conditions.robot.closures and virtual_joints(conditions.robot).cones.shape[1]:
        return with_rest_positions(conditions)
    return conditions
