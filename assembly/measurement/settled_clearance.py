"""Positions of loaded joints within their clearances.

A joint that transmits the wrench w rests at the point of its clearance cones that is
farthest along w.  In a robot without closures, this position is the exact minimum of
(22).  With closures, it is the limit for small clearances (envelope theorem).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.load import loads_with_weight
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.without_clearance import flexibility
from forcefit.assembly.model.clearance import (
    CONES,
    clearance_bounds,
    clearance_components,
    component_bounds,
    scales_with_margin,
)
from forcefit.assembly.model.contact_closures import loops
from forcefit.assembly.model.robot import Clearance, Frame, Robot

# fraction of the largest moment or force below which a wrench component is zero
_UNLOADED = 1e-9


def with_clearances_taken_up(conditions: Conditions) -> tuple[Conditions, NDArray]:
    """Replace clearances by the joint positions under the load.

    Args:
        conditions: conditions of R measurements of a robot with clearances.

    Returns:
        The conditions of a robot without clearances, whose errors include these
        positions; and (R,) bool, True if a joint with clearance transmits no load.
        Such a joint is at the centre of its clearance.
    """
    tight = replace(conditions, robot=without_joint_clearances(conditions.robot))
    distinct, posture_of_row = tight.postures.distinct
    errors = conditions.errors.reshape(len(conditions), -1)
    loads = loads_with_weight(tight.postures, tight.load_at_origin(), tight.gravity)
    through = flexibility(distinct).solve(posture_of_row, errors, loads).joint_wrenches
    wrenches = through.reshape(len(conditions), -1, 6)
    bounds = np.where(
        scales_with_margin(conditions.robot), clearance_bounds(conditions.robot), 0.0
    )
    clearance_screws, undetermined = (
        np.zeros_like(wrenches),
        np.zeros(len(conditions), dtype=bool),
    )
    for cone, rows in enumerate(CONES):
        parts = wrenches[:, :, list(rows)]
        size = np.linalg.norm(parts, axis=2)
        rests = size > _UNLOADED * size.max(initial=0.0)
        unit = parts / np.where(rests, size, 1.0)[:, :, None]
        # A joint has either a clearance ``ball``, or clearances ``radial`` and
        # ``axial``.
        bound = np.where(np.isnan(bounds[:, cone]), 0.0, bounds[:, cone])
        clearance_screws[:, :, list(rows)] += unit * (rests * bound)[:, :, None]
        undetermined |= np.any(~rests & (bound > 0.0), axis=1)
    return replace(tight, errors=conditions.errors + clearance_screws), undetermined


def with_clearances_at_rest(conditions: Conditions) -> Conditions:
    """Replace clearances by the rest positions of the joints.

    Args:
        conditions: conditions of R measurements of a robot with clearances, and with
            ``rest``.

    Returns:
        The conditions of a robot without clearances, whose errors include the rest
        positions.

    Raises:
        ValueError: ``rest`` is not given.
    """
    if conditions.rest is None:
        raise ValueError(
            "conditions.rest: missing; expected the rest positions of the joints "
            "within their clearances"
        )
    clearance_screws = conditions.rest * _component_bounds(conditions.robot)
    robot = without_joint_clearances(conditions.robot)
    return replace(
        conditions, robot=robot, errors=conditions.errors + clearance_screws, rest=None
    )


def _component_bounds(robot: Robot) -> NDArray:
    """Return the bounds of clearance screw components, (n, 6); 0 if rigid."""
    bounds = np.where(scales_with_margin(robot), clearance_bounds(robot), 0.0)
    bounds[np.isinf(bounds)] = 0.0
    return component_bounds(bounds)


def fractions(robot: Robot, clearance_screws: NDArray) -> NDArray:
    """Divide clearance screws by their bounds.

    Args:
        robot: robot of n frames.
        clearance_screws: (n, 6) [rad, m] clearance screws.

    Returns:
        (n, 6) [-] ratios; 0 for components without clearance.
    """
    bounds = _component_bounds(robot)
    finite = np.isfinite(bounds) & (bounds > 0)
    bounded = clearance_components(robot, clearance_screws)
    return np.divide(bounded, bounds, out=np.zeros_like(bounded), where=finite)


def without_joint_clearances(robot: Robot) -> Robot:
    """Return a robot without clearances.  Motion limits of passive joints remain.

    Args:
        robot: robot with or without clearances.

    Returns:
        The robot without clearances and without closures between contacts.
    """
    tight = tuple(_tight(frame) for frame in robot.frames)
    return replace(robot, frames=tight, closures=loops(robot))


def _tight(frame: Frame) -> Frame:
    if frame.clearance is None:
        return frame
    kept = Clearance()
    if frame.passive and not frame.compliant:
        own = "axial" if frame.joint == "prismatic" else "spin"
        kept = Clearance(**{own: getattr(frame.clearance, own)})
    return replace(frame, clearance=kept)
