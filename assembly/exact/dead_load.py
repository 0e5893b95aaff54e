r"""Dead loads: constant forces on points that move with the bodies.

The work of a dead load is <G, T - T_nominal>, where T contains the first three rows of
the body's transform.  For a force f at the point a of the body, in the body's axes, G
is f [a, 1]^T.  A couple m consists of two opposite forces, and G is [m]x R_nominal / 2.

The weight W of a beam acts at the middle of the cubic curve between its clamped ends.
This point is (p1 + p2) / 2 + (t1 - t2) / 12, where p are the end points, and t the end
tangents multiplied by the length.

The force f of a drive does the work f . q, where q is the motion along the joint axis.

======  =============  ==========  ==================================================
symbol  code           shape       meaning
======  =============  ==========  ==================================================
G       ``bodies`` ..  (n, 3, 4)   load on the body between a frame and its parent
G       ``carried``    (n, 3, 4)   load on all bodies that the frame's joint moves
w       ``load``       (6,)        wrench on the platform, see :mod:`.exact`
M       --             (3, 3)      sum of position times force over all loads
======  =============  ==========  ==================================================

For small motions, see :mod:`forcefit.assembly.linear.load`.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.finite_robot import LINK, nominally_carried
from forcefit.assembly.exact.placement import Placement
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.load import drive_loads
from forcefit.assembly.model.robot import BeamLink, beam_axis
from forcefit.stiffness.beam.sections import declared_section
from forcefit.stiffness.screws import rotation_matrix, skew, transform


@dataclass(frozen=True, eq=False)
class DeadLoads:
    """Dead loads on all bodies of a robot.

    Attributes:
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        bodies: (n, 3, 4) [N m, N] loads on the body of each frame.
        carried: (n, 3, 4) [N m, N] loads on all bodies that each frame's joint moves.
        distributed: (n, 3, 4) [N m, N] weights of beams, which ``bodies`` includes.
        drives: (n, 6) [N m, N] wrenches of the drives on their joints, in the axes of
            each frame.
    """

    load: NDArray
    bodies: NDArray
    carried: NDArray
    distributed: NDArray = field(default_factory=lambda: np.zeros((3, 4)))
    drives: NDArray = field(default_factory=lambda: np.zeros(6))

    @cached_property
    def beyond_platform(self) -> bool:
        """Whether loads other than the platform wrench and drive forces act."""
        return bool(np.any(self.bodies) or np.any(self.carried))


def dead_loads(
    posture: Posture,
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
) -> DeadLoads:
    """Return the dead loads on a robot.

    Args:
        posture: configuration of a robot of n frames.
        load: (6,) [N m, N] wrench on the platform at ``point``, base axes.
        bodies: (n, 6) [N m, N] wrench on the body of each frame, at the frame's origin,
            base axes.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        point: (3,) [m] point of application on the platform, platform axes.

    Returns:
        The dead loads.
    """
    count = len(posture.robot.frames)
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    on_bodies, carried, distributed = np.zeros((3, count, 3, 4))
    if np.any(point):
        platform = posture.robot.index(posture.robot.platform)
        on_bodies[platform] = np.outer(wrench[3:], [*np.asarray(point), 1.0])
        wrench[3:] = 0.0
    if bodies is not None:
        given = np.asarray(bodies, dtype=float)
        on_bodies[:, :, :3] += skew(given[:, :3]) @ posture.transforms[:, :3, :3] / 2
        on_bodies[:, :, 3] += given[:, 3:]
    if gravity is not None:
        g = np.asarray(gravity, dtype=float)
        distributed = _add_weights(posture, posture.robot.errors, g, on_bodies, carried)
    drives = drive_loads(posture.robot)
    return DeadLoads(wrench, on_bodies, carried, distributed, drives)


def dead_loads_of_rows(
    postures: Posture, errors: NDArray, load: NDArray, gravity: NDArray, point: NDArray
) -> DeadLoads:
    """Return the dead loads in R measurements.

    Args:
        postures: R postures in one object.
        errors: (R, n, 6) [rad, m] geometric errors of the bodies.
        load: (R, 6) [N m, N] wrenches on the platform at ``point``, base axes.
        gravity: (R, 3) [m/s^2] gravity vectors in base axes.
        point: (3,) [m] point of application on the platform, platform axes.

    Returns:
        Loads whose arrays have a first axis of length R.
    """
    robot = postures.robot
    on_bodies, carried = np.zeros((2, *errors.shape[:2], 3, 4))
    wrench = load.copy()
    if point.any():
        at_point = np.array([*point, 1.0])
        on_bodies[:, robot.index(robot.platform)] = wrench[:, 3:, None] * at_point
        wrench[:, 3:] = 0.0
    if gravity.any():
        _add_weights(postures, errors, gravity, on_bodies, carried)
    return DeadLoads(wrench, on_bodies, carried, drives=drive_loads(robot))


def _add_weights(
    posture: Posture, errors: NDArray, g: NDArray, on_bodies: NDArray, carried: NDArray
) -> NDArray:
    """Add the weights of bodies and beams, and return the weights of beams."""
    robot, nominal = posture.robot, nominally_carried(posture)
    distributed = np.zeros_like(on_bodies)
    for i, frame in enumerate(robot.frames):
        place = np.array([*frame.centre_of_mass, 1.0])
        on_bodies[..., i, :, :] += frame.mass * g[..., None] * place
        link = frame.link
        if not isinstance(link, BeamLink) or link.density is None:
            continue
        length, axis = beam_axis(frame)
        section = declared_section(link.section, link.poisson)
        W = link.density * section.area * length * g
        at_tip = W[..., None] * np.array([*(-length * axis / 12), 0.5])
        distributed[..., i, :, :] = at_tip
        on_bodies[..., i, :, :] += at_tip
        parent = robot.parents[i]
        if parent >= 0:  # the start of the beam moves with the parent
            # start and tangent of the beam in the moved frame of the parent
            error = errors[..., i, :]
            off = transform(error[..., 3:], rotation_matrix(error[..., :3]))
            T = np.linalg.inv(nominal[..., parent, :, :])
            T = T @ posture.transforms[..., i, :, :] @ off
            along = T[..., :3, :3] @ (length * axis)
            middle = (T[..., :3, 3] - along) / 2 + along / 12
            half = np.full((*middle.shape[:-1], 1), 0.5)
            row = np.concatenate([middle, half], axis=-1)[..., None, :]
            carried[..., parent, :, :] += W[..., None] * row
    return distributed


def work_of(place: Placement, loads: DeadLoads) -> float:
    """Return the work [J] of all loads, from the nominal posture to a placement."""
    work = 0.0
    if loads.load.any():
        work += float(loads.load @ place.platform_screw)
    if loads.beyond_platform:
        posture = place.model.posture
        for G, T, nominal in (
            (loads.bodies, place.body_ends, posture.transforms),
            (loads.carried, place.carried, nominally_carried(posture)),
        ):
            work += float(np.sum(G * (T - nominal)[:, :3]))
    if loads.drives.any():
        work += float(_on_motions(place, loads) @ place.x)
    return work


def work_gradient(place: Placement, loads: DeadLoads) -> NDArray:
    """Return the derivatives of the work with respect to the unknowns, (N,) [J]."""
    gradient = place.platform_rows.T @ loads.load
    if loads.beyond_platform:
        wrenches, _ = _on_unknowns(place, loads)
        gradient = gradient + np.sum(place.moves.T * wrenches, axis=1)
    if loads.drives.any():
        gradient = gradient + _on_motions(place, loads)
    return gradient


def curvature_of(place: Placement, multipliers: NDArray, loads: DeadLoads) -> NDArray:
    """Return the second derivative of multipliers . residual + work.

    Args:
        place: displaced robot.
        multipliers: (6 K,) multipliers of the scaled residual.
        loads: loads on the robot.

    Returns:
        (N, N) symmetric matrix, with the accuracy of
        :meth:`forcefit.assembly.exact.placement.Placement.curvature`.
    """
    H = place.curvature(multipliers, loads.load)
    if not loads.beyond_platform:
        return H
    wrenches, M = _on_unknowns(place, loads)
    turn, shift = place.moves[:3].T, place.moves[3:].T
    # to second order, exp(A) exp(B) moves a point x by the product a x (b x x + v_b)
    spread = np.trace(M, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    later = np.einsum("nij,nj->ni", M - spread, turn)
    later -= np.cross(wrenches[:, 3:], shift)
    pairs = (turn @ later.T) * place.model.comes_before
    return H + pairs + pairs.T + place.exponential_curvature(wrenches)


def load_magnitudes(place: Placement, loads: DeadLoads) -> NDArray:
    """Return the absolute work of all loads per unit of each unknown, (N,) [J]."""
    sizes = np.abs(place.platform_rows).T @ np.abs(loads.load)
    if loads.beyond_platform:
        wrenches, _ = _on_unknowns(place, loads)
        sizes = sizes + np.sum(np.abs(place.moves.T * wrenches), axis=1)
    if loads.drives.any():
        sizes = sizes + np.abs(_on_motions(place, loads))
    return sizes


def largest_wrench(place: Placement, loads: DeadLoads) -> float:
    """Return the largest component of the loads [N m].

    Forces are multiplied by the reference length.
    """
    scale = place.model.scale
    largest = float(np.abs(loads.load / scale).max())
    if loads.beyond_platform:
        wrenches, _ = _on_unknowns(place, loads)
        largest = max(largest, float(np.abs(wrenches / scale).max(initial=0.0)))
    if loads.drives.any():
        of_drives = drive_wrenches(place.model.posture, loads, place.carried)
        largest = max(largest, float(np.abs(of_drives / scale).max()))
    return largest


def wrenches_on_frames(place: Placement, loads: DeadLoads) -> tuple[NDArray, NDArray]:
    """Return the resultants of all loads at the platform's nominal origin, base axes.

    Args:
        place: displaced robot.
        loads: loads on the robot.

    Returns:
        (n, 6) [N m, N] resultant on the body of each frame and all bodies that it
        moves, and (n, 6) resultant on all bodies that the frame's joint moves.
    """
    robot = place.model.posture.robot
    body, joint, *_ = _on_frames(place, loads)
    if loads.drives.any():
        joint = joint + drive_wrenches(place.model.posture, loads, place.carried)
    if loads.load.any():
        # all bodies on the path to the platform transmit this wrench, and all joints on
        # the path except that of the platform's frame
        last = robot.index(robot.platform)
        on_path = robot.on_path[last][:, None] * place.load_wrench(loads.load)
        body, joint = body + on_path, joint + on_path
        joint[last] -= on_path[last]
    return body, joint


def distributed_at_tips(place: Placement, loads: DeadLoads) -> NDArray:
    """Return the tip wrenches that are equivalent to the weights of beams.

    Args:
        place: displaced robot.
        loads: loads on the robot.

    Returns:
        (n, 6) [N m, N] wrenches in the axes of the tips.
    """
    T = place.body_ends
    G = np.broadcast_to(loads.distributed, (len(T), 3, 4))
    moment, force, _ = _read(G, T, T[:, :3, 3])
    return np.concatenate([
        np.einsum("nji,nj->ni", T[:, :3, :3], part) for part in (moment, force)
    ], axis=-1)  # fmt: skip


def _on_motions(place: Placement, loads: DeadLoads) -> NDArray:
    """Return the work of the drives per unit of each unknown, (N,) [J]."""
    model = place.model
    work = np.vecdot(loads.drives[model.frame], model.columns)
    return np.where(model.motion == LINK, 0.0, work)


def drive_wrenches(posture: Posture, loads: DeadLoads, carried: NDArray) -> NDArray:
    """Return the wrenches of the drives on the bodies that they move.

    Args:
        posture: nominal posture.
        loads: loads on the robot.
        carried: (..., n, 4, 4) frames after the motion of their joint.

    Returns:
        (..., n, 6) [N m, N] wrenches at the platform's nominal origin, base axes.
    """
    R, arms = carried[..., :3, :3], carried[..., :3, 3]
    moment = np.einsum("...nij,nj->...ni", R, loads.drives[:, :3])
    force = np.einsum("...nij,nj->...ni", R, loads.drives[:, 3:])
    moment += np.cross(arms - posture.platform[..., None, :3, 3], force)
    return np.concatenate([moment, force], axis=-1)


def _on_unknowns(place: Placement, loads: DeadLoads) -> tuple[NDArray, NDArray]:
    """Return the load on all bodies that each unknown moves, (N, 6), and matrices M."""
    model = place.model
    body, joint, M_body, M_joint = _on_frames(place, loads)
    link = (model.motion == LINK)[:, None]
    wrenches = np.where(link, body[model.frame], joint[model.frame])
    M = np.where(link[:, None], M_body[model.frame], M_joint[model.frame])
    return wrenches, M


def _on_frames(
    place: Placement, loads: DeadLoads
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return the resultants of the dead loads at a placement."""
    posture = place.model.posture
    return resultants(posture, loads, place.body_ends, place.carried)


def resultants(
    posture: Posture, loads: DeadLoads, body_ends: NDArray, carried: NDArray
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return the resultants of the dead loads on all bodies that each frame moves.

    Args:
        posture: nominal posture.
        loads: loads on the robot.
        body_ends: (..., n, 4, 4) ends of the bodies in the base frame.
        carried: (..., n, 4, 4) frames after the motion of their joint.

    Returns:
        (..., n, 6) [N m, N] resultants on the bodies that each body moves (including
        itself) and on the bodies that each joint moves, at the platform's nominal
        origin, base axes; and (..., n, 3, 3) [N m] their matrices M.
    """
    robot, origin = posture.robot, posture.platform[..., None, :3, 3]
    below = (robot.on_path & ~np.eye(len(robot.frames), dtype=bool)).T
    own, after = (
        np.concatenate(_read(G, T, origin), axis=-1)
        for G, T in ((loads.bodies, body_ends), (loads.carried, carried))
    )
    joint = below @ (own + after) + after
    body = joint + own
    square = (*joint.shape[:-1], 3, 3)
    return (
        body[..., :6], joint[..., :6],
        body[..., 6:].reshape(square), joint[..., 6:].reshape(square),
    )  # fmt: skip


def _read(G: NDArray, T: NDArray, origin: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return the moments, forces and matrices M (..., n, 9) of dead loads G."""
    points = T[..., :3, :].copy()
    points[..., 3] -= origin
    moments = np.cross(points, G, axis=-2).sum(axis=-1)
    M = points @ np.swapaxes(G, -1, -2)
    return moments, G[..., 3], M.reshape(*M.shape[:-2], 9)
