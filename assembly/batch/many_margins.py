"""Problem (21) at one posture for many draws of the errors, with slopes.

The margin is ``max q.K e`` over multipliers q with ``sum_k |B_k^T q| <= 1``: convex in
the errors e, proportional to them, and its slope is ``K^T q`` of the best q.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

from assembly.kernels.choice import kernels
from assembly.kinematics.posture import Posture
from assembly.linear.closure import (
    VirtualJoints,
    linearise,
    virtual_joints,
)
from assembly.linear.reduction import complement, reduce_problem
from assembly.linear.thresholds import INFEASIBLE, RANK
from assembly.linear.zone import zone_margin
from assembly.model.clearance import Compliant, clearance_bounds, component_bounds
from assembly.solvers.cones import cone_starts
from assembly.solvers.conic import SolverFailed

_CLEARLY_INFEASIBLE = 1e-10  # [rad, reference lengths] where nothing closes the errors


@dataclass(frozen=True, eq=False)
class DrawMargins:
    """Zone margins of k draws at one posture.

    Attributes:
        margin: (k,) factor on all clearances at which it just assembles; inf where
            none does, NaN where the solver failed.
        bound: (k,) certified lower bound.
        slopes: (k, n, 6) [1/rad, 1/m] how the margin grows with each error; NaN where
            the fallback solved.
        fallback: (k,) bool, solved by :func:`assembly.linear.zone.zone_margin`.
    """

    margin: NDArray
    bound: NDArray
    slopes: NDArray
    fallback: NDArray


@dataclass(frozen=True, eq=False)
class PostureMargins:
    """A posture prepared for the margins of any errors, by :func:`prepare_margins`.

    Attributes:
        posture: where the robot stands; its own errors do not matter.
        joints: what may move.
        starts: (cones + 1,) first clearance of each cone, and nu.
        B: (p, nu) orthonormal rows that the clearances must satisfy.
        K: (p, 6n) and their right side by the errors: B u = K e.
        infeasible: (.., 6n) infeasible component of the errors.
        motions: (nq, nu + 6n) free motions of clearances and errors.
        ranges: (nq,) [rad or m] their bounds, which were left out.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.
    """

    posture: Posture
    joints: VirtualJoints
    starts: NDArray
    B: NDArray
    K: NDArray
    infeasible: NDArray
    motions: NDArray
    ranges: NDArray
    compliant: Compliant

    def solve(self, errors: ArrayLike) -> DrawMargins:
        """Margins of k draws.

        Args:
            errors: (k, n, 6) [rad, m] delta l.

        Returns:
            Margins with their certificates and slopes.

        Raises:
            ValueError: the shape does not fit the robot, or a value is not finite.
        """
        errors = np.asarray(errors, dtype=float)
        count, n = len(errors), len(self.posture.robot.frames)
        if errors.shape != (count, n, 6) or not np.isfinite(errors).all():
            raise ValueError(
                f"errors have shape {errors.shape}, expected (k, {n}, 6), all finite"
            )
        e = errors.reshape(count, 6 * n)
        margin, bound = np.zeros(count), np.zeros(count)
        q, unit = np.zeros((count, len(self.B))), np.ones(self.B.shape[1])
        if len(self.B):
            right = np.ascontiguousarray(e @ self.K.T)
            kernels.least_margins(self.B, self.starts, right, margin, bound, q)
        infeasible = np.abs(e @ self.infeasible.T).max(axis=1, initial=0.0)
        no_factor = infeasible > _CLEARLY_INFEASIBLE
        margin[no_factor] = bound[no_factor] = np.inf
        most = np.concatenate(
            [unit * np.nanmax(margin, initial=0.0, where=np.isfinite(margin)),
             np.abs(e).max(axis=0, initial=0.0)]
        )  # fmt: skip
        fallback = np.isnan(margin)
        fallback |= (infeasible > INFEASIBLE) & ~no_factor
        if (np.abs(self.motions) @ most > self.ranges).any():
            fallback[:] = True
        slopes = (q @ self.K).reshape(count, n, 6)
        for i in np.flatnonzero(fallback).tolist():
            robot = self.posture.robot.with_errors(errors[i])
            slopes[i] = margin[i] = bound[i] = np.nan
            try:
                zone = zone_margin(replace(self.posture, robot=robot), self.compliant)
            except SolverFailed:
                continue
            margin[i] = np.inf if zone.margin is None else zone.margin
            bound[i] = np.inf if zone.bound is None else zone.bound
        return DrawMargins(margin, bound, slopes, fallback)


def prepare_margins(posture: Posture, compliant: Compliant = "free") -> PostureMargins:
    """Eliminate free motions at a posture, for the margins of any errors.

    Args:
        posture: where the robot stands.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.

    Returns:
        What :meth:`PostureMargins.solve` needs.

    Raises:
        ValueError: ``compliant`` is something else.
    """
    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot, compliant)
    reduced = reduce_problem(lin, joints)
    # orthonormal rows, whatever the units of the closures
    U, S, B = svd(reduced.H, full_matrices=False)
    rigid = reduced.rigid
    held = np.linalg.qr(rigid)[0] if rigid.shape[1] else rigid
    redundant = reduced.basis @ complement(held, RANK)
    A = lin.rows
    inverse = np.linalg.pinv(A @ joints.free, rcond=RANK)
    screws = np.hstack([joints.cones, np.eye(A.shape[1])])
    bounds = component_bounds(clearance_bounds(robot, compliant)).ravel()
    return PostureMargins(
        posture=posture,
        joints=joints,
        starts=cone_starts(joints.group),
        B=np.ascontiguousarray(B),
        K=-(U.T / S[:, None]) @ rigid.T @ reduced.basis.T @ A,
        infeasible=redundant.T @ A,
        motions=-inverse @ A @ screws,
        ranges=bounds[np.flatnonzero(joints.free.any(axis=1))],
        compliant=compliant,
    )
