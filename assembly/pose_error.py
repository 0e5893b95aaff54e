"""How far off the platform can be: problem (27) with certified bounds.

Printed as it is, (27) is degenerate: with the deformations frozen at the solution of
(22), complementary slackness holds every loaded clearance where it is.  So there are
three readings of what may still move:

======== =================================================================
frozen   all deformations stay; only unloaded clearances move (the paper)
free     compliant joints also turn about their own axis: play inside zones
budget   everything that closes with at most (1 + eta) times the least energy
======== =================================================================

The set of platform screws is convex; its farthest one is bracketed by
:mod:`assembly.solvers.farthest`, compiled.  What that solver cannot certify is asked of
Clarabel.  :func:`assembly.solvers.batch_error.bound_pose_errors` does many postures at
once.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

from assembly.clearance import has_bounded_motion
from assembly.closure import VirtualJoints, virtual_joints
from assembly.energy import Assembly, without_own_springs
from assembly.solvers.conic import cone_sizes, into_cones, minimise_energy
from assembly.solvers.reduction import NOISE, complement
from stiffness.display import Figures, bracket, html_table, short_repr
from stiffness.screws import skew

if TYPE_CHECKING:
    from assembly.solvers.support import Body

READINGS = ("frozen", "free", "budget")
_RANK = 1e-10
_MOST_SUPPORTS = 400


@dataclass(frozen=True, eq=False)
class Support:
    """How far a set of screws extends along a direction.

    Attributes:
        height: certified upper bound of direction . screw over the set.
        screw: (6,) [rad, m] of the set, (nearly) attains it.
        pulls: (nv,) what pulls each cone towards the direction, closures included.
    """

    height: float
    screw: NDArray
    pulls: NDArray


@dataclass(frozen=True, eq=False)
class Reach:
    """Platform screws that remain possible: centre + map @ (v - start).

    v runs over unit cones with rows @ (v - start) = 0: the homogeneous form, in which
    an error of the solution of (22) opens no false play.

    Attributes:
        centre: (6,) [rad, m] the screw at ``start``.
        map: (6, nv) [rad, m] how the screw follows v.
        rows: (p, nv) orthonormal rows of the closures.
        start: (nv,) v at the solution of (22), within its cones.
        group: (nv,) cone of each column.
        unbounded: whether the platform can move without bound.
    """

    centre: NDArray
    map: NDArray
    rows: NDArray
    start: NDArray
    group: NDArray
    unbounded: bool = False

    __repr__, _repr_html_ = short_repr, html_table

    def at_point(self, offset: ArrayLike) -> "Reach":
        """The same set for another point of the platform.

        Args:
            offset: (3,) [m] from the platform's origin to the point, base axes.

        Returns:
            Screws read at the point.
        """
        move = np.eye(6)
        move[3:, :3] = -skew(offset)
        return replace(self, centre=move @ self.centre, map=move @ self.map)

    def support(self, direction: ArrayLike) -> "Support":
        """Largest component of the platform screw along a direction.

        Args:
            direction: (6,) weights of the screw's components.

        Returns:
            The height with the point that attains it.

        Raises:
            SolverFailed: the cone solver gave up.
        """
        from assembly.solvers.support import screw_at, within

        direction = np.asarray(direction, dtype=float)
        pull = self.map.T @ direction
        at_centre = float(direction @ self.centre)
        size = float(np.linalg.norm(pull))
        if size == 0.0:
            return Support(at_centre, self.centre, pull)
        none, right = np.zeros((0, len(pull))), self.rows @ self.start
        least = minimise_energy(
            none, np.zeros(0), pull / size, self.rows, right, self.group
        )
        height = at_centre - least.bound * size - float(pull @ self.start)
        body = self.body
        screw = screw_at(body, within(body, least.clearances))
        pulls = pull + self.rows.T @ least.rigid_multipliers * size
        return Support(max(height, float(direction @ screw)), screw, pulls)

    @property
    def body(self) -> "Body":
        """The set as the compiled search reads it."""
        from assembly.solvers.support import Body

        starts = np.searchsorted(self.group, np.arange(self.group.max(initial=-1) + 2))
        centre, X, H, start = (
            np.require(a, requirements=["C", "W"])
            for a in (self.centre, self.map, self.rows, self.start)
        )
        return Body(centre, X, H, start, starts)


@dataclass(frozen=True, eq=False)
class PoseError:
    """Certified bounds of the largest pose error, and screws that attain the lower.

    Attributes:
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: [rad] (lower, upper) bounds.
        translation_error: [m] (lower, upper) bounds.
        rotation_screw: (6,) [rad, m] attains the lower bound of the rotation.
        translation_screw: (6,) [rad, m] attains that of the translation.
        cuts: support functions computed.
        unproved: what of the answer of (22), or of what was asked of the bounds, is
            not proved; empty if nothing.
    """

    reading: str
    rotation_error: tuple[float, float]
    translation_error: tuple[float, float]
    rotation_screw: NDArray
    translation_screw: NDArray
    cuts: int
    unproved: str = ""

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """What ``forcefit assembly error`` prints of it."""
        found = {
            "reading": self.reading,
            "rotation": f"{bracket(self.rotation_error)} mrad",
            "translation": f"{bracket(self.translation_error)} mm",
        }
        return found | ({"not proved": self.unproved} if self.unproved else {})


def bound_pose_error(
    answer: Assembly,
    reading: str = "frozen",
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
) -> PoseError:
    """Bracket the largest rotation and translation error of the platform.

    Args:
        answer: the assembly at least energy, without a load in reading ``budget``.
        reading: see the head of this module.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point asked about.

    Returns:
        Bounds; wider than asked only if 400 supports did not suffice, which
        ``unproved`` then says; infinite if the platform can move without bound.

    Raises:
        ValueError: the reading is unknown, or ``budget`` is asked under a load.
        SolverFailed: the cone solver gave up.
    """
    reach = reachable_screws(answer, reading, energy_budget).at_point(offset)
    rotation = _farthest(reach, 0, tolerance_rotation)
    translation = _farthest(reach, 3, tolerance_translation)
    return PoseError(
        reading,
        rotation[0], translation[0], rotation[1], translation[1],
        rotation[2] + translation[2],
        "; ".join(filter(None, (
            answer.unproved,
            _too_wide("rotation", rotation[0], tolerance_rotation, "rad"),
            _too_wide("translation", translation[0], tolerance_translation, "m"),
        ))),
    )  # fmt: skip


def _too_wide(
    part: str, bounds: tuple[float, float], tolerance: float, unit: str
) -> str:
    """That bounds are farther apart than asked, if they are."""
    low, high = bounds
    # no bound at all is an answer: the platform can move without bound
    if high - low <= tolerance or low == high:
        return ""
    return (
        f"the bounds of the {part} are {high - low:.1e} {unit} apart, "
        f"expected {tolerance:.1e}"
    )


def reachable_screws(
    answer: Assembly, reading: str, energy_budget: float = 0.05
) -> Reach:
    """The set of platform screws that a reading of (27) leaves possible.

    Args:
        answer: the assembly at least energy.
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        energy_budget: eta of reading ``"budget"``, >= 0.

    Returns:
        The set; bounds of passive joints' own motion are left out unless the platform
        would move without bound.

    Raises:
        ValueError: the reading is unknown, or ``budget`` is asked under a load.
    """
    if reading not in READINGS:
        raise ValueError(f"reading is {reading!r}, expected one of {READINGS}")
    if reading == "budget" and (answer.forces or energy_budget < 0):
        raise ValueError("the budget reading needs no load and a budget >= 0")
    robot = answer.posture.robot
    bounded = answer.joints.bounded_motion
    for limit in (bounded, True):
        mode = "free" if reading == "free" else "elastic"
        joints = virtual_joints(robot, mode, bounded_motion=limit)
        reach = _Moving(answer, joints, reading, energy_budget).reach
        if not reach.unbounded or not has_bounded_motion(robot):
            break
    return reach


@dataclass(frozen=True, eq=False)
class _Moving:
    """What may move in a reading: columns of screws, and where (22) left them."""

    answer: Assembly
    joints: VirtualJoints
    reading: str
    energy_budget: float

    @cached_property
    def pinned(self) -> NDArray:
        """(nu,) bool: clearances that carry load, held by complementary slackness."""
        if self.reading == "budget":
            return np.zeros(self.joints.cones.shape[1], dtype=bool)
        holder = self.answer
        if self.reading == "free":
            # turning about the own axis costs nothing here: only what stays loaded
            # without those soft springs is held
            holder = without_own_springs(self.answer)
        return loaded_cones(holder, self.joints)

    @cached_property
    def reach(self) -> Reach:
        """The set of platform screws."""
        lin, held = self.answer.linearisation, self.pinned
        columns = self.joints.cones[:, ~held]
        start = self._start()[~held]
        group = self.joints.group[~held]
        if self.reading == "budget":
            radius = np.sqrt(2 * (1 + self.energy_budget) * self.answer.energy)
            columns = np.hstack([columns, self.joints.elastic * radius])
            spring = self.answer.elastic / max(radius, 1e-300)
            start = np.concatenate([start, spring])
            last = group.max(initial=-1) + 1
            group = np.concatenate([group, np.full(len(spring), last)])
        group = np.unique(group, return_inverse=True)[1]
        A_q, P_q = lin.rows @ self.joints.free, lin.platform @ self.joints.free
        A_v, P_v = lin.rows @ columns, lin.platform @ columns
        Z = complement(A_q, _RANK + 30 * self.answer.posture.mismatch)
        follow = np.linalg.lstsq(A_q.T, P_q.T, rcond=_RANK)[0]
        left = np.abs(A_q.T @ follow - P_q.T).max(initial=0.0)
        rows = _rows(Z.T @ A_v, NOISE * np.abs(A_v).max(initial=0.0))
        return Reach(
            self.answer.platform_screw, P_v - follow.T @ A_v, rows, start, group,
            unbounded=bool(left > 1e-8),
        )  # fmt: skip

    def _start(self) -> NDArray:
        """(nu,) the solution's clearances in these cones."""
        screws = self.answer.clearance_screws.ravel()
        size = (self.joints.cones**2).sum(axis=0)
        u = self.joints.cones.T @ screws / size
        return into_cones(u, self.joints.group)


def _rows(A: NDArray, noise: float) -> NDArray:
    """Orthonormal rows spanning those of A, but for rounding."""
    _, S, Vt = svd(A, full_matrices=False)
    return Vt[: int(np.sum(S > max(noise, 1e-9 * S.max(initial=0.0))))]


def loaded_cones(answer: Assembly, joints: VirtualJoints) -> NDArray:
    """Which clearances press on their bound, by strict complementarity.

    Args:
        answer: the assembly at least energy.
        joints: whose columns are asked about.

    Returns:
        (nu,) bool, the same for all columns of a cone.
    """
    wrenches = answer.joint_wrenches.ravel()
    push = cone_sizes(joints.cones.T @ wrenches, joints.group)
    screws = answer.clearance_screws.ravel()
    u = joints.cones.T @ screws / (joints.cones**2).sum(axis=0)
    slack = np.maximum(0.0, 1.0 - cone_sizes(u, joints.group))
    # push times slack is about the solver's gap: one of the two is nearly zero
    scale = max(answer.energy, 1e-9 * answer.energy_without_play, 1e-300)
    return ((push > scale * slack) & (push > 1e-9 * scale))[joints.group]


def _farthest(
    reach: Reach, part: int, tolerance: float
) -> tuple[tuple[float, float], NDArray, int]:
    """Bounds of the largest size of half a screw, a screw, and the supports it took."""
    from assembly.solvers.cone_solvers import cone_solvers
    from assembly.solvers.farthest import NEEDED, advance, begin, choose, learn
    from assembly.solvers.polytope import empty_polytope

    if reach.unbounded:
        return (np.inf, np.inf), reach.centre, 0
    body = reach.body
    search = begin(body, part, tolerance, _MOST_SUPPORTS, empty_polytope())
    while advance(cone_solvers(), body, search) == NEEDED:
        found = reach.support(search.direction @ np.eye(6)[part : part + 3])
        learn(body, search, found.height, found.screw, found.pulls)
        choose(search)
    low, high = search.bounds.tolist()
    return (low, high), search.best, int(search.counts[1])
