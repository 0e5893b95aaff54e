"""Error bounds on energy, closures and platform screw, derived from a certificate.

The certificate of a minimum-energy assembly is a lower bound on the energy.  It also
bounds the distance of the computed platform screw from every minimum-energy platform
screw.

The energy E = y.y/2 minus the work of the loads is quadratic in the scaled deformations
y of the springs.  The energy of a solution with duality gap g exceeds the minimum
energy by at most g.  Let w_k be the wrench on cone k.  Then

    |y - y_least| <= sqrt(2 g),          |w_k| - w_k.u_k <= g for each cone,

for the computed solution and every minimum-energy solution.  The gap g thus bounds the
errors of the spring deformations, and of the motions within clearances that transmit a
force.  It does not bound the motions within unloaded clearances, because the energy
does not depend on them.  The minimum-energy platform screws form a convex set, and so
do the platform screws of all assemblies whose energy exceeds the minimum by at most g.
A cone program with a certified objective value bounds the extent of each set along each
axis.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import VirtualJoints
from forcefit.assembly.linear.reference.pose_error import (
    MovingCones,
    ReachableSet,
    clearances_in,
    within_bounds,
)
from forcefit.assembly.linear.rounding import SPREAD, stiffness_spread
from forcefit.assembly.solvers.cones import cone_sizes
from forcefit.assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE, SolverFailed

# [rad, reference lengths] largest accepted residual of a closure
LARGEST_RESIDUAL = 1e-9
# [-] largest accepted relative excess of a clearance over its bound
LARGEST_EXCESS = 1e-9
# largest accepted error of the platform screw: absolute [rad, m] and relative
_SCREW, _SCREW_SHARE = 1e-5, 1e-3
_AMPLIFIED = 10.0  # assumed largest ratio of frame motions to spring deformations
# [-] required relative difference between the upper and lower bound on a distance
_WIDTH = 3e-5
# [-] range, relative to its cone, below which a clearance is treated as fixed
_HELD = 0.1


@dataclass(frozen=True)
class ScrewBound:
    """Bounds on the distance to the minimum-energy platform screws.

    Attributes:
        rotation: [rad] upper bound; infinite if the platform rotates freely.
        translation: [m] upper bound, at the platform's origin.
        rotation_open: [rad] part of ``rotation`` due to unloaded clearances, which make
            the screw non-unique.
        translation_open: [m] part of ``translation`` due to unloaded clearances.
        rotation_error: [rad] part of ``rotation`` that is numerical error.
        translation_error: [m] part of ``translation`` that is numerical error.
    """

    rotation: float
    translation: float
    rotation_open: float
    translation_open: float
    rotation_error: float
    translation_error: float


def unproved(assembly: Assembly) -> str:
    """Return sentences about properties of an assembly that are not proved.

    An assembly is proved if three conditions are met.  The closure residuals are at
    most 1e-9, in rad or reference lengths.  The clearances exceed their bounds by a
    factor of at most 1 + 1e-9.  The energy exceeds the minimum by at most 1e-8 times
    the energy and the work of the loads, plus 1e-12 times the energy without clearance.

    Args:
        assembly: minimum-energy assembly.

    Returns:
        Sentences joined by semicolons; empty if the assembly is proved.
    """
    residual, excess, gap = (
        assembly.closure_residual(), assembly.clearance_excess(),
        assembly.duality_gap(),
    )  # fmt: skip
    allowed = GAP * (assembly.stored + abs(assembly.work))
    allowed += GAP_WITHOUT_CLEARANCE * assembly.energy_without_clearance
    sentences = []
    # With NaN, the comparison is False, so the assembly is not proved.
    if not gap <= allowed:
        sentences.append(
            f"the minimum energy is certified to within {gap:.1e} J only, "
            f"expected {allowed:.1e} J"
        )
    if not residual <= LARGEST_RESIDUAL:
        sentences.append(
            f"a loop stays open by {residual:.1e} rad or reference lengths"
        )
    if not excess <= LARGEST_EXCESS:
        sentences.append(f"a clearance is exceeded by {excess:.1e} of its bound")
    if not sentences and not _springs_determined(assembly):
        sentences += unproved_screw(assembly, bound_screw(assembly))
    return "; ".join(sentences)


def unproved_screw(assembly: Assembly, bound: ScrewBound) -> list[str]:
    """Return a message for each inaccurate half of the platform screw.

    Non-uniqueness due to unloaded clearances is not an inaccuracy.

    Args:
        assembly: minimum-energy assembly.
        bound: error bound on the platform screw.

    Returns:
        Messages, at most one for the rotation and one for the translation.  A half is
        inaccurate if its error can exceed 1e-5 rad or m plus 1e-3 times its magnitude.
    """
    allowed = _allowed(assembly)
    spread = stiffness_spread(assembly.joints, assembly.linearisation.size)
    why = (
        f"; the stiffest spring is {spread:.0e} times as stiff as the softest"
        if spread > SPREAD
        else ""
    )
    return [
        f"the platform's {part} is certified to within {error:.1e} {unit} only, "
        f"expected {most:.1e} {unit}{why}"
        for part, error, unit, most in (
            ("rotation", bound.rotation_error, "rad", allowed[0]),
            ("translation", bound.translation_error, "m", allowed[1]),
        )
        if not error <= most
    ]


def _allowed(assembly: Assembly) -> NDArray:
    """Return the accepted errors of rotation [rad] and translation [m]."""
    halves = assembly.platform_screw.reshape(2, 3)
    return _SCREW + _SCREW_SHARE * np.linalg.norm(halves, axis=1)


def _springs_determined(assembly: Assembly) -> bool:
    """Return whether errors of the spring deformations hardly move the platform."""
    frames, springs = len(assembly.posture.robot.frames), assembly.elastic.size
    blocks = assembly.joints.elastic.reshape(frames, 6, springs)
    moved = np.linalg.norm(assembly.posture.paths @ blocks, axis=(0, 2))
    moved = np.linalg.norm(moved.reshape(2, 3), axis=1)
    distance = np.sqrt(2 * assembly.uncertainty) * moved
    return bool(np.all(_AMPLIFIED * distance <= _allowed(assembly)))


def bound_screw(assembly: Assembly) -> ScrewBound:
    """Bound the distance to every minimum-energy platform screw.

    Args:
        assembly: the computed assembly with its wrenches.

    Returns:
        Bounds on the distances.  They are computed for boxes around the sets of screws,
        and overestimate the true distances by at most a factor of sqrt(3).
    """
    gap, lin = assembly.uncertainty, assembly.linearisation
    open_closures = lin.rows @ assembly.screws.ravel()
    residual = float(np.linalg.norm(open_closures)) + assembly.rounding

    def unloaded(joints: VirtualJoints) -> MovingCones:
        """Return the cones of clearances on which the energy does not depend."""
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
        """Return the unknowns that are uncertain because of the duality gap."""
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
    total = _extents(within_bounds(assembly, kept, uncertain))
    open_set = within_bounds(assembly, kept, unloaded)
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
    """Return the range in which each clearance motion varies at minimum energy.

    Returns:
        Columns of the clearance motions; their values in this assembly; the cone of
        each column; and (nu,) [-] ranges relative to the sizes of the cones.  A range
        of 1 is the complete cone.  A smaller range bounds the distance between this
        assembly and any minimum-energy assembly.
    """
    group = joints.group
    load = cone_sizes(joints.cones.T @ assembly.joint_wrenches.ravel(), group)
    share = np.divide(gap, load, out=np.full(len(load), np.inf), where=load > 0.0)
    # The range is measured from the end of an interval. In a disc, it is the width of a
    # circular segment.
    room = np.where(np.bincount(group) > 1, 2.0 * np.sqrt(2.0 * share), share)
    room = np.where(room < _HELD, room, 1.0)
    return joints.cones, clearances_in(assembly, joints), group, room[group]


def _farthest(reachable: ReachableSet, part: int, box: float) -> float:
    """Return a bound [rad or m] on the distance of a set's screws from its centre."""
    if not 0.0 < box < np.inf:
        return box
    about_centre = replace(reachable, centre=np.zeros(6))
    try:
        return min(box, about_centre.farthest(part, _WIDTH * box)[0][1])
    except SolverFailed:
        return box


def _extents(reachable: ReachableSet) -> NDArray:
    """Return the half-width of a box that contains a set of screws, (6,) [rad, m]."""
    extents = []
    for d in np.concatenate([np.eye(6), -np.eye(6)]):
        try:
            height = reachable.support(d).height
            extents.append(height - float(d @ reachable.centre))
        except SolverFailed:  # There is no bound in this direction.
            extents.append(np.inf)
    return np.maximum(np.reshape(extents, (2, 6)).max(axis=0), 0.0)
