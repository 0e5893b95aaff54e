"""Free motions and springs eliminated once, for many draws of the errors."""

import numpy as np
from numpy.typing import ArrayLike

from assembly.batch.one_posture import OnePosture
from assembly.batch.posture_loads import posture_loads
from assembly.kinematics.posture import Posture
from assembly.linear.closure import (
    closure_signs,
    linearise,
    virtual_joints,
)
from assembly.linear.load import loads_with_weight
from assembly.linear.reduction import FreeMotion, complement, reduce_problem
from assembly.linear.thresholds import RANK
from assembly.model.clearance import (
    clearance_bounds,
    component_bounds,
    has_bounded_motion,
)
from assembly.solvers.cones import cone_starts

__all__ = ["OnePosture", "prepare_energies"]


def prepare_energies(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> OnePosture:
    """Eliminate free motions and springs at a posture, for any errors.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        What :meth:`OnePosture.solve` needs.  Bounds of passive joints' own motion are
        left out, unless a load drives a joint up to its bound.

    Raises:
        FreeMotion: a load drives a motion that nothing resists.
    """
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot)
    wrench = np.zeros(6) if load is None else np.asarray(load, dtype=float)
    g = np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float)
    frame_loads = loads_with_weight(posture, wrench, g)
    try:
        reduced = reduce_problem(lin, joints, frame_loads)
    except FreeMotion:
        if not has_bounded_motion(robot):
            raise
        joints = virtual_joints(robot, bounded_motion=True)
        reduced = reduce_problem(lin, joints, frame_loads)
    A = lin.rows
    A_q, A_u, A_y = (A @ part for part in (joints.free, joints.cones, joints.elastic))
    closing = reduced.basis @ reduced.elastic_inverse.T @ reduced.spread
    # rows that neither free motions nor springs enter, as orthonormal rows
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    redundant = reduced.basis @ complement(reduced.basis.T @ held, RANK)
    # free motions of least size close what the rest leaves open
    inverse = np.linalg.pinv(A_q, rcond=RANK)
    springs = joints.elastic @ reduced.spread
    misfit = -closing.T @ A
    of_errors = np.eye(6 * len(robot.frames)) + springs @ misfit
    screws = np.hstack([joints.cones + springs @ reduced.G, of_errors])
    motions = -inverse @ (A @ screws)
    moved = screws + joints.free @ motions
    bounds = component_bounds(clearance_bounds(robot)).ravel()
    size = np.tile(np.repeat([1.0, lin.size], 3), len(robot.closures))
    signs = closure_signs(robot)
    wrenches = np.einsum("nji,kn->nikj", posture.paths, signs)
    return OnePosture(
        posture=posture,
        joints=joints,
        starts=cone_starts(joints.group),
        G=reduced.G,
        H=reduced.H,
        closures=A,
        misfit=misfit,
        closing=closing,
        on_springs=A_y.T @ closing,
        cones=np.ascontiguousarray(A_u.T @ closing),
        free=A_q.T @ closing,
        redundant=redundant,
        infeasible=redundant.T @ A,
        screws=lin.platform @ moved,
        platform=lin.platform,
        motions=motions,
        left=A @ moved,
        ranges=bounds[np.flatnonzero(joints.free.any(axis=1))],
        wrench=wrenches.reshape(len(robot.frames), 6, -1) / size,
        loads=posture_loads(reduced, closing, wrench, g) if frame_loads else None,
    )
