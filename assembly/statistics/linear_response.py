"""Linear response of a posture to clearances and geometric errors.

The response does not depend on the errors, so it is computed once for all draws. The
draws are solved by :func:`forcefit.assembly.linear.energy.solve_assembly`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.linear.closure import (
    VirtualJoints,
    closure_signs,
    linearise,
    virtual_joints,
)
from forcefit.assembly.linear.energy import Assembly, solve_assembly
from forcefit.assembly.linear.load import FrameLoads, loads_with_weight
from forcefit.assembly.linear.reference.reduction import (
    FreeMotion,
    Reduction,
    complement,
    reduce_problem,
    spring_deformations,
)
from forcefit.assembly.model.clearance import (
    clearance_bounds,
    component_bounds,
    has_bounded_motion,
)
from forcefit.assembly.solvers.cones import cone_starts


@dataclass(frozen=True, eq=False)
class LinearResponse:
    """Linear response of a posture, computed by :func:`linear_response`.

    There are n frames, nu clearances, r springs after elimination, nq free motions and
    m closure equations, six for each loop. The columns of ``screws`` and ``motions``
    belong to the nu clearances, followed by the 6n errors.

    Attributes:
        posture: posture of the robot, whose errors are not used.
        joints: virtual joints of the posture.
        starts: (cones + 1,) index of the first clearance of each cone, and finally nu.
        G: (r, nu) derivative of the scaled strains with respect to the clearances.
        H: (p, nu) matrix of the closure equations without springs.
        closures: (m, 6n) matrix of the scaled closure equations.
        misfit: (r, 6n) derivative of the scaled strains with respect to the errors.
        closing: (m, r) derivative of the closure multipliers with respect to the scaled
            strains.
        redundant: (m, p) orthonormal combinations of closure equations that contain
            neither free motions nor springs.
        infeasible: (p, 6n) product of ``redundant``, transposed, and ``closures``.
        screws: (6, nu + 6n) derivative of the platform screw with respect to clearances
            and errors.
        platform: (6, 6n) derivative of the platform screw with respect to the screws of
            all frames.
        motions: (nq, nu + 6n) derivative of the free motions with respect to clearances
            and errors.
        ranges: (nq,) [rad or m] limits of the free motions, which the response omits.
        wrench: (n, 6, m) [N m, N] link wrenches due to unit closure multipliers.
        load: (6,) [N m, N] load on the platform at its origin in base axes, or None.
        gravity: (3,) [m/s^2] gravity in base axes, or None.
        loads: generalised forces of load and weight on all frames, or None.
        load_motions: (nq,) [rad, m] free motions under the loads without clearances.
    """

    posture: Posture
    joints: VirtualJoints
    starts: NDArray
    G: NDArray
    H: NDArray
    closures: NDArray
    misfit: NDArray
    closing: NDArray
    redundant: NDArray
    infeasible: NDArray
    screws: NDArray
    platform: NDArray
    motions: NDArray
    ranges: NDArray
    wrench: NDArray
    load: NDArray | None
    gravity: NDArray | None
    loads: FrameLoads | None
    load_motions: NDArray

    def solve(self, errors: ArrayLike) -> Assembly:
        """Solve the minimum-energy problem for k draws.

        Args:
            errors: (k, n, 6) [rad, m] geometric errors delta l.

        Returns:
            The assemblies under the loads.

        Raises:
            ValueError: the shape does not match the robot, or a value is not finite.
        """
        errors = checked_errors(errors, len(self.posture.robot.frames))
        found = solve_assembly(
            self.posture, self.load, gravity=self.gravity, errors=errors
        )
        if found.joints.cones.shape[1] < self.starts[-1]:
            return found.in_columns(self.joints)  # self.joints includes motion limits
        return found


def checked_errors(errors: ArrayLike, n: int) -> NDArray:
    """Convert the errors of k draws to an array of the required shape.

    Args:
        errors: (k, n, 6) [rad, m] geometric errors delta l.
        n: number of frames.

    Returns:
        The errors as an array.

    Raises:
        ValueError: the shape does not match the robot, or a value is not finite.
    """
    errors = np.asarray(errors, dtype=float)
    if errors.shape != (len(errors), n, 6) or not np.isfinite(errors).all():
        raise ValueError(
            f"errors have shape {errors.shape}, expected (k, {n}, 6), all finite"
        )
    return errors


def linear_response(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> LinearResponse:
    """Compute the linear response of a posture to clearances and errors.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        The linear response. It includes motion limits of passive joints only if nothing
        else resists a load.

    Raises:
        FreeMotion: a load acts along a motion without stiffness.
    """
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot)
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    g = np.zeros(3) if gravity is None else np.array(gravity, dtype=float)
    loads = loads_with_weight(posture, wrench, g)
    try:
        reduced = reduce_problem(lin, joints, loads)
    except FreeMotion:
        if not has_bounded_motion(robot):
            raise
        joints = virtual_joints(robot, bounded_motion=True)
        reduced = reduce_problem(lin, joints, loads)
    A, free = lin.rows, joints.free
    closing = reduced.basis @ reduced.elastic_inverse.T @ reduced.spread
    # closure equations that contain neither free motions nor springs
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    redundant = reduced.basis @ complement(reduced.basis.T @ held, RANK)
    # The pseudoinverse returns the smallest free motions that close the loops.
    inverse = np.linalg.pinv(A @ free, rcond=RANK)
    springs = joints.elastic @ reduced.spread
    misfit = -closing.T @ A
    of_errors = np.eye(6 * len(robot.frames)) + springs @ misfit
    screws = np.hstack([joints.cones + springs @ reduced.G, of_errors])
    motions = -inverse @ (A @ screws)
    bounds = component_bounds(clearance_bounds(robot)).ravel()
    size = np.tile(np.repeat([1.0, lin.size], 3), len(robot.closures))
    wrenches = np.einsum("nji,kn->nikj", posture.paths, closure_signs(robot))
    return LinearResponse(
        posture=posture,
        joints=joints,
        starts=cone_starts(joints.group),
        G=reduced.G,
        H=reduced.H,
        closures=A,
        misfit=misfit,
        closing=closing,
        redundant=redundant,
        infeasible=redundant.T @ A,
        screws=lin.platform @ (screws + free @ motions),
        platform=lin.platform,
        motions=motions,
        ranges=bounds[(free != 0).argmax(axis=0)],
        wrench=wrenches.reshape(len(robot.frames), 6, -1) / size,
        load=wrench if loads else None,
        gravity=g if loads else None,
        loads=loads if loads else None,
        load_motions=-inverse @ (A @ _bent(reduced, closing) if loads else A[:, 0] * 0),
    )


def _bent(reduced: Reduction, closing: NDArray) -> NDArray:
    """Compute the frame screws under load without clearances, (6n,) [rad, m]."""
    # The multipliers balance the load on the free motions at minimum energy.
    bent = reduced.spread.T @ reduced.load_springs
    springs = spring_deformations(
        reduced.linearisation, reduced.joints, reduced.frame_loads,
        reduced.load_multipliers - closing @ bent,
    )  # fmt: skip
    springs -= reduced.spread @ (reduced.spread.T @ springs)  # removes round-off
    return reduced.joints.elastic @ springs
