"""Loads at one posture, and what follows from them for any errors.

What is eliminated once, and every map of :mod:`assembly.batch.one_posture`, is that of
the robot without loads; these add constants, those of the tight robot under them, and
the work d.u that clearances may gain (``assembly/linear/cpp/loads.h``).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.load import FrameLoads
from assembly.linear.reduction import Reduction, spring_deformations
from assembly.linear.thresholds import RANK


@dataclass(frozen=True, eq=False)
class PostureLoads:
    """Loads on a robot at one posture, and what follows from them for any errors.

    Attributes:
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        frame_loads: of both, on every small screw.
        d: (nu,) [J] what the tight robot carries through each clearance.
        multipliers: (6 closures,) of the tight robot.
        springs: (ny,) [sqrt(2 J)] scaled deformation of the tight robot's springs.
        screws: (6n,) [rad, m] motion of its frames, free motions included.
        motions: (nq,) [rad, m] free motions among these.
        on_free: (nq,) generalised forces on free motions: nothing but rounding.
    """

    load: NDArray
    gravity: NDArray
    frame_loads: FrameLoads
    d: NDArray
    multipliers: NDArray
    springs: NDArray
    screws: NDArray
    motions: NDArray
    on_free: NDArray

    @property
    def stored(self) -> float:
        """[J] energy that loads alone bend."""
        return float(self.springs @ self.springs) / 2


def posture_loads(
    reduced: Reduction, closing: NDArray, load: ArrayLike, gravity: ArrayLike
) -> PostureLoads:
    """What follows from loads for any errors.

    Args:
        reduced: the problem with the loads, whatever its errors.
        closing: (m, r) closure multipliers of the springs'.
        load: (6,) [N m, N] on the platform.
        gravity: (3,) [m/s^2].

    Returns:
        The constants.
    """
    lin, joints, loads = reduced.linearisation, reduced.joints, reduced.frame_loads
    # wrenches that hold the free motions, and bend springs least
    bent = reduced.spread.T @ reduced.load_springs
    multipliers = reduced.load_multipliers - closing @ bent
    springs = spring_deformations(lin, joints, loads, multipliers)
    springs -= reduced.spread @ (reduced.spread.T @ springs)  # rounding
    moved = joints.elastic @ springs
    inverse = np.linalg.pinv(lin.rows @ joints.free, rcond=RANK)
    motions = -inverse @ (lin.rows @ moved)
    on_joints = lin.rows.T @ multipliers + loads.joint
    return PostureLoads(
        load=np.array(load, dtype=float),
        gravity=np.array(gravity, dtype=float),
        frame_loads=loads,
        d=joints.cones.T @ on_joints,
        multipliers=multipliers,
        springs=springs,
        screws=moved + joints.free @ motions,
        motions=motions,
        on_free=joints.free.T @ on_joints,
    )
