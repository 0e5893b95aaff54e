"""Accelerations of idle motions, which neither drives nor platform nor closures hold.

A rod between two balls may spin.  No force resists its inertia about its own axis, so
the spin accelerates until none is left: the loads then do no work on idle motions.
Their rates are taken as zero.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.nominal import motion_screws, size_of
from assembly.path.inertial_loads import InertialLoads, inertial_loads
from assembly.path.motion import Motion, carries_matrix, idle_rates

_MASSLESS = 1e-12  # of the largest inertia: below it an idle motion has none
_STILL = 1e-10  # of the largest twist: a body with less is at rest but for rounding


def with_idle_accelerations(motion: Motion, gravity: NDArray) -> Motion:
    """Return the motion with idle motions that accelerate under the loads.

    Args:
        motion: motion at k points, idle motions at rest.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The same without idle motions.
    """
    if not motion.free:
        return motion
    Z = idle_rates(motion)
    if not Z.shape[2]:
        return motion
    robot, T = motion.postures.robot, motion.postures.transforms
    S, carries = motion_screws(robot, T), carries_matrix(robot)
    joints = [S * Z[:, :, d, None] for d in range(Z.shape[2])]
    bodies = [_without_rounding(carries @ own, size_of(robot)) for own in joints]
    parts = [body + own for body, own in zip(bodies, joints, strict=True)]

    def work(loads: InertialLoads) -> NDArray:
        p = T[..., :3, 3]
        return np.stack([
            _power(loads.bodies, body, p) + _power(loads.carried, part, p)
            for body, part in zip(bodies, parts, strict=True)
        ], axis=1)  # fmt: skip

    still = replace(motion, twists=np.zeros_like(motion.twists))
    inertia = -np.stack([
        work(inertial_loads(replace(still, accelerations=body))) for body in bodies
    ], axis=2)  # fmt: skip
    driving = work(inertial_loads(motion, gravity))
    solve = np.linalg.pinv(inertia, rcond=_MASSLESS, hermitian=True)
    second = (solve @ driving[..., None])[..., 0]
    added = sum(second[:, d, None, None] * body for d, body in enumerate(bodies))
    rates = motion.second_rates + (Z @ second[..., None])[..., 0]
    return replace(
        motion, second_rates=rates, accelerations=motion.accelerations + added
    )


def _without_rounding(twists: NDArray, size: float) -> NDArray:
    """Return (k, n, 6) twists at the base, 0 for bodies that an idle motion leaves.

    Else the inertia of a rod without mass that spins would be that of the platform in
    its rounding, and the spin would accelerate until the platform falls.
    """
    angles = twists * np.repeat([1.0, 1.0 / size], 3)
    sizes = np.linalg.norm(angles, axis=2, keepdims=True)
    return np.where(sizes > _STILL * sizes.max(axis=1, keepdims=True), twists, 0.0)


def _power(wrenches: NDArray, twists: NDArray, points: NDArray) -> NDArray:
    """Return (k,) power of (k, n, 6) wrenches at points on twists at the base."""
    velocity = twists[..., 3:] + np.cross(twists[..., :3], points)
    power = np.sum(wrenches[..., :3] * twists[..., :3], axis=(1, 2))
    return power + np.sum(wrenches[..., 3:] * velocity, axis=(1, 2))
