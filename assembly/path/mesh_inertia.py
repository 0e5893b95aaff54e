"""Inertial loads and weight of a moving mesh link.

The mass matrix of the finite elements is condensed to the motions of both ends of the
link and multiplied by their accelerations.  The resultant of these loads can differ
from that of a rigid link, for example if the centre of mass is not between the ends.
Half of the difference is added at each end.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.mesh_link import mesh_link_mass
from forcefit.assembly.path.motion import Motion
from forcefit.stiffness.screws import skew


def mesh_end_wrenches(
    motion: Motion, body: int, gravity: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """Return the inertial load and the weight of a mesh link as wrenches at its ends.

    Args:
        motion: motion at k points.
        body: index of a frame with a mesh link that has a density.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        (k, 6) [N m, N] wrenches at the tip (the frame's origin) and at the base, in the
        frame's axes; and the vector (3,) [m] from base to tip.

    Raises:
        BadInput: the finite-element model of the link was not solved.
    """
    M, span = mesh_link_mass(motion.postures.robot.frames[body])
    T = motion.postures.transforms[:, body]
    R, tip = T[:, :3, :3], T[:, :3, 3]
    to_frame = np.swapaxes(R, 1, 2)

    def read(vectors: NDArray) -> NDArray:
        return (to_frame @ vectors[..., None])[..., 0]

    omega, alpha = (
        read(part[:, body, :3]) for part in (motion.twists, motion.accelerations)
    )
    at_tip, at_base = (
        read(motion.acceleration_of(body, point) - gravity)
        for point in (tip, tip - R @ span)
    )
    e = span / np.linalg.norm(span)
    # the slope of the acceleration along the axis, as an angular acceleration of both
    # ends
    slope = alpha + np.cross(e, omega) * (omega @ e)[:, None]
    wrenches = -np.hstack([slope, at_base, slope, at_tip]) @ M.T
    base, tip = wrenches[:, :6], wrenches[:, 6:]
    missing = _rigid(M, span, omega, alpha, at_tip) - tip - _at_tip(base, span)
    half = missing / 2
    half[:, :3] += np.cross(span, half[:, 3:]) / 2
    return tip + half, base + half, span


def _at_tip(wrenches: NDArray, span: NDArray) -> NDArray:
    """Return wrenches (k, 6) at the tip that are equivalent to base wrenches."""
    read = wrenches.copy()
    read[:, :3] -= np.cross(span, wrenches[:, 3:])
    return read


def _rigid(
    M: NDArray, span: NDArray, omega: NDArray, alpha: NDArray, at_tip: NDArray
) -> NDArray:
    """Return the inertial load and the weight of the rigid link at its tip.

    Args:
        M: (12, 12) mass matrix.
        span: (3,) [m] vector from base to tip.
        omega: (k, 3) [rad/s] angular velocity.
        alpha: (k, 3) [rad/s^2] angular acceleration.
        at_tip: (k, 3) [m/s^2] acceleration of the tip minus gravity.

    Returns:
        (k, 6) [N m, N] wrench.
    """
    ends = np.eye(12, 6)
    ends[6:] = np.eye(6)
    ends[3:6, :3] = skew(span)
    rigid = ends.T @ M @ ends
    wrench = -np.hstack([alpha, at_tip]) @ rigid
    wrench[:, :3] -= np.cross(omega, omega @ rigid[:3, :3])
    # mass times the vector from the tip to the centre of mass
    first = np.array([rigid[2, 4], rigid[0, 5], rigid[1, 3]])
    wrench[:, 3:] -= np.cross(omega, np.cross(omega, first))
    return wrench
