"""Compute joint wrenches and the change of the readings per unit screw at a frame.

Both are computed with the linear model of the robot in the file.  A geometric error at
a frame changes the readings by J times its screw.  A spring at a frame changes the
readings by J times its compliance times its wrench w.

======  =============  ============  =================================================
symbol  code           shape         meaning
======  =============  ============  =================================================
D       ``reading``    (R, 6, 6)     change of the reading per unit platform screw
J       ``screws``     (R, 6, n, 6)  change of the reading per unit screw at a frame
w       ``wrenches``   (R, n, 6)     wrench at every joint [N m, N], joint axes
======  =============  ============  =================================================
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.load import loads_with_weight
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import read
from forcefit.assembly.measurement.settled_clearance import (
    with_clearances_at_rest,
    with_clearances_taken_up,
    without_joint_clearances,
)
from forcefit.assembly.measurement.without_clearance import flexibility

_STEP = 1e-5  # [rad, m] step of central differences
# Wrench component that is treated as zero, relative to the largest component.
_ROUNDING = 1e-9
_AT_ONCE = 50  # number of postures that are computed together, to limit memory


@dataclass(frozen=True, eq=False)
class Responses:
    """Changes of the readings of a robot with n frames due to small screws, for R rows.

    Attributes:
        reading: (R, 6, 6) change of the readings per unit platform screw.
        screws: (R, 6, n, 6) change of the readings per unit screw at a frame.
        wrenches: (R, n, 6) [N m, N] wrench at every joint, joint axes.
    """

    reading: NDArray
    screws: NDArray
    wrenches: NDArray


def responses(conditions: Conditions) -> Responses:
    """Return the changes of the readings of R rows due to small screws at frames.

    Joints are at rest positions within their clearances.  The changes are zero in rows
    without a solution.
    """
    tight = _without_clearance(conditions)
    distinct, which = tight.postures.distinct
    R, n = len(tight), len(tight.robot.frames)
    platform = np.zeros((len(distinct.transforms), 6, 6 * n))
    wrenches = np.zeros((R, 6 * n))
    forces = loads_with_weight(tight.postures, tight.load_at_origin(), tight.gravity)
    errors = tight.errors.reshape(R, -1)
    for begin in range(0, len(platform), _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        flexible = flexibility(_some(distinct, some))
        platform[some] = flexible.platform_of(np.eye(6 * n))
        rows = np.flatnonzero((which >= begin) & (which < begin + _AT_ONCE))
        part = replace(forces, body=forces.body[rows], joint=forces.joint[rows])
        solved = flexible.solve(which[rows] - begin, errors[rows], part)
        wrenches[rows] = solved.joint_wrenches
    D = _reading(tight)
    screws = np.einsum("rij,rjk->rik", D, platform[which])
    good = np.isfinite(screws).all(axis=(1, 2)) & np.isfinite(wrenches).all(axis=1)
    screws[~good], wrenches[~good] = 0.0, 0.0
    # Remove round-off errors, such as small moments in struts between ball joints.
    wrenches[np.abs(wrenches) < _ROUNDING * np.abs(wrenches).max(initial=0.0)] = 0.0
    return Responses(D, screws.reshape(R, 6, n, 6), wrenches.reshape(R, n, 6))


def _without_clearance(conditions: Conditions) -> Conditions:
    """Fix the joints at rest positions within their clearances."""
    if not virtual_joints(conditions.robot).cones.shape[1]:
        return conditions
    if conditions.rest is not None:
        return with_clearances_at_rest(conditions)
    if not conditions.robot.closures:
        return with_clearances_taken_up(conditions)[0]
    return replace(conditions, robot=without_joint_clearances(conditions.robot))


def _some(postures: Posture, rows: slice) -> Posture:
    """Return the postures with given indices."""
    return replace(
        postures,
        coordinates=postures.coordinates[rows],
        transforms=postures.transforms[rows],
    )


def _reading(conditions: Conditions) -> NDArray:
    """Return the change (R, 6, 6) of the readings per unit platform screw."""
    D = np.zeros((len(conditions), 6, 6))
    for k in range(6):
        screw = np.zeros((len(conditions), 6))
        screw[:, k] = _STEP
        D[:, :, k] = (read(conditions, screw) - read(conditions, -screw)) / (2 * _STEP)
    return D
