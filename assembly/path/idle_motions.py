"""Velocities and accelerations of idle motions.

An idle motion, such as the spin of a rod between two ball joints, moves neither a drive
nor the platform.  No force acts along it.  Its momentum is therefore zero along a path
that starts from rest, and its acceleration is such that the loads do no work on it.
This is exact if the inertia does not depend on the idle motion, for example for a rod
that is rotationally symmetric about its axis.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import motion_screws, size_of
from forcefit.assembly.path.inertial_loads import InertialLoads, inertial_loads
from forcefit.assembly.path.motion import Motion, carries_matrix, idle_rates

_MASSLESS = 1e-12  # [-] tolerance for zero inertias, relative to the largest inertia
_ROUNDING = 1e-20  # [-] round-off of an inertia, relative to its upper bound


@dataclass(frozen=True, eq=False)
class IdleMotions:
    """Idle motions of a robot along a path.

    Attributes:
        joints: (k, n, d) [rad or m] rates of n joints in d idle motions at k points.
        bodies: d twists (k, n, 6) of the bodies, at the base's origin.
        parts: d twists (k, n, 6) of the bodies that each joint moves.
        inverse: (k, d, d) pseudoinverse of the mass matrix of the idle motions.
    """

    joints: NDArray
    bodies: list[NDArray]
    parts: list[NDArray]
    inverse: NDArray


def idle_motions(motion: Motion) -> IdleMotions | None:
    """Return the idle motions of a robot along a path, or None.

    Args:
        motion: motion at k points.  Its velocities are not used.
    """
    if not motion.free:
        return None
    Z = idle_rates(motion)
    if not Z.shape[2]:
        return None
    robot, T = motion.postures.robot, motion.postures.transforms
    S, carries = motion_screws(robot, T), carries_matrix(robot)
    joints = [S * Z[:, :, d, None] for d in range(Z.shape[2])]
    bodies = [carries @ own for own in joints]
    parts = [body + own for body, own in zip(bodies, joints, strict=True)]
    idle = IdleMotions(Z, bodies, parts, np.zeros(()))
    inertia = np.stack([_momentum(motion, idle, body) for body in bodies], axis=2)
    least = _ROUNDING * _largest_inertia(motion, bodies)
    return replace(idle, inverse=_inverse(inertia, least))


def momentum_free_rates(motion: Motion, idle: IdleMotions) -> NDArray:
    """Return changes of joint rates for which the momentum of idle motions is zero.

    Args:
        motion: motion at k points with arbitrary rates of the idle motions.
        idle: idle motions of the robot.

    Returns:
        (k, n) [rad/s or m/s] changes of the joint rates.
    """
    momentum = _momentum(motion, idle, motion.twists)
    amounts = -idle.inverse @ momentum[..., None]
    return np.asarray((idle.joints @ amounts)[..., 0])


def with_idle_accelerations(
    motion: Motion, idle: IdleMotions, gravity: NDArray
) -> Motion:
    """Return a motion that includes the accelerations of idle motions.

    Args:
        motion: motion at k points.
        idle: idle motions of the robot.
        gravity: (3,) [m/s^2] gravity in base axes.
    """
    driving = _work(motion, idle, inertial_loads(motion, gravity))
    second = (idle.inverse @ driving[..., None])[..., 0]
    added = sum(second[:, d, None, None] * body for d, body in enumerate(idle.bodies))
    rates = motion.second_rates + (idle.joints @ second[..., None])[..., 0]
    return replace(
        motion, second_rates=rates, accelerations=motion.accelerations + added
    )


def _momentum(motion: Motion, idle: IdleMotions, twists: NDArray) -> NDArray:
    """Return the momentum along each idle motion, (k, d) [kg m^2/s or kg m/s]."""
    # without velocities, the inertial loads are linear in the accelerations
    still = replace(motion, twists=np.zeros_like(twists), accelerations=twists)
    return -_work(motion, idle, inertial_loads(still))


def _work(motion: Motion, idle: IdleMotions, loads: InertialLoads) -> NDArray:
    """Return the power of loads per unit rate of each idle motion, (k, d)."""
    p = motion.postures.transforms[..., :3, 3]
    return np.stack([
        _power(loads.bodies, body, p) + _power(loads.carried, part, p)
        for body, part in zip(idle.bodies, idle.parts, strict=True)
    ], axis=1)  # fmt: skip


def _inverse(inertia: NDArray, least: NDArray) -> NDArray:
    """Return the pseudoinverses of symmetric matrices.

    Args:
        inertia: (k, d, d) mass matrix of the idle motions.
        least: (k,) round-off of the mass matrix; smaller eigenvalues are treated as
            zero.

    Returns:
        (k, d, d) pseudoinverses.
    """
    values, vectors = np.linalg.eigh(inertia)
    least = np.maximum(least, _MASSLESS * values[:, -1])[:, None]
    inverse = np.where(values > least, 1.0 / np.where(values > least, values, 1.0), 0.0)
    return np.asarray((vectors * inverse[:, None, :]) @ vectors.swapaxes(1, 2))


def _largest_inertia(motion: Motion, bodies: list[NDArray]) -> NDArray:
    """Return an upper bound on the inertia of an idle motion, (k,)."""
    along = np.zeros_like(motion.twists)
    along[..., 3] = 1.0
    still = replace(motion, twists=np.zeros_like(along), accelerations=along)
    loads = inertial_loads(still)
    mass = -(loads.bodies + loads.carried)[..., 3].sum(axis=1)
    lengths = np.repeat([size_of(motion.postures.robot), 1.0], 3)
    speed = max(np.abs(body * lengths).max(initial=0.0) for body in bodies)
    return np.asarray(mass * speed**2)


def _power(wrenches: NDArray, twists: NDArray, points: NDArray) -> NDArray:
    """Return the power of wrenches (k, n, 6), summed over all bodies, (k,)."""
    velocity = twists[..., 3:] + np.cross(twists[..., :3], points)
    power = np.sum(wrenches[..., :3] * twists[..., :3], axis=(1, 2))
    return power + np.sum(wrenches[..., 3:] * velocity, axis=(1, 2))
