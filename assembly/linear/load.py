"""Loads on the platform and on the bodies of a robot, including weights.

A dead load does work on every small screw of the chain between its point of application
and the base.  A load on the body of frame j acts on the base side of j's joint: it does
work on the body's error and deformation, but not on the joint's clearance and spring.
A load ``carried`` by j's joint acts on the platform side of that joint.  The drive
force of frame j (``drive_force``) acts between j's body and the body that j's joint
carries.  It does work only on the joint's motion.

The weight W of a beam is distributed over its length.  It is replaced by forces W / 2
at both ends, together with the moments -r x W / 12 and +r x W / 12 of a beam clamped at
both ends.  The deflections and rotations at the ends then equal those under the
distributed load.  The section at the tip transmits the wrench of the beam's spring
minus the equivalent wrench at the tip, see :func:`weights_at_tips`.

Sources:
    Timoshenko, Strength of Materials I, section 38 (beam with built-in ends, uniform
    load: end moments q L^2 / 12).
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Content, Posture, content_of
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import BeamLink, MeshLink, Robot, beam_axis
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.beam.sections import declared_section

_LARGEST_LOAD = 1e60  # [N m, N] largest accepted component of a load


@dataclass(frozen=True, eq=False)
class FrameLoads:
    """Loads as wrenches on the small screws of every frame, in the frame's axes.

    Attributes:
        body: (..., 6n) [N m, N] wrenches that do work on errors and deformations of
            bodies.
        joint: (..., 6n) [N m, N] wrenches that do work on clearances, springs and
            motions of joints.
        distributed: (..., 6n) [N m, N] wrenches at the links' tips that are equivalent
            to the distributed weights of the links.  They are included in ``body``.
    """

    body: NDArray
    joint: NDArray
    distributed: NDArray = field(default_factory=lambda: np.zeros(()))

    def __bool__(self) -> bool:
        # count_nonzero is faster than any().
        return bool(np.count_nonzero(self.body) or np.count_nonzero(self.joint))

    def __getitem__(self, rows: Any) -> "FrameLoads":
        """Return the loads at one posture or at a selection of postures."""
        parts = (self.body, self.joint, self.distributed)
        return FrameLoads(*(part[rows] if part.ndim > 1 else part for part in parts))

    @property
    def at_tips(self) -> NDArray:
        """Tip wrenches of distributed weights, one per frame, (..., n, 6) [N m, N]."""
        full = np.broadcast_to(self.distributed, self.body.shape)
        return full.reshape(*full.shape[:-1], -1, 6)

    def rows(self) -> NDArray:
        """Return the loads in the layout that the compiled functions expect.

        Returns:
            (k, 2, n, 6) [N m, N] wrenches on bodies and on joints; k = 1 if all points
            have the same loads.
        """
        rows = np.stack([self.body, self.joint], axis=-2)
        return rows.reshape(-1, 2, rows.shape[-1] // 6, 6)


@lru_cache(maxsize=32)
def no_loads(size: int) -> FrameLoads:
    """Return a shared, read-only zero load.

    Args:
        size: number of components, 6n for a robot of n frames.

    Returns:
        Zero loads.
    """
    none = np.zeros((2, size))
    none.setflags(write=False)
    return FrameLoads(*none)


def loads_on_frames(
    posture: Posture,
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    carried: ArrayLike | None = None,
) -> FrameLoads:
    """Return the loads that act on the small screws of a robot.

    Args:
        posture: one or many configurations of a robot of n frames.  The leading
            dimensions of its transforms (..., n, 4, 4) and of all arrays below are
            broadcast.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        bodies: (n, 6) [N m, N] wrench on each frame's body at the frame's origin, base
            axes.
        carried: (n, 6) [N m, N] wrench at each frame's origin on the body that the
            frame's joint carries, base axes.

    Returns:
        The loads, including drive forces; zeros if no load is given.

    Raises:
        BadInput: a number is not finite or too large, or a shape is wrong.
    """
    for whose, given in (("load", load), ("bodies", bodies), ("carried", carried)):
        _check(whose, given, _LARGEST_LOAD, "N m, N")
    robot, T = posture.robot, posture.transforms
    n = len(robot.frames)
    lead = T.shape[:-3]
    for whose, wrenches, axes in (
        ("load", load, (6,)), ("bodies", bodies, (n, 6)), ("carried", carried, (n, 6)),
    ):  # fmt: skip
        if wrenches is not None:
            lead = _with_leading(lead, whose, np.shape(wrenches), axes)
    given = np.zeros((*lead, 2, n, 6))
    own, after = given[..., 0, :, :], given[..., 1, :, :]
    if bodies is not None:
        own += np.asarray(bodies, dtype=float)
    if carried is not None:
        after += np.asarray(carried, dtype=float)
    if load is not None:
        own[..., robot.index(robot.platform), :] += np.asarray(load, dtype=float)
    acting = np.flatnonzero(given.reshape(-1, n, 6).any(axis=(0, 2)))
    if acting.size:
        # Express all wrenches at the platform's origin, then add up the wrenches on the
        # frames that each frame carries.
        arms = (T[..., :3, 3] - posture.platform[..., None, :3, 3])[..., None, :, :]
        if acting.tolist() != [robot.index(robot.platform)]:  # other bodies are loaded
            given[..., acting, :] = _moved(given[..., acting, :], arms[..., acting, :])
        after += _beyond(robot)[:, acting] @ (own + after)[..., acting, :]
        own += after
        halves = _moved(given, -arms).reshape(*lead, 2, n, 2, 3)
        given = halves @ T[..., None, :, :3, :3]
    if driven(robot):
        given = given.reshape(*lead, 2, n, 6)
        given[..., 1, :, :] += drive_loads(robot)
    on = given.reshape(*lead, 2, 6 * n)
    return FrameLoads(on[..., 0, :], on[..., 1, :])


@lru_cache(maxsize=32)
def driven(robot: Robot) -> bool:
    """Return whether a drive of the robot is controlled by force."""
    return any(frame.drive_force for frame in robot.frames)


def drive_loads(robot: Robot) -> NDArray:
    """Return the wrenches that drives exert on the bodies they move, (n, 6) [N m, N].

    Each wrench acts at its frame's origin and is expressed in the frame's axes.  The
    drive exerts the opposite wrench on the body on which it is mounted.
    """
    wrenches = np.zeros((len(robot.frames), 6))
    for wrench, frame in zip(wrenches, robot.frames, strict=True):
        wrench[frame.own_axis] = frame.drive_force
    return wrenches


def _with_leading(
    lead: tuple[int, ...], whose: str, shape: tuple[int, ...], own: tuple[int, ...]
) -> tuple[int, ...]:
    """Return the common leading dimensions of arrays; ``own`` are the others."""
    if shape == own:  # no leading dimensions
        return lead
    try:
        if shape[-len(own) :] != own:
            raise ValueError
        return np.broadcast_shapes(lead, shape[: -len(own)])
    except ValueError:
        one, many = str(own), str((*lead, *own) if lead else ("k", *own))
        raise BadInput(
            f"{whose}: found an array of shape {shape}, expected {one}"
            f" or {many.replace(chr(39), '')}"
        ) from None


@lru_cache(maxsize=16)
def _beyond(robot: Robot) -> NDArray:
    """Return a matrix whose entry (i, j) is 1 if frame i carries frame j, (n, n)."""
    return (robot.on_path & ~np.eye(len(robot.frames), dtype=bool)).T.astype(float)


def _moved(wrenches: NDArray, arms: NDArray) -> NDArray:
    """Return wrenches (..., n, 6), applied at points (..., n, 3), about the origin."""
    read = wrenches.copy()
    x, y, z = (arms[..., a] for a in range(3))
    fx, fy, fz = (wrenches[..., a] for a in range(3, 6))
    read[..., 0] += y * fz - z * fy
    read[..., 1] += z * fx - x * fz
    read[..., 2] += x * fy - y * fx
    return read


def weights(posture: Posture, gravity: ArrayLike) -> tuple[NDArray, NDArray]:
    """Compute the weights of links with a density and of bodies with a mass.

    Args:
        posture: one or many configurations of a robot of n frames.
        gravity: (..., 3) [m/s^2] gravity vector in base axes, such as (0, 0, -9.81).

    Returns:
        Arguments ``bodies`` and ``carried`` (..., n, 6) [N m, N] of
        :func:`loads_on_frames`.  Links given by a matrix, a mesh or a library are
        treated as weightless.

    Raises:
        BadInput: gravity is not finite, exceeds 1e6 m/s^2, or has a wrong shape.
    """
    _check("gravity", gravity, LARGEST_LENGTH, "m/s^2")
    robot, T = posture.robot, posture.transforms
    lead = _with_leading(T.shape[:-3], "gravity", np.shape(gravity), (3,))
    g = np.broadcast_to(np.asarray(gravity, dtype=float), (*lead, 3))
    bodies, carried = np.zeros((2, *lead, len(robot.frames), 6))
    for i, (mass, *centre, beam_mass, x, y, z) in enumerate(_masses(robot).tolist()):
        R = T[..., i, :3, :3]
        if mass:
            bodies[..., i, :] += _at(R @ centre, mass * g)
        if beam_mass:
            along, W = R @ [x, y, z], beam_mass * g
            clamp = np.zeros((*W.shape[:-1], 6))
            clamp[..., :3] = np.cross(along, W) / 12
            bodies[..., i, :] += _at(np.zeros(3), W / 2) - clamp
            parent = robot.parents[i]
            if parent >= 0:  # The base carries frames without a parent.
                # The start of a beam can differ from the parent's origin.
                arm = T[..., i, :3, 3] - along - T[..., parent, :3, 3]
                carried[..., parent, :] += _at(arm, W / 2) + clamp
    return bodies, carried


def massless(robot: Robot, gravity: ArrayLike | None) -> list[str]:
    """Return a remark if gravity does not act on the robot or on a mesh link.

    Args:
        robot: any robot.
        gravity: (3,) [m/s^2] gravity vector, or None.

    Returns:
        A list of one sentence, or an empty list.
    """
    if gravity is None or not np.any(gravity):
        return []
    without = [
        frame.name for frame in robot.frames
        if not frame.mass and isinstance(frame.link, MeshLink) and frame.link.density
    ]  # fmt: skip
    if without:
        return [
            (
                f"the weight of {', '.join(map(quoted, without))}, whose stiffness "
                "is computed from a mesh, and the resulting stress are neglected: "
                'expected "mass" and "centre_of_mass" of the frame; forcefit '
                "stiffness stress --gravity computes that stress"
            )
        ]
    if _masses(robot)[:, [0, 4]].any():
        return []
    return [
        (
            "gravity has no effect, because no frame has a mass; expected a "
            '"density" for links or a "mass" for frames'
        )
    ]


def weights_at_tips(posture: Posture, gravity: ArrayLike) -> NDArray:
    """Return the wrenches at the tips that are equivalent to the links' weights.

    Args:
        posture: one or many configurations of a robot of n frames.
        gravity: (..., 3) [m/s^2] gravity vector in base axes.

    Returns:
        (..., n, 6) [N m, N] wrenches at each frame's origin, in its axes.  Each force
        is half of the link's weight.
    """
    table, R = _masses(posture.robot), posture.transforms[..., :3, :3]
    g = np.asarray(gravity, dtype=float)[..., None, :]
    lead = R.shape[:-1] if g.ndim == 2 else np.broadcast_shapes(R.shape[:-1], g.shape)
    W = np.einsum("...nji,...nj->...ni", R, np.broadcast_to(g, lead)) * table[:, 4:5]
    return np.concatenate([-np.cross(table[:, 5:], W) / 12, W / 2], axis=-1)


def wrenches_at_starts(robot: Robot, tips: NDArray, distributed: NDArray) -> NDArray:
    """Compute the wrenches at the starts of links under their own weight.

    Args:
        robot: robot of n frames.
        tips: (..., n, 6) [N m, N] wrenches through the section at each link's tip.
        distributed: (..., n, 6) [N m, N] result of :func:`weights_at_tips`.

    Returns:
        (..., n, 6) [N m, N] wrenches at each link's start, in its frame's axes; NaN for
        a link without distributed weight.
    """
    table = _masses(robot)
    weight, span = 2 * distributed[..., 3:], table[:, 5:]
    moment = tips[..., :3] + np.cross(span, tips[..., 3:] + weight / 2)
    starts = np.concatenate([moment, tips[..., 3:] + weight], axis=-1)
    return np.where(table[:, 4:5] > 0, starts, np.nan)


@lru_cache(maxsize=16)
def _masses(robot: Robot) -> NDArray:
    """Return mass and centre of each body, and mass and vector of each beam, (n, 8)."""
    table = np.zeros((len(robot.frames), 8))
    for row, frame in zip(table, robot.frames, strict=True):
        row[0], row[1:4] = frame.mass, frame.centre_of_mass
        link = frame.link
        if isinstance(link, BeamLink) and link.density is not None:
            length, axis = beam_axis(frame)
            area = declared_section(link.section, link.poisson).area
            row[4], row[5:] = link.density * area * length, length * axis
    table.setflags(write=False)
    return table


def loads_with_weight(postures: Posture, load: NDArray, gravity: NDArray) -> FrameLoads:
    """Return the loads due to a platform wrench and gravity.

    Args:
        postures: one posture, or R postures in one object.
        load: (6,) or (R, 6) [N m, N] wrench on the platform at its origin, base axes.
        gravity: (3,) or (R, 3) [m/s^2] gravity vector in base axes.

    Returns:
        Loads (6n,) or (R, 6n) on all small screws, read-only.  Robots that differ only
        in errors, springs and clearances share these arrays.
    """
    robot = postures.robot
    arrays = load, gravity, _masses(robot), drive_loads(robot)
    return _loads_with_weight(content_of(postures, arrays, robot.platform))


@lru_cache(maxsize=4)
def _loads_with_weight(content: Content) -> FrameLoads:
    load, gravity, *_ = content.arrays
    bodies = carried = None
    if gravity.any():
        bodies, carried = weights(content.postures, gravity)
    loads = loads_on_frames(content.postures, load, bodies, carried)
    if bodies is not None:
        loads = with_distributed(loads, content.postures, gravity)
    for part in (loads.body, loads.joint, loads.distributed):
        part.flags.writeable = False
    return loads


def with_distributed(
    loads: FrameLoads, posture: Posture, gravity: ArrayLike
) -> FrameLoads:
    """Return loads with the distributed weights of links in ``distributed``.

    Args:
        loads: loads that include the result of :func:`weights`.
        posture: one or many configurations of the robot.
        gravity: (..., 3) [m/s^2] gravity vector in base axes.

    Returns:
        The loads with the field ``distributed`` set.
    """
    at_tips = weights_at_tips(posture, gravity)
    return replace(loads, distributed=at_tips.reshape(*at_tips.shape[:-2], -1))


def _check(whose: str, given: ArrayLike | None, largest: float, unit: str) -> None:
    """Raise BadInput if a number is not finite or too large."""
    if given is None:
        return
    values = np.asarray(given, dtype=float)
    refused = ~(np.abs(values) <= largest)  # NaN, too
    if refused.any():
        raise BadInput(
            f"{whose}: found {values[refused].flat[0]:g}, expected finite numbers of "
            f"size at most {largest:g} [{unit}]"
        )


def _at(arm: NDArray, force: NDArray) -> NDArray:
    """Return the wrench ``[arm x f, f]`` of a force about the origin, (..., 6)."""
    return np.concatenate([np.cross(arm, force), force], axis=-1)
