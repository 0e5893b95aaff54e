"""Accelerations of idle motions, which neither drives nor platform nor closures hold.

A rod between two balls may spin.  No force resists its inertia about its own axis, so
the spin accelerates until none is left: the loads then do no work on idle motions.
Their rates are taken as zero.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import motion_screws, size_of
from forcefit.assembly.path.inertial_loads import InertialLoads, inertial_loads
from forcefit.assembly.path.motion import Motion, carries_matrix, idle_rates

_MASSLESS = 1e-12  # of the largest inertia: below it an idle motion has none
_ROUNDING = 1e-20  # of the whole mass on the longest arm: 1e-10 of an arm, squared


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
    bodies = [carries @ own for own in joints]
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
    solve = _inverse(inertia, _ROUNDING * _largest_inertia(motion, bodies))
    second = (solve @ driving[..., None])[..., 0]
    added = sum(second[:, d, None, None] * body for d, body in enumerate(bodies))
    rates = motion.second_rates + (Z @ second[..., None])[..., 0]
    return replace(
        motion, second_rates=rates, accelerations=motion.accelerations + added
    )


def _inverse(inertia: NDArray, least: NDArray) -> NDArray:
    """Return the (k, d, d) pseudoinverse of symmetric matrices.

    Args:
        inertia: (k, d, d) of idle motions.
        least: (k,) eigenvalues up to it count as 0.  The inertia of a spin without
            mass, or of masses on its axis, is rounding: the spin would accelerate
            until the platform falls.

    Returns:
        The pseudoinverses.
    """
    values, vectors = np.linalg.eigh(inertia)
    least = np.maximum(least, _MASSLESS * values[:, -1])[:, None]
    inverse = np.where(values > least, 1.0 / np.where(values > least, values, 1.0), 0.0)
    return np.asarray((vectors * inverse[:, None, :]) @ vectors.swapaxes(1, 2))


def _largest_inertia(motion: Motion, bodies: list[NDArray]) -> NDArray:
    """Return (k,) the inertia if the whole mass moved as the fastest body does."""
    along = np.zeros_like(motion.twists)
    along[..., 3] = 1.0
    still = replace(motion, twists=np.zeros_like(along), accelerations=along)
    loads = inertial_loads(still)
    mass = -(loads.bodies + loads.carried)[..., 3].sum(axis=1)
    lengths = np.repeat([size_of(motion.postures.robot), 1.0], 3)
    speed = max(np.abs(body * lengths).max(initial=0.0) for body in bodies)
    return np.asarray(mass * speed**2)


def _power(wrenches: NDArray, twists: NDArray, points: NDArray) -> NDArray:
    """Return (k,) power of (k, n, 6) wrenches at points on twists at the base."""
    velocity = twists[..., 3:] + np.cross(twists[..., :3], points)
    power = np.sum(wrenches[..., :3] * twists[..., :3], axis=(1, 2))
    return power + np.sum(wrenches[..., 3:] * velocity, axis=(1, 2))
