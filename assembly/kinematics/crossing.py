"""Test whether there is a singularity between a posture and the home pose.

With drives locked, the closure matrix A (6 c, p) of the passive joints has rank r at
almost all postures.  Along a path from home, A is expressed in bases of its range and
row space and is then a square matrix.  The path crosses a singularity if the sign of
the determinant changes.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import SINGULAR, locked_closures
from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import Posture, home_posture, pose_components
from forcefit.assembly.kinematics.singular_posture import rank_near
from forcefit.assembly.model.robot import Robot

# [-] smallest accepted cosine between the subspaces of two successive points
_ALIKE = 0.3
# numbers of steps per path; the second is used if the cosine is too small
_STEPS = (4, 32)


def beyond_singularity(robot: Robot, target: Target, T: NDArray) -> NDArray:
    """Return True for postures with a singularity between home and the posture.

    Args:
        robot: robot of n frames.
        target: k poses or joint coordinates that were reached from home.
        T: (k, n, 4, 4) frames at these targets.

    Returns:
        (k,) bool; all False if the home pose is singular.
    """
    home = home_posture(robot)
    start = locked_closures(robot, home.transforms[None])
    rank = home_rank(robot)
    values = np.linalg.svd(start[0], compute_uv=False)
    if not rank or values[rank - 1] <= SINGULAR * values[0]:
        return np.zeros(len(T), dtype=bool)
    ends = locked_closures(robot, T)
    signs, alike = _compared(start, ends, rank)
    for steps in _STEPS:
        unsure = np.flatnonzero(alike < _ALIKE)
        if not unsure.size:
            break
        signs[unsure], alike[unsure] = _along(
            robot, home, target.rows(unsure), steps, rank, ends[unsure]
        )
    return signs < 0


@lru_cache(maxsize=16)
def home_rank(robot: Robot) -> int:
    """Return the rank of the closures with locked drives, at home or nearby."""
    home = home_posture(robot)
    return rank_near(robot, home.coordinates, home.transforms)


def _compared(A: NDArray, B: NDArray, rank: int) -> tuple[NDArray, NDArray]:
    """Return the signs of det B in the bases of A, and the overlap of the bases.

    Returns:
        (k,) signs of the determinants; (k,) overlaps, 1 if A and B span the same space,
        0 if a direction of one space is orthogonal to the other space.
    """
    U, _, Vt = np.linalg.svd(A)
    U, V = U[..., :rank], np.swapaxes(Vt[:, :rank], -1, -2)
    sign, size = np.linalg.slogdet(np.swapaxes(U, -1, -2) @ B @ V)
    if rank == B.shape[2]:
        product = np.linalg.slogdet(np.swapaxes(B, -1, -2) @ B)[1] / 2
    elif rank == B.shape[1]:
        product = np.linalg.slogdet(B @ np.swapaxes(B, -1, -2))[1] / 2
    else:
        values = np.linalg.svd(B, compute_uv=False)[:, :rank]
        product = np.log(values.clip(1e-300)).sum(axis=1)
    return sign, np.exp(np.minimum(size - product, 0.0))


def _along(
    robot: Robot, home: Posture, target: Target, steps: int, rank: int, ends: NDArray
) -> tuple[NDArray, NDArray]:
    """Return signs of determinants and smallest overlaps of bases along paths."""
    before = locked_closures(robot, home.transforms[None]).repeat(len(ends), axis=0)
    signs, alike = np.ones(len(ends)), np.ones(len(ends))
    for k in range(1, steps + 1):
        A = ends
        if k < steps:
            track = follow(robot, home.coordinates, _part(home, target, k / steps))
            A = locked_closures(robot, track.transforms)
            # Unreachable points of the path are omitted.
            A = np.where(track.reached[:, None, None], A, before)
        sign, near = _compared(before, A, rank)
        signs, alike, before = signs * sign, np.minimum(alike, near), A
    return signs, alike


def _part(home: Posture, target: Target, part: float) -> Target:
    """Return the point at a fraction of the straight line from home to a target."""

    def between(start: NDArray, end: NDArray | None) -> NDArray | None:
        return None if end is None else start + part * (end - start)

    return Target(
        between(pose_components(home.platform), target.pose),
        between(home.coordinates, target.coordinates),
    )
