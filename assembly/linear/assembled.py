"""Minimum-energy assembly of a manipulator: screws, wrenches, energy, certificate.

======  ====================  =========  =============================================
symbol  code                  shape      meaning
======  ====================  =========  =============================================
dx_p    ``platform_screw``    (6,)       platform's pose error at its origin, base axes
dc      ``clearance_screws``  (n, 6)     motions of clearances and passive joints
de      ``link_screws``       (n, 6)     deformations of links
db      ``joint_screws``      (n, 6)     deformations of joints
w       ``wrenches``          (n, 6)     wrenches of the links' springs, in frame axes
--      ``tip_wrenches``      (n, 6)     wrenches through the tip sections of links
E       ``energy``            [J]        elastic energy of all springs
======  ====================  =========  =============================================

The wrenches are computed from the closure multipliers rather than from eqs (23)-(26).
Eq. (23) adds the wrenches of springs in series, although these wrenches are equal.  Eqs
(24)-(26) include only the path to the platform, so their wrenches add up to zero
without a load on the platform.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.load import (
    FrameLoads,
    loads_on_frames,
    weights,
    with_distributed,
    wrenches_at_starts,
)
from forcefit.assembly.linear.reference.reduction import reduce_problem
from forcefit.assembly.linear.rounding import (
    ROUNDING,
    closure_rounding,
    differs_from_zero,
)
from forcefit.assembly.linear.solution import Solution
from forcefit.assembly.model.clearance import (
    clearance_bounds,
    clearance_components,
    clearance_excess,
)
from forcefit.assembly.model.point_results import N, plain
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.solvers.cones import cone_sizes, cone_sums
from forcefit.assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE
from forcefit.results.display import (
    Figures,
    largest,
    largest_row,
    short_repr,
    show,
)
from forcefit.results.text import forced_lines

if TYPE_CHECKING:
    import pandas
    import xarray

# Components below this fraction of the largest component are round-off.
_ROUNDED = 1e-9
_NOTHING = 1e-12  # [N m, N] wrench components below this value are round-off


@dataclass(frozen=True, eq=False, repr=False)
class Assembly(Solution[N]):
    """Minimum-energy assembly of a manipulator, at one or many points.

    The arrays of many points begin with a point axis, and ``[i]`` returns point i.  If
    no solution was found at point i, ``[i]`` raises the corresponding exception.  For
    the fields see :class:`~forcefit.assembly.linear.solution.Solution`.
    """

    summary, plot = short_repr, show

    def _figures(self) -> Figures:
        """Return the numbers that ``forcefit assembly solve`` prints."""
        if self.of_many:
            energy = np.asarray(self.energy)
            solved = np.isfinite(energy)
            return {
                "points": f"{len(self)}, {np.count_nonzero(solved)} solved",
                "energy": f"at most {energy[solved].max(initial=0.0):.6g} J",
                "platform error": f"at most {largest(self.platform_screw[solved])}",
            }
        forces = np.linalg.norm(without_rounding(self.tip_wrenches)[:, 3:], axis=1)
        # Links in series have equal forces. The first of them is reported.
        most = largest_row(forces)
        return {
            **forced_lines(self),
            "largest force": f"{forces[most]:.4g} N, in "
            f"{self.posture.robot.frames[most].name}",
            "certificate": f"closure residual {self.closure_residual():.1e}, clearance "
            f"excess {self.clearance_excess():.1e}, gap {self.duality_gap():.1e} J",
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set as described in :mod:`forcefit.assembly.model.tables`."""
        from forcefit.assembly.model.tables import assembly_dataset

        return super().to_xarray() if self.of_many else assembly_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with one row per frame, or one row per point."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point" if self.of_many else "frame")

    @property
    def ranks(self) -> dict[str, int]:
        """Numbers of closure equations that are free, elastic, rigid and redundant."""
        return reduce_problem(self.linearisation, self.joints, self.frame_loads).ranks

    @property
    def loaded(self) -> Any:
        """True at points where a load acts on the robot."""
        acting = np.any(self.frame_loads.body, axis=-1)
        acting = acting | np.any(self.frame_loads.joint, axis=-1)
        return plain(np.broadcast_to(acting, np.shape(self.energy_without_clearance)))

    @cached_property
    def energy(self) -> N:
        """Elastic energy [J]; 0 if it cannot be distinguished from round-off."""
        nonzero = differs_from_zero(
            self.stored, self.duality_gap(), self.multipliers,
            self.closure_residual() + self.rounding,
        )  # fmt: skip
        return plain(np.where(nonzero, self.stored, 0.0))

    @property
    def stored(self) -> N:
        """Elastic energy [J] of the springs, including round-off."""
        return plain(np.vecdot(self.elastic, self.elastic) / 2)

    @cached_property
    def potential(self) -> N:
        """Potential energy [J]: elastic energy minus the work of the loads."""
        on_errors = np.vecdot(self.frame_loads.body, _flat(self._errors))
        return plain(self.stored - self.work - on_errors)

    @cached_property
    def work(self) -> N:
        """Work [J] of the loads on all small screws except geometric errors."""
        joints = self.clearance_screws + self.joint_screws
        on_bodies = np.vecdot(self.frame_loads.body, _flat(self.link_screws))
        return plain(on_bodies + np.vecdot(self.frame_loads.joint, _flat(joints)))

    @property
    def _errors(self) -> NDArray:
        """Geometric errors of the frames, (..., n, 6) [rad, m]."""
        return self.posture.robot.errors if self.errors is None else self.errors

    @cached_property
    def clearance_screws(self) -> NDArray:
        """Screws of clearances and passive joints, (..., n, 6) [rad, m]."""
        screws = self.clearances @ self.joints.cones.T
        return _by_frames(screws + self.motions @ self.joints.free.T)

    @cached_property
    def link_screws(self) -> NDArray:
        """Deformations of the bodies, (..., n, 6) [rad, m]."""
        springs = self.elastic * self.joints.links
        return _by_frames(springs @ self.joints.elastic.T)

    @cached_property
    def joint_screws(self) -> NDArray:
        """Deformations of the joints, (..., n, 6) [rad, m]."""
        springs = self.elastic * ~self.joints.links
        return _by_frames(springs @ self.joints.elastic.T)

    @cached_property
    def screws(self) -> NDArray:
        """Sum of error, deformations and joint motion, (..., n, 6) [rad, m]."""
        moved = self.clearance_screws + self.link_screws + self.joint_screws
        return self._errors + moved

    @cached_property
    def platform_screw(self) -> NDArray:
        """Pose error of the platform at its origin, base axes, (..., 6) [rad, m]."""
        return _times(self.linearisation.platform, _flat(self.screws))

    @cached_property
    def closure_wrenches(self) -> NDArray:
        """Wrench of a closure's second chain on its first, (..., closures, 6) [N m, N].

        The wrenches act at the platform's origin and are expressed in base axes.  If
        rigid bodies are overconstrained, the wrenches are not unique, and those of
        minimum norm are returned.
        """
        size = self.linearisation.size
        return _by_frames(self.multipliers) / np.array([1, 1, 1, size, size, size])

    @cached_property
    def wrenches(self) -> NDArray:
        """Elastic wrench of each link, K_E @ deformation, (..., n, 6) [N m, N].

        Each wrench acts at the frame's origin and is expressed in the frame's axes.
        Half of the link's own weight is applied at each of its ends.  See
        :attr:`tip_wrenches` for the wrench through the section at the tip.
        """
        return self._closing + _by_frames(self.frame_loads.body)

    @cached_property
    def tip_wrenches(self) -> NDArray:
        """Wrench that the next body exerts on each body's tip, (..., n, 6) [N m, N].

        Each wrench acts at the frame's origin and is expressed in the frame's axes.
        The body's own weight is distributed along the body.
        """
        return self.wrenches - self.frame_loads.at_tips

    @cached_property
    def start_wrenches(self) -> NDArray:
        """Wrench at the start of each link under its own weight, (..., n, 6) [N m, N].

        Each wrench acts at the link's start and is expressed in its frame's axes.  The
        entries of bodies without distributed weight are NaN.
        """
        at_tips = self.frame_loads.at_tips
        starts = wrenches_at_starts(self.posture.robot, self.tip_wrenches, at_tips)
        return starts if at_tips.any() else np.full_like(starts, np.nan)

    @cached_property
    def joint_wrenches(self) -> NDArray:
        """Wrench through each joint, (..., n, 6) [N m, N].

        The difference from :attr:`tip_wrenches` equals the loads that act on the body
        at the frame.
        """
        return self._closing + _by_frames(self.frame_loads.joint)

    @cached_property
    def _closing(self) -> NDArray:
        """Wrench that the closures exert on each frame, (..., n, 6) [N m, N]."""
        at_platform = closure_signs(self.posture.robot).T @ self.closure_wrenches
        return np.einsum("...nji,...nj->...ni", self.posture.paths, at_platform)

    @cached_property
    def bound(self) -> N:
        """Certified lower bound [J] on the potential energy of the assembly.

        The bound is the complementary energy of the computed wrenches.  For any
        wrenches w in equilibrium, the energy of every assembly is at least
        -w.dl - w.C w/2 - (largest work of w on the clearances).  The bound is therefore
        independent of the solution method.  It is valid provided that no free motion
        exceeds its value in this solution.
        """
        joint, springs = _flat(self.joint_wrenches), self._balancing
        clearances = cone_sizes(joint @ self.joints.cones, self.joints.group)
        slip = np.vecdot(np.abs(joint @ self.joints.free), np.abs(self.motions))
        errors = np.vecdot(_flat(self.wrenches), _flat(self._errors))
        gains = clearances.sum(axis=-1)
        return plain(-errors - np.vecdot(springs, springs) / 2 - gains - slip)

    @property
    def _balancing(self) -> NDArray:
        """Spring deformations in equilibrium with the wrenches, (..., ny) [sqrt(2 J)].

        The wrenches include those of the applied loads.
        """
        columns, links = self.joints.elastic, self.joints.links
        body, joint = _flat(self.wrenches), _flat(self.joint_wrenches)
        return np.where(links, body @ columns, joint @ columns)

    def has_loads(
        self,
        load: ArrayLike | None = None,
        bodies: ArrayLike | None = None,
        gravity: ArrayLike | None = None,
    ) -> bool:
        """Return whether the assembly was computed for the given loads.

        For the arguments see :func:`solve_assembly`.
        """
        other = all_loads(self.posture, load, bodies, gravity)
        return np.array_equal(other.body, self.frame_loads.body) and np.array_equal(
            other.joint, self.frame_loads.joint
        )

    def closure_residual(self) -> N:
        """Return the largest closure error [rad, reference lengths]."""
        return self._residual

    @cached_property
    def _residual(self) -> N:
        residual = np.abs(_times(self.linearisation.rows, _flat(self.screws)))
        return plain(residual.max(axis=-1, initial=0.0))

    def clearance_excess(self, own_axes_free: bool = False) -> N:
        """Return the largest relative amount by which a clearance exceeds its bound."""
        if not own_axes_free and "_excess" in vars(self):
            return self._excess
        bounds = clearance_bounds(self.posture.robot, own_axes_free)
        bounded = clearance_components(self.posture.robot, self.clearance_screws)
        return plain(clearance_excess(bounded, bounds))

    @cached_property
    def _excess(self) -> N:
        return self.clearance_excess()

    @cached_property
    def rounding(self) -> N:
        """Largest closure error that round-off can cause [rad, reference lengths]."""
        size = self.linearisation.size
        return plain(closure_rounding(self._errors, self.joints, size))

    @cached_property
    def uncertainty(self) -> N:
        """Duality gap [J], evaluated without cancellation, plus round-off.

        The energy minus its bound equals |y - s|^2 / 2.  Here y are the spring
        deformations, and s the deformations in equilibrium with the wrenches.  Two
        terms are added: the largest further work of each contact force within its
        clearance, and the work of the multipliers on the closure residual.
        """
        joint, springs = _flat(self.joint_wrenches), self.elastic - self._balancing
        group, on_cones = self.joints.group, joint @ self.joints.cones
        sizes = cone_sizes(on_cones, group)
        gains = sizes - cone_sums(on_cones * self.clearances, group)
        slip = np.vecdot(np.abs(joint @ self.joints.free), np.abs(self.motions))
        residual = np.abs(_times(self.linearisation.rows, _flat(self.screws)))
        rounding = np.asarray(self.rounding)[..., None]
        work_on_residual = np.vecdot(np.abs(self.multipliers), residual + rounding)
        return plain(
            np.vecdot(springs, springs) / 2
            + np.maximum(gains, 0.0).sum(axis=-1) + 2 * slip + work_on_residual
            + ROUNDING * (sizes.sum(axis=-1) + np.abs(self.work))
        )  # fmt: skip

    def duality_gap(self) -> N:
        """Return a certified bound [J] on the difference from the minimum energy."""
        return self._gap

    @cached_property
    def _gap(self) -> N:
        return plain(np.maximum(self.potential - self.bound, 0.0))  # NaN remains NaN

    def relative_gap(self) -> N:
        """Return the duality gap divided by the elastic energy.

        The divisor is at least 1e-4 times the minimum energy without clearance.
        """
        # The minimum energy is zero in an assembly zone, so the divisor has a lower
        # bound.
        least = np.maximum(1e-4 * np.asarray(self.energy_without_clearance), 1e-300)
        return plain(self.duality_gap() / np.maximum(self.stored, least))

    @property
    def certified(self) -> Any:
        """True where the duality gap is within its tolerance.

        The tolerance is 1e-8 times the energy, plus 1e-12 times the energy without
        clearance.  Under loads, 1e-12 times their work is added.
        """
        largest_energy = self.energy_without_clearance + np.abs(self.work)
        allowed = GAP * self.energy + GAP_WITHOUT_CLEARANCE * largest_energy
        return (self.duality_gap() <= allowed) & (np.asarray(self.status) == OK)


def _flat(screws: NDArray) -> NDArray:
    """Return screws (..., n, 6) in the shape (..., 6n)."""
    return screws.reshape(*screws.shape[:-2], -1)


def _by_frames(screws: NDArray) -> NDArray:
    """Return screws (..., 6n) in the shape (..., n, 6)."""
    return screws.reshape(*screws.shape[:-1], -1, 6)


def _times(matrices: NDArray, vectors: NDArray) -> NDArray:
    """Return the products of matrices (..., a, b) and vectors (..., b)."""
    return (matrices @ vectors[..., None])[..., 0]


def without_rounding(wrenches: NDArray) -> NDArray:
    """Set wrench components that are only round-off to zero.

    Args:
        wrenches: (..., n, 6) [N m, N] wrenches of the n bodies of a robot.

    Returns:
        (..., n, 6) [N m, N] wrenches.  A component is set to 0 if its absolute value is
        below 1e-9 times the robot's largest component, or below 1e-12 in SI units.
    """
    sizes = np.abs(wrenches)
    largest = sizes.max(axis=(-2, -1), keepdims=True, initial=0.0)
    least = np.maximum(_ROUNDED * largest, _NOTHING)
    return np.where(sizes < least, 0.0, wrenches)


def all_loads(
    posture: Posture,
    load: ArrayLike | None,
    bodies: ArrayLike | None,
    gravity: ArrayLike | None,
    carried: ArrayLike | None = None,
) -> FrameLoads:
    """Return the loads on all frames.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        carried: (n, 6) [N m, N] wrenches on the bodies that the frames' joints carry.

    Returns:
        Loads on every frame, including the weights if ``gravity`` is given.
    """
    if gravity is not None:
        on_bodies, on_parts = weights(posture, gravity)
        bodies = on_bodies if bodies is None else on_bodies + np.asarray(bodies)
        carried = on_parts if carried is None else on_parts + np.asarray(carried)
    loads = loads_on_frames(posture, load, bodies, carried)
    return loads if gravity is None else with_distributed(loads, posture, gravity)
