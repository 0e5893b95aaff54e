r"""D'Alembert loads and weight of all bodies of a moving robot.

The load on a rigid body of mass m, centre c and inertia tensor I, at its frame's
origin, is

    F = m (g - a_c),        M = c x F - (I alpha + omega x I omega)

The inertia of a beam with a density is distributed along the beam
(:mod:`forcefit.assembly.path.beam_inertia`).  The inertia of a mesh link follows from
its mass matrix (:mod:`forcefit.assembly.path.mesh_inertia`).  These loads act at both
ends of the link.  The load at the start of the link acts on the previous body.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.robot import MeshLink
from forcefit.assembly.path.beam_inertia import BeamLoad, beam_load
from forcefit.assembly.path.mesh_inertia import mesh_end_wrenches
from forcefit.assembly.path.motion import Motion


@dataclass(frozen=True, eq=False)
class InertialLoads:
    """Loads on the n bodies of a robot at k points, base axes.

    Attributes:
        bodies: (k, n, 6) [N m, N] loads on each body, at its frame's origin.
        carried: (k, n, 6) [N m, N] loads on the body that each frame's joint moves, at
            the frame's origin.
        at_tips: (k, n, 6) [N m, N] loads at the tips of links with a density, in the
            axes of the frames.  They are included in ``bodies``.
        beams: distributed loads of beams, by frame index.
    """

    bodies: NDArray
    carried: NDArray
    at_tips: NDArray
    beams: dict[int, BeamLoad]


def inertial_loads(motion: Motion, gravity: ArrayLike | None = None) -> InertialLoads:
    """Return the loads due to the accelerations and weights of all bodies.

    Args:
        motion: motion of a robot of n frames at k points.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.

    Returns:
        The loads on all bodies.

    Raises:
        BadInput: the finite-element model of a mesh link was not solved.
    """
    robot, T = motion.postures.robot, motion.postures.transforms
    g = np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float)
    bodies, carried, at_tips = np.zeros((3, *T.shape[:2], 6))
    beams: dict[int, BeamLoad] = {}
    for i, frame in enumerate(robot.frames):
        R = T[:, i, :3, :3]
        if frame.mass or frame.inertia.any():
            bodies[:, i] += _of_rigid_body(motion, i, g)
        load = beam_load(motion, i, g)
        if load is not None:
            beams[i] = load
            tip = load.at_tip()
            ends = tip, load.at_base(tip)
            tip, base = (_turned(load.data.axes, wrench) for wrench in ends)
            span = load.data.length * load.data.axes[:, 0]
        elif isinstance(frame.link, MeshLink) and frame.link.density:
            tip, base, span = mesh_end_wrenches(motion, i, g)
        else:
            continue
        at_tips[:, i] = tip
        bodies[:, i] += _turned(R, tip)
        parent = robot.parents[i]
        if parent >= 0:  # otherwise, the load acts on the base
            start = T[:, i, :3, 3] - R @ span
            arm = start - T[:, parent, :3, 3]
            wrench = _turned(R, base)
            wrench[:, :3] += np.cross(arm, wrench[:, 3:])
            carried[:, parent] += wrench
    return InertialLoads(bodies, carried, at_tips, beams)


def _of_rigid_body(motion: Motion, i: int, gravity: NDArray) -> NDArray:
    """Return the load of a rigid body at its frame's origin, (k, 6) [N m, N]."""
    frame, T = motion.postures.robot.frames[i], motion.postures.transforms[:, i]
    R, p = T[:, :3, :3], T[:, :3, 3]
    c = R @ frame.centre_of_mass
    F = frame.mass * (gravity - motion.acceleration_of(i, p + c))
    omega, alpha = motion.twists[:, i, :3], motion.accelerations[:, i, :3]
    inertia = R @ frame.inertia @ np.swapaxes(R, 1, 2)
    momentum = (inertia @ omega[..., None])[..., 0]
    turning = (inertia @ alpha[..., None])[..., 0] + np.cross(omega, momentum)
    return np.concatenate([np.cross(c, F) - turning, F], axis=1)


def _turned(R: NDArray, wrenches: NDArray) -> NDArray:
    """Return wrenches (k, 6) in other axes."""
    halves = wrenches.reshape(len(wrenches), 2, 3)
    return (halves @ np.swapaxes(R, -1, -2)).reshape(len(wrenches), 6)
