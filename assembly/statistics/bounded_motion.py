"""Joint positions within clearances if a passive joint may reach its motion limit.

The linear response omits the motion limits of passive joints, because clearances rarely
move a joint so far. If a joint may reach a limit in a draw, that draw is solved
separately: the limit is added as a cone to problem (27), which describes the set of
platform screws (:mod:`forcefit.assembly.linear.reference.pose_error`).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.ranks import UNBOUNDED, rank_tolerance
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.linear_response import LinearResponse

# assumption of problem (27): springs keep their minimum-energy deformation
ASSUMPTION = "frozen"


def draws_at_bounds(prepared: LinearResponse, draws: Assembly) -> NDArray:
    """Return a mask of draws in which a passive joint may reach its motion limit.

    Args:
        prepared: linear response of the posture.
        draws: solutions for k draws at the posture.

    Returns:
        (k,) bool, True if a motion limit is active in the solution, if a joint can
        reach its limit within the clearances, or if only the limit bounds a platform
        motion.
    """
    solved = np.isfinite(draws.energy)
    active = solved & np.isnan(draws.clearances).any(axis=1)
    limited = np.isfinite(prepared.ranges)
    if not limited.any():
        return active
    if _moves_platform(prepared)[limited].any():
        return solved
    nu = prepared.starts[-1]
    motions = prepared.motions[limited]
    middle = draws.errors.reshape(len(solved), -1) @ motions[:, nu:].T
    middle += prepared.load_motions[limited]
    by_cone = np.add.reduceat(motions[:, :nu] ** 2, prepared.starts[:-1], axis=1)
    reach = np.abs(middle) + (np.sqrt(by_cone).sum(axis=1) if nu else 0.0)
    return active | (solved & (reach > prepared.ranges[limited]).any(axis=1))


def _moves_platform(prepared: LinearResponse) -> NDArray:
    """Return a mask (nq,) of free motions that move the platform."""
    mismatch = prepared.posture.mismatch
    A_q = prepared.closures @ prepared.joints.free
    P_q = prepared.platform @ prepared.joints.free
    inverse = np.linalg.pinv(A_q, rcond=rank_tolerance(mismatch))
    undetermined = P_q - (P_q @ inverse) @ A_q
    return np.abs(undetermined).max(axis=0) > rank_tolerance(mismatch, UNBOUNDED)


def bounded_position(
    draws: Assembly, i: int, wrench: NDArray | None, rng: np.random.Generator
) -> tuple[NDArray, bool]:
    """Compute the platform screw of one draw in the contact or the uniform model.

    Args:
        draws: solutions for random draws at one posture.
        i: index of the draw.
        wrench: (6,) [N m, N] wrench that pushes the platform until joints are in
            contact (contact model); None for uniformly distributed positions (uniform
            model).
        rng: random number generator for the uniform model.

    Returns:
        Platform screw, (6,) [rad, m], and whether the random walk mixed. The screw is
        NaN if the draw has no solution or the solver fails. Free motions without a
        limit are as small as possible.
    """
    from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position

    try:
        reachable = reachable_screws(draws[i], ASSUMPTION)
        if wrench is not None:
            bounded = replace(reachable, free=np.zeros((6, 0)))
            return bounded.support(wrench).screw, True
    except (CannotAssemble, FreeMotion, SolverFailed):
        return np.full(6, np.nan), True
    rows, start = reachable.rows, reachable.start
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    v, to_screw = start.copy(), np.ascontiguousarray(reachable.map)
    mixed = sample_uniform_position(Z, reachable.starts, to_screw, v, rng)
    return reachable.centre + reachable.map @ (v - start), mixed
