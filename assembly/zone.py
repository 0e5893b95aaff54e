"""The assembly zone, problem (21), as a margin: how much play does it take?

The margin t is the factor on all clearances at which the manipulator just goes
together with every link and joint rigid: assemblable where t <= 1.  It is continuous,
which a yes or no is not, and its inverse is the factor on the errors.

As printed, (21) makes compliant joints rigid in every direction (``"rigid"``, the
literal reading); ``"free"`` lets them turn about their own axis, as a hinge does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

from assembly.closure import Linearisation, VirtualJoints, linearise, virtual_joints
from assembly.conic import cone_sizes, least_factor
from assembly.posture import Posture
from assembly.reduction import reduce_problem

ASSEMBLABLE = 1.0 + 1e-6  # a margin within rounding of 1 counts as inside


@dataclass(frozen=True)
class Zone:
    """Answer to problem (21) at one posture.

    Attributes:
        margin: factor on the clearances at which it just assembles; None: none does.
        bound: certified lower bound of the margin; None if it is None.
    """

    margin: float | None
    bound: float | None

    @property
    def assemblable(self) -> bool:
        """Whether it goes together rigidly."""
        return self.margin is not None and self.margin <= ASSEMBLABLE


def zone_margin(posture: Posture, compliant: str = "rigid") -> Zone:
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
    zone, play = _margin(lin, virtual_joints(posture.robot, compliant))
    limited = virtual_joints(posture.robot, compliant, bounded_motion=True)
    if limited.cones.shape[1] > play and zone.margin:
        # some passive joint's range is bounded: does the margin respect it?
        pass
    return zone


def _margin(lin: Linearisation, joints: VirtualJoints) -> tuple[Zone, int]:
    """Margin of one set of columns."""
    small = reduce_problem(lin, joints)
    if small.inconsistent:
        return Zone(None, None), 0
    return Zone(*_least(small.H, small.k, joints)), joints.cones.shape[1]


def _least(
    B: NDArray, right: NDArray, joints: VirtualJoints
) -> tuple[float | None, float | None]:
    """Least factor and its bound."""
    if not np.any(right):
        return 0.0, 0.0
    U, S, Vt = svd(B, full_matrices=False)
    t, y = least_factor(Vt, U.T @ right / S, joints.group, joints.scaled)
    if t is None:
        return None, None
    return t, _margin_bound(Vt, U.T @ right / S, joints, y)


def _margin_bound(
    B: NDArray, right: NDArray, joints: VirtualJoints, y: NDArray
) -> float:
    """Certified lower bound: t sum_k |B_k^T y| >= y.right for every y."""
    reach = cone_sizes(B.T @ y, joints.group)
    first = np.searchsorted(joints.group, np.arange(len(reach)))
    scaled = joints.scaled[first]
    work = float(y @ right) - float(reach[~scaled].sum())
    return max(0.0, work / max(float(reach[scaled].sum()), 1e-300))
