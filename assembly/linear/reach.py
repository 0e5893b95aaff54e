"""The set of platform screws that a reading of problem (27) leaves possible.

Clearances v move within their cones, free motions q follow the closures,

    A_q dq + A_v dv = 0,        platform screw = centre + P_v dv + P_q dq.

A free motion that no closure holds either leaves the platform where it is or makes
some of its components unbounded; those of the other half stay as they are.

Bounds of passive joints' own motion count.  Most are ranges no play comes near, and a
cone of 10 rad beside ones of 1e-5 costs digits; so each is left out until it is seen
that it could be passed: dq = -A_q^+ A_v dv is largest at a sum over the cones.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

from assembly.linear.closure import VirtualJoints, virtual_joints
from assembly.linear.energy import Assembly, without_own_springs
from assembly.linear.reduction import NOISE, complement
from assembly.model.clearance import clearance_bounds, scales_with_margin
from assembly.solvers.conic import cone_sizes, into_cones, minimise_energy
from forcefit.inputs.display import html_table, short_repr
from stiffness.screws import skew

if TYPE_CHECKING:
    from assembly.solvers.support import Body

READINGS = ("frozen", "free", "budget")
_RANK = 1e-10
_UNBOUNDED = 1e-8  # [rad, m] of the platform for a unit of a motion nothing holds


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
        drift: (6, k) [rad, m] screws of the platform, for a unit of motions that
            nothing holds and nothing bounds.
    """

    centre: NDArray
    map: NDArray
    rows: NDArray
    start: NDArray
    group: NDArray
    drift: NDArray = field(default_factory=lambda: np.zeros((6, 0)))

    __repr__, _repr_html_ = short_repr, html_table

    def unbounded(self, part: int) -> bool:
        """Whether the rotation (part 0), or the translation (3), has no bound."""
        drift = self.drift[part : part + 3]
        return bool(np.abs(drift).max(initial=0.0) > _UNBOUNDED)

    def at_point(self, offset: ArrayLike) -> "Reach":
        """The same set for another point of the platform.

        Args:
            offset: (3,) [m] from the platform's origin to the point, base axes.

        Returns:
            Screws read at the point.
        """
        move = np.eye(6)
        move[3:, :3] = -skew(offset)
        return replace(
            self, centre=move @ self.centre, map=move @ self.map,
            drift=move @ self.drift,
        )  # fmt: skip

    def support(self, direction: ArrayLike) -> "Support":
        """Largest component of the platform screw along a direction.

        Args:
            direction: (6,) weights of the screw's components.

        Returns:
            The height with the point that attains it; infinite where the platform
            drifts that way.

        Raises:
            SolverFailed: the cone solver gave up.
        """
        from assembly.solvers.support import screw_near

        direction = np.asarray(direction, dtype=float)
        pull = self.map.T @ direction
        along = np.abs(direction @ self.drift).max(initial=0.0)
        if along > _UNBOUNDED * np.abs(direction).max(initial=0.0):
            return Support(np.inf, self.centre, pull)
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
        screw = screw_near(body, least.clearances)
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


def reachable_screws(
    answer: Assembly, reading: str, energy_budget: float = 0.05
) -> Reach:
    """The set of platform screws that a reading of (27) leaves possible.

    Args:
        answer: the assembly at least energy.
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        energy_budget: eta of reading ``"budget"``, >= 0.

    Returns:
        The set, within all bounds of passive joints' own motion too.

    Raises:
        ValueError: the reading is unknown, or ``budget`` is asked under a load.
    """
    if reading not in READINGS:
        raise ValueError(f"reading is {reading!r}, expected one of {READINGS}")
    if reading == "budget" and (answer.forces or energy_budget < 0):
        raise ValueError("the budget reading needs no load and a budget >= 0")
    mode = "free" if reading == "free" else "elastic"
    holder = answer
    if reading == "free":
        # turning about the own axis costs nothing here: only what stays loaded
        # without those soft springs is held
        holder = without_own_springs(answer)

    def play(joints: VirtualJoints) -> tuple[NDArray, NDArray, NDArray, NDArray]:
        held = np.zeros(joints.cones.shape[1], dtype=bool)
        if reading != "budget":
            held = loaded_cones(holder, joints)
        columns, group = joints.cones[:, ~held], joints.group[~held]
        start = clearances_in(answer, joints)[~held]
        if reading == "budget":
            radius = np.sqrt(2 * (1 + energy_budget) * answer.stored)
            columns = np.hstack([columns, joints.elastic * radius])
            spring = answer.elastic / max(radius, 1e-300)
            start = np.concatenate([start, spring])
            last = group.max(initial=-1) + 1
            group = np.concatenate([group, np.full(len(spring), last)])
        lin = answer.linearisation
        return lin.rows @ columns, lin.platform @ columns, start, group

    return within_bounds(answer, mode, holder.joints.bounded_motion, play)


def within_bounds(
    answer: Assembly, mode: str, kept: frozenset[int],
    play: Callable[[VirtualJoints], tuple[NDArray, NDArray, NDArray, NDArray]],
) -> Reach:  # fmt: skip
    """Platform screws as cones move about an answer and free motions follow.

    Args:
        answer: where they start.
        mode: of compliant joints, see :func:`assembly.linear.closure.virtual_joints`.
        kept: frames whose bound of the joint's own motion is certain to count.
        play: unit cones of given virtual joints: their columns in the closures (6
            closures, nv) and at the platform (6, nv), start and groups (nv,).

    Returns:
        The set, within all bounds.
    """
    kept = kept | answer.joints.bounded_motion
    while True:
        joints = virtual_joints(answer.posture.robot, mode, bounded_motion=kept)
        A_v, P_v, start, group = play(joints)
        group = np.unique(group, return_inverse=True)[1]
        moving = _Moving(answer, joints, A_v, P_v, start, group)
        if not moving.passed:
            return moving.reach
        kept = kept | moving.passed


@dataclass(frozen=True, eq=False)
class _Moving:
    """Cones that move, and the free motions that follow them."""

    answer: Assembly
    joints: VirtualJoints
    A_v: NDArray
    P_v: NDArray
    start: NDArray
    group: NDArray

    @cached_property
    def _follow(self) -> tuple[NDArray, NDArray]:
        """(nq, m) free motions for what they have to close; (6, nq) the drift."""
        lin = self.answer.linearisation
        A_q, P_q = lin.rows @ self.joints.free, lin.platform @ self.joints.free
        back = np.linalg.pinv(A_q, rcond=self._rounding(_RANK))
        drift = P_q - (P_q @ back) @ A_q
        large = np.abs(drift).max(axis=0) > self._rounding(_UNBOUNDED)
        return back, np.where(large, drift, 0.0)

    def _rounding(self, least: float) -> float:
        """[-] what counts as zero beside what is left of the nominal closures."""
        return least + 30.0 * self.answer.posture.mismatch

    @cached_property
    def passed(self) -> frozenset[int]:
        """Frames whose own motion may pass a bound that is left out here."""
        back, drift = self._follow
        row = self.joints.free.argmax(axis=0)
        # what has no spring here has its bound in every reading
        limit = clearance_bounds(self.joints.robot)[:, [0, 0, 1, 2, 2, 3]].ravel()[row]
        own = scales_with_margin(self.joints.robot)[:, [0, 0, 1, 2, 2, 3]].ravel()[row]
        limited = np.isfinite(limit) & ~own
        if not limited.any():
            return frozenset()
        step = -back @ self.A_v
        middle = self.answer.clearance_screws.ravel()[row] - step @ self.start
        most = np.abs(middle)
        for c in range(self.group.max(initial=-1) + 1):
            most = most + np.linalg.norm(step[:, self.group == c], axis=1)
        # a motion that nothing but its bound holds goes up to it
        passing = limited & ((most > limit) | drift.any(axis=0))
        return frozenset((row[passing] // 6).tolist())

    @property
    def reach(self) -> Reach:
        """The set of platform screws."""
        lin = self.answer.linearisation
        back, drift = self._follow
        Z = complement(lin.rows @ self.joints.free, self._rounding(_RANK))
        rows = _rows(Z.T @ self.A_v, NOISE * np.abs(self.A_v).max(initial=0.0))
        follow = lin.platform @ self.joints.free @ back
        return Reach(
            self.answer.platform_screw, self.P_v - follow @ self.A_v, rows, self.start,
            self.group, drift,
        )  # fmt: skip


def clearances_in(answer: Assembly, joints: VirtualJoints) -> NDArray:
    """(nu,) an answer's clearances in the unit cones of other virtual joints."""
    screws = answer.clearance_screws.ravel()
    u = joints.cones.T @ screws / (joints.cones**2).sum(axis=0)
    return into_cones(u, joints.group)


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
