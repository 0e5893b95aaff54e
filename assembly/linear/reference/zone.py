"""Solve problem (21) by the reference method."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    linearise,
    virtual_joints,
)
from forcefit.assembly.linear.reference.reduction import Reduction, reduce_problem
from forcefit.assembly.model.clearance import (
    clearance_bounds,
    clearance_components,
    clearance_excess,
    scales_with_margin,
)
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts
from forcefit.assembly.solvers.conic import least_factor


def least_margin(posture: Posture, own_axes_free: bool) -> tuple[float, float]:
    """Compute the factor on clearances at which a rigid manipulator can be assembled.

    Args:
        posture: the robot's configuration.
        own_axes_free: whether compliant joints rotate freely about their own axis.

    Returns:
        The margin and its certified lower bound; inf for both if no factor suffices.

    Raises:
        SolverFailed: the cone solver did not converge.
    """
    lin, robot = linearise(posture), posture.robot
    joints = virtual_joints(robot, False, own_axes_free)
    margin, bound, screws = margin_with(lin, joints)
    bounds = clearance_bounds(robot, own_axes_free)
    ranges = np.where(scales_with_margin(robot), np.inf, bounds)
    if clearance_excess(clearance_components(robot, screws), ranges) > 1e-9:
        # An omitted motion limit of a passive joint is active. Solve again with all
        # limits.
        joints = virtual_joints(robot, False, own_axes_free, bounded_motion=True)
        margin, bound, _ = margin_with(lin, joints)
    return margin, bound


def margin_with(
    lin: Linearisation, joints: VirtualJoints
) -> tuple[float, float, NDArray]:
    """Return the margin for given virtual joints.

    Args:
        lin: the assembly constraints.
        joints: virtual joints that can move, without springs.

    Returns:
        The margin and its certified lower bound, inf if no factor suffices; and the
        (n, 6) [rad, m] clearance screws that attain the margin.

    Raises:
        SolverFailed: the cone solver did not converge.
    """
    reduced = reduce_problem(lin, joints)
    margin, bound, u = _margin_of(reduced)
    if margin == np.inf:
        return np.inf, np.inf, np.zeros((len(joints.robot.frames), 6))
    motions = reduced.motions(u, np.zeros(joints.elastic.shape[1]))
    screws = joints.cones @ u + joints.free @ motions
    return margin, bound, screws.reshape(-1, 6)


def _margin_of(reduced: Reduction) -> tuple[float, float, NDArray]:
    """Return the margin of a reduced problem, its lower bound, and the clearances."""
    joints = reduced.joints
    u = np.zeros(joints.cones.shape[1])
    if reduced.inconsistent:
        return np.inf, np.inf, u
    if not np.any(reduced.k):
        return 0.0, 0.0, u
    # With orthonormal rows, the result does not depend on the units of the closures.
    U, S, B = svd(reduced.H, full_matrices=False)
    right = U.T @ reduced.k / S
    t, u, y = least_factor(B, right, joints.group, joints.scaled)
    if t is None:
        return np.inf, np.inf, u
    return t, _margin_bound(B, right, joints, y), u


def _margin_bound(
    B: NDArray, right: NDArray, joints: VirtualJoints, y: NDArray
) -> float:
    """Return the certified lower bound max(0, y.right / sum_k |B_k^T y|)."""
    sizes = cone_sizes(B.T @ y, joints.group)
    scaled = joints.scaled[cone_starts(joints.group)[:-1]]
    work = float(y @ right) - float(sizes[~scaled].sum())
    return max(0.0, work / max(float(sizes[scaled].sum()), 1e-300))
