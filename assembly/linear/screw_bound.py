"""How far the least energy's platform screw may be from the one found, certified.

The energy is quadratic in the springs' scaled deformations y, E = y.y/2 less the work
of the loads, and an answer whose gap is g is at most g above the least.  So, with w_k
the wrench that presses cone k,

    |y - y_least| <= sqrt(2 g),          |w_k| - w_k.u_k <= g for each cone,

of both answers: springs are known, and so is the play that presses on its bound.  Play
that presses nowhere is not: all of it that closes costs nothing, a flat valley, and any
point of it is an answer of least energy.  Both sets of platform screws are convex; how
far they extend along each axis is a cone programme with a certified height.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.linear.closure import VirtualJoints
from assembly.linear.energy import Assembly
from assembly.linear.reach import Reach, clearances_in, within_bounds
from assembly.linear.rounding import SPREAD, stiffness_spread
from assembly.solvers.conic import SolverFailed, cone_sizes

_CAPPED = 0.1  # [-] of a cone: a push that leaves it more room holds nothing
_SCREW, _SCREW_SHARE = 1e-5, 1e-3  # [rad, m], and of its size: accepted of the screw
_AMPLIFIED = 10.0  # by closures, of what springs move; beyond it, it is looked at


@dataclass(frozen=True)
class ScrewBound:
    """Distances from the platform screw found to any of least energy.

    Attributes:
        rotation: [rad] at most this; infinite where the platform turns freely.
        translation: [m] likewise, at the platform's origin.
        rotation_open: [rad] of it what play leaves open at no cost of energy: there is
            no one answer.
        translation_open: [m] likewise.
        rotation_error: [rad] the rest: what the answer may be wrong by.
        translation_error: [m] likewise.
    """

    rotation: float
    translation: float
    rotation_open: float
    translation_open: float
    rotation_error: float
    translation_error: float


def bound_screw(answer: Assembly) -> ScrewBound:
    """Bound the distance to every platform screw of least energy.

    Args:
        answer: the assembly found, with its wrenches.

    Returns:
        The bounds, from nothing but its certificate; of boxes around the sets, so up
        to sqrt(3) times the distances themselves.
    """
    gap = answer.uncertainty
    left = answer.linearisation.rows @ answer.screws.ravel()
    open_ = float(np.linalg.norm(left)) + answer.rounding

    def valley(joints: VirtualJoints) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        columns, start, group, room = _cones(answer, joints, gap)
        free = room >= 1.0
        lin, columns = answer.linearisation, columns[:, free]
        return lin.rows @ columns, lin.platform @ columns, start[free], group[free]

    def whole(joints: VirtualJoints) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        columns, start, group, room = _cones(answer, joints, gap)
        springs = joints.elastic * np.sqrt(2.0 * gap)
        columns = np.hstack([columns * room, springs])
        lin, last = answer.linearisation, group.max(initial=-1) + 1
        rows, ny = len(lin.rows), springs.shape[1]
        return (
            np.hstack([lin.rows @ columns, open_ * np.eye(rows)]),
            np.hstack([lin.platform @ columns, np.zeros((6, rows))]),
            np.concatenate([np.where(room >= 1.0, start, 0.0), np.zeros(ny + rows)]),
            np.concatenate([group, np.full(ny, last), np.full(rows, last + 1)]),
        )

    kept: frozenset[int] = frozenset()
    most = _heights(within_bounds(answer, "elastic", kept, whole))
    flat = _heights(within_bounds(answer, "elastic", kept, valley))
    with np.errstate(invalid="ignore"):
        rest = np.where(np.isinf(flat), 0.0, np.maximum(most - flat, 0.0))
    halves = [np.linalg.norm(v[half]) for v in (most, flat, rest)
              for half in (slice(0, 3), slice(3, 6))]  # fmt: skip
    return ScrewBound(*(float(v) for v in halves))


def _cones(
    answer: Assembly, joints: VirtualJoints, gap: float
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """What play least energy leaves.

    Returns:
        Clearances' columns, where they start, their cones, and the room (nu,) left: 1
        where it is the whole cone; else the answer and any of least energy are no
        farther apart than it, in sizes of the cone.
    """
    group = joints.group
    push = cone_sizes(joints.cones.T @ answer.joint_wrenches.ravel(), group)
    share = np.divide(gap, push, out=np.full(len(push), np.inf), where=push > 0.0)
    # of an interval's last share; of a disc's cap that high, across
    room = np.where(np.bincount(group) > 1, 2.0 * np.sqrt(2.0 * share), share)
    room = np.where(room < _CAPPED, room, 1.0)
    return joints.cones, clearances_in(answer, joints), group, room[group]


def _heights(reach: Reach) -> NDArray:
    """(6,) [rad, m] how far the set extends from its centre, to either side."""
    sides = np.concatenate([np.eye(6), -np.eye(6)])
    found = []
    for d in sides:
        try:
            found.append(reach.support(d).height - float(d @ reach.centre))
        except SolverFailed:  # nothing is known that way
            found.append(np.inf)
    return np.maximum(np.reshape(found, (2, 6)).max(axis=0), 0.0)


def unproved_screw(answer: Assembly) -> list[str]:
    """What of the platform screw the gap leaves unproved, beside what play leaves open.

    Args:
        answer: the assembly found.

    Returns:
        A sentence for each half that is not proved to 1e-5 rad or m plus 1e-3 of it.
    """
    bound, allowed = answer.screw_bound, _allowed(answer)
    softest = stiffness_spread(answer.joints, answer.linearisation.size)
    why = f"; stiffnesses differ {softest:.0e} times" if softest > SPREAD else ""
    return [
        f"the platform's {part} is proved to {error:.1e} {unit} only, expected "
        f"{most:.1e}{why}"
        for part, error, unit, most in (
            ("rotation", bound.rotation_error, "rad", allowed[0]),
            ("translation", bound.translation_error, "m", allowed[1]),
        )
        if not error <= most
    ]


def _allowed(answer: Assembly) -> NDArray:
    """(2,) [rad, m] most that the platform screw may be wrong by."""
    halves = answer.platform_screw.reshape(2, 3)
    return _SCREW + _SCREW_SHARE * np.linalg.norm(halves, axis=1)


def springs_settled(answer: Assembly) -> bool:
    """Whether springs, as far as the gap leaves them open, hardly move a frame."""
    frames, springs = len(answer.posture.robot.frames), answer.elastic.size
    blocks = answer.joints.elastic.reshape(frames, 6, springs)
    moved = np.linalg.norm(answer.posture.paths @ blocks, axis=(0, 2))
    far = np.sqrt(2 * answer.uncertainty) * np.linalg.norm(moved.reshape(2, 3), axis=1)
    return bool(np.all(_AMPLIFIED * far <= _allowed(answer)))
