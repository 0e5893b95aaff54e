"""The nominal closures, solved: joint coordinates at which the perfect robot closes.

Many targets are followed at once, each along its straight line from the home pose.
Steps are damped Gauss-Newton of least norm, so what the closures and the target leave
undetermined stays where it was, and overconstrained robots are no special case.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.robot import Robot
from stiffness.screws import rotation_matrix, rotation_vector, skew

NOT_CLOSED = "expected a configuration in which every closure holds"
_CLOSED = 1e-10  # scaled residual at which a configuration counts as solved
_ROUNDED = 1e-5  # scaled residual accepted where it cannot be made smaller
_JUMP = 0.4  # [rad or lengths] largest joint motion in a step: keeps the assembly mode
_SMALLEST_STEP = 1e-5
_NEWTON = 12  # iterations; quadratic convergence needs about 4


@dataclass(frozen=True, eq=False)
class Target:
    """Where to go: one of the two, NaN where free.

    Attributes:
        pose: (k, 6) ``[tx ty tz rx ry rz]`` [m, rad] of the platform, or None.
        coordinates: (k, n) [rad or m] of the joints held, or None.
    """

    pose: NDArray | None = None
    coordinates: NDArray | None = None

    def __len__(self) -> int:
        given = self.pose if self.pose is not None else self.coordinates
        return 0 if given is None else len(given)


@dataclass(frozen=True, eq=False)
class Track:
    """How far each target was followed.

    Attributes:
        coordinates: (k, n) joint coordinates where the track ends.
        transforms: (k, n, 4, 4) frames there.
        progress: (k,) 1 where the target was reached, less where the track broke off.
        closure_mismatch: (k, closures) [rad, m] largest component left open.
    """

    coordinates: NDArray
    transforms: NDArray
    progress: NDArray
    closure_mismatch: NDArray

    @property
    def reached(self) -> NDArray:
        """(k,) bool."""
        return self.progress == 1.0

    @property
    def mismatch(self) -> NDArray:
        """(k,) [rad, m] largest component left open in any closure."""
        return self.closure_mismatch.max(axis=1, initial=0.0)


def forward(robot: Robot, coordinates: NDArray) -> NDArray:
    """Frames seen from the base, without imperfections.

    Args:
        robot: of n frames.
        coordinates: (..., n) [rad or m].

    Returns:
        (..., n, 4, 4) each frame before its own joint's motion.
    """
    q = np.asarray(coordinates, dtype=float)
    T = np.empty((*q.shape, 4, 4))
    after: dict[int, NDArray] = {-1: np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4))}
    for i, frame in enumerate(robot.frames):
        T[..., i, :, :] = after[robot.parents[i]] @ robot.fixed_transforms[i]
        after[i] = T[..., i, :, :]
        if frame.joint != "fixed":
            after[i] = after[i] @ _motion(frame.joint, q[..., i])
    return T


def _motion(joint: str, q: NDArray) -> NDArray:
    """(..., 4, 4) the joint's own motion about or along z."""
    M = np.zeros((*q.shape, 4, 4))
    M[...] = np.eye(4)
    if joint == "prismatic":
        M[..., 2, 3] = q
    else:
        M[..., 0, 0] = M[..., 1, 1] = np.cos(q)
        M[..., 1, 0] = np.sin(q)
        M[..., 0, 1] = -M[..., 1, 0]
    return M


def size_of(robot: Robot) -> float:
    """[m] reference length: the longest body of the robot, 1 if all are points."""
    lengths = np.linalg.norm(robot.fixed_transforms[:, :3, 3], axis=1)
    return float(lengths.max()) or 1.0


def mobile(robot: Robot) -> NDArray:
    """(n,) bool: joints that are not fixed."""
    return np.array([f.joint != "fixed" for f in robot.frames])


def motion_screws(robot: Robot, T: NDArray) -> NDArray:
    """Screws by which unit joint motions move what is attached, at the base origin.

    Args:
        robot: of n frames.
        T: (..., n, 4, 4) frames.

    Returns:
        (..., n, 6) zero for fixed joints; base axes.
    """
    z, p = T[..., :3, 2], T[..., :3, 3]
    prismatic = np.array([f.joint == "prismatic" for f in robot.frames])[:, None]
    turning = np.concatenate([z, np.cross(p, z)], axis=-1)
    sliding = np.concatenate([np.zeros_like(z), z], axis=-1)
    return np.where(prismatic, sliding, turning) * mobile(robot)[:, None]


def follow(robot: Robot, start: NDArray, target: Target, steps: int = 8) -> Track:
    """Follow the nominal closures from one configuration to many targets.

    Args:
        robot: of n frames.
        start: (n,) coordinates that close (or are the first guess, with ``steps=1``).
        target: k poses or sets of held coordinates.
        steps: first number of steps; they shrink and grow by themselves.

    Returns:
        The tracks, with how far each one came.
    """
    count = len(target)
    q = np.tile(start, (count, 1)).astype(float)
    begin = _begin(robot, q, target)
    done, step = np.zeros(count), np.full(count, 1.0 / steps)
    first = steps == 1  # the start need not close: any step is then allowed
    going = np.ones(count, dtype=bool)
    while going.any():
        rows = np.flatnonzero(going)
        goal = np.minimum(1.0, done[rows] + step[rows])
        tried, fine = _newton(robot, q[rows], _between(begin, target, rows, goal))
        if not first:
            fine &= np.abs(tried - q[rows]).max(axis=1) < _JUMP * max(
                1.0, size_of(robot)
            )
        q[rows[fine]], done[rows[fine]] = tried[fine], goal[fine]
        step[rows] *= np.where(fine, 2.0, 0.5)
        if first:
            q[rows], going[rows] = tried, False
        going &= (done < 1.0) & (step > _SMALLEST_STEP)
    T = forward(robot, q)
    return Track(q, T, done, _closure_mismatch(robot, T))


def _begin(robot: Robot, q: NDArray, target: Target) -> NDArray:
    """Where the straight lines begin: the pose, or the coordinates, of the start."""
    if target.pose is None:
        return q.copy()
    T = forward(robot, q)[:, robot.index(robot.platform)]
    return np.concatenate([T[:, :3, 3], rotation_vector(T[:, :3, :3])], axis=1)


def _between(begin: NDArray, target: Target, rows: NDArray, s: NDArray) -> Target:
    """Targets a fraction s along their lines; exactly the target at s = 1."""
    goal = target.pose if target.pose is not None else target.coordinates
    assert goal is not None
    part = begin[rows] + s[:, None] * (goal[rows] - begin[rows])
    part = np.where(s[:, None] == 1.0, goal[rows], part)
    return Target(pose=part) if target.pose is not None else Target(coordinates=part)


def _newton(robot: Robot, q: NDArray, target: Target) -> tuple[NDArray, NDArray]:
    """Solve the closures at fixed targets: coordinates, and which ones converged."""
    q = q.copy()
    free = np.tile(mobile(robot), (len(q), 1))
    if target.coordinates is not None:
        held = np.isfinite(target.coordinates)
        q[held] = target.coordinates[held]
        free &= ~held
    size = size_of(robot)
    unit = np.where([f.joint == "prismatic" for f in robot.frames], size, 1.0)
    fine = np.zeros(len(q), dtype=bool)
    going = ~fine
    for _ in range(_NEWTON):
        rows = np.flatnonzero(going)
        part = Target(pose=target.pose[rows]) if target.pose is not None else Target()
        r, J = _equations(robot, forward(robot, q[rows]), part, size)
        worst = np.abs(r).max(axis=1, initial=0.0)
        J = J * (unit * free[rows])[:, None, :]
        step = _least_step(J, r)
        still = np.abs(step).max(axis=1, initial=0.0) < 1e-9
        # at rest: solved, or as well as a rounded overconstrained file can be
        fine[rows] = (worst < _CLOSED) | (still & (worst < _ROUNDED))
        going[rows] = ~(worst < 1e-14) & ~still
        limit = 0.5 / np.maximum(0.5, np.abs(step).max(axis=1, initial=0.0))
        q[rows] -= step * limit[:, None] * unit
        if not going.any():
            break
    return q, fine


def _least_step(J: NDArray, r: NDArray) -> NDArray:
    """(k, n) least-squares x of J x = r, of least norm by damping at rounding level."""
    normal = np.swapaxes(J, 1, 2) @ J
    damping = 1e-13 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-30
    right = np.swapaxes(J, 1, 2) @ r[..., None]
    return np.linalg.solve(normal + damping * np.eye(J.shape[2]), right)[..., 0]


def _equations(
    robot: Robot, T: NDArray, target: Target, size: float
) -> tuple[NDArray, NDArray]:
    """Scaled residuals (k, rows) and their derivative (k, rows, n)."""
    motions = motion_screws(robot, T)
    residuals, rows = [], []
    for a, b in robot.closures:
        i, j = robot.index(a), robot.index(b)
        turn, shift = _difference(T[:, i], T[:, j])
        moves = _moves(robot, motions, i, T[:, i]) - _moves(robot, motions, j, T[:, i])
        residuals += [turn, shift / size]
        rows += [moves[:, :3], moves[:, 3:] / size]
    if target.pose is not None:
        p = robot.index(robot.platform)
        r, J = _pose_equations(T[:, p], _moves(robot, motions, p, T[:, p]), target.pose)
        r[:, :3] /= size
        J[:, :3] /= size
        residuals.append(r)
        rows.append(J)
    count, n = T.shape[:2]
    if not rows:
        return np.zeros((count, 0)), np.zeros((count, 0, n))
    return np.concatenate(residuals, axis=1), np.concatenate(rows, axis=1)


def _difference(T_a: NDArray, T_b: NDArray) -> tuple[NDArray, NDArray]:
    """Rotation vector and translation from b to a, base axes."""
    turn = rotation_vector(T_a[..., :3, :3] @ np.swapaxes(T_b[..., :3, :3], -1, -2))
    return turn, T_a[..., :3, 3] - T_b[..., :3, 3]


def _moves(robot: Robot, motions: NDArray, frame: int, T: NDArray) -> NDArray:
    """(k, 6, n) how unit joint motions move a frame, read at T's origin."""
    carried = robot.on_path[frame].copy()
    carried[frame] = False  # a joint's motion comes after its own frame
    at_origin = motions * carried[:, None]
    turn, shift = at_origin[..., :3], at_origin[..., 3:]
    shift = shift + np.cross(turn, T[:, None, :3, 3])
    return np.swapaxes(np.concatenate([turn, shift], axis=-1), -1, -2)


def _pose_equations(
    T: NDArray, moves: NDArray, goal: NDArray
) -> tuple[NDArray, NDArray]:
    """Residual and derivative of the pose components given, zero where free."""
    r = np.zeros((len(T), 6))
    J = np.zeros((len(T), 6, moves.shape[2]))
    r[:, :3], J[:, :3] = T[:, :3, 3] - goal[:, :3], moves[:, 3:]
    rotation = goal[:, 3:]
    if np.isfinite(rotation).any():
        whole = np.isfinite(rotation).all(axis=1)
        here = rotation_vector(T[:, :3, :3])
        r[:, 3:] = here - rotation
        J[:, 3:] = _inverse_left_jacobian(here) @ moves[:, :3]
        if whole.any():  # no trouble near half a turn when all three are given
            goal_R = rotation_matrix(rotation[whole])
            between = T[whole, :3, :3] @ np.swapaxes(goal_R, 1, 2)
            r[whole, 3:], J[whole, 3:] = rotation_vector(between), moves[whole, :3]
    free = ~np.isfinite(goal)
    r[free], J[free] = 0.0, 0.0
    return r, J


def _inverse_left_jacobian(r: NDArray) -> NDArray:
    """(k, 3, 3) change of a rotation vector per small turn in fixed axes."""
    # Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, sec. 10.7
    angle = np.maximum(np.linalg.norm(r, axis=1), 1e-6)[:, None, None]
    S = skew(r)
    half = angle / 2
    return np.eye(3) - S / 2 + (1 - half / np.tan(half)) / angle**2 * (S @ S)


def _closure_mismatch(robot: Robot, T: NDArray) -> NDArray:
    """(k, closures) [rad, m] largest open component of each closure."""
    worst = np.zeros((len(T), len(robot.closures)))
    for k, (a, b) in enumerate(robot.closures):
        turn, shift = _difference(T[:, robot.index(a)], T[:, robot.index(b)])
        worst[:, k] = np.abs(np.concatenate([turn, shift], axis=1)).max(axis=1)
    return worst
