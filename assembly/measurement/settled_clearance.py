"""Play taken up by the load: each joint rests against its cone, where the load pushes.

A joint that transmits the wrench w rests at the point of its clearance cones farthest
along w.  In a robot without closures the wrenches follow from the loads alone, and this
is the exact minimum of (22); with closures it is its limit for small play, by the
envelope theorem: dE/d(bound) = -|w| in the cone's directions.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.linear.load import row_forces
from assembly.linear.without_clearance import flexibility, in_groups
from assembly.measurement.conditions import Conditions
from assembly.model.clearance import CONES, clearance_bounds, scales_with_margin
from assembly.model.robot import Clearance, Frame, Robot

_PUSHED = 1e-9  # of the largest wrench of its kind: less pushes nowhere


def taken_up(here: Conditions) -> tuple[Conditions, NDArray]:
    """Conditions with play replaced by the screws it takes up under the load.

    Args:
        here: R situations of a robot with play.

    Returns:
        The same situations of the robot without play, the play among its errors, and
        (R,) whether some joint with play transmits nothing, so that where it rests is
        open; it is then left in the middle.
    """
    tight = replace(here, robot=without_play(here.robot))
    distinct, which = in_groups(tight.postures)
    errors = here.errors.reshape(len(here), -1)
    forces = row_forces(tight.postures, tight.load_at_origin(), tight.gravity)
    through = flexibility(distinct).solve(which, errors, forces).joint_wrenches
    wrenches = through.reshape(len(here), -1, 6)
    bounds = np.where(scales_with_margin(here.robot), clearance_bounds(here.robot), 0.0)
    play, open_ = np.zeros_like(wrenches), np.zeros(len(here), dtype=bool)
    for cone, rows in enumerate(CONES):
        pushed = wrenches[:, :, list(rows)]
        size = np.linalg.norm(pushed, axis=2)
        rests = size > _PUSHED * size.max(initial=0.0)
        unit = pushed / np.where(rests, size, 1.0)[:, :, None]
        play[:, :, list(rows)] = unit * (rests * bounds[:, cone])[:, :, None]
        open_ |= np.any(~rests & (bounds[:, cone] > 0.0), axis=1)
    return replace(tight, errors=here.errors + play), open_


def at_rest(here: Conditions) -> Conditions:
    """Conditions with play replaced by the screws at which it is said to rest.

    Args:
        here: R situations of a robot with play, ``rest`` given.

    Returns:
        The same situations of the robot without play, the play among its errors.

    Raises:
        ValueError: no ``rest`` is given.
    """
    if here.rest is None:
        raise ValueError("at_rest: conditions do not say where play rests")
    play = here.rest * _bounds_by_row(here.robot)
    robot = without_play(here.robot)
    return replace(here, robot=robot, errors=here.errors + play, rest=None)


def _bounds_by_row(robot: Robot) -> NDArray:
    """(n, 6) bound of every row of a clearance screw; 0 where it is no play."""
    bounds = np.where(scales_with_margin(robot), clearance_bounds(robot), 0.0)
    return bounds[:, [0, 0, 1, 2, 2, 3]]


def fractions(robot: Robot, play: NDArray) -> NDArray:
    """Clearance screws in units of their bounds.

    Args:
        robot: of n frames.
        play: (n, 6) [rad, m].

    Returns:
        (n, 6) [-], 0 where there is no play.
    """
    bounds = _bounds_by_row(robot)
    finite = np.isfinite(bounds) & (bounds > 0)
    return np.divide(play, bounds, out=np.zeros_like(play), where=finite)


def without_play(robot: Robot) -> Robot:
    """The robot with tight joints; bounds of passive joints' own motion stay.

    Args:
        robot: any.

    Returns:
        A robot without clearance cones.
    """
    return replace(robot, frames=tuple(_tight(f) for f in robot.frames))


def _tight(frame: Frame) -> Frame:
    if frame.clearance is None:
        return frame
    kept = Clearance()
    if frame.passive and not frame.compliant:
        own = "axial" if frame.joint == "prismatic" else "spin"
        kept = Clearance(**{own: getattr(frame.clearance, own)})
    return replace(frame, clearance=kept)
