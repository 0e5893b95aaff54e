"""Generate postures near a given posture by small motions that satisfy the closures.

Start with :func:`near_postures`.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import SINGULAR, closure_matrices
from forcefit.assembly.kinematics.nominal import Target, follow, mobile, size_of
from forcefit.assembly.kinematics.track import Track
from forcefit.assembly.model.robot import Robot

_CORRECTIONS = 3  # number of corrections of the closure error
_ROUNDING = 1e-13  # [rad, m] closure error that is only round-off


def near_postures(
    robot: Robot, q: NDArray, T: NDArray, distance: float, count: int
) -> Iterator[Track]:
    """Yield nearby postures, each reached by a random motion of all joints.

    Args:
        robot: robot of n frames.
        q: (n,) [rad or m] coordinates of all joints.
        T: (n, 4, 4) frames seen from the base.
        distance: [rad or reference lengths] norm of the joint motion.
        count: number of postures.

    Yields:
        One posture at a time, with its closure error.
    """
    free = Target(coordinates=np.full((1, len(q)), np.nan))
    for step in _steps_aside(robot, T, distance, count):
        track = follow(robot, q + step, free, guess=True)
        for _ in range(_CORRECTIONS):
            if track.mismatch[0] < _ROUNDING:
                break
            track = follow(robot, track.coordinates[0], free, guess=True)
        yield track


def _steps_aside(robot: Robot, T: NDArray, distance: float, count: int) -> NDArray:
    """Return random joint steps that are tangent to the closures, (count, n)."""
    A = closure_matrices(robot, T[None])[0][0]
    _, values, Vt = np.linalg.svd(A)
    rank = int((values > SINGULAR * values[:1]).sum())
    ways = np.random.default_rng(1).normal(size=(count, len(Vt) - rank))
    steps = np.zeros((count, len(T)))
    steps[:, mobile(robot)] = ways @ Vt[rank:]
    steps *= distance / np.linalg.norm(steps, axis=1, keepdims=True).clip(1e-300)
    slides = np.array([f.joint == "prismatic" for f in robot.frames])
    return steps * np.where(slides, size_of(robot), 1.0)
