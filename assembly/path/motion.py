r"""Velocities and accelerations of all bodies of a robot along a path.

======  ======================  ============  =====================================
symbol  code                    shape         meaning
======  ======================  ============  =====================================
S_j     ``screws``              (k, n, 6)     unit twist of joint j, base axes
q', q'' ``rates``               (k, n)        rates and second derivatives of the
                                              joint coordinates
V_j     ``twists``              (k, n, 6)     twist [omega, v] of body j, with v at
                                              the origin of the base
A_j     ``accelerations``       (k, n, 6)     derivative of V_j with time
======  ======================  ============  =====================================

The twist of a body is V = sum S_j q'_j over the joints that move it, and its derivative
is A = sum S_j q''_j + [V_j, S_j] q'_j.  Both frames of a closure have the same V and A.
The closure equations and those of the prescribed pose components are linear in q' and
in q'', with the same matrix.  The minimum-norm solution is used if a rate is
undetermined, for example the spin of a rod between two ball joints.  The module
:mod:`forcefit.assembly.path.idle_motions` then corrects such motions.

Sources:
    Featherstone (2008), Rigid Body Dynamics Algorithms, chapters 2 and 8 (spatial
    accelerations, loop closures).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import mobile, motion_screws, size_of
from forcefit.assembly.kinematics.posture import POSE, Posture, pose_components
from forcefit.assembly.kinematics.se3 import bracket, stumpff, turn_jacobian
from forcefit.assembly.model.robot import Robot

# [-] tolerance for zero singular values, relative to the largest, as in
# forcefit.assembly.kinematics.closure_rates
_SINGULAR = 1e-6
# [-] singular values below this multiple of the nominal closure error count as zero
_NOISE = 30.0
_PRESCRIBED = 1e-4  # [-] largest relative error of a prescribed velocity


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a robot with n frames at k points of a path.

    Attributes:
        postures: the k postures as one object.
        rates: (k, n) [rad/s or m/s] first derivatives of the joint coordinates.
        second_rates: (k, n) [rad/s^2 or m/s^2] second derivatives.
        twists: (k, n, 6) [rad/s, m/s] twists of the bodies, at the base's origin.
        accelerations: (k, n, 6) [rad/s^2, m/s^2] time derivatives of the twists.
        free: largest number of joint motions that neither the path nor the loop
            closures prescribe.
        equations: (k, 6 closures + c, n) coefficients of the joint rates in the
            equations of loop closures and of c prescribed components.
    """

    postures: Posture
    rates: NDArray
    second_rates: NDArray
    twists: NDArray
    accelerations: NDArray
    free: int
    equations: NDArray

    def acceleration_of(self, body: int, points: NDArray) -> NDArray:
        """Return the acceleration of a point of a body.

        Args:
            body: index of the body's frame.
            points: (k, 3) [m] position of the point at k instants, base axes.

        Returns:
            (k, 3) [m/s^2] accelerations in base axes.
        """
        V, A = self.twists[:, body], self.accelerations[:, body]
        velocity = V[:, 3:] + np.cross(V[:, :3], points)
        return A[:, 3:] + np.cross(A[:, :3], points) + np.cross(V[:, :3], velocity)


class NotFollowed(Exception):
    """Raised if the robot cannot follow a path.

    Attributes:
        row: index of the first point at which this is impossible.
    """

    def __init__(self, row: int) -> None:
        super().__init__(f"point {row} cannot be followed")
        self.row = row


def follow_path(
    postures: Posture, names: tuple[str, ...],
    path: tuple[NDArray, NDArray, NDArray], idle: NDArray | float = 0.0,
) -> Motion:  # fmt: skip
    """Compute the motion of a robot along a path.

    Args:
        postures: k postures on the path.
        names: c prescribed components, either pose components ``tx`` .. or joint
            coordinates ``q.<frame>``.  In the second case, all other drives do not
            move.
        path: three arrays (k, c): components [m or rad], first and second derivatives.
        idle: (k, n) [rad/s or m/s] joint rates of idle motions, which are added to the
            minimum-norm solution, see
            :func:`forcefit.assembly.path.idle_motions.momentum_free_rates`.

    Returns:
        The motion.

    Raises:
        NotFollowed: the prescribed velocity or acceleration is impossible because the
            posture is singular.
    """
    robot = postures.robot
    if names[0] not in POSE:
        names, path = _with_all_drives(robot, names, path)
    values, first, second = path
    moves, scale = mobile(robot), _units(robot)
    S = motion_screws(robot, postures.transforms)
    E, size = _equations(postures, names, values, S)
    U, sizes, Vt = np.linalg.svd(E[:, :, moves] * scale[moves], full_matrices=False)
    inverse = _inverse(sizes, postures.mismatch)
    solve = np.swapaxes(Vt, 1, 2) * inverse[:, None] @ np.swapaxes(U, 1, 2)
    ranks = np.count_nonzero(inverse, axis=1)
    free = int(moves.sum() - ranks.min(initial=moves.sum()))

    def joints(prescribed: NDArray, closures: NDArray) -> NDArray:
        right = np.concatenate([closures, prescribed], axis=1)
        q = np.zeros((len(values), len(moves)))
        q[:, moves] = (solve @ right[..., None])[..., 0] * scale[moves]
        _check_followed(E, q, right)
        return q

    closed = np.zeros((len(values), E.shape[1] - values.shape[1]))
    rates = joints(first, closed) + idle
    carries = carries_matrix(robot)
    twists = carries @ (S * rates[..., None])
    turning = (bracket(twists) @ S[..., None])[..., 0] * rates[..., None]
    drift = carries @ turning  # accelerations for q'' = 0
    of_closures = _of_closures(robot, drift) / size
    own = _second_of_pose(postures, names, values, twists, drift)
    second_rates = joints(second - own, -of_closures)
    accelerations = carries @ (S * second_rates[..., None]) + drift
    return Motion(postures, rates, second_rates, twists, accelerations, free, E)


def _with_all_drives(
    robot: Robot, names: tuple[str, ...], path: tuple[NDArray, NDArray, NDArray]
) -> tuple[tuple[str, ...], tuple[NDArray, NDArray, NDArray]]:
    """Return a path of joint coordinates, to which drives at rest are added."""
    drives = [f"q.{f.name}" for f in robot.frames if f.actuated]
    still = [name for name in drives if name not in names]
    zero = np.zeros((len(path[0]), len(still)))
    values, first, second = (np.hstack([part, zero]) for part in path)
    return (*names, *still), (values, first, second)


def _units(robot: Robot) -> NDArray:
    """Return the unit of each joint coordinate, 1 rad or the robot's size, (n,)."""
    slides = np.array([f.joint == "prismatic" for f in robot.frames])
    return np.where(slides, size_of(robot), 1.0)


def carries_matrix(robot: Robot) -> NDArray:
    """Return a matrix whose entry (i, j) is 1 if joint j moves body i, (n, n)."""
    return robot.on_path - np.eye(len(robot.frames))


def _closures(robot: Robot) -> NDArray:
    """Return the indices of the two frames of each closure, (closures, 2)."""
    pairs = [[robot.index(name) for name in pair] for pair in robot.closures]
    return np.array(pairs, dtype=int).reshape(-1, 2)


def _of_closures(robot: Robot, bodies: NDArray) -> NDArray:
    """Return differences of frame screws at the closures, (k, 6 closures)."""
    pairs = _closures(robot)
    first, second = bodies[:, pairs[:, 0]], bodies[:, pairs[:, 1]]
    return (first - second).reshape(len(bodies), 6 * len(pairs))


def _equations(
    postures: Posture, names: tuple[str, ...], values: NDArray, S: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the equations of loop closures and prescribed components.

    Returns:
        (k, 6 closures + c, n) coefficients of the joint rates, with translations in
        closures divided by the robot's size; and (6 closures,) these divisors.
    """
    robot = postures.robot
    carries = carries_matrix(robot)
    unit = np.tile(np.repeat([1.0, size_of(robot)], 3), len(robot.closures))
    pairs = _closures(robot)
    signs = carries[pairs[:, 0]] - carries[pairs[:, 1]]
    closures = np.einsum("cn,kns->kcsn", signs, S)
    closures = closures.reshape(len(S), len(unit), len(carries))
    if names[0] not in POSE:
        rows = [robot.index(name.removeprefix("q.")) for name in names]
        own = np.broadcast_to(
            np.eye(len(robot.frames))[rows], (len(S), len(rows), len(carries))
        )
    else:
        platform = carries[robot.index(robot.platform)]
        twists = np.swapaxes(S * platform[:, None], 1, 2)
        own = _of_pose(postures, names, values) @ twists
    return np.concatenate([closures / unit[:, None], own], axis=1), unit


def _rotations(postures: Posture, names: tuple[str, ...], values: NDArray) -> NDArray:
    """Return the rotation vectors of the platform along the path, (k, 3) [rad]."""
    turn = pose_components(postures.platform)[:, 3:]
    for k, name in enumerate(names):
        if name[0] == "r":
            turn[:, POSE.index(name) - 3] = values[:, k]
    return turn


def _of_pose(postures: Posture, names: tuple[str, ...], values: NDArray) -> NDArray:
    """Return the rates of the pose components per unit twist, (k, c, 6)."""
    rates = np.zeros((len(values), 6, 6))
    p = postures.platform[:, :3, 3]
    rates[:, :3, 3:] = np.eye(3)
    for i, axis in enumerate(np.eye(3)):
        rates[:, :3, i] = np.cross(axis, p)
    if any(name[0] == "r" for name in names):
        turn = _rotations(postures, names, values)
        rates[:, 3:, :3] = np.linalg.inv(turn_jacobian(turn))
    return rates[:, [POSE.index(name) for name in names]]


def _second_of_pose(
    postures: Posture, names: tuple[str, ...], values: NDArray, twists: NDArray,
    drift: NDArray,
) -> NDArray:  # fmt: skip
    """Return the second derivatives of prescribed components for q'' = 0, (k, c)."""
    if names[0] not in POSE:
        return np.zeros_like(values)
    row = postures.robot.index(postures.robot.platform)
    V, A, p = twists[:, row], drift[:, row], postures.platform[:, :3, 3]
    omega = V[:, :3]
    velocity = V[:, 3:] + np.cross(omega, p)
    shift = A[:, 3:] + np.cross(A[:, :3], p) + np.cross(omega, velocity)
    second = np.concatenate([shift, np.zeros_like(shift)], axis=1)
    if any(name[0] == "r" for name in names):
        turn = _rotations(postures, names, values)
        to_rates = np.linalg.inv(turn_jacobian(turn))
        rate = (to_rates @ omega[..., None])[..., 0]
        moved = A[:, :3] - _turning_of_jacobian(turn, rate)
        second[:, 3:] = (to_rates @ moved[..., None])[..., 0]
    return second[:, [POSE.index(name) for name in names]]


def _turning_of_jacobian(turn: NDArray, rate: NDArray) -> NDArray:
    """Return J' r', where J is the :func:`turn_jacobian` of r(t), (k, 3).

    For a rotation vector r, J r' = r' + c_2 r x r' + c_3 r x (r x r').  The time
    derivative of c_k is (k c_(k+2) - c_(k+1)) r.r'.
    """
    _, _, _, c3, c4, c5 = (c[..., 0] for c in stumpff(turn))
    along = np.sum(turn * rate, axis=1, keepdims=True)
    once = np.cross(turn, rate)
    twice = np.cross(turn, once)
    own = c3 * np.cross(rate, once)
    return own + along * ((2 * c4 - c3) * once + (3 * c5 - c4) * twice)


def _inverse(values: NDArray, mismatch: Any) -> NDArray:
    """Return inverse singular values, (k, m), with 0 for values below the threshold."""
    least = np.maximum(_SINGULAR, _NOISE * np.broadcast_to(mismatch, len(values)))
    kept = values > least[:, None] * values[:, :1]
    return np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)


def idle_rates(motion: Motion) -> NDArray:
    """Return joint motions that move neither a drive nor the platform.

    Args:
        motion: motion of a robot of n frames at k points.

    Returns:
        (k, n, d) [rad or m] d independent motions, where d is the smallest number of
        such motions at any point.
    """
    robot = motion.postures.robot
    passive = np.array([f.passive for f in robot.frames])
    E = motion.equations[:, :, passive] * _units(robot)[passive]
    _, values, Vt = np.linalg.svd(E)
    inverse = _inverse(values, motion.postures.mismatch)
    rank = int(np.count_nonzero(inverse, axis=1).max(initial=0))
    idle = np.zeros((len(E), len(passive), Vt.shape[1] - rank))
    idle[:, passive] = np.swapaxes(Vt[:, rank:], 1, 2)
    return idle * _units(robot)[:, None]


def _check_followed(E: NDArray, q: NDArray, right: NDArray) -> None:
    """Raise NotFollowed if the equations have no solution."""
    left = np.abs((E @ q[..., None])[..., 0] - right).max(axis=1, initial=0.0)
    size = np.abs(right).max(axis=1, initial=0.0)
    size = np.maximum(size, 1e-6 * size.max(initial=0.0))
    beyond = left > _PRESCRIBED * size
    if beyond.any():
        raise NotFollowed(int(np.argmax(beyond)))
