"""Of all assemblies of least energy, the one whose platform is nearest to nominal.

Springs and loaded clearances are the same in all of them (:mod:`assembly.linear.reach`,
reading ``frozen``); clearances that nothing loads may be anywhere in their cones as
long as the closures hold.  The nearest pose is a second-order cone programme again,

    minimise  |x + X (v - u)|^2    subject to  H (v - u) = 0,  |v_k| <= 1,

x the deviation at the solution u, X how it follows the clearances left free.

Sources:
    Public format, exact reading 15: the pose of least energy and, among those, of
    least norm.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.closure import virtual_joints
from assembly.linear.energy import EXCESS, Assembly, solve_with
from assembly.linear.reach import loaded_cones
from assembly.linear.reduction import NOISE, complement
from assembly.model.clearance import has_bounded_motion
from assembly.solvers.conic import into_cones, minimise_energy
from stiffness.screws import skew

_RANK = 1e-10
_STILL = 1e-11  # [rad, m] a pose that moves less is settled


def nearest_pose(
    answer: Assembly, offset: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[Assembly, bool]:
    """The assembly of the same energy whose pose deviates least.

    Args:
        answer: at least energy.
        offset: (3,) [m] from the platform's origin to the point whose deviation counts,
            base axes.

    Returns:
        The assembly, its deviation (rotation vector [rad] and shift of the point [m])
        of least Euclidean norm; and whether play leaves the pose free.

    Raises:
        SolverFailed: the cone solver gave up.
    """
    free = _free_play(answer, offset)
    if free is None:
        return answer, False
    h = free.deviation - free.map @ free.start
    none = np.zeros(len(free.start))
    right = free.rows @ free.start
    least = minimise_energy(free.map, h, none, free.rows, right, free.group)
    moved = _with_play(answer, free, least.clearances) if least.feasible else answer
    if moved.clearance_excess() > EXCESS and not answer.joints.bounded_motion:
        # the bound of a passive joint's own motion was left out, but it matters
        robot = answer.posture.robot
        if has_bounded_motion(robot):
            joints = virtual_joints(robot, bounded_motion=True)
            kept = solve_with(answer.linearisation, joints, answer.load, answer.forces)
            return nearest_pose(kept, offset)
    if moved.unproved and not answer.unproved:
        moved = answer
    return moved, _moves(free)


@dataclass(frozen=True, eq=False)
class _FreePlay:
    """Clearances that carry nothing, and what the platform does with them.

    Attributes:
        unloaded: (nu,) bool, which columns of the cones these k are.
        deviation: (6,) [rad, m] of the point, at the solution.
        map: (6, k) [rad, m] how it follows them, free motions following suit.
        rows: (p, k) orthonormal rows of the closures.
        start: (k,) where the solution has them.
        group: (k,) cone of each.
    """

    unloaded: NDArray
    deviation: NDArray
    map: NDArray
    rows: NDArray
    start: NDArray
    group: NDArray


def _free_play(answer: Assembly, offset: ArrayLike) -> _FreePlay | None:
    """What may still move at least energy; None if nothing may."""
    joints, lin = answer.joints, answer.linearisation
    unloaded = ~loaded_cones(answer, joints)
    columns = joints.cones[:, unloaded]
    if not columns.shape[1]:
        return None
    A_q, A_v = lin.rows @ joints.free, lin.rows @ columns
    Z = complement(A_q, _RANK + 30.0 * answer.posture.mismatch)
    _, S, Vt = np.linalg.svd(Z.T @ A_v, full_matrices=False)
    noise = max(NOISE * np.abs(A_v).max(initial=0.0), 1e-9 * S.max(initial=0.0))
    follow = np.linalg.lstsq(A_q, -A_v, rcond=_RANK)[0]
    at_point = np.eye(6)
    at_point[3:, :3] = -skew(np.asarray(offset, dtype=float))
    group = np.unique(joints.group[unloaded], return_inverse=True)[1]
    return _FreePlay(
        unloaded,
        at_point @ answer.platform_screw,
        at_point @ lin.platform @ (columns + joints.free @ follow),
        Vt[: int(np.sum(S > noise))],
        into_cones(answer.clearances[unloaded], group),
        group,
    )


def _with_play(answer: Assembly, free: _FreePlay, v: NDArray) -> Assembly:
    """The assembly with other unloaded clearances, free motions following suit."""
    joints, lin = answer.joints, answer.linearisation
    u = answer.clearances.copy()
    u[free.unloaded] = v
    moved = joints.cones @ u + joints.elastic @ answer.elastic
    right = -lin.misfit - lin.rows @ moved
    q = np.linalg.lstsq(lin.rows @ joints.free, right, rcond=_RANK)[0]
    return replace(answer, clearances=u, motions=q)


def _moves(free: _FreePlay) -> bool:
    """Whether the closures leave the platform anywhere to go."""
    left = free.map - free.map @ free.rows.T @ free.rows
    U, S, _ = np.linalg.svd(left, full_matrices=False)
    return any(sum(_heights(free, direction)) > _STILL for direction in U.T[S > _STILL])


def _heights(free: _FreePlay, direction: NDArray) -> Iterator[float]:
    """[rad, m] how far the platform goes both ways along a direction."""
    pull = free.map.T @ direction
    size = float(np.linalg.norm(pull))
    none, right = np.zeros((0, len(pull))), free.rows @ free.start
    for way in (pull / size, -pull / size):
        found = minimise_energy(none, np.zeros(0), way, free.rows, right, free.group)
        yield size * float(way @ (found.clearances - free.start))
