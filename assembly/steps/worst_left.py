"""Largest pose error over all positions in which a joint may be bolted.

At the pose where the joint is bolted, the minimum-energy positions form a convex set of
motions u within its clearance.  At any other pose, u is constant and acts like a
geometric error.  The platform screw is

    x = x0 + X (u - u0) + V (v - v0),

where v are the motions within the clearances of all other joints.  The largest rotation
and translation are computed by convex maximisation, with a lower and an upper bound:

====================  ==================================================================
other clearances      bounds of the largest error
====================  ==================================================================
none, or no springs   The maximum over all u and v that close the loops is between both
                      bounds.
with springs          The maximum over u and v is an upper bound, because minimum energy
                      determines v.  The lower bound is the largest error of equilibria
                      at extreme positions u.
====================  ==================================================================
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import null_space

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.linear.closure import VirtualJoints, linearise, virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.load import no_loads
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.reduction import complement, reduce_problem
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts
from forcefit.assembly.solvers.one_problem import farthest_points
from forcefit.assembly.solvers.outer_cuts import farthest
from forcefit.assembly.steps.bolted import last_bolt
from forcefit.assembly.steps.left_anywhere import free_positions
from forcefit.assembly.steps.machine import Machine
from forcefit.stiffness.screws import skew

# [-] difference between both bounds, relative to the largest error along an axis
_TOLERANCE = 5e-4
_ROUNDING = 1e-10  # [-] tolerance for zero rows, relative to the largest row

CONVEX = "the largest error of all positions with minimum energy"
BRACKET = (
    "between the largest error of the computed equilibria and an upper bound, which "
    "treats loose clearances as errors"
)


@dataclass(frozen=True, eq=False)
class WorstLeft:
    """Largest pose error over the positions in which joints may be bolted.

    Attributes:
        rotation: (2,) [rad] lower and upper bound of the largest rotation.
        translation: (2,) [m] lower and upper bound of the largest translation.
        assumption: :data:`CONVEX` or :data:`BRACKET`.
    """

    rotation: NDArray
    translation: NDArray
    assumption: str


class _Response(NamedTuple):
    """Linear response of a posture to errors and to motions within clearances.

    Attributes:
        joints: virtual joints with their clearances.
        screws: (6, 6n) [rad, m] matrix that converts errors to the platform screw.
        rigid: (p, 6n) loop-closure equations without springs.
        elastic: whether motions within clearances deform springs.
    """

    joints: VirtualJoints
    screws: NDArray
    rigid: NDArray
    elastic: bool


@dataclass(frozen=True, eq=False)
class _Positions:
    """Set of positions w = (u, v) in unit cones with rows (w - start) = 0.

    Attributes:
        start: (nw,) a position in the set.
        rows: (p, nw) orthonormal rows.
        group: (nw,) index of the cone to which each component of w belongs.
        screws: (6, nw) [rad, m] matrix that converts w to the platform screw.
        errors: (6n, nw) [rad, m] matrix that converts w to geometric errors.
        centre: (6,) [rad, m] platform screw at ``start``.
    """

    start: NDArray
    rows: NDArray
    group: NDArray
    screws: NDArray
    errors: NDArray
    centre: NDArray


def is_left_worst(robot: Robot) -> bool:
    """Return whether a robot contains a joint with ``left = "worst"``."""
    bolts = [frame.locked_at for frame in robot.frames]
    return any(bolt is not None and bolt.left == "worst" for bolt in bolts)


def worst_left(posture: Posture, offset: ArrayLike = (0.0, 0.0, 0.0)) -> WorstLeft:
    """Return bounds of the largest pose error over all positions of bolted joints.

    Args:
        posture: unloaded posture of a robot with a joint that has ``left = "worst"``.
        offset: (3,) [m] vector from the platform's origin to the point whose
            translation is bounded, base axes.

    Returns:
        Lower and upper bounds of the largest rotation and translation.

    Raises:
        BadInput: another joint is bolted after those with ``left = "worst"``.
        CannotAssemble: the robot cannot be assembled at the posture.
    """
    response = _response(posture)
    at = _positions(posture, response, np.asarray(offset, dtype=float))
    exact = not response.elastic
    found = []
    for half in (0, 3):
        bounds, corners = _largest(at, half)
        if not exact:
            bounds = _attained(posture, at, corners, half, offset), bounds[1]
        found.append(np.array([bounds[0], max(bounds)]))
    return WorstLeft(found[0], found[1], CONVEX if exact else BRACKET)


def _response(posture: Posture) -> _Response:
    """Return the linear response of an unloaded posture to errors."""
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot)
    reduced = reduce_problem(lin, joints, no_loads(robot.errors.size))
    closing = reduced.basis @ reduced.elastic_inverse.T @ reduced.spread
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    rigid = reduced.basis @ complement(reduced.basis.T @ held, RANK)
    X = (
        np.eye(robot.errors.size)
        - joints.elastic @ reduced.spread @ closing.T @ lin.rows
    )
    inverse = np.linalg.pinv(lin.rows @ joints.free, rcond=RANK)
    X -= joints.free @ inverse @ lin.rows @ X
    return _Response(joints, lin.platform @ X, rigid.T @ lin.rows, reduced.G.size > 0)


def _positions(posture: Posture, response: _Response, offset: NDArray) -> _Positions:
    """Return the set of possible positions within all clearances."""
    robot, cones = posture.robot, response.joints.cones
    frames, machine, state = last_bolt(robot)
    u, free, Z = free_positions(machine, state, 0)
    errors = np.hstack([_locked_in(machine, frames)[:, free], np.zeros_like(cones)])
    v = solve_assembly(posture, errors=robot.errors[None]).clearances[0]
    v = v[: cones.shape[1]]
    columns = errors + np.hstack([np.zeros((len(cones), len(Z))), cones])
    of_u = np.hstack([null_space(Z.T).T, np.zeros((len(Z) - Z.shape[1], len(v)))])
    of_both = response.rigid @ columns
    least = _ROUNDING * np.abs(response.rigid).max(initial=0.0) * np.abs(columns).max()
    rows = np.vstack([of_u, of_both[np.abs(of_both).max(axis=1) > least]])
    _, sizes, Vt = np.linalg.svd(rows, full_matrices=False)
    own = np.unique(machine.joints.group[free], return_inverse=True)[1]
    loose = response.joints.group + own.max(initial=-1) + 1
    to_point = np.eye(6)
    to_point[3:, :3] = -skew(offset)
    centre = response.screws @ (robot.errors.ravel() + cones @ v)
    return _Positions(
        start=np.concatenate([u[free], v]),
        rows=Vt[: np.sum(sizes > _ROUNDING * sizes[:1])],
        group=np.concatenate([own, loose]),
        screws=to_point @ response.screws @ columns, errors=errors,
        centre=to_point @ centre,
    )  # fmt: skip


def _locked_in(machine: Machine, frames: list[int]) -> NDArray:
    """Return the screws of the bolted joints' motions in clearances, (6n, nu)."""
    bolted = np.isin(np.arange(len(machine.cones)) // 6, frames)
    return machine.cones * bolted[:, None]


def _largest(at: _Positions, half: int) -> tuple[tuple[float, float], list[NDArray]]:
    """Return bounds of the largest rotation or translation, and extreme positions."""
    corners: list[NDArray] = [at.start]
    starts, right = cone_starts(at.group), (at.rows @ at.start)[None]

    def support(direction: NDArray) -> tuple[float, NDArray, NDArray]:
        d = direction @ at.screws[half : half + 3]
        length = float(np.linalg.norm(d))
        if not length:
            return float(direction @ at.centre[half : half + 3]), at.centre, d
        w, n, _ = farthest_points(
            at.rows, starts, d[None] / length, right, np.array([1e-9])
        )
        slack = d / length - n[0] @ at.rows
        most = float(n[0] @ right[0] + cone_sizes(slack, at.group).sum()) * length
        corners.append(w[0])
        height = float(direction @ at.centre[half : half + 3]) + most - d @ at.start
        return height, at.centre + at.screws @ (w[0] - at.start), d

    centre = at.centre[half : half + 3]
    reach = [support(sign * axis)[0] for axis in np.eye(3) for sign in (1, -1)]
    size = max(np.abs(reach).max(), float(np.linalg.norm(centre)))
    if not size:
        return (0.0, 0.0), corners
    bounds, _, _ = farthest(at.centre, half, _TOLERANCE * size, support)
    return bounds, corners


def _attained(
    posture: Posture, at: _Positions, corners: list[NDArray], half: int,
    offset: ArrayLike,
) -> float:  # fmt: skip
    """Return the largest pose error with joints bolted at given positions."""
    moved = (np.array(corners) - at.start) @ at.errors.T
    errors = posture.robot.errors + moved.reshape(len(moved), -1, 6)
    bounds = bound_pose_error(solve_assembly(posture, errors=errors), offset=offset)
    found = bounds.translation_error if half else bounds.rotation_error
    return float(np.nanmax(found[:, 0]))
