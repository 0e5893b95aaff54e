r"""Minimum-energy assembly with finite motions and loop closure on SE(3).

Springs, clearances and geometric errors are those of the linear virtual-joint model
(:mod:`forcefit.assembly.linear.energy`), but motions are finite
(:mod:`forcefit.assembly.exact.finite_robot`).  The elastic energy minus the work of the
loads is minimised,

    minimise  |y|^2 / 2 - w . x_p(y, u, q) - W(y, u, q)
    subject to  r(y, u, q) = 0,   |u_k| <= 1 for each cone k.

The iteration starts from the linear solution.  Its steps are described in
:mod:`forcefit.assembly.exact.descent`.

======  ====================  ========  ==============================================
symbol  code                  shape     meaning
======  ====================  ========  ==============================================
x_p     ``platform_screw``    (6,)      rotation vector of R R_nominal^T and shift of
                                        the platform's origin, base axes
w       ``load``              (6,)      dead force, and moment m with the work m . theta
W       ``loads``             [J]       work of weights and of loads on bodies
r       ``closure_residual``  (6 K,)    logarithm of the gap in each loop
======  ====================  ========  ==============================================

The solution is a local minimum, because the problem is not convex.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.exact.dead_load import (
    DeadLoads,
    dead_loads,
    distributed_at_tips,
    work_of,
    wrenches_on_frames,
)
from forcefit.assembly.exact.descent import (
    CLOSED,
    LONGEST_STEP,
    Expansion,
    NotConverged,
    advance,
    energy_of,
    expand,
    potential,
    problem_name,
)
from forcefit.assembly.exact.equilibrium import imbalance, least_curvature
from forcefit.assembly.exact.finite_robot import CLEARANCE, LINK, SPRING, FiniteRobot
from forcefit.assembly.exact.placement import Placement, place
from forcefit.assembly.kinematics.closure_rates import closure_signs
from forcefit.assembly.kinematics.pieces import CutRobot, cut_beams
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.se3 import inverse, logarithm
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import VirtualJoints, virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.rounding import differs_from_zero
from forcefit.assembly.model.clearance import (
    clearance_bounds,
    clearance_components,
    clearance_excess,
    has_bounded_motion,
)
from forcefit.assembly.model.given_load import Load, given_load
from forcefit.assembly.model.links import own_screws
from forcefit.assembly.solvers.cones import into_cones
from forcefit.assembly.solvers.method import Method, check_method
from forcefit.results.display import Figures, html_table, short_repr, show
from forcefit.results.text import forced_lines
from forcefit.stiffness.screws import rotation_matrix, screw_map, transform

if TYPE_CHECKING:
    import pandas
    import xarray

_STEPS = 160  # maximum number of steps
_NEAR = 1e-2  # [-] largest predicted decrease at which Newton's method is tried
_DECREMENT = 1e-14  # [-] convergence tolerance on the predicted relative decrease
# number of steps after which the step length is no longer a convergence criterion
_RESTLESS = 100
_STILL = 1e-9  # [rad, reference lengths] convergence tolerance on the step
_STATIONARY = 1e-7  # [-] largest accepted relative force residual
_ROUNDING = 1e-30  # [J] round-off of the energy


@dataclass(frozen=True, eq=False)
class LinearisationError:
    """Difference between the linear and the exact result.

    Attributes:
        rotation: (3,) [rad] difference of the platform's rotation.
        translation: (3,) [m] difference of the displacement of the platform's origin.
        energy: [J] difference of the energy.
        relative_energy: [-] energy difference relative to the exact energy.
    """

    rotation: NDArray
    translation: NDArray
    energy: float
    relative_energy: float


@dataclass(frozen=True, eq=False)
class ExactAssembly:
    """Equilibrium of a manipulator assembled with finite motions.

    The equilibrium is a local minimum if ``least_curvature`` is positive.  A lower
    minimum may exist elsewhere.

    Attributes:
        whole: the robot's nominal configuration, with each beam as one link.
        cut: the robot with beams divided into elements, and the map between both.
        linear: solution of the linear model, from which the iteration starts.
        expansion: expansion of the problem at the solution.
        stationarity: [-] largest relative force residual of all unknowns.
        iterations: number of steps.
        method: method for all cone programs, ``"compiled"`` or ``"reference"`` (numpy
            and Clarabel).
    """

    whole: Posture
    cut: CutRobot
    linear: Assembly
    expansion: Expansion
    stationarity: float
    iterations: int
    method: Method

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr
    plot = show

    def _figures(self) -> Figures:
        """Return the quantities that are shown in the short representation."""
        return {
            **forced_lines(self),
            "certificate": f"closure residual {self.closure_residual():.1e}, "
            f"equilibrium residual {self.stationarity:.1e}; {self.iterations} "
            "iterations",
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Return an xarray data set with the results of all frames and closures."""
        from forcefit.assembly.model.tables import assembly_dataset

        return assembly_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with a row for each frame."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "frame")

    @property
    def placement(self) -> Placement:
        """Displaced positions of all frames."""
        return self.expansion.placement

    @property
    def load(self) -> NDArray:
        """Wrench on the platform at its origin, base axes, (6,) [N m, N]."""
        return self.linear.load

    @property
    def loads(self) -> DeadLoads:
        """All loads on the robot."""
        return self.expansion.loads

    @property
    def multipliers(self) -> NDArray:
        """Multipliers of the scaled loop-closure equations, (6 closures,)."""
        return self.expansion.multipliers

    @cached_property
    def least_curvature(self) -> float:
        """Smallest curvature of the potential [J/rad^2]; positive if stable."""
        return least_curvature(self.expansion)

    @property
    def posture(self) -> Posture:
        """Nominal configuration of the robot."""
        return self.whole

    @cached_property
    def energy(self) -> float:
        """Elastic energy [J], or 0 if it does not exceed the round-off."""
        energy, residual = energy_of(self.placement), self.closure_residual()
        differs = differs_from_zero(energy, 0.0, self.multipliers, residual)
        return energy if differs else 0.0

    @property
    def potential(self) -> float:
        """Elastic energy minus the work of the loads [J]."""
        return potential(self.placement, self.loads)

    @property
    def platform_screw(self) -> NDArray:
        """Rotation vector of R R_nominal^T and shift of the origin, base axes, (6,)."""
        return self.placement.platform_screw

    @property
    def transforms(self) -> NDArray:
        """Frames in the base frame, before the motion of their joint, (n, 4, 4)."""
        return self.placement.transforms[self.cut.last]

    @cached_property
    def link_screws(self) -> NDArray:
        """Deformation of each body, (n, 6) [rad, m].

        The deformation of a beam is the screw of its tip relative to its base.
        """
        screws = self.placement.screws[LINK, self.cut.last]
        pieces = np.bincount(self.cut.owner)
        for i in np.flatnonzero(pieces > 1):
            parent = self.whole.robot.parents[i]
            base = self.placement.carried[self.cut.last[parent]]
            error = self.whole.robot.errors[i]
            rigid = self.whole.robot.fixed_transforms[i] @ transform(
                error[3:], rotation_matrix(error[:3])
            )
            rigid = base @ rigid if parent >= 0 else rigid
            bent = inverse(rigid) @ self.placement.body_ends[self.cut.last[i]]
            screws[i] = logarithm(bent)
        return screws

    @property
    def joint_screws(self) -> NDArray:
        """Elastic deformation of each joint, (n, 6) [rad, m]."""
        return self.placement.screws[SPRING, self.cut.last]

    @cached_property
    def clearance_screws(self) -> NDArray:
        """Motion within the clearance and motion of passive joints, (n, 6) [rad, m]."""
        screws = self.placement.screws[CLEARANCE, self.cut.last]
        own = self.placement.own[self.cut.last, None]
        return screws + own * own_screws(self.posture.robot)

    @cached_property
    def closure_wrenches(self) -> NDArray:
        """Wrench of each closure's second chain on its first chain.

        Shape (closures, 6) [N m, N], at the platform's nominal origin, base axes.
        """
        return self.multipliers.reshape(-1, 6) * self.placement.model.scale

    @property
    def wrenches(self) -> NDArray:
        """Wrench of each link, K_E times its deformation, (n, 6) [N m, N].

        The reference point is the origin of the displaced frame; axes of the frame.
        """
        return self._through[0]

    @property
    def tip_wrenches(self) -> NDArray:
        """Wrench of the next body on the tip of each body, (n, 6) [N m, N]."""
        own = distributed_at_tips(self.placement, self.loads)
        return self.wrenches - own[self.cut.last]

    @property
    def joint_wrenches(self) -> NDArray:
        """Wrench in each joint, (n, 6) [N m, N].

        It differs from :attr:`tip_wrenches` by the loads on the body of the frame.
        """
        return self._through[1]

    @cached_property
    def _through(self) -> NDArray:
        """Wrenches in bodies and joints, (2, n, 6) [N m, N]."""
        robot, T = self.cut.robot, self.placement.transforms
        closing = closure_signs(robot).T @ self.closure_wrenches
        of_loads = wrenches_on_frames(self.placement, self.loads)
        readings = screw_map(T[:, :3, 3] - self.posture.platform[:3, 3], T[:, :3, :3])
        through = np.einsum("nji,knj->kni", readings, closing + np.stack(of_loads))
        return through[:, self.cut.last]

    @cached_property
    def linearisation_error(self) -> LinearisationError:
        """Difference between the linear and the exact result."""
        screw = self.linear.platform_screw - self.platform_screw
        energy = self.linear.energy - self.energy
        # inside an assembly zone, both energies are round-off
        scale = max(self.energy, 1e-6 * self.linear.energy_without_clearance, _ROUNDING)
        return LinearisationError(screw[:3], screw[3:], energy, energy / scale)

    def closure_residual(self) -> float:
        """Return the largest loop-closure residual [rad, reference lengths]."""
        return float(np.abs(self.placement.residual).max(initial=0.0))

    def clearance_excess(self) -> float:
        """Return the largest relative amount [-] by which a clearance is exceeded."""
        robot = self.posture.robot
        bounded = clearance_components(robot, self.clearance_screws)
        return float(clearance_excess(bounded, clearance_bounds(robot)))


def solve_exact(
    posture: Posture,
    load: Load | None = None,
    start: Assembly | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    point: ArrayLike = (0.0, 0.0, 0.0),
    near: ExactAssembly | None = None,
    progress: Callable[[int, int], None] = lambda done, most: None,
    method: Method = "compiled",
) -> ExactAssembly:
    """Compute the equilibrium of a manipulator with finite motions.

    The iteration starts from the solution of the linear model.

    Args:
        posture: configuration of the robot, with its errors, clearances, links and
            joint springs.
        load: (6,) [N m, N] wrench on the platform at ``point``, base axes; or a mapping
            of components such as ``{"fz": -50}``.  The force is a dead load.  The work
            of the moment is its scalar product with the rotation vector.
        start: linear solution for the same posture and loads.  By default, it is
            computed.
        bodies: (n, 6) [N m, N] dead loads on the body of each frame, at the origin of
            the frame, base axes.
        gravity: (3,) [m/s^2] gravity vector in base axes.
        point: (3,) [m] point of application of ``load``, in platform axes.
        near: equilibrium of the same posture under another load, used as the initial
            guess.
        progress: function called with the number of completed steps and the maximum
            number of steps.
        method: method for the linear solution and for each step, ``"compiled"`` or
            ``"reference"`` (numpy and Clarabel).

    Returns:
        The equilibrium.

    Raises:
        CannotAssemble: the linear model has no solution.
        FreeMotion: a load acts on a motion without stiffness.
        NotConverged: no equilibrium was found near the linear solution.  The class is
            derived from :class:`SolverFailed`.
        ValueError: ``start`` belongs to another posture or other loads, the method is
            unknown, or the method is ``"reference"`` and ``start`` or ``near`` was
            computed by the compiled method.
    """
    check_method(method)
    if method == "reference":
        _refuse_compiled(start, near)
    cut = cut_beams(posture.robot)
    load = np.zeros(6) if load is None else given_load(load)
    wrench = load.copy()
    wrench[:3] += np.cross(posture.platform[:3, :3] @ np.asarray(point), wrench[3:])
    if start is not None and (
        start.posture is not posture or not start.has_loads(wrench, bodies, gravity)
    ):
        raise ValueError(
            "solve_exact: start: found the linear solution of another posture "
            "or load, expected the solution for this posture and load; omit start, "
            "and it is computed"
        )
    placed = posture
    if cut.robot is not posture.robot:
        placed, start = cut.cut(posture), None
        bodies = None if bodies is None else cut.spread(np.asarray(bodies))
    loads = dead_loads(placed, load, bodies, gravity, point)
    if start is None:
        start = solve_assembly(placed, wrench, bodies, gravity, method=method)

    def search(joints: VirtualJoints) -> ExactAssembly:
        known = near is not None and len(near.placement.x) == _count(joints)
        first = near.placement.x if near is not None and known else None
        found = _search(joints, start, loads, first, progress, method)
        return ExactAssembly(posture, cut, start, *found, method)

    assembly = search(start.joints)
    if assembly.clearance_excess() > 1e-9 and has_bounded_motion(posture.robot):
        # solve again with the motion limits of passive joints, because one is exceeded
        assembly = search(virtual_joints(cut.robot, bounded_motion=True))
    return assembly


def _refuse_compiled(*starts: Assembly | ExactAssembly | None) -> None:
    """Raise ValueError if a start of the reference method is a compiled solution."""
    if any(start is not None and start.method != "reference" for start in starts):
        raise ValueError(
            "solve_exact: start or near: found a solution of the compiled "
            "method, expected a solution of method 'reference'; omit it, and it is "
            "computed"
        )


def _count(joints: VirtualJoints) -> int:
    """Return the number of springs, clearance motions and free motions."""
    return sum(part.shape[1] for part in (joints.elastic, joints.cones, joints.free))


def _search(
    joints: VirtualJoints, linear: Assembly, loads: DeadLoads, first: NDArray | None,
    progress: Callable[[int, int], None], method: Method,
) -> tuple[Expansion, float, int]:  # fmt: skip
    """Return the expansion at an equilibrium, its force residual and step count."""
    model = FiniteRobot(linear.posture, joints)
    current = place(model, _first_guess(model, linear) if first is None else first)
    rigid = np.zeros(len(current.residual))
    penalty, damping, near = 0.0, 0.0, False
    for count in range(1, _STEPS + 1):
        progress(count, _STEPS)
        local = expand(current, loads, rigid)
        penalty = max(penalty, 2.0 * float(np.linalg.norm(local.multipliers)))
        step = advance(local, penalty, damping, near, method)
        current, rigid, damping = step.placement, step.rigid, step.damping
        scale = max(_energy_scale(current, linear, loads), local.small_energy)
        near = step.decrement <= _NEAR * scale
        still = damping == 0.0 and step.length <= _STILL
        still = still or abs(step.decrement) <= _DECREMENT * scale or count > _RESTLESS
        if still and current.largest_gap <= CLOSED + linear.posture.mismatch:
            last = expand(current, loads, rigid)
            if imbalance(last) <= _STATIONARY:
                return last, imbalance(last), count
    unbalanced = imbalance(expand(current, loads, rigid))
    raise NotConverged(
        problem_name(current, loads),
        f"after {_STEPS} steps, the relative loop-closure residual is "
        f"{current.largest_gap:.2g} and the relative force residual is "
        f"{unbalanced:.2g}",
    )


def _first_guess(model: FiniteRobot, linear: Assembly) -> NDArray:
    """Return the linear solution with clearances projected onto their cones, (N,)."""
    motions = np.hstack([model.joints.cones, model.joints.free])
    screws = clearance_components(linear.posture.robot, linear.clearance_screws)
    moved = motions.T @ screws.ravel() / np.sum(motions**2, axis=0)
    x = np.concatenate([linear.elastic, moved])
    turned = np.linalg.norm(place(model, x).screws[..., :3], axis=-1)
    x *= LONGEST_STEP / turned.max(initial=LONGEST_STEP)
    x[model.bounded] = into_cones(x[model.bounded], model.joints.group)
    return x


def _energy_scale(at: Placement, linear: Assembly, loads: DeadLoads) -> float:
    """Return a typical energy [J], to which tolerances are relative."""
    return max(
        energy_of(at), abs(work_of(at, loads)), 1e-3 * linear.energy_without_clearance
    )
