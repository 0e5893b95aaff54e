"""Assembly margins, problem (21), of many draws at one posture.

The margin is the maximum of ``q.K e`` over multipliers q with ``sum_k |B_k^T q| <= 1``.
It is convex and positively homogeneous in the errors e. Its derivative is ``K^T q`` at
the optimal q.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.reference.reduction import complement, reduce_problem
from forcefit.assembly.linear.zone import Compliant, Zone, zone_margin
from forcefit.assembly.solvers.cones import cone_starts
from forcefit.assembly.statistics.linear_response import checked_errors

# [rad, reference lengths] largest error that clearances cannot compensate and that is
# treated as zero
_CLEARLY_INFEASIBLE = 1e-10


@dataclass(frozen=True, eq=False)
class PostureMargins:
    """Problem (21) at a posture, prepared for many sets of errors.

    Attributes:
        posture: posture of the robot, whose errors are not used.
        starts: (cones + 1,) index of the first clearance of each cone, and finally nu.
        B: (p, nu) orthonormal rows of the equations B u = K e for the clearances u.
        K: (p, 6n) matrix of the right-hand sides for the errors e.
        infeasible: (.., 6n) matrix whose product is zero with errors that clearances
            can compensate.
        compliant: whether compliant joints are ``"rigid"`` or ``"free"``, see
            :mod:`forcefit.assembly.linear.zone`.
    """

    posture: Posture
    starts: NDArray
    B: NDArray
    K: NDArray
    infeasible: NDArray
    compliant: Compliant

    def solve(self, errors: ArrayLike) -> Zone:
        """Compute the margins of k draws.

        Args:
            errors: (k, n, 6) [rad, m] geometric errors delta l.

        Returns:
            Margins with their certificates. If no clearances can compensate the
            errors, the margin is inf, and the forces belong to the component of the
            errors that clearances can compensate.

        Raises:
            ValueError: the errors have the wrong shape, or a value is not finite.
        """
        errors = checked_errors(errors, len(self.posture.robot.frames))
        left = errors.reshape(len(errors), -1) @ self.infeasible.T
        no_factor = np.abs(left).max(axis=1, initial=0.0) > _CLEARLY_INFEASIBLE
        if no_factor.any():
            both = np.linalg.pinv(np.vstack([self.K, self.infeasible]))
            open_ = left[no_factor] @ both[:, len(self.K) :].T
            errors = errors.copy()
            errors[no_factor] -= open_.reshape(-1, *errors.shape[1:])
        found = zone_margin(self.posture, self.compliant, errors=errors)
        found.margin[no_factor] = found.bound[no_factor] = np.inf
        return found

    def slopes(self, zone: Zone) -> NDArray:
        """Return the derivatives of the margins with respect to the errors.

        Args:
            zone: result of :meth:`solve` for k draws.

        Returns:
            Derivatives, (k, n, 6) [1/rad, 1/m]; NaN for draws that were solved by the
            reference method.
        """
        slopes = zone.forces @ self.B.T @ self.K
        return slopes.reshape(len(slopes), -1, 6)


def prepare_margins(posture: Posture, compliant: Compliant = "free") -> PostureMargins:
    """Prepare problem (21) at a posture by eliminating free motions.

    Args:
        posture: the robot's configuration.
        compliant: whether compliant joints are ``"rigid"`` or ``"free"``, see
            :mod:`forcefit.assembly.linear.zone`.

    Returns:
        The prepared problem.

    Raises:
        ValueError: ``compliant`` has another value.
    """
    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    robot = posture.robot
    lin, joints = linearise(posture), virtual_joints(robot, False, compliant == "free")
    reduced = reduce_problem(lin, joints)
    # Orthonormal rows do not depend on the units of the closure equations.
    U, S, B = svd(reduced.H, full_matrices=False)
    rigid = reduced.rigid
    held = np.linalg.qr(rigid)[0] if rigid.shape[1] else rigid
    redundant = reduced.basis @ complement(held, RANK)
    A = lin.rows
    return PostureMargins(
        posture=posture,
        starts=cone_starts(joints.group),
        B=np.ascontiguousarray(B),
        K=-(U.T / S[:, None]) @ rigid.T @ reduced.basis.T @ A,
        infeasible=redundant.T @ A,
        compliant=compliant,
    )
