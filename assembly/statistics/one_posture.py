"""Problem (22) at one posture for many draws of the errors, and how it follows them.

Draws are solved by :func:`assembly.linear.energy.solve_assembly`.  What clearances and
errors do to springs, closures and platform is linear, and the same for all of them.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.assemblies import COMPILED
from assembly.linear.closure import (
    VirtualJoints,
    closure_signs,
    linearise,
    virtual_joints,
)
from assembly.linear.energy import Assembly, solve_assembly
from assembly.linear.load import FrameLoads, loads_with_weight
from assembly.linear.reduction import (
    FreeMotion,
    Reduction,
    complement,
    reduce_problem,
    spring_deformations,
)
from assembly.linear.thresholds import RANK
from assembly.model.clearance import (
    clearance_bounds,
    component_bounds,
    has_bounded_motion,
)
from assembly.solvers.cones import cone_starts


@dataclass(frozen=True, eq=False)
class Draws:
    """Least energies of k draws at one posture, each with its certificate.

    Attributes:
        errors: (k, n, 6) [rad, m] delta l of every draw.
        energy: (k,) [J]; NaN where there is no solution.
        bound: (k,) [J] certified lower bound.
        clearances: (k, nu) in units of the cones; NaN where the bound of a passive
            joint's own motion is active that is no cone here.
        multipliers: (k, 6 closures) of the scaled closure rows.
        platform_screw: (k, 6) [rad, m] at the platform's origin, base axes.
        fallback: (k,) bool, solved one by one.
    """

    errors: NDArray
    energy: NDArray
    bound: NDArray
    clearances: NDArray
    multipliers: NDArray
    platform_screw: NDArray
    fallback: NDArray

    def taken(self, rows: NDArray) -> "Draws":
        """Some of the draws.

        Args:
            rows: indices of them, or which they are.

        Returns:
            These, in that order.
        """
        return Draws(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True, eq=False)
class OnePosture:
    """A posture prepared for any errors, by :func:`prepare_energies`.

    With n frames, nu clearances, r springs left after elimination, m = 6 closures;
    ``screws`` and ``motions`` take the columns [clearances | errors].

    Attributes:
        posture: where the robot stands; its own errors do not matter.
        joints: what may move.
        starts: (cones + 1,) first clearance of each cone, and nu.
        G: (r, nu) sensitivity of the scaled strains to the clearances.
        H: (p, nu) rows of the clearances that no spring enters.
        closures: (m, 6n) scaled closure rows.
        misfit: (r, 6n) sensitivity of the scaled strains to the errors.
        closing: (m, r) closure multipliers of the springs'.
        redundant: (m, m - ..) closure rows that neither free motions nor springs enter,
            orthonormal columns.
        infeasible: (m - .., 6n) infeasible component of the errors, redundant.T @
            closures.
        screws: (6, nu + 6n) platform screw.
        platform: (6, 6n) screws of all frames to the platform's.
        motions: (nq, nu + 6n) free motions.
        ranges: (nq,) [rad or m] bounds of the free motions, which were left out.
        wrench: (n, 6, m) [N m, N] wrenches of unit closure multipliers.
        load: (6,) [N m, N] on the platform at its origin, base axes; None for none.
        gravity: (3,) [m/s^2] base axes; None for none.
        loads: of both on every small screw, None if there are none.
        load_motions: (nq,) [rad, m] free motions of the tight robot under them.
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

    def solve(self, errors: ArrayLike) -> Draws:
        """Least energies of k draws.

        Args:
            errors: (k, n, 6) [rad, m] delta l.

        Returns:
            Energies, screws, multipliers and certificates.  Under loads ``energy`` is
            what is stored, and ``bound`` is it less the certified gap of energy minus
            work.

        Raises:
            ValueError: the shape does not fit the robot, or a value is not finite.
        """
        errors = checked_errors(errors, len(self.posture.robot.frames))
        found = solve_assembly(
            self.posture, self.load, gravity=self.gravity, errors=errors
        )
        clearances = found.clearances
        if clearances.shape[1] < self.starts[-1]:  # bounds of motions are cones here
            clearances = found.bounded.reshape(len(errors), self.starts[-1])
        return Draws(
            errors, found.energy, found.bound, clearances, found.multipliers,
            found.platform_screw, found.outcome >= COMPILED,
        )  # fmt: skip

    def wrenches(self, multipliers: NDArray) -> NDArray:
        """(k, n, 6) [N m, N] of every link's spring, at its frame in its axes."""
        wrenches = np.tensordot(multipliers, self.wrench, axes=(1, 2))
        if self.loads is not None:
            wrenches += self.loads.body.reshape(-1, 6)
        return wrenches

    def assembly(self, errors: NDArray) -> Assembly:
        """The assembled manipulator of one draw.

        Args:
            errors: (n, 6) [rad, m] delta l.

        Returns:
            The solution of (22), within all bounds of passive joints' own motion.

        Raises:
            CannotAssemble: a closure is open that no clearance and no spring closes.
            SolverFailed: the cone solver gave up.
        """
        posture = replace(self.posture, robot=self.posture.robot.with_errors(errors))
        return solve_assembly(posture, self.load, gravity=self.gravity)

    @property
    def at_tips(self) -> NDArray:
        """(n, 6) [N m, N] the part of :meth:`wrenches` that is links' own weight."""
        if self.loads is None:
            return np.zeros((len(self.posture.robot.frames), 6))
        return self.loads.at_tips


def checked_errors(errors: ArrayLike, n: int) -> NDArray:
    """Errors of k draws.

    Args:
        errors: (k, n, 6) [rad, m] delta l.
        n: frames.

    Returns:
        The same.

    Raises:
        ValueError: the shape does not fit the robot, or a value is not finite.
    """
    errors = np.asarray(errors, dtype=float)
    if errors.shape != (len(errors), n, 6) or not np.isfinite(errors).all():
        raise ValueError(
            f"errors have shape {errors.shape}, expected (k, {n}, 6), all finite"
        )
    return errors


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
    # rows that neither free motions nor springs enter, as orthonormal rows
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    redundant = reduced.basis @ complement(reduced.basis.T @ held, RANK)
    # free motions of least size close what the rest leaves open
    inverse = np.linalg.pinv(A @ free, rcond=RANK)
    springs = joints.elastic @ reduced.spread
    misfit = -closing.T @ A
    of_errors = np.eye(6 * len(robot.frames)) + springs @ misfit
    screws = np.hstack([joints.cones + springs @ reduced.G, of_errors])
    motions = -inverse @ (A @ screws)
    bounds = component_bounds(clearance_bounds(robot)).ravel()
    size = np.tile(np.repeat([1.0, lin.size], 3), len(robot.closures))
    wrenches = np.einsum("nji,kn->nikj", posture.paths, closure_signs(robot))
    return OnePosture(
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
        ranges=bounds[np.flatnonzero(free.any(axis=1))],
        wrench=wrenches.reshape(len(robot.frames), 6, -1) / size,
        load=wrench if loads else None,
        gravity=g if loads else None,
        loads=loads if loads else None,
        load_motions=-inverse @ (A @ _bent(reduced, closing) if loads else A[:, 0] * 0),
    )


def _bent(reduced: Reduction, closing: NDArray) -> NDArray:
    """(6n,) [rad, m] what loads bend in the tight robot."""
    # wrenches that hold the free motions, and bend springs least
    bent = reduced.spread.T @ reduced.load_springs
    springs = spring_deformations(
        reduced.linearisation, reduced.joints, reduced.frame_loads,
        reduced.load_multipliers - closing @ bent,
    )  # fmt: skip
    springs -= reduced.spread @ (reduced.spread.T @ springs)  # rounding
    return reduced.joints.elastic @ springs
