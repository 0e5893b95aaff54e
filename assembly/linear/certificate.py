"""What the certificate of a least energy proves: energies, closures, and the screw.

The distance from the computed platform screw to any of least energy is certified too.

The energy is quadratic in the springs' scaled deformations y, E = y.y/2 less the work
of the loads, and a solution whose gap is g is at most g above the least.  So, with w_k
the wrench on cone k,

    |y - y_least| <= sqrt(2 g),          |w_k| - w_k.u_k <= g for each cone,

of both solutions: springs are known, and so are the clearances whose constraint is
active.  Clearances that nothing loads are not: the energy does not depend on them, and
the minimiser is not unique.  Both sets of platform screws are convex; how far they
extend along each axis is a cone programme with a certified height.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.linear.assembled import Assembly
from assembly.linear.closure import VirtualJoints
from assembly.linear.reference.pose_error import (
    MovingCones,
    ReachableSet,
    clearances_in,
    within_bounds,
)
from assembly.linear.rounding import SPREAD, stiffness_spread
from assembly.solvers.cones import cone_sizes
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE, SolverFailed

LARGEST_RESIDUAL = 1e-9  # [rad, reference lengths] accepted of a closure
LARGEST_EXCESS = 1e-9  # [-] accepted of a clearance
_SCREW, _SCREW_SHARE = 1e-5, 1e-3  # [rad, m], and of its size: accepted of the screw
_AMPLIFIED = 10.0  # factor by which closures may amplify what springs move
_WIDTH = 3e-5  # of a distance: upper minus lower bound
_HELD = 0.1  # [-] of a cone: a load that leaves it more room does not hold it


@dataclass(frozen=True)
class ScrewBound:
    """Distances from the computed platform screw to any of least energy.

    Attributes:
        rotation: [rad] at most this; infinite where the platform turns freely.
        translation: [m] likewise, at the platform's origin.
        rotation_open: [rad] of it what clearances leave open at no cost of energy: the
            screw is not unique, and the farthest one is at most this far.
        translation_open: [m] likewise.
        rotation_error: [rad] the rest: the numerical error.
        translation_error: [m] likewise.
    """

    rotation: float
    translation: float
    rotation_open: float
    translation_open: float
    rotation_error: float
    translation_error: float


def unproved(assembly: Assembly) -> str:
    """What the certificate leaves unproved.

    Proved is an assembly that closes to 1e-9 (rad, or m per reference length), with
    clearances within 1e-9 of their bounds, whose energy is at most 1e-8 of it, and of
    the loads' work, plus 1e-12 of that without clearance above the least possible.

    Args:
        assembly: of least energy.

    Returns:
        Sentences joined by semicolons; empty if all is proved.
    """
    residual, excess, gap = (
        assembly.closure_residual(), assembly.clearance_excess(),
        assembly.duality_gap(),
    )  # fmt: skip
    allowed = GAP * (assembly.stored + abs(assembly.work))
    allowed += GAP_WITHOUT_CLEARANCE * assembly.energy_without_clearance
    sentences = []
    # written so that NaN is not proved
    if not gap <= allowed:
        sentences.append(
            f"the energy is proved least to {gap:.1e} J only, expected {allowed:.1e} J"
        )
    if not residual <= LARGEST_RESIDUAL:
        sentences.append(
            f"a closure stays open by {residual:.1e} (rad, or m per length)"
        )
    if not excess <= LARGEST_EXCESS:
        sentences.append(f"a clearance is exceeded by {excess:.1e} of its size")
    if not sentences and not _springs_determined(assembly):
        sentences += unproved_screw(assembly, bound_screw(assembly))
    return "; ".join(sentences)


def unproved_screw(assembly: Assembly, bound: ScrewBound) -> list[str]:
    """What of the platform screw the gap leaves unproved, where it is unique.

    Args:
        assembly: of least energy.
        bound: of its platform screw.

    Returns:
        A sentence for each half that is not proved to 1e-5 rad or m plus 1e-3 of it.
    """
    allowed = _allowed(assembly)
    spread = stiffness_spread(assembly.joints, assembly.linearisation.size)
    why = f"; stiffnesses differ {spread:.0e} times" if spread > SPREAD else ""
    return [
        f"the platform's {part} is proved to {error:.1e} {unit} only, expected "
        f"{most:.1e}{why}"
        for part, error, unit, most in (
            ("rotation", bound.rotation_error, "rad", allowed[0]),
            ("translation", bound.translation_error, "m", allowed[1]),
        )
        if not error <= most
    ]


def _allowed(assembly: Assembly) -> NDArray:
    """Return the (2,) [rad, m] largest error accepted of the platform screw."""
    halves = assembly.platform_screw.reshape(2, 3)
    return _SCREW + _SCREW_SHARE * np.linalg.norm(halves, axis=1)


def _springs_determined(assembly: Assembly) -> bool:
    """Whether springs, as far as the gap leaves them open, hardly move a frame."""
    frames, springs = len(assembly.posture.robot.frames), assembly.elastic.size
    blocks = assembly.joints.elastic.reshape(frames, 6, springs)
    moved = np.linalg.norm(assembly.posture.paths @ blocks, axis=(0, 2))
    moved = np.linalg.norm(moved.reshape(2, 3), axis=1)
    distance = np.sqrt(2 * assembly.uncertainty) * moved
    return bool(np.all(_AMPLIFIED * distance <= _allowed(assembly)))


def bound_screw(assembly: Assembly) -> ScrewBound:
    """Bound the distance to every platform screw of least energy.

    Args:
        assembly: the computed one, with its wrenches.

    Returns:
        The bounds, from nothing but its certificate.  Those of the screw and of its
        error are of boxes around the sets, so up to sqrt(3) times the distances.
    """
    gap, lin = assembly.uncertainty, assembly.linearisation
    open_closures = lin.rows @ assembly.screws.ravel()
    residual = float(np.linalg.norm(open_closures)) + assembly.rounding

    def unloaded(joints: VirtualJoints) -> MovingCones:
        """Return the clearances on which the energy does not depend."""
        columns, start, group, room = _room(assembly, joints, gap)
        free = room >= 1.0
        columns = columns[:, free]
        return MovingCones(
            closures=lin.rows @ columns,
            platform=lin.platform @ columns,
            start=start[free],
            group=group[free],
        )

    def uncertain(joints: VirtualJoints) -> MovingCones:
        """All that the gap leaves open: clearances, springs and the residual."""
        columns, start, group, room = _room(assembly, joints, gap)
        springs = joints.elastic * np.sqrt(2.0 * gap)
        columns = np.hstack([columns * room, springs])
        last = np.bincount(group).size
        rows, ny = len(lin.rows), springs.shape[1]
        return MovingCones(
            closures=np.hstack([lin.rows @ columns, residual * np.eye(rows)]),
            platform=np.hstack([lin.platform @ columns, np.zeros((6, rows))]),
            start=np.concatenate([
                np.where(room >= 1.0, start, 0.0),
                np.zeros(ny + rows),
            ]),
            group=np.concatenate([group, np.full(ny, last), np.full(rows, last + 1)]),
        )

    kept: frozenset[int] = frozenset()
    total = _extents(within_bounds(assembly, "elastic", kept, uncertain))
    open_set = within_bounds(assembly, "elastic", kept, unloaded)
    not_unique = _extents(open_set)
    with np.errstate(invalid="ignore"):
        error = np.maximum(total - not_unique, 0.0)
    error = np.where(np.isinf(not_unique), 0.0, error)
    (rotation, translation), boxes, errors = (
        np.linalg.norm(half.reshape(2, 3), axis=1).tolist()
        for half in (total, not_unique, error)
    )
    open_ = [_farthest(open_set, 3 * i, box) for i, box in enumerate(boxes)]
    return ScrewBound(rotation, translation, *open_, *errors)


def _room(
    assembly: Assembly, joints: VirtualJoints, gap: float
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return the room that least energy leaves to the clearances.

    Returns:
        Clearances' columns, where they start, their cones, and the room (nu,) left: 1
        where it is the whole cone; else this assembly and any of least energy are no
        farther apart than it, in sizes of the cone.
    """
    group = joints.group
    load = cone_sizes(joints.cones.T @ assembly.joint_wrenches.ravel(), group)
    share = np.divide(gap, load, out=np.full(len(load), np.inf), where=load > 0.0)
    # an interval's last share; of a disc the width of the cap of that height
    room = np.where(np.bincount(group) > 1, 2.0 * np.sqrt(2.0 * share), share)
    room = np.where(room < _HELD, room, 1.0)
    return joints.cones, clearances_in(assembly, joints), group, room[group]


def _farthest(reachable: ReachableSet, part: int, box: float) -> float:
    """[rad or m] certified largest distance from the centre, no more than the box's."""
    if not 0.0 < box < np.inf:
        return box
    about_centre = replace(reachable, centre=np.zeros(6))
    try:
        return min(box, about_centre.farthest(part, _WIDTH * box)[0][1])
    except SolverFailed:
        return box


def _extents(reachable: ReachableSet) -> NDArray:
    """(6,) [rad, m] how far the set extends from its centre, to either side."""
    extents = []
    for d in np.concatenate([np.eye(6), -np.eye(6)]):
        try:
            height = reachable.support(d).height
            extents.append(height - float(d @ reachable.centre))
        except SolverFailed:  # no bound is known in that direction
            extents.append(np.inf)
    return np.maximum(np.reshape(extents, (2, 6)).max(axis=0), 0.0)
