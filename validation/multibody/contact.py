"""Model joint clearances as smooth, conservative contacts.

Joints move freely within bounds, called cones.  The bounds are discs for (TX, TY) and
(RX, RY), and intervals for TZ and RZ.  Alternatively, the bound for (TX, TY, TZ) is a
ball.  At distance r from the middle of a cone of size c,

    x = (r^2 - c^2) / 2c,   P = (x + sqrt(x^2 + w^2)) / 2,   energy = k P^2 / 2,

where k is the stiffness of the contact.  The contact force k P P' r / c is smooth. It
is nearly zero inside the cone, and equal to the force of a stiff spring outside.  The
width w of the smoothing, relative to c, is reduced from 3 to 3e-4 during the solution.

A pin in two bushes has contacts at z = +h and z = -h.  At each contact, a disc bounds
the position of the pin's axis, (TX + h RY, TY - h RX).  The two discs replace the
bounds for (TX, TY) and (RX, RY).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from forcefit.assembly.model.robot import Clearance, Frame

TURN_STIFFNESS = 1e9  # [N m/rad] rotational stiffness of the contact
SHIFT_STIFFNESS = 1e12  # [N/m] translational stiffness of the contact
# [-] Initial and final smoothing width, relative to the size of the cone.
WIDE, NARROW = 3.0, 3e-4
_UNBOUNDED = 0.5  # [rad, m] bound above which a motion is modelled as unbounded
_CONES = (
    ("tilt", (0, 1)), ("spin", (2,)), ("radial", (3, 4)), ("axial", (5,)),
    ("ball", (3, 4, 5)),
)  # fmt: skip


@dataclass(frozen=True)
class ClearanceCone:
    """A disc, an interval or a ball that bounds components of a screw.

    Attributes:
        rows: indices of the screw components that the cone bounds.
        size: [rad or m] bound, > 0.
        stiffness: [N m/rad or N/m] stiffness of the contact.
        arm: [m] distance along z from the middle of the joint to the contact, for
            radial discs.
    """

    rows: tuple[int, ...]
    size: float
    stiffness: float
    arm: float = 0.0

    def offsets(self, screw: Sequence[float]) -> list[float]:
        """Return the one to three bounded components [rad or m] of a screw."""
        if self.arm:
            return [
                screw[3] + self.arm * screw[1],
                screw[4] - self.arm * screw[0],
            ]
        return [screw[row] for row in self.rows]


@dataclass(frozen=True)
class JointClearance:
    """Motions of a joint without deformation of its springs.

    Attributes:
        cones: bounds on the motions.
        free: indices of the screw components without a bound.
    """

    cones: tuple[ClearanceCone, ...]
    free: tuple[int, ...]

    def softened(self, factor: float) -> "JointClearance":
        """Return the clearance with the contact stiffness multiplied by a factor."""
        cones = (replace(c, stiffness=factor * c.stiffness) for c in self.cones)
        return replace(self, cones=tuple(cones))

    @property
    def unlocked(self) -> tuple[int, ...]:
        """Indices of the screw components that are not locked."""
        bounded = {row for cone in self.cones for row in cone.rows}
        tilting = {row for cone in self.cones if cone.arm for row in (0, 1)}
        return tuple(sorted(bounded | tilting | {*self.free}))


def joint_clearance(
    frame: Frame, scale: float = 1.0, bushes: bool = False
) -> JointClearance:
    """Return the bounds and the free motions of a frame's joint.

    Args:
        frame: frame of a robot.
        scale: factor by which clearances are multiplied.
        bushes: whether a joint with radial clearance and tilt is modelled as a pin in
            two bushes.  Each bush has the radial clearance, and the distance between
            the bushes is computed from the tilt.

    Returns:
        The bounds and free motions. If there are none, every component is locked.
    """
    given = frame.clearance or Clearance()
    moves = frame.passive and not frame.compliant
    cones: list[ClearanceCone] = []
    free: list[int] = []
    for name, rows in _CONES:
        bound = getattr(given, name)
        own = moves and frame.own_axis in rows
        if bound == math.inf or (own and (bound is None or bound >= _UNBOUNDED)):
            free += rows
        elif bound:
            stiffness = TURN_STIFFNESS if rows[0] < 3 else SHIFT_STIFFNESS
            cones.append(ClearanceCone(rows, scale * bound, stiffness))
    if bushes and given.radial and given.tilt:
        size, h = scale * given.radial, given.radial / given.tilt
        cones = [cone for cone in cones if cone.rows not in {(0, 1), (3, 4)}]
        cones += [ClearanceCone((3, 4), size, SHIFT_STIFFNESS, arm) for arm in (h, -h)]
    return JointClearance(tuple(cones), tuple(free))


def cone_forces(
    cone: ClearanceCone, screw: Sequence[float], width: float
) -> Iterator[tuple[int, float]]:
    """Yield the contact forces of a cone on a joint displaced from its middle.

    Args:
        cone: the bound.
        screw: (6,) [rad, m] displacement of the joint.
        width: [-] width of the smoothing, relative to the size of the cone.

    Yields:
        Indices of the bounded screw components, and the contact force [N m or N] along
        them, which is the gradient of the energy.
    """
    offsets = cone.offsets(screw)
    P, root = _overlap(cone, offsets, width)
    factor = cone.stiffness * P * (P / root) / cone.size
    for row, offset in zip(cone.rows, offsets, strict=True):
        yield row, factor * offset
    if cone.arm:
        yield 0, -cone.arm * factor * offsets[1]
        yield 1, cone.arm * factor * offsets[0]


def cone_energy(cone: ClearanceCone, screw: Sequence[float], width: float) -> float:
    """Return the energy [J] of a joint's contact with a cone; see ``cone_forces``."""
    return cone.stiffness * _overlap(cone, cone.offsets(screw), width)[0] ** 2 / 2


def _overlap(
    cone: ClearanceCone, offsets: list[float], width: float
) -> tuple[float, float]:
    """Return P and sqrt(x^2 + w^2) of the contact energy k P^2 / 2."""
    squared = sum(u * u for u in offsets)
    x = (squared - cone.size**2) / (2 * cone.size)
    w = width * cone.size
    root = math.hypot(x, w)
    # (x + root) / 2 is rearranged for x < 0 to avoid cancellation.
    return (x + root if x > 0 else w * w / (root - x)) / 2, root
