"""Problem (22) at one posture for many draws of the errors.

Free motions and springs are eliminated once: only the right sides differ from draw to
draw, and every answer, certificates included, is a linear map of few numbers.  A draw
whose certificate falls short, or that this road does not cover, is solved again by
:mod:`assembly.batch.many_postures`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.batch.draws import Draws
from assembly.batch.loaded_draws import Loads, forces_of, loads_of, solve_loaded
from assembly.batch.many_postures import minimise_energies
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.linear.closure import (
    VirtualJoints,
    closure_signs,
    linearise,
    virtual_joints,
)
from assembly.linear.reduction import complement, reduce_problem
from assembly.linear.rounding import closure_rounding, drop_zeros
from assembly.model.clearance import clearance_bounds

_LEFT_OPEN = 1e-11  # [rad, lengths] most that a closure may stay open, as in the batch
_RIGID = 1e-13  # [rad, lengths] most that the errors may ask where no spring answers


@dataclass(frozen=True, eq=False)
class OnePosture:
    """A posture made ready for any errors, by :func:`prepare_energies`.

    With n frames, nu clearances, r springs left after elimination, m = 6 closures; the
    last three maps take the columns [clearances | errors].

    Attributes:
        posture: where the robot stands; its own errors do not matter.
        joints: what may move.
        starts: (cones + 1,) first clearance of each cone, and nu.
        G: (r, nu) springs' answer to the clearances.
        H: (p, nu) rows of the clearances that no spring can take up: the fast road is
            closed where there are any.
        closures: (m, 6n) scaled closure rows.
        misfit: (r, 6n) springs' answer to the errors, h = misfit @ errors; as well the
            work of unit multipliers on the errors, before any elimination.
        closing: (m, r) closure multipliers of the springs'.
        pulls: (ny, r) how they pull the springs, before any elimination.
        cones: (nu, r) how they pull the clearances, likewise.
        free: (nq, r) how they pull free motions: nothing but rounding.
        over: (m, m - ..) closure rows that neither free motions nor springs take up,
            orthonormal columns.
        unanswered: (m - .., 6n) what of the errors they ask, over.T @ closures.
        screws: (6, nu + 6n) platform screw.
        platform: (6, 6n) screws of all frames to the platform's.
        motions: (nq, nu + 6n) free motions.
        left: (m, nu + 6n) what stays open in the closures: rounding.
        ranges: (nq,) [rad or m] bounds of the free motions, which were left out.
        wrench: (n, 6, m) [N m, N] wrenches of unit closure multipliers.
        loads: what pushes on the robot, None if nothing.
    """

    posture: Posture
    joints: VirtualJoints
    starts: NDArray
    G: NDArray
    H: NDArray
    closures: NDArray
    misfit: NDArray
    closing: NDArray
    pulls: NDArray
    cones: NDArray
    free: NDArray
    over: NDArray
    unanswered: NDArray
    screws: NDArray
    platform: NDArray
    motions: NDArray
    left: NDArray
    ranges: NDArray
    wrench: NDArray
    loads: Loads | None = None

    def solve(self, errors: ArrayLike) -> Draws:
        """Least energies of k draws.

        Args:
            errors: (k, n, 6) [rad, m] delta l.

        Returns:
            Energies, screws, multipliers and certificates.

        Raises:
            ValueError: the shape does not fit the robot, or a value is not finite.
        """
        from assembly.batch.compiled_draws import least_energies

        errors = np.asarray(errors, dtype=float)
        count, n = len(errors), len(self.posture.robot.frames)
        if errors.shape != (count, n, 6) or not np.isfinite(errors).all():
            raise ValueError(
                f"errors have shape {errors.shape}, expected (k, {n}, 6), all finite"
            )
        if self.loads is not None:
            return solve_loaded(self, self.loads, errors)
        some = np.flatnonzero(errors.reshape(-1, 6 * n).any(axis=0))  # most have none
        e = np.ascontiguousarray(errors.reshape(-1, 6 * n)[:, some])
        r, nu = self.G.shape
        u, y = np.zeros((count, nu)), np.zeros((count, r))
        energy, bound = np.zeros(count), np.zeros(count)
        road = np.zeros(count, dtype=np.int64)
        columns = np.concatenate([np.arange(nu), nu + some])
        screws, motions, left = (
            m[:, columns] for m in (self.screws, self.motions, self.left)
        )
        # nothing is larger than this in any draw: no need to look at each one
        most = np.concatenate([np.ones(nu), np.abs(e).max(axis=0, initial=0.0)])
        slip = np.abs(self.free).T @ (np.abs(motions) @ most)
        least_energies(
            np.ascontiguousarray(self.G.T), self.starts,
            e @ self.misfit[:, some].T, np.linalg.pinv(self.G), self.cones,
            self.pulls.T @ self.pulls,
            float(np.linalg.norm(slip)), u, y, energy, bound, road,
        )  # fmt: skip
        parts = np.hstack([u, e])
        slower = (road > 0) | bool(len(self.H))
        for rows, limit in (
            (left, np.full(len(left), _LEFT_OPEN)), (motions, self.ranges)
        ):  # fmt: skip
            if (np.abs(rows) @ most > limit).any():
                slower |= (np.abs(parts @ rows.T) > limit).any(axis=1)
        missed = np.abs(e @ self.unanswered[:, some].T)
        slower |= missed.max(axis=1, initial=0.0) > _RIGID
        multipliers = y @ self.closing.T
        size = size_of(self.posture.robot)
        left = closure_rounding(errors, self.joints, size)
        drop_zeros(energy, bound, multipliers, left)
        answer = Draws(energy, bound, u, multipliers, parts @ screws.T, slower)
        self._solve_slowly(errors, answer)
        return answer

    def wrenches(self, multipliers: NDArray) -> NDArray:
        """(k, n, 6) [N m, N] through every frame, at its origin in its axes."""
        wrenches = np.tensordot(multipliers, self.wrench, axes=(1, 2))
        if self.loads is not None:
            wrenches += self.loads.forces.body.reshape(-1, 6)
        return wrenches

    def _solve_slowly(self, errors: NDArray, answer: Draws) -> None:
        """The draws that the fast road did not solve."""
        rows = np.flatnonzero(answer.slower)
        if not len(rows):
            return
        one = self.posture
        T = np.broadcast_to(one.transforms, (len(rows), *one.transforms.shape))
        found = minimise_energies(one.robot, T.copy(), errors[rows], one.mismatch)
        answer.energy[rows], answer.bound[rows] = found.energy, found.bound
        answer.platform_screw[rows] = found.platform_screw
        answer.clearances[rows] = found.clearances
        multipliers = found.multipliers
        if not len(self.H):
            # the smallest wrenches where rigid parts leave them undetermined; those of
            # joints at the end of their motion stay
            multipliers = multipliers - multipliers @ self.over @ self.over.T
        answer.multipliers[rows] = multipliers


def prepare_energies(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> OnePosture:
    """Eliminate free motions and springs at a posture, for any errors.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        What :meth:`OnePosture.solve` needs.

    Raises:
        FreeMotion: a load drives a motion that nothing resists.
    """
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot)
    push = np.zeros(6) if load is None else np.asarray(load, dtype=float)
    g = np.zeros(3) if gravity is None else np.asarray(gravity, dtype=float)
    forces = forces_of(posture, push, g)
    small = reduce_problem(lin, joints, forces)
    A = lin.rows
    A_q, A_u, A_y = (A @ part for part in (joints.free, joints.cones, joints.elastic))
    grip = small.basis @ small.elastic_inverse.T  # (m, ny)
    closing = grip @ small.spread
    # rows that neither free motions nor springs take up, as orthonormal rows
    held = np.linalg.qr(closing)[0] if closing.shape[1] else closing
    over = small.basis @ complement(small.basis.T @ held, 1e-10)
    # free motions of least size close what the rest leaves
    back = np.linalg.pinv(A_q, rcond=1e-10)
    springs = joints.elastic @ small.spread
    misfit = -closing.T @ A
    own = np.eye(6 * len(robot.frames)) + springs @ misfit
    screws = np.hstack([joints.cones + springs @ small.G, own])
    motions = -back @ (A @ screws)
    moved = screws + joints.free @ motions
    bounds = clearance_bounds(robot)[:, [0, 0, 1, 2, 2, 3]].ravel()
    size = np.tile(np.repeat([1.0, lin.size], 3), len(robot.closures))
    signs = closure_signs(robot)
    wrench = np.einsum("nji,kn->nikj", posture.paths, signs)
    starts = np.searchsorted(joints.group, np.arange(joints.group.max(initial=-1) + 2))
    return OnePosture(
        posture, joints, starts.astype(np.int64),
        small.G, small.H, A, misfit, closing, A_y.T @ closing,
        np.ascontiguousarray(A_u.T @ closing), A_q.T @ closing,
        over, over.T @ A, lin.platform @ moved, lin.platform, motions, A @ moved,
        bounds[np.flatnonzero(joints.free.any(axis=1))],
        wrench.reshape(len(robot.frames), 6, -1) / size,
        loads_of(small, misfit, push, g) if forces else None,
    )  # fmt: skip
