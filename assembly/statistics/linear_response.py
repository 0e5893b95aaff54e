"""Linear response of springs, closures and platform to clearances and errors.

The response depends only on the posture, so all draws of errors share it;
:func:`forcefit.assembly.linear.energy.solve_assembly` solves the draws.
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
    """Response of a posture to clearances and errors, from :func:`linear_response`.

    There are n frames, nu clearances, r springs after elimination, and m closure rows,
    six for each loop. The columns of ``screws`` and ``motions`` are [clearances |
    errors].

    Attributes:
        posture: the robot's configuration; the errors of its robot file are not used.
        joints: virtual joints of the posture.
        starts: (cones + 1,) index of the first clearance of each cone, and nu.
        G: (r, nu) derivative of the scaled strains with respect to the clearances.
        H: (p, nu) equations for the clearances that do not involve springs.
        closures: (m, 6n) scaled closure rows.
        misfit: (r, 6n) derivative of the scaled strains with respect to the errors.
        closing: (m, r) map from springs to closure multipliers.
        redundant: (m, m - ..) orthonormal columns: combinations of closure rows to
            which neither free motions nor springs contribute.
        infeasible: (m - .., 6n) infeasible component of the errors, redundant.T @
            closures.
        screws: (6, nu + 6n) derivative of the platform screw.
        platform: (6, 6n) map from the screws of all frames to the platform's screw.
        motions: (nq, nu + 6n) derivative of the free motions.
        ranges: (nq,) [rad or m] limits of the free motions, which are not applied here.
        wrench: (n, 6, m) [N m, N] wrenches for unit closure multipliers.
        load: (6,) [N m, N] load on the platform at its origin, base axes; None if none.
        gravity: (3,) [m/s^2] gravity in base axes; None if none.
        loads: generalised forces of load and weight on all small screws; None if none.
        load_motions: (nq,) [rad, m] free motions under the loads at zero clearance.
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
            The assemblies under the loads, with clearances in the columns of
            :attr:`joints`.

        Raises:
            ValueError: the shape does not match the robot, or a value is not finite.
        """
        errors = checked_errors(errors, len(self.posture.robot.frames))
        found = solve_assembly(
            self.posture, self.load, gravity=self.gravity, errors=errors
        )
        if found.joints.cones.shape[1] < self.starts[-1]:
            return found.in_columns(self.joints)  # these columns include motion limits
        return found


def checked_errors(errors: ArrayLike, n: int) -> NDArray:
    """Convert the errors of k draws to an array, and check shape and values.

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
    """Compute the response of a posture, with free motions and springs eliminated.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        The linear response.  Motion limits of passive joints are omitted unless a load
        moves a joint to its limit.

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
    # orthonormal rows to which neither free motions nor springs contribute
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    redundant = reduced.basis @ complement(reduced.basis.T @ held, RANK)
    # smallest free motions that close the remaining closure error
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
    """Compute the elastic deformations (6n,) [rad, m] under load at zero clearance."""
    # wrenches that balance the free motions, with the minimum spring energy
    bent = reduced.spread.T @ reduced.load_springs
    springs = spring_deformations(
        reduced.linearisation, reduced.joints, reduced.frame_loads,
        reduced.load_multipliers - closing @ bent,
    )  # fmt: skip
    springs -= reduced.spread @ (reduced.spread.T @ springs)  # removes round-off
    return reduced.joints.elastic @ springs
