"""Find the minimum-energy assembly with the smallest pose deviation.

The minimum-energy assembly need not be unique.  Springs and loaded clearances are equal
in all such assemblies, see ``frozen`` in
:mod:`forcefit.assembly.linear.reference.pose_error`.  Unloaded clearances can have any
values in their cones that satisfy the closures.  The nearest pose is the solution of
another second-order cone program,

    minimise  |x + X (v - u)|^2    subject to  H (v - u) = 0,  |v_k| <= 1.

Here x is the deviation at the solution u, X its derivative with respect to the unloaded
clearances, v their new values, and H contains the closure equations.

Sources:
    Public format, section 5, item 15: the minimum-energy pose and, among these poses,
    the pose of minimum norm.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.ranks import (
    RANK,
    ROWS_RANK,
    noise_of,
    rank_of,
    rank_tolerance,
)
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.certificate import LARGEST_EXCESS, unproved
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.reference.energy import solve_with
from forcefit.assembly.linear.reference.pose_error import loaded_cones
from forcefit.assembly.linear.reference.reduction import complement
from forcefit.assembly.model.clearance import has_bounded_motion
from forcefit.assembly.solvers.cones import into_cones
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.solvers.method import Method
from forcefit.stiffness.screws import skew

_STILL = 1e-11  # [rad, m] range below which the platform pose is treated as unique


def nearest_pose(
    assembly: Assembly,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    method: Method = "compiled",
) -> tuple[Assembly, bool]:
    """Return the minimum-energy assembly with the smallest pose deviation.

    Args:
        assembly: minimum-energy assembly.
        offset: (3,) [m] from the platform's origin to the point whose deviation is
            minimised, base axes.
        method: method of :func:`forcefit.assembly.solvers.conic.minimise_energy`.

    Returns:
        The assembly that minimises the Euclidean norm of the deviation (rotation vector
        [rad] and displacement of the point [m]); and whether the pose is non-unique
        because of clearances.

    Raises:
        SolverFailed: the cone solver did not converge.
    """
    free = _free_clearances(assembly, offset)
    if free is None:
        return assembly, False
    h = free.deviation - free.map @ free.start
    none = np.zeros(len(free.start))
    right = free.rows @ free.start
    least = minimise_energy(free.map, h, none, free.rows, right, free.group, method)
    moved = assembly
    if least.feasible:
        moved = _with_clearances(assembly, free, least.clearances)
    exceeded = moved.clearance_excess() > LARGEST_EXCESS
    if exceeded and not assembly.joints.bounded_motion:
        # An omitted motion limit of a passive joint is active. Solve again with all
        # limits.
        robot = assembly.posture.robot
        if has_bounded_motion(robot):
            bounded = solve_with(
                assembly.linearisation, virtual_joints(robot, bounded_motion=True),
                assembly.load, assembly.frame_loads,
            )  # fmt: skip
            return nearest_pose(bounded, offset, method)
    if unproved(moved) and not unproved(assembly):
        moved = assembly
    return moved, _moves(free, method)


@dataclass(frozen=True, eq=False)
class _FreeClearances:
    """Unloaded clearances and their effect on the platform pose.

    Attributes:
        unloaded: (nu,) bool, True for the k columns of unloaded clearances.
        deviation: (6,) [rad, m] deviation of the point at the solution.
        map: (6, k) [rad, m] derivative of the deviation with respect to the clearances,
            including the resulting free motions.
        rows: (p, k) orthonormal rows of the closures.
        start: (k,) values of the clearances at the solution.
        group: (k,) cone of each column.
    """

    unloaded: NDArray
    deviation: NDArray
    map: NDArray
    rows: NDArray
    start: NDArray
    group: NDArray


def _free_clearances(assembly: Assembly, offset: ArrayLike) -> _FreeClearances | None:
    """Return the clearances that can vary at minimum energy, or None."""
    joints, lin = assembly.joints, assembly.linearisation
    unloaded = ~loaded_cones(assembly, joints)
    columns = joints.cones[:, unloaded]
    if not columns.shape[1]:
        return None
    A_q, A_v = lin.rows @ joints.free, lin.rows @ columns
    Z = complement(A_q, rank_tolerance(assembly.posture.mismatch))
    _, S, Vt = np.linalg.svd(Z.T @ A_v, full_matrices=False)
    follow = np.linalg.lstsq(A_q, -A_v, rcond=RANK)[0]
    at_point = np.eye(6)
    at_point[3:, :3] = -skew(np.asarray(offset, dtype=float))
    group = np.unique(joints.group[unloaded], return_inverse=True)[1]
    return _FreeClearances(
        unloaded=unloaded,
        deviation=at_point @ assembly.platform_screw,
        map=at_point @ lin.platform @ (columns + joints.free @ follow),
        rows=Vt[: rank_of(S, ROWS_RANK, noise_of(A_v))],
        start=into_cones(assembly.clearances[unloaded], group),
        group=group,
    )


def _with_clearances(assembly: Assembly, free: _FreeClearances, v: NDArray) -> Assembly:
    """Replace the unloaded clearances; satisfy the closures by free motions."""
    joints, lin = assembly.joints, assembly.linearisation
    u = assembly.clearances.copy()
    u[free.unloaded] = v
    moved = joints.cones @ u + joints.elastic @ assembly.elastic
    right = -lin.misfit - lin.rows @ moved
    q = np.linalg.lstsq(lin.rows @ joints.free, right, rcond=RANK)[0]
    return replace(assembly, clearances=u, motions=q)


def _moves(free: _FreeClearances, method: Method) -> bool:
    """Return whether unloaded clearances allow the platform to move."""
    projected = free.map - free.map @ free.rows.T @ free.rows
    U, S, _ = np.linalg.svd(projected, full_matrices=False)
    directions = U.T[S > _STILL]
    return any(sum(_heights(free, way, method)) > _STILL for way in directions)


def _heights(
    free: _FreeClearances, direction: NDArray, method: Method
) -> Iterator[float]:
    """Yield how far the platform can move along a direction and against it [rad, m]."""
    gradient = free.map.T @ direction
    size = float(np.linalg.norm(gradient))
    none, right = np.zeros((0, len(gradient))), free.rows @ free.start
    for d in (gradient / size, -gradient / size):
        least = minimise_energy(
            none, np.zeros(0), d, free.rows, right, free.group, method
        )
        yield size * float(d @ (least.clearances - free.start))
