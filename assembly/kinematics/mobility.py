"""Mobility and redundant constraints of the perfect robot: ranks of its closures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.closure_rates import closure_signs
from assembly.kinematics.nominal import mobile, motion_screws, size_of
from assembly.kinematics.posture import Posture
from assembly.kinematics.ranks import rank_of

# [rad, lengths] of the platform for unit joint rates: less is none, the null space of
# closures known to the tolerance above
_PLATFORM_RANK = 1e-6


@dataclass(frozen=True)
class Mobility:
    """Degrees of freedom at one posture; every joint rigid except for its own motion.

    Attributes:
        freedoms: number of joint motions that keep all closures, drives free.
        platform_freedoms: number of independent motions of the platform among them;
            the others are local motions of the legs with the platform at rest.
        freedoms_drives_locked: as ``freedoms``, with the actuated joints locked.
        platform_freedoms_drives_locked: as ``platform_freedoms``, likewise.
        redundant_constraints: number of rows of all joints' constraints, actuated
            joints locked, minus their rank: independent internal loads of the rigid
            robot.
        drives: number of actuated joints.
        locked_freedoms: as ``freedoms_drives_locked``.
        overconstraint: number of closure equations that the others imply, drives free.
        smallest_singular_value: [-] least nonzero one of the constraint matrix,
            lengths divided by the robot's size: near zero is near a singularity.
    """

    freedoms: int
    platform_freedoms: int
    freedoms_drives_locked: int
    platform_freedoms_drives_locked: int
    redundant_constraints: int
    drives: int
    locked_freedoms: int
    overconstraint: int
    smallest_singular_value: float


def mobility(posture: Posture, tolerance: float = 1e-8) -> Mobility:
    """Return the mobility and redundant constraints at a posture.

    Args:
        posture: the robot's configuration.
        tolerance: relative size below which a singular value counts as zero.

    Returns:
        The numbers.

    Sources:
        Zlatanov, Bonev, Gosselin (2002), Constraint singularities of parallel
        mechanisms: freedoms as the null space of the joint screws of all closures.
    """
    robot = posture.robot
    size = size_of(robot)
    screws = motion_screws(robot, posture.transforms) / ([1.0] * 3 + [size] * 3)
    blocks = closure_signs(robot)[:, :, None] * screws
    A = np.swapaxes(blocks, 1, 2).reshape(6 * len(robot.closures), len(robot.frames))
    P = (screws * robot.on_path[robot.index(robot.platform)][:, None]).T
    moves = mobile(robot)
    driven = np.array([f.actuated for f in robot.frames])
    passive = moves & ~driven
    values = np.linalg.svd(A[:, moves], compute_uv=False)
    least = tolerance * float(values.max(initial=0.0))
    rank = rank_of(values, tolerance)
    free, locked = (_motions(A[:, k], P[:, k], least) for k in (moves, passive))
    return Mobility(
        freedoms=free[0],
        platform_freedoms=free[1],
        freedoms_drives_locked=locked[0],
        platform_freedoms_drives_locked=locked[1],
        redundant_constraints=len(A) - int(passive.sum()) + locked[0],
        drives=int(driven.sum()),
        locked_freedoms=locked[0],
        overconstraint=len(A) - rank,
        smallest_singular_value=float(values[rank - 1]) if rank else 0.0,
    )


def _motions(A: NDArray, P: NDArray, least: float) -> tuple[int, int]:
    """Dimensions of the joint motions that close, and of the platform's among them.

    Args:
        A: (6 closures, joints) closures for unit rates of the joints.
        P: (6, joints) the platform likewise.
        least: size below which a singular value of A counts as zero.

    Returns:
        The two.
    """
    _, values, V = np.linalg.svd(A)
    rank = int(np.sum(values > least))
    moved = np.linalg.svd(P @ V[rank:].T, compute_uv=False)
    return len(V) - rank, int(np.sum(moved > _PLATFORM_RANK))
