"""Singular postures, at which the robot with locked drives gains a degree of freedom.

At such postures, the closure equations are linearly dependent to first order, and small
errors can cause large motions.  Equations (17) to (27) are linear in the errors, so
they determine neither whether the robot can be assembled nor its pose error.  Operation
modes meet at singular postures (Zlatanov, Bonev, Gosselin 2002).

Start with :func:`is_singular`.
"""

from itertools import chain

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import locked_closures, locked_ranks
from forcefit.assembly.kinematics.near_postures import near_postures
from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.model.robot import Robot

_ASIDE = 0.02  # [rad or reference lengths] distance to nearby postures
_NEIGHBOURS = 6  # number of nearby postures
# relative size above which singular values at nearby postures are nonzero
_APART = 1e-5
_CLOSED = 1e-8  # [rad, m] largest closure error of a nearby posture
_NOISE = 1e3  # singular values below this factor times the closure error are zero


def is_singular(robot: Robot, q: NDArray, T: NDArray) -> bool:
    """Return whether the robot with locked drives is at a singular posture.

    Args:
        robot: robot of n frames.
        q: (n,) [rad or m] coordinates of all joints.
        T: (n, 4, 4) frames seen from the base.

    Returns:
        True if the robot has more degrees of freedom than at nearby postures.  False
        for robots without drives.
    """
    rank = int(locked_ranks(robot, T[None])[0])
    # The rank cannot exceed the number of columns.
    most = sum(f.passive for f in robot.frames)
    return rank < most and rank < rank_near(robot, q, T)


def rank_near(robot: Robot, q: NDArray, T: NDArray) -> int:
    """Return the largest rank of the closures with locked drives near a posture.

    Args:
        robot: robot of n frames.
        q: (n,) [rad or m] coordinates of all joints.
        T: (n, 4, 4) frames seen from the base.

    Returns:
        The rank.
    """
    free = Target(coordinates=np.full((1, len(q)), np.nan))
    here = follow(robot, q, free, guess=True)
    best = 0
    for there in chain([here], near_postures(robot, q, T, _ASIDE, _NEIGHBOURS)):
        left_open = float(there.mismatch[0])
        if left_open < _CLOSED:
            locked = locked_closures(robot, there.transforms)[0]
            values = np.linalg.svd(locked, compute_uv=False)
            least = max(_APART, _NOISE * left_open)
            best = max(best, int((values > least * values[:1]).sum()))
    return best
