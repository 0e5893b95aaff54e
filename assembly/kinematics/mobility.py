"""Mobility and overconstraint of the perfect robot: ranks of its closures."""

from dataclasses import dataclass

import numpy as np

from assembly.kinematics.closure_rates import closure_signs
from assembly.kinematics.nominal import mobile, motion_screws, size_of
from assembly.kinematics.posture import Posture
from assembly.kinematics.ranks import rank_of


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom at one posture; every joint rigid except for its own motion.

    Attributes:
        freedoms: number of joint motions that keep all closures.
        locked_freedoms: the same number with the actuated joints locked.
        overconstraint: number of closure equations that the others imply.
        smallest_singular_value: [-] least nonzero one of the constraint matrix,
            lengths divided by the robot's size: near zero is near a singularity.
    """

    freedoms: int
    locked_freedoms: int
    overconstraint: int
    smallest_singular_value: float


def mobility(posture: Posture, tolerance: float = 1e-8) -> Mobility:
    """Return the mobility and overconstraint at a posture.

    Args:
        posture: the robot's configuration.
        tolerance: relative size below which a singular value counts as zero.

    Returns:
        The numbers.
    """
    robot = posture.robot
    size = size_of(robot)
    screws = motion_screws(robot, posture.transforms) / ([1.0] * 3 + [size] * 3)
    blocks = closure_signs(robot)[:, :, None] * screws
    A = np.swapaxes(blocks, 1, 2).reshape(6 * len(robot.closures), len(robot.frames))
    moves = mobile(robot)
    passive = moves & ~np.array([f.actuated for f in robot.frames])
    values = np.linalg.svd(A[:, moves], compute_uv=False)
    rank = rank_of(values, tolerance)
    locked = np.linalg.svd(A[:, passive], compute_uv=False)
    locked_rank = int(np.sum(locked > tolerance * values[:1]))
    return Mobility(
        freedoms=int(moves.sum()) - rank,
        locked_freedoms=int(passive.sum()) - locked_rank,
        overconstraint=len(A) - rank,
        smallest_singular_value=float(values[rank - 1]) if rank else 0.0,
    )
