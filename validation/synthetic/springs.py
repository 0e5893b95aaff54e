"""Compute equilibria of machines with links as springs.

All rows are solved together, which is faster than the multibody simulation.  Motions
are finite, and the deformed machine is in equilibrium.  A beam is represented by its
tip compliance.  Clearances in closed loops require the multibody simulation.

The unknowns are the motions q of the passive joints and the wrench l of each closure.
They determine the deformations of the springs and the poses of the frames.  The
residuals are

    r = errors of the closures,        t = moments about passive joints' axes.

Newton's method uses the Jacobian of the nominal posture, because deformations are
small.  In this Jacobian, a is the axis of a joint, and s is +1 if the joint is on the
first chain of a closure and -1 if it is on the second:

    [ -S       -(s a) ] [ dl ]     [ r ]
    [ (s a)^T    0    ] [ dq ] = - [ t ]

S contains the compliance between the two frames of each closure, and the compliances
that couple closures.  Each step is the solution of minimum norm, which also determines
free rotations and the wrenches of overconstrained rigid loops.  Screws and wrenches are
at the base origin in base axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.stiffness.beam.sections import declared_section
from forcefit.validation.multibody.beams import beam_span
from forcefit.validation.multibody.simulation import SimulationFailed
from forcefit.validation.synthetic.effects import Machine, Rest

_STEPS = 60
_CONVERGED = 1e-12  # [rad, m] largest step at convergence
_DIVERGED = 1e3  # [rad, m] coordinate above which the iteration has diverged
_RANK = 1e-10  # relative singular value that is treated as zero, as for a free motion


@dataclass(frozen=True, eq=False)
class _SpringModel:
    """Arrays that describe k machines of equal structure with n frames.

    Attributes:
        robot: a robot with this structure.
        placed: (k, n, 4, 4) poses of frames with their errors, relative to their
            parents.
        compliances: (2, k, n, 6, 6) compliances of links and of joints, at each frame
            in frame axes.
        nominal: (k, n, 4, 4) nominal poses of frames.
        passive: indices of the frames with free joints.
        pairs: (closures, 2) indices of the frames that each closure joins.
        signs: (closures, n) +1 for frames on the first chain, -1 on the second.
        closed: (k, closures, 4, 4) nominal pose of the second frame relative to the
            first.
    """

    robot: Robot
    placed: NDArray
    compliances: NDArray
    nominal: NDArray
    passive: list[int]
    pairs: NDArray
    signs: NDArray
    closed: NDArray


def rest_on_springs(machines: Sequence[Machine]) -> list[Rest]:
    """Return the equilibria of machines with links as springs.

    Args:
        machines: machines of equal structure, without clearances.

    Raises:
        SimulationFailed: a joint has clearance, or no equilibrium was found.
    """
    robot = machines[0].robot
    if any(f.clearance is not None for m in machines for f in m.robot.frames):
        raise SimulationFailed(
            robot.name, "clearances in closed loops need --program multibody"
        )
    q = np.array([
        [m.coordinates.get(f.name, 0.0) for f in m.robot.frames] for m in machines
    ])
    parts = _spring_model(machines, q)
    newton, unit = _newton(parts, q)
    size = 6 * len(parts.pairs)
    wrenches = np.zeros((len(q), len(parts.pairs), 6))
    screws = np.zeros((2, *q.shape, 6))
    ends = _forward(parts, q, screws)
    for _ in range(_STEPS):
        carried = _carried(machines, parts, ends, wrenches)
        # Wrenches are the gradient of an energy only if they are applied half-way along
        # the deformation.
        halfway = ends @ np.linalg.inv(_deflections(screws / 2))
        read = _at_frames(halfway, carried)
        new = np.einsum("skaij,skaj->skai", parts.compliances, read)
        converged = np.abs(new - screws).max() < _CONVERGED
        screws = new
        ends = _forward(parts, q, screws)
        errors = _closure_errors(parts, ends[1]).reshape(len(q), size)
        axes = _axes(parts, ends[1])
        moments = np.einsum("kai,kai->ka", axes, carried[1][:, parts.passive])
        residual = np.concatenate([errors, unit * moments], axis=1)
        move = np.einsum("kij,kj->ki", newton, residual)
        wrenches = wrenches + move[:, :size].reshape(wrenches.shape) / unit
        q[:, parts.passive] += move[:, size:]
        if not np.abs(q).max() < _DIVERGED:
            break
        step = np.abs(move[:, size:]).max(initial=0)
        if converged and max(np.abs(errors).max(initial=0), step) < _CONVERGED:
            wrench = _at_frames(ends[1], carried[1])
            return [Rest(*one) for one in zip(ends[1], wrench, screws[1], strict=True)]
    raise SimulationFailed(
        robot.name, "the iteration for the equilibrium does not converge"
    )


def _spring_model(machines: Sequence[Machine], q: NDArray) -> _SpringModel:
    """Return the compliances, poses and chains of machines."""
    robot = machines[0].robot
    drawn = _placements(np.array([
        [[*f.rotation, *f.translation] for f in m.robot.frames] for m in machines
    ]))  # fmt: skip
    placed = drawn @ _placements(np.array([m.robot.errors for m in machines]))
    nominal = _chain(robot, drawn, np.broadcast_to(np.eye(4), drawn.shape), q)
    pairs = [[robot.index(name) for name in pair] for pair in robot.closures]
    on_path = robot.on_path.astype(float)
    signs = [on_path[a] - on_path[b] for a, b in pairs]
    first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
    closed = np.linalg.inv(nominal[:, first]) @ nominal[:, second]
    passive = [i for i, f in enumerate(robot.frames) if f.passive and not f.compliant]
    # The compliances of a frame that several machines contain are computed once.
    known: dict[int, tuple[NDArray, NDArray]] = {}
    for frame in (f for m in machines for f in m.robot.frames):
        if id(frame) not in known:
            known[id(frame)] = _compliances(frame)
    compliances = [[known[id(f)] for f in m.robot.frames] for m in machines]
    return _SpringModel(
        robot=robot,
        placed=placed,
        compliances=np.moveaxis(np.array(compliances), 2, 0),
        nominal=nominal,
        passive=passive,
        pairs=np.stack([first, second], axis=1),
        signs=np.reshape(signs, (-1, q.shape[1])),
        closed=closed,
    )


def _compliances(frame: Frame) -> tuple[NDArray, NDArray]:
    """Return the compliances (6, 6) of a frame's link and joint."""
    joint = np.zeros((6, 6))
    K = frame.springs
    if K is not None:
        soft = np.ix_(*[np.isfinite(np.diag(K))] * 2)
        joint[soft] = np.linalg.inv(K[soft])
    link = np.zeros((6, 6)) if frame.link is None else link_compliance(frame)
    return link, joint


def _placements(screws: NDArray) -> NDArray:
    """Convert rotation vectors and translations (..., 6) to motions (..., 4, 4)."""
    T = np.zeros((*screws.shape[:-1], 4, 4))
    turns = Rotation.from_rotvec(screws[..., :3].reshape(-1, 3)).as_matrix()
    T[..., :3, :3] = turns.reshape(*screws.shape[:-1], 3, 3)
    T[..., :3, 3] = screws[..., 3:]
    T[..., 3, 3] = 1.0
    return T


def _deflections(screws: NDArray) -> NDArray:
    """Return the motions (..., 4, 4) of springs with deformations (..., 6).

    The translation is in the mean axes of both ends.
    """
    half = screws.copy()
    half[..., :3] /= 2
    T = _placements(screws)
    turned = _placements(half)[..., :3, :3]
    T[..., :3, 3] = np.einsum("...ij,...j->...i", turned, screws[..., 3:])
    return T


def _chain(robot: Robot, steps: NDArray, ends: NDArray, q: NDArray) -> NDArray:
    """Return the poses of frames as products of motions along the chains.

    Args:
        robot: robot with the tree of frames.
        steps: (k, n, 4, 4) motions from the parent's joint to the end of the body.
        ends: (k, n, 4, 4) motions from the end of the body to the joint.
        q: (k, n) [rad or m] coordinates of the joints.

    Returns:
        Poses in the base frame, before the motion of the joints, (k, n, 4, 4).
    """
    own = np.zeros((*q.shape, 6))
    for i, frame in enumerate(robot.frames):
        if frame.joint != "fixed":
            own[:, i, frame.own_axis] = q[:, i]
    motions, T = _placements(own), np.zeros_like(steps)
    after = np.zeros_like(steps)
    for i, parent in enumerate(robot.parents):
        T[:, i] = steps[:, i] @ ends[:, i]
        if parent >= 0:
            T[:, i] = after[:, parent] @ T[:, i]
        after[:, i] = T[:, i] @ motions[:, i]
    return T


def _forward(parts: _SpringModel, q: NDArray, screws: NDArray) -> NDArray:
    """Return poses at the ends of bodies and after joint springs, (2, k, n, 4, 4)."""
    links, joints = _deflections(screws)
    before = _chain(parts.robot, parts.placed @ links, joints, q)
    return np.stack([before @ np.linalg.inv(joints), before])


def _maps(T: NDArray) -> NDArray:
    """Return matrices (..., 6, 6) that transform screws from frames to the base."""
    R, p = T[..., :3, :3], T[..., :3, 3]
    A = np.zeros((*T.shape[:-2], 6, 6))
    A[..., :3, :3] = A[..., 3:, 3:] = R
    A[..., 3:, :3] = np.cross(p[..., None, :], np.swapaxes(R, -1, -2)).swapaxes(-1, -2)
    return A


def _axes(parts: _SpringModel, T: NDArray) -> NDArray:
    """Return the screws of unit motions of passive joints, (k, passive, 6)."""
    own = [parts.robot.frames[i].own_axis for i in parts.passive]
    maps = _maps(T[:, parts.passive])
    columns = [maps[:, k, :, axis] for k, axis in enumerate(own)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(T), 0, 6))


def _newton(parts: _SpringModel, q: NDArray) -> tuple[NDArray, float]:
    """Return the inverse Newton matrices, and the compliance that scales wrenches."""
    # Rows with the same configuration and springs have the same matrix.
    distinct = np.hstack([
        q,
        parts.compliances.sum(axis=(0, 3, 4)).reshape(len(q), -1),
    ])
    first, same = np.unique(distinct, axis=0, return_index=True, return_inverse=True)[
        1:
    ]
    nominal, C = parts.nominal[first], parts.compliances.sum(axis=0)[first]
    machines, passive = len(first), len(parts.passive)
    size = 6 * len(parts.pairs)
    maps, s = _maps(nominal), parts.signs
    at_base = maps @ C @ np.swapaxes(maps, -1, -2)
    S = np.einsum("an,bn,knij->kaibj", s, s, at_base, optimize=True)
    S = S.reshape(machines, size, size)
    axes = _axes(parts, nominal)
    # A closure wrench acts on the joints of its two chains.
    A = np.einsum("an,kni->kain", s[:, parts.passive], axes)
    A = A.reshape(machines, size, passive)
    diagonal = np.diagonal(S, axis1=1, axis2=2)
    unit = float(np.median(diagonal[diagonal > 0])) if (diagonal > 0).any() else 1e-8
    M = np.zeros((machines, size + passive, size + passive))
    M[:, :size, :size] = -S / unit
    M[:, :size, size:] = -A
    M[:, size:, :size] = np.swapaxes(A, 1, 2)
    return -np.linalg.pinv(M, rcond=_RANK)[same.ravel()], unit


def _carried(
    machines: Sequence[Machine], parts: _SpringModel, ends: NDArray, closing: NDArray
) -> NDArray:
    """Return the wrenches at each body's end and in its joint, (2, k, n, 6)."""
    robot, (bodies, before) = parts.robot, ends
    carried = np.zeros((2, *before.shape[:2], 6))
    platform = robot.index(robot.platform)
    loads = np.array([m.load for m in machines])
    carried[1, :, platform] += _at_base(loads, before[:, platform, :3, 3])
    for k, (a, b) in enumerate(parts.pairs):
        carried[1, :, a] += closing[:, k]
        carried[1, :, b] -= closing[:, k]
    gravity = np.array([m.gravity for m in machines])
    if gravity.any():
        _add_weights(machines, gravity, bodies, carried)
    # Children are treated before their parents.
    for i in range(before.shape[1] - 1, -1, -1):
        carried[0, :, i] += carried[1, :, i]
        if robot.parents[i] >= 0:
            carried[1, :, robot.parents[i]] += carried[0, :, i]
    return carried


def _add_weights(
    machines: Sequence[Machine], gravity: NDArray, bodies: NDArray, carried: NDArray
) -> None:
    """Add the weights of bodies.

    The weight of a beam acts at its ends, with end moments.
    """
    parents = machines[0].robot.parents
    for i, frame in enumerate(machines[0].robot.frames):
        R, tip = bodies[:, i, :3, :3], bodies[:, i, :3, 3]
        centre = tip + R @ frame.centre_of_mass
        carried[0, :, i] += _at_base(_force(frame.mass * gravity), centre)
        link = frame.link
        if not isinstance(link, BeamLink) or link.density is None:
            continue
        length, x = beam_span(frame, link)
        line = R @ (x / np.linalg.norm(x) * length)
        section = declared_section(link.section, link.poisson)
        weight = link.density * section.area * length * gravity
        couple = np.cross(line, weight) / 12
        half = _force(weight / 2)
        half[:, :3] = -couple
        carried[0, :, i] += _at_base(half, tip)
        half[:, :3] = couple
        if parents[i] >= 0:
            carried[1, :, parents[i]] += _at_base(half, tip - line)


def _force(vectors: NDArray) -> NDArray:
    """Return the wrenches (k, 6) of forces (k, 3)."""
    return np.concatenate([np.zeros_like(vectors), vectors], axis=1)


def _at_base(wrenches: NDArray, points: NDArray) -> NDArray:
    """Transform wrenches (k, 6) from given points to the base origin."""
    moments = wrenches[:, :3] + np.cross(points, wrenches[:, 3:])
    return np.concatenate([moments, wrenches[:, 3:]], axis=1)


def _at_frames(T: NDArray, wrenches: NDArray) -> NDArray:
    """Transform wrenches (..., 6) to frames and their axes."""
    return np.einsum("...ij,...i->...j", _maps(T), wrenches)


def _closure_errors(parts: _SpringModel, before: NDArray) -> NDArray:
    """Return the closure errors, (k, closures, 6) [rad, m]."""
    first, second = parts.pairs.T
    target, T = before[:, first] @ parts.closed, before[:, second]
    turn = (T[..., :3, :3] @ np.swapaxes(target[..., :3, :3], -1, -2)).reshape(-1, 3, 3)
    angles = Rotation.from_matrix(turn).as_rotvec() if len(turn) else np.zeros((0, 3))
    angles = angles.reshape(*T.shape[:2], 3)
    p = T[..., :3, 3]
    shift = p - target[..., :3, 3] + np.cross(p, angles)
    return np.concatenate([angles, shift], axis=-1)
