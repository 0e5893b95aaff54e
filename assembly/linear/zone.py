"""The assembly zone, problem (21), as a margin on the clearances.

The margin t is the factor on all clearances at which the manipulator just assembles
with every link and joint rigid: it is assemblable where t <= 1.  The margin varies
continuously, unlike a yes or no, and its inverse is the factor on the errors.

As printed, (21) makes compliant joints rigid in every direction (``"rigid"``, the
literal reading); ``"free"`` lets them turn about their own axis, as a hinge does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

from assembly.kinematics.posture import Posture
from assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    linearise,
    virtual_joints,
)
from assembly.linear.reduction import Reduction, reduce_problem
from assembly.linear.thresholds import MARGIN_GAP
from assembly.model.clearance import (
    Compliant,
    clearance_bounds,
    clearance_excess,
    scales_with_margin,
)
from assembly.solvers.conic import cone_sizes, least_factor

_GAP_ABSOLUTE = 1e-12  # accepted beside MARGIN_GAP
# readings of compliant joints, by the names of their margins
MARGIN_READINGS: dict[str, Compliant] = {"margin": "rigid", "margin_free": "free"}
ASSEMBLABLE = 1.0 + 1e-6  # a margin within rounding of 1 counts as inside


@dataclass(frozen=True)
class Zone:
    """Solution of problem (21) at one posture.

    Attributes:
        margin: factor on the clearances at which it just assembles; None if no factor
            does.
        bound: certified lower bound of the margin; None if it is None.
    """

    margin: float | None
    bound: float | None

    @property
    def assemblable(self) -> bool:
        """Whether it assembles rigidly."""
        return self.margin is not None and self.margin <= ASSEMBLABLE

    @property
    def unproved(self) -> str:
        """What the certificate leaves unproved, empty if nothing."""
        if self.margin is None or self.bound is None:
            return ""
        allowed = MARGIN_GAP * self.margin + _GAP_ABSOLUTE
        # written so that NaN is not proved
        if self.margin - self.bound <= allowed:
            return ""
        return f"the margin {self.margin:.9g} is proved down to {self.bound:.9g} only"


def zone_margin(posture: Posture, compliant: Compliant = "rigid") -> Zone:
    """Factor on all clearances at which a rigid manipulator just assembles.

    Args:
        posture: where the robot stands.
        compliant: ``"rigid"`` or ``"free"``: passive joints with stiffness, see above.

    Returns:
        The margin with a certified lower bound.

    Raises:
        ValueError: ``compliant`` is something else.
        SolverFailed: the cone solver gave up.
    """
    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    lin = linearise(posture)
    zone, screws = margin_with(lin, virtual_joints(posture.robot, compliant))
    bounds = clearance_bounds(posture.robot, compliant)
    ranges = np.where(scales_with_margin(posture.robot), np.inf, bounds)
    if zone.margin is not None and clearance_excess(screws, ranges) > 1e-9:
        # the range of a passive joint's motion was left out, but it is active
        joints = virtual_joints(posture.robot, compliant, bounded_motion=True)
        zone, _ = margin_with(lin, joints)
    return zone


def margin_with(lin: Linearisation, joints: VirtualJoints) -> tuple[Zone, NDArray]:
    """Margin with a given choice of what may move.

    Args:
        lin: the assembly constraints.
        joints: what may move, without springs.

    Returns:
        The margin, and the (n, 6) [rad, m] clearance screws that attain it.

    Raises:
        SolverFailed: the cone solver gave up.
    """
    reduced = reduce_problem(lin, joints)
    zone, u = _least(reduced)
    if zone.margin is None:
        return zone, np.zeros((len(joints.robot.frames), 6))
    motions = reduced.motions(u, np.zeros(joints.elastic.shape[1]))
    screws = joints.cones @ u + joints.free @ motions
    return zone, screws.reshape(-1, 6)


def _least(reduced: Reduction) -> tuple[Zone, NDArray]:
    """Margin of a reduced problem, and the clearances that attain it."""
    joints = reduced.joints
    u = np.zeros(joints.cones.shape[1])
    if reduced.inconsistent:
        return Zone(None, None), u
    if not np.any(reduced.k):
        return Zone(0.0, 0.0), u
    # orthonormal rows, whatever the units of the closures
    U, S, B = svd(reduced.H, full_matrices=False)
    right = U.T @ reduced.k / S
    t, u, y = least_factor(B, right, joints.group, joints.scaled)
    bound = None if t is None else _margin_bound(B, right, joints, y)
    return Zone(t, bound), u


def _margin_bound(
    B: NDArray, right: NDArray, joints: VirtualJoints, y: NDArray
) -> float:
    """Certified lower bound: t sum_k |B_k^T y| >= y.right for every y."""
    sizes = cone_sizes(B.T @ y, joints.group)
    first = np.searchsorted(joints.group, np.arange(len(sizes)))
    scaled = joints.scaled[first]
    work = float(y @ right) - float(sizes[~scaled].sum())
    return max(0.0, work / max(float(sizes[scaled].sum()), 1e-300))
