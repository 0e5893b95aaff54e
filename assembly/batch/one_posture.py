"""Problem (22) at one posture, prepared for many draws of the errors.

Free motions and springs are eliminated once: only the right sides differ from draw to
draw, and every result, certificates included, is a linear map of few numbers.  A draw
whose certificate falls short, or that this does not cover, is solved again by
:mod:`assembly.linear.energy`.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.batch.draws import Draws
from assembly.batch.draws_side_by_side import Energies, Reduced, least_energies
from assembly.batch.posture_loads import PostureLoads
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.linear.closure import VirtualJoints
from assembly.linear.energy import (
    Assembly,
    CannotAssemble,
    minimise_energies,
    solve_assembly,
)
from assembly.linear.reduction import FreeMotion
from assembly.linear.rounding import closure_rounding, drop_zeros
from assembly.linear.thresholds import INFEASIBLE, OPEN
from assembly.solvers.conic import SolverFailed


@dataclass(frozen=True, eq=False)
class OnePosture:
    """A posture prepared for any errors, by ``prepare_energies``.

    With n frames, nu clearances, r springs left after elimination, m = 6 closures;
    ``screws``, ``motions`` and ``left`` take the columns [clearances | errors].

    Attributes:
        posture: where the robot stands; its own errors do not matter.
        joints: what may move.
        starts: (cones + 1,) first clearance of each cone, and nu.
        G: (r, nu) sensitivity of the scaled strains to the clearances.
        H: (p, nu) rows of the clearances that no spring enters; where there are any,
            every draw goes to the fallback.
        closures: (m, 6n) scaled closure rows.
        misfit: (r, 6n) sensitivity of the scaled strains to the errors, h = misfit @
            errors; also the work of unit multipliers on the errors, before any
            elimination.
        closing: (m, r) closure multipliers of the springs'.
        on_springs: (ny, r) generalised forces of these on the springs, before any
            elimination.
        cones: (nu, r) on the clearances, likewise.
        free: (nq, r) on free motions: nothing but rounding.
        redundant: (m, m - ..) closure rows that neither free motions nor springs enter,
            orthonormal columns.
        infeasible: (m - .., 6n) infeasible component of the errors, redundant.T @
            closures.
        screws: (6, nu + 6n) platform screw.
        platform: (6, 6n) screws of all frames to the platform's.
        motions: (nq, nu + 6n) free motions.
        left: (m, nu + 6n) residual of the closures: rounding.
        ranges: (nq,) [rad or m] bounds of the free motions, which were left out.
        wrench: (n, 6, m) [N m, N] wrenches of unit closure multipliers.
        loads: on the robot, None if there are none.
    """

    posture: Posture
    joints: VirtualJoints
    starts: NDArray
    G: NDArray
    H: NDArray
    closures: NDArray
    misfit: NDArray
    closing: NDArray
    on_springs: NDArray
    cones: NDArray
    free: NDArray
    redundant: NDArray
    infeasible: NDArray
    screws: NDArray
    platform: NDArray
    motions: NDArray
    left: NDArray
    ranges: NDArray
    wrench: NDArray
    loads: PostureLoads | None = None

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
        errors = np.asarray(errors, dtype=float)
        count, n = len(errors), len(self.posture.robot.frames)
        if errors.shape != (count, n, 6) or not np.isfinite(errors).all():
            raise ValueError(
                f"errors have shape {errors.shape}, expected (k, {n}, 6), all finite"
            )
        return _solve_draws(self, errors)

    def wrenches(self, multipliers: NDArray) -> NDArray:
        """(k, n, 6) [N m, N] of every link's spring, at its frame in its axes."""
        wrenches = np.tensordot(multipliers, self.wrench, axes=(1, 2))
        if self.loads is not None:
            wrenches += self.loads.frame_loads.body.reshape(-1, 6)
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
        if self.loads is None:
            return solve_assembly(posture)
        return solve_assembly(posture, self.loads.load, gravity=self.loads.gravity)

    @property
    def at_tips(self) -> NDArray:
        """(n, 6) [N m, N] the part of :meth:`wrenches` that is links' own weight."""
        if self.loads is None:
            return np.zeros((len(self.posture.robot.frames), 6))
        return self.loads.frame_loads.at_tips


def _solve_draws(one: OnePosture, errors: NDArray) -> Draws:
    """Least energies of k draws."""
    count, n = len(errors), len(one.posture.robot.frames)
    flat = errors.reshape(-1, 6 * n)
    erring = np.flatnonzero(flat.any(axis=0))  # most components have no error
    e = np.ascontiguousarray(flat[:, erring])
    r, nu = one.G.shape
    u, y = np.zeros((count, nu)), np.zeros((count, r))
    energy, bound = np.zeros(count), np.zeros(count)
    outcome = np.zeros(count, dtype=np.int64)
    columns = np.concatenate([np.arange(nu), nu + erring])
    screws, motions, left = (m[:, columns] for m in (one.screws, one.motions, one.left))
    # nothing is larger than this in any draw, which saves a look at each one
    most = np.concatenate([np.ones(nu), np.abs(e).max(axis=0, initial=0.0)])
    reduced = _reduced(one, np.abs(motions) @ most)
    h = e @ one.misfit[:, erring].T
    least_energies(reduced, h, Energies(u, y, energy, bound, outcome))
    parts = np.hstack([u, e])
    multipliers = y @ one.closing.T
    screw = parts @ screws.T
    always, open_ = np.zeros(len(motions)), np.zeros(len(left))
    fallback = (outcome > 0) | bool(len(one.H))
    if one.loads is not None:
        always, open_ = one.loads.motions, one.closures @ one.loads.screws
        multipliers += one.loads.multipliers
        screw += one.platform @ one.loads.screws
    for rows, constant, limit in (
        (left, open_, np.full(len(left), OPEN)), (motions, always, one.ranges)
    ):  # fmt: skip
        if (np.abs(rows) @ most + np.abs(constant) > limit).any():
            fallback |= (np.abs(parts @ rows.T + constant) > limit).any(axis=1)
    infeasible = np.abs(e @ one.infeasible[:, erring].T)
    fallback |= infeasible.max(axis=1, initial=0.0) > INFEASIBLE
    rounding = closure_rounding(errors, one.joints, size_of(one.posture.robot))
    drop_zeros(energy, bound, multipliers, rounding, one.loads is not None)
    draws = Draws(
        errors=errors,
        energy=energy,
        bound=bound,
        clearances=u,
        multipliers=multipliers,
        platform_screw=screw,
        fallback=fallback,
    )
    if one.loads is None:
        _solve_fallback(one, errors, draws)
    else:
        for i in np.flatnonzero(fallback).tolist():
            _solve_loaded_fallback(one, errors[i], draws, i)
    return draws


def _reduced(one: OnePosture, most: NDArray) -> Reduced:
    """What all draws share, free motions moving by at most (nq,) ``most``."""
    loads, slack = one.loads, 0.0
    if loads is not None:
        most = most + np.abs(loads.motions)
        slack = 2.0 * float(np.abs(loads.on_free) @ most)
    return Reduced(
        Gt=np.ascontiguousarray(one.G.T),
        starts=one.starts,
        inverse=np.linalg.pinv(one.G),
        cones=one.cones,
        gram=one.on_springs.T @ one.on_springs,
        d=None if loads is None else loads.d,
        slip=float(np.linalg.norm(np.abs(one.free).T @ most)),
        slack=slack,
        stored=0.0 if loads is None else loads.stored,
    )


def _solve_fallback(one: OnePosture, errors: NDArray, draws: Draws) -> None:
    """Solve again the draws without loads that are marked."""
    rows = np.flatnonzero(draws.fallback)
    if not len(rows):
        return
    posture = one.posture
    T = np.broadcast_to(posture.transforms, (len(rows), *posture.transforms.shape))
    energies = minimise_energies(
        posture.robot, T.copy(), errors[rows], posture.mismatch
    )
    draws.energy[rows], draws.bound[rows] = energies.energy, energies.bound
    draws.platform_screw[rows] = energies.platform_screw
    draws.clearances[rows] = energies.clearances
    multipliers = energies.multipliers
    if not len(one.H):
        # the smallest wrenches where rigid parts leave them undetermined; those of
        # joints at the end of their motion stay
        multipliers = multipliers - multipliers @ one.redundant @ one.redundant.T
    draws.multipliers[rows] = multipliers


def _solve_loaded_fallback(
    one: OnePosture, errors: NDArray, draws: Draws, i: int
) -> None:
    """Solve draw i again by :func:`assembly.linear.energy.solve_assembly`."""
    for values in (draws.energy, draws.bound, draws.clearances, draws.multipliers,
                   draws.platform_screw):  # fmt: skip
        values[i] = np.nan
    try:
        assembly = one.assembly(errors)
    except (CannotAssemble, SolverFailed, FreeMotion):
        return
    draws.energy[i] = assembly.energy
    draws.bound[i] = assembly.energy - assembly.duality_gap()
    draws.platform_screw[i] = assembly.platform_screw
    draws.multipliers[i] = assembly.multipliers
    if assembly.clearances.shape == draws.clearances[i].shape:
        draws.clearances[i] = assembly.clearances
