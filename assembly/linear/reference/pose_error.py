"""Set of platform screws that are possible under an assumption of problem (27).

Clearances v move within their cones, and free motions q follow through the closures:

    A_q dq + A_v dv = 0,        platform screw = centre + P_v dv + P_q dq.

A free motion that no closure constrains either does not move the platform, or makes
components of its screw unbounded.

Motions of passive joints are limited.  Most of these limits are never active, and a
limit of 10 rad among cones of 1e-5 rad reduces the accuracy.  A limit is therefore
omitted unless the sum of |A_q^+ A_v| over the cones exceeds it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

from forcefit.assembly.kinematics.ranks import (
    RANK,
    ROWS_RANK,
    UNBOUNDED,
    noise_of,
    rank_of,
    rank_tolerance,
)
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import VirtualJoints, virtual_joints
from forcefit.assembly.linear.reference.energy import least_energy
from forcefit.assembly.linear.reference.reduction import complement
from forcefit.assembly.model.clearance import (
    clearance_bounds,
    clearance_components,
    component_bounds,
    scales_with_margin,
)
from forcefit.assembly.solvers import one_problem, outer_cuts
from forcefit.assembly.solvers.cones import cone_sizes, cone_starts, into_cones
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.solvers.method import Method
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.screws import skew

ASSUMPTIONS = ("frozen", "free", "budget")
# Accepted excess of squared clearances over their cones. With a smaller value, a cone
# at its bound would block the step of all other cones.
_EXCESS = 1e-8


@dataclass(frozen=True, eq=False)
class Support:
    """Largest component along a direction among the screws of a set.

    Attributes:
        height: certified upper bound on direction . screw over the set.
        screw: (6,) [rad, m] screw of the set that approximately attains the height.
        gradient: (nv,) derivative of the component with respect to the clearances v,
            minus the contribution of the closures' multipliers.
    """

    height: float
    screw: NDArray
    gradient: NDArray


class MovingCones(NamedTuple):
    """Clearances that can change, as nv columns grouped into unit cones.

    Attributes:
        closures: (6 closures, nv) scaled closure error per unit of each column.
        platform: (6, nv) [rad, m] platform screw per unit of each column.
        start: (nv,) values at the solution of (22), within the cones.
        group: (nv,) cone of each column.
    """

    closures: NDArray
    platform: NDArray
    start: NDArray
    group: NDArray


@dataclass(frozen=True, eq=False)
class ReachableSet:
    """Set of possible platform screws: centre + map @ (v - start).

    The points v are in unit cones and satisfy rows @ (v - start) = 0.  This equation is
    homogeneous, so errors in the solution of (22) do not enlarge the set.

    Attributes:
        centre: (6,) [rad, m] the screw at ``start``.
        map: (6, nv) [rad, m] derivative of the screw with respect to v.
        rows: (p, nv) orthonormal rows of the closures.
        start: (nv,) values of v at the solution of (22).
        group: (nv,) cone of each column.
        free: (6, k) [rad, m] screws of the platform per unit of each motion that is
            neither resisted nor bounded.
    """

    centre: NDArray
    map: NDArray
    rows: NDArray
    start: NDArray
    group: NDArray
    free: NDArray = field(default_factory=lambda: np.zeros((6, 0)))

    __repr__, _repr_html_ = short_repr, html_table

    def unbounded(self, part: int) -> bool:
        """Return whether the rotation (part 0) or translation (part 3) is unbounded."""
        free = self.free[part : part + 3]
        return bool(np.abs(free).max(initial=0.0) > UNBOUNDED)

    def at_point(self, offset: ArrayLike) -> "ReachableSet":
        """Return the set of screws at another point of the platform.

        Args:
            offset: (3,) [m] from the platform's origin to the point, base axes.

        Returns:
            The set with translations at that point.
        """
        move = np.eye(6)
        move[3:, :3] = -skew(offset)
        return replace(
            self, centre=move @ self.centre, map=move @ self.map,
            free=move @ self.free,
        )  # fmt: skip

    def support(self, direction: ArrayLike, method: Method = "compiled") -> "Support":
        """Return the largest component of the platform screw along a direction.

        Args:
            direction: (6,) weights of the screw's components.
            method: method of :func:`forcefit.assembly.solvers.conic.minimise_energy`.

        Returns:
            The height with a screw that attains it; infinite if the platform moves
            freely in that direction.

        Raises:
            SolverFailed: the cone solver did not converge.
        """
        direction = np.asarray(direction, dtype=float)
        gradient = self.map.T @ direction
        along = np.abs(direction @ self.free).max(initial=0.0)
        if along > UNBOUNDED * np.abs(direction).max():
            return Support(np.inf, self.centre, gradient)
        at_centre = float(direction @ self.centre)
        size = float(np.linalg.norm(gradient))
        if size == 0.0:
            return Support(at_centre, self.centre, gradient)
        none, right = np.zeros((0, len(gradient))), self.rows @ self.start
        least = minimise_energy(
            none, np.zeros(0), gradient / size, self.rows, right, self.group, method
        )
        height = at_centre - least.bound * size - float(gradient @ self.start)
        screw = self._screw_near(least.clearances)
        reduced = gradient + self.rows.T @ least.rigid_multipliers * size
        return Support(max(height, float(direction @ screw)), screw, reduced)

    def _screw_near(self, v: NDArray) -> NDArray:
        """Return the platform screw [rad, m] at a point of the set near v."""
        # The screw satisfies the closures to machine precision, and the bounds of the
        # cones to 5e-9 of their size.
        start, group = self.start, self.group
        step = v - start
        step = step - self.rows.T @ (self.rows @ step)
        # Find the longest step that remains inside all cones.
        aa, ab, bb = (
            np.bincount(group, one * other)
            for one, other in ((step, step), (start, step), (start, start))
        )
        most = 1.0 + _EXCESS
        beyond = aa + 2.0 * ab + bb > most
        aa, ab, room = aa[beyond], ab[beyond], np.maximum(most - bb[beyond], 0.0)
        shares = (np.sqrt(ab**2 + aa * room) - ab) / aa
        return self.centre + self.map @ (shares.min(initial=1.0) * step)

    def farthest(
        self, part: int, tolerance: float, method: Method = "compiled"
    ) -> tuple[tuple[float, float], NDArray, int]:
        """Bound the largest rotation or translation of the set.

        Args:
            part: 0 for the rotation, 3 for the translation.
            tolerance: [rad or m] required difference between the upper and lower bound.
            method: ``"compiled"``; or ``"reference"``, which uses only numpy and
                Clarabel.

        Returns:
            (lower, upper) bounds; (6,) [rad, m] screw that attains the lower bound; and
            the number of support functions evaluated.

        Raises:
            SolverFailed: the cone solver did not converge.
        """
        if self.unbounded(part):
            return (np.inf, np.inf), self.centre, 0
        half = np.eye(6)[part : part + 3]

        def along(direction: NDArray) -> tuple[float, NDArray, NDArray]:
            found = self.support(direction @ half, method)
            return found.height, found.screw, found.gradient

        if method == "reference":
            return outer_cuts.farthest(self.centre, part, tolerance, along)
        (low, high), screw, supports = one_problem.farthest(
            self.centre, self.map, self.rows, self.start, self.starts, part, tolerance,
            along,
        )  # fmt: skip
        return (float(low), float(high)), screw, supports

    @property
    def starts(self) -> NDArray:
        """Index of the first column of each cone, followed by nv, (cones + 1,)."""
        return cone_starts(self.group)


def reachable_screws(
    assembly: Assembly, assumption: str, energy_budget: float = 0.05
) -> ReachableSet:
    """Return the set of platform screws that are possible under an assumption.

    Args:
        assembly: minimum-energy assembly.
        assumption: ``"frozen"``, ``"free"`` or ``"budget"``.
        energy_budget: eta of assumption ``"budget"``, >= 0.

    Returns:
        The set, in which all motion limits of passive joints are satisfied.

    Raises:
        ValueError: the assumption is unknown, or ``budget`` is used under a load.
    """
    if assumption not in ASSUMPTIONS:
        raise ValueError(f"assumption is {assumption!r}, expected one of {ASSUMPTIONS}")
    if assumption == "budget" and (assembly.frame_loads or energy_budget < 0):
        raise ValueError(
            "assumption 'budget': expected an assembly without load and an energy "
            "budget >= 0"
        )
    free = assumption == "free"
    loaded = assembly
    if free:
        # Under this assumption, joints rotate freely about their own axes. A clearance
        # is fixed only if it remains loaded without the springs about these axes.
        loaded = least_energy(
            assembly.posture, assembly.load, assembly.frame_loads, own_axes_free=True
        )

    def moving(joints: VirtualJoints) -> MovingCones:
        held = np.zeros(joints.cones.shape[1], dtype=bool)
        if assumption != "budget":
            held = loaded_cones(loaded, joints)
        columns, group = joints.cones[:, ~held], joints.group[~held]
        start = clearances_in(assembly, joints)[~held]
        if assumption == "budget":
            radius = np.sqrt(2 * (1 + energy_budget) * assembly.stored)
            columns = np.hstack([columns, joints.elastic * radius])
            spring = assembly.elastic / max(radius, 1e-300)
            start = np.concatenate([start, spring])
            last = np.bincount(group).size
            group = np.concatenate([group, np.full(len(spring), last)])
        lin = assembly.linearisation
        return MovingCones(lin.rows @ columns, lin.platform @ columns, start, group)

    return within_bounds(assembly, loaded.joints.bounded_motion, moving, free)


def within_bounds(
    assembly: Assembly, kept: frozenset[int],
    moving: Callable[[VirtualJoints], MovingCones], own_axes_free: bool = False,
) -> ReachableSet:  # fmt: skip
    """Return the set of platform screws for clearances that can change.

    Args:
        assembly: assembly at the start.
        kept: frames whose motion limits are included from the beginning.
        moving: function of virtual joints that returns the cones of these clearances.
        own_axes_free: see :func:`forcefit.assembly.linear.closure.virtual_joints`; if
            True, no spring acts.

    Returns:
        The set, in which all motion limits are satisfied.
    """
    kept = kept | assembly.joints.bounded_motion
    while True:
        joints = virtual_joints(
            assembly.posture.robot, not own_axes_free, own_axes_free, kept
        )
        cones = moving(joints)
        group = np.unique(cones.group, return_inverse=True)[1]
        motion = _Motion(assembly, joints, cones._replace(group=group))
        if not motion.passed:
            return motion.reachable
        kept = kept | motion.passed


@dataclass(frozen=True, eq=False)
class _Motion:
    """Clearances that can change, and the free motions that the closures impose."""

    assembly: Assembly
    joints: VirtualJoints
    cones: MovingCones

    @cached_property
    def _follow(self) -> tuple[NDArray, NDArray]:
        """Pseudoinverse of A_q, and platform screws of unconstrained motions."""
        lin = self.assembly.linearisation
        A_q, P_q = lin.rows @ self.joints.free, lin.platform @ self.joints.free
        inverse = np.linalg.pinv(A_q, rcond=self._with_mismatch(RANK))
        free = P_q - (P_q @ inverse) @ A_q
        large = np.abs(free).max(axis=0) > self._with_mismatch(UNBOUNDED)
        return inverse, np.where(large, free, 0.0)

    def _with_mismatch(self, threshold: float) -> float:
        """Return a rank threshold that includes the nominal closure error."""
        return rank_tolerance(self.assembly.posture.mismatch, threshold)

    @cached_property
    def passed(self) -> frozenset[int]:
        """Frames whose passive joint can exceed a motion limit that is not imposed."""
        inverse, free = self._follow
        row = self.joints.free.argmax(axis=0)
        # The motion limit of a joint without a spring is always included.
        robot, group = self.joints.robot, self.cones.group
        limit = component_bounds(clearance_bounds(robot)).ravel()[row]
        clearance = component_bounds(scales_with_margin(robot)).ravel()[row]
        limited = np.isfinite(limit) & ~clearance
        if not limited.any():
            return frozenset()
        step = -inverse @ self.cones.closures
        middle = self.assembly.clearance_screws.ravel()[row] - step @ self.cones.start
        most = np.abs(middle)
        for c in np.unique(group):
            most = most + np.linalg.norm(step[:, group == c], axis=1)
        # A motion that no closure constrains reaches its limit.
        passing = limited & ((most > limit) | free.any(axis=0))
        return frozenset((row[passing] // 6).tolist())

    @property
    def reachable(self) -> ReachableSet:
        """Set of possible platform screws."""
        lin, A_v = self.assembly.linearisation, self.cones.closures
        inverse, free = self._follow
        Z = complement(lin.rows @ self.joints.free, self._with_mismatch(RANK))
        follow = lin.platform @ self.joints.free @ inverse
        return ReachableSet(
            centre=self.assembly.platform_screw,
            map=self.cones.platform - follow @ A_v,
            rows=_rows(Z.T @ A_v, noise_of(A_v)),
            start=self.cones.start,
            group=self.cones.group,
            free=free,
        )


def clearances_in(assembly: Assembly, joints: VirtualJoints) -> NDArray:
    """Return the clearance motions of an assembly for other basis columns."""
    screws = clearance_components(joints.robot, assembly.clearance_screws).ravel()
    u = joints.cones.T @ screws / (joints.cones**2).sum(axis=0)
    return into_cones(u, joints.group)


def _rows(A: NDArray, noise: float) -> NDArray:
    """Return an orthonormal basis of the row space of A."""
    _, S, Vt = svd(A, full_matrices=False)
    return Vt[: rank_of(S, ROWS_RANK, noise)]


def loaded_cones(assembly: Assembly, joints: VirtualJoints) -> NDArray:
    """Find the clearances at their bound that transmit a contact force.

    Args:
        assembly: minimum-energy assembly.
        joints: virtual joints whose columns are tested.

    Returns:
        (nu,) bool, equal for all columns of a cone.
    """
    wrenches = assembly.joint_wrenches.ravel()
    load = cone_sizes(joints.cones.T @ wrenches, joints.group)
    screws = clearance_components(joints.robot, assembly.clearance_screws).ravel()
    u = joints.cones.T @ screws / (joints.cones**2).sum(axis=0)
    slack = np.maximum(0.0, 1.0 - cone_sizes(u, joints.group))
    # At a cone solver's solution, the contact force or the distance from the bound is
    # nearly zero.
    scale = max(assembly.energy, 1e-9 * assembly.energy_without_clearance, 1e-300)
    return ((load > scale * slack) & (load > 1e-9 * scale))[joints.group]
