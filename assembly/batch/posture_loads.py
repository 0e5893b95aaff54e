"""Loads at one posture, and what follows from them for any errors.

What is eliminated once, and every map of :mod:`assembly.batch.one_posture`, is that of
the robot without loads; loads add constants to springs, free motions and pose, and the
work d.u that clearances may gain.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.load import FrameLoads
from assembly.linear.reduction import Reduction
from assembly.linear.thresholds import RANK


@dataclass(frozen=True, eq=False)
class PostureLoads:
    """Loads on a robot at one posture, and what follows from them for any errors.

    Attributes:
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        frame_loads: of both, on every small screw.
        h: (r,) [sqrt(2 J)] what they add to the scaled strains.
        d: (nu,) [J] their work along the clearances.
        multipliers: (6 closures,) that balance them on free motions.
        springs: (ny,) [sqrt(2 J)] scaled deformation that they alone would cause.
        spread: (ny, r) from the reduced problem's springs to all of them.
        screws: (6n,) [rad, m] motion of every frame, free motions included.
        motions: (nq,) [rad, m] free motions among these.
    """

    load: NDArray
    gravity: NDArray
    frame_loads: FrameLoads
    h: NDArray
    d: NDArray
    multipliers: NDArray
    springs: NDArray
    spread: NDArray
    screws: NDArray
    motions: NDArray


def posture_loads(
    reduced: Reduction, misfit: NDArray, load: ArrayLike, gravity: ArrayLike
) -> PostureLoads:
    """What follows from loads for any errors.

    Args:
        reduced: the problem with the loads, whatever its errors.
        misfit: (r, 6n) sensitivity of the scaled strains to the errors.
        load: (6,) [N m, N] on the platform.
        gravity: (3,) [m/s^2].

    Returns:
        The constants.
    """
    lin, joints = reduced.linearisation, reduced.joints
    h = reduced.h - misfit @ lin.posture.robot.errors.ravel()
    springs = reduced.load_springs
    moved = joints.elastic @ (reduced.spread @ h + springs)
    inverse = np.linalg.pinv(lin.rows @ joints.free, rcond=RANK)
    motions = -inverse @ (lin.rows @ moved)
    return PostureLoads(
        load=np.array(load, dtype=float),
        gravity=np.array(gravity, dtype=float),
        frame_loads=reduced.frame_loads,
        h=h,
        d=reduced.d,
        multipliers=reduced.load_multipliers,
        springs=springs,
        spread=reduced.spread,
        screws=moved + joints.free @ motions,
        motions=motions,
    )
