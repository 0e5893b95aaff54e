"""Velocities of the closures for given joint rates."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import mobile, motion_screws, size_of
from forcefit.assembly.model.robot import Robot

# Relative size below which a singular value of the closures is treated as zero. Closure
# errors are 1e-10; near a singularity, the posture error is their square root.
SINGULAR = 1e-6
_NOISE = 30.0  # assumed ratio of singular value noise to closure error


@lru_cache(maxsize=64)
def closure_signs(robot: Robot) -> NDArray:
    """Return +1 for frames in a closure's first chain, -1 in the second, else 0."""
    paths = robot.on_path.astype(int)
    pairs = [(robot.index(a), robot.index(b)) for a, b in robot.closures]
    count = len(robot.frames)
    signs = np.array([paths[a] - paths[b] for a, b in pairs]).reshape(-1, count)
    signs.setflags(write=False)
    return signs


def closure_matrices(robot: Robot, T: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return the velocities of closures, drives and platform for unit joint rates.

    Args:
        robot: robot of n frames with m mobile joints, a drives and c closures.
        T: (k, n, 4, 4) frames seen from the base.

    Returns:
        (k, 6 c, m) velocities of the closures; (k, m, a + 6) velocities of the drives
        and the platform; (k, m, 6) velocities of the platform.  Lengths are in
        reference lengths.  Velocities refer to the platform's origin and base axes.
    """
    size = size_of(robot)
    i = robot.index(robot.platform)
    screws = motion_screws(robot, T)
    screws[..., 3:] += np.cross(screws[..., :3], T[:, None, i, :3, 3])
    moves = mobile(robot)
    slides = np.array([f.joint == "prismatic" for f in robot.frames])[:, None]
    screws *= np.where(slides, size, 1.0) / np.array([1, 1, 1, size, size, size])
    signs = closure_signs(robot)[:, moves]
    A = np.einsum("cm,kms->kcsm", signs, screws[:, moves])
    A = A.reshape(len(T), 6 * len(signs), int(moves.sum()))
    P = screws[:, moves] * robot.on_path[i, moves, None]
    driven = np.array([f.actuated for f in robot.frames])
    drives = np.eye(len(robot.frames))[moves][:, driven]
    drives = np.broadcast_to(drives, (len(T), *drives.shape))
    return A, np.concatenate([drives, P], axis=2), P


def locked_closures(robot: Robot, T: NDArray) -> NDArray:
    """Return the velocities of closures for unit rates of the passive joints.

    Args:
        robot: robot of n frames with p passive joints and c closures.
        T: (k, n, 4, 4) frames seen from the base.

    Returns:
        (k, 6 c, p) velocities in the units and axes of :func:`closure_matrices`.
    """
    passive = np.array([not f.actuated for f in robot.frames])[mobile(robot)]
    return closure_matrices(robot, T)[0][:, :, passive]


def locked_ranks(robot: Robot, T: NDArray) -> NDArray:
    """Return the ranks of the matrices of :func:`locked_closures`."""
    values = np.linalg.svd(locked_closures(robot, T), compute_uv=False)
    return (values > SINGULAR * values[:, :1].clip(1e-300)).sum(axis=1)


def redundant_drives(robot: Robot, T: NDArray, left_open: float = 0.0) -> int:
    """Return the number of redundant drives.

    Args:
        robot: robot of n frames.
        T: (n, 4, 4) frames seen from the base.
        left_open: [rad, m] closure error at this posture; smaller singular values are
            treated as zero.

    Returns:
        The rank of all closures minus the rank with the drives locked.
    """
    least = max(SINGULAR, _NOISE * left_open)
    ranks = []
    for A in (
        closure_matrices(robot, T[None])[0][0],
        locked_closures(robot, T[None])[0],
    ):
        values = np.linalg.svd(A, compute_uv=False)
        ranks.append(int((values > least * values[:1]).sum()))
    return ranks[0] - ranks[1]
