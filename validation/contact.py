"""Joint clearances as smooth, conservative contact.

A joint plays inside its cones: discs for (TX, TY) and (RX, RY), intervals for TZ and
RZ.  At distance r from the middle of a cone of size c,

    x = (r^2 - c^2) / 2c,   P = (x + sqrt(x^2 + w^2)) / 2,   energy = k P^2 / 2,

so the push is k P P' r / c: none inside, a stiff spring outside, smooth everywhere, at
the middle too (smoothing r - c instead is singular there).  The width w is first three
times c, which pulls the joint gently to its middle, and then shrinks to 3e-4.
"""

import math
from dataclasses import dataclass

from assembly.robot import Clearance, Frame

TURN_STIFFNESS = 1e9  # [N m/rad] of the contact
SHIFT_STIFFNESS = 1e12  # [N/m]
WIDE, NARROW = 3.0, 3e-4  # [-] widths of the smoothing in sizes of the cone
_LOOSE = 0.5  # [rad, m] bounds of own motions from here on are looked at afterwards
_CONES = (("tilt", (0, 1)), ("spin", (2,)), ("radial", (3, 4)), ("axial", (5,)))


@dataclass(frozen=True)
class Cone:
    """A disc or an interval.

    Attributes:
        rows: of the screw, those it bounds together.
        size: [rad or m] > 0.
        stiffness: [N m/rad or N/m] of the contact.
    """

    rows: tuple[int, ...]
    size: float
    stiffness: float


@dataclass(frozen=True)
class Play:
    """How a joint may move beside its springs.

    Attributes:
        cones: what bounds it.
        free: rows without a bound.
    """

    cones: tuple[Cone, ...]
    free: tuple[int, ...]

    @property
    def loose(self) -> tuple[int, ...]:
        """Rows that are not locked."""
        return tuple(row for cone in self.cones for row in cone.rows) + self.free


def joint_play(frame: Frame, scale: float = 1.0) -> Play:
    """Clearances of a frame's joint, and its own motion where no spring holds it.

    Args:
        frame: of a robot.
        scale: factor on the clearances.

    Returns:
        The play; without clearance and own motion, nothing is loose.
    """
    given = frame.clearance or Clearance()
    moves = frame.passive and not frame.compliant
    cones: list[Cone] = []
    free: list[int] = []
    for name, rows in _CONES:
        bound = getattr(given, name)
        if moves and frame.own_axis in rows and (bound is None or bound >= _LOOSE):
            free += rows
        elif bound:
            stiffness = TURN_STIFFNESS if rows[0] < 3 else SHIFT_STIFFNESS
            cones.append(Cone(rows, scale * bound, stiffness))
    return Play(tuple(cones), tuple(free))


def cone_push(cone: Cone, offsets: list[float], width: float) -> list[float]:
    """What holds a joint back that has moved out of the middle of a cone.

    Args:
        cone: the bound.
        offsets: [rad or m] one or two components.
        width: [-] of the smoothing, in sizes of the cone.

    Returns:
        [N m or N] as many components, along the offsets: gradient of the energy.
    """
    P, root = _overlap(cone, offsets, width)
    factor = cone.stiffness * P * (P / root) / cone.size
    return [factor * u for u in offsets]


def cone_energy(cone: Cone, offsets: list[float], width: float) -> float:
    """[J] stored where a joint presses against a cone; arguments of ``cone_push``."""
    return cone.stiffness * _overlap(cone, offsets, width)[0] ** 2 / 2


def _overlap(cone: Cone, offsets: list[float], width: float) -> tuple[float, float]:
    """P and sqrt(x^2 + w^2) of the head of this module."""
    squared = sum(u * u for u in offsets)
    x = (squared - cone.size**2) / (2 * cone.size)
    w = width * cone.size
    root = math.hypot(x, w)
    # x + root, without cancellation deep inside
    return (x + root if x > 0 else w * w / (root - x)) / 2, root
