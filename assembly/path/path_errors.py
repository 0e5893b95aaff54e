"""Errors of a robot along a path: deflection, forces and stress due to acceleration.

At each instant, inertia and weight act as static loads, and problem (22) is solved.
Vibration, damping and the inertial forces of the deflection itself are neglected.  This
is valid if the path takes many periods of the first natural vibration, and if the
acceleration is continuous.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.nominal import Target
from forcefit.assembly.kinematics.posture import Posture, together
from forcefit.assembly.kinematics.verdict import verdicts
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.link_stress import stressed_links
from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OK, SINGULAR
from forcefit.assembly.path.beam_inertia import beam_stress
from forcefit.assembly.path.conditions import (
    Covariates,
    check_effects,
    equilibria,
    path_conditions,
)
from forcefit.assembly.path.idle_motions import (
    idle_motions,
    momentum_free_rates,
    with_idle_accelerations,
)
from forcefit.assembly.path.inertial_loads import InertialLoads, inertial_loads
from forcefit.assembly.path.motion import Motion, NotFollowed, follow_path
from forcefit.assembly.path.placing import first_frequency, placed
from forcefit.assembly.path.tangents import check_linear, check_state, compliances
from forcefit.assembly.path.trajectory import Trajectory
from forcefit.assembly.platform_stiffness.vibration import check_masses
from forcefit.assembly.sweeps.targets import goals_of, of_joints
from forcefit.inputs.table import BadInput, nearest
from forcefit.results.display import Figures, html_table, largest, short_repr

ASSUMPTIONS = ("none", "frozen", "free")  # for the pose error bounds, problem (27)
if TYPE_CHECKING:
    import pandas
    import xarray

_BLOCK = 2000  # number of points that are solved and stored together
_BLOCK_OF_TANGENTS = 100  # number of points per block with compliance under load
# names of results that are also known at points without an equilibrium
_GEOMETRIC = {
    "coordinates", "rates", "second_rates", "platform", "platform_velocity",
    "platform_acceleration", "compliance",
}  # fmt: skip
Progress = Callable[[int, int], None]
# function that returns the stored arrays of a block, or computes them
Recall = Callable[..., tuple[NDArray, ...]]


@dataclass(frozen=True, eq=False)
class PathErrors:
    """Results for a robot with n frames at k instants of a path.

    Attributes:
        robot: the robot with the effects in its file applied.  An elastic foundation is
            an additional frame.
        declared: the robot as defined in its file, without effects applied.
        trajectory: components of the pose over time.
        assumption: assumption for the pose error bounds, problem (27); ``"none"`` for
            no bounds.
        state: state for which the compliance is computed.
        frequency: [Hz] lowest natural frequency along the path; NaN if unknown.
        free: largest number of joint motions that neither the path nor the loop
            closures prescribe.
        arrays: results by name, with k rows each; NaN where the status is not ok.

            - ``coordinates``, ``rates``, ``second_rates`` (k, n): joint coordinates and
              their derivatives
            - ``platform`` (k, 4, 4): pose of the platform
            - ``platform_velocity``, ``platform_acceleration`` (k, 6): motion at its
              origin
            - ``platform_screw`` (k, 6): pose error due to geometric errors and loads
            - ``inertial_screw`` (k, 6): change of the pose error due to accelerations
            - ``energy`` (k,): elastic energy
            - ``wrench`` (k, n, 6): wrench that each body transmits at its tip
            - ``drive_force`` (k, drives): forces of the drives
            - ``stress`` (k, links): largest stress in each link
            - ``compliance`` (k, 6, 6): compliance of the platform
            - ``rotation_error``, ``translation_error`` (k, 2): pose error bounds
        status: (k,) ``"ok"``, or the kind of failure at this instant.
        reason: (k,) error message if the status is not ok.
    """

    robot: Robot
    declared: Robot
    trajectory: Trajectory
    assumption: str
    state: str
    frequency: float
    free: int
    arrays: dict[str, NDArray]
    status: NDArray
    reason: NDArray = field(repr=False)

    __repr__, _repr_html_ = short_repr, html_table

    def _figures(self) -> Figures:
        """Return the quantities that are shown in the short representation."""
        solved = self.status == OK
        return {
            "points": f"{len(self.status)}, {np.count_nonzero(solved)} solved",
            "deflection due to acceleration": f"at most "
            f"{largest(self.inertial[solved])}",
            "path time": f"{self.trajectory.duration:.4g} s, {self.periods:.3g} "
            "periods of the first natural frequency",
        }

    def to_xarray(self) -> "xarray.Dataset":
        """Return an xarray data set over ``time``."""
        from forcefit.assembly.path.dataset import path_dataset

        return path_dataset(self)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a pandas table with a row for each instant."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "time")

    @property
    def inertial(self) -> NDArray:
        """Change of the pose error due to accelerations, (k, 6) [rad, m]."""
        return self.arrays["inertial_screw"]

    @property
    def periods(self) -> float:
        """Duration of the path divided by the first natural period; NaN if unknown."""
        return self.trajectory.duration * self.frequency

    @property
    def drives(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of ``drive_force``."""
        return tuple(self.drive_units)

    @property
    def drive_units(self) -> dict[str, str]:
        """Unit of each drive force, N for prismatic joints and N m for all others."""
        return {
            f.name: "N" if f.joint == "prismatic" else "N m"
            for f in self.robot.frames if f.actuated
        }  # fmt: skip


def path_errors(
    robot: Robot,
    trajectory: Trajectory,
    *,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    assumption: str = "none",
    state: str = "nominal",
    under: Covariates | None = None,
    progress: Progress = lambda done, most: None,
    recall: Recall = lambda compute, *given: compute(),
) -> PathErrors:
    """Compute the errors of a robot along a path, including inertial effects.

    Args:
        robot: robot with masses.
        trajectory: result of :func:`forcefit.assembly.path.trajectory.timed` or
            :func:`~forcefit.assembly.path.trajectory.profiled`.
        load: (6,) [N m, N] constant load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        assumption: assumption for the pose error bounds, problem (27): ``"frozen"`` or
            ``"free"``, or ``"none"`` for no bounds.
        state: state for which the compliance is computed: ``"nominal"``, or
            ``"contact"`` or ``"exact"`` under the loads at each instant.
        under: values of covariates by name, such as ``temperature``, for the effects in
            the robot file.  ``time`` is the time at the first instant.
        progress: function called with the number of solved points and the number of
            all points.
        recall: method of :class:`forcefit.assembly.statistics.replay.Replay`, which
            stores blocks of points.  By default, all blocks are computed.

    Returns:
        The results at all instants.

    Raises:
        BadInput: no body has a mass, an effect is not supported along a path or in this
            state, the robot cannot follow the path, the assumption or the state is
            unknown, or a link has a density and the state is ``"exact"``.
    """
    if assumption not in ASSUMPTIONS:
        hint = nearest(assumption, ASSUMPTIONS)
        raise BadInput(f'--assumption: found "{assumption[:60]}"{hint}')
    check_masses(robot)
    check_effects(robot, under or {})
    check_state(robot, state)
    asked = _Asked(robot, trajectory, load, gravity, assumption, state, under or {})
    start = _conditions(asked, slice(0, 1), _placed(asked, slice(0, 1)))
    check_linear(start, state)
    count, parts = len(trajectory.times), []
    block = _BLOCK if state == "nominal" else _BLOCK_OF_TANGENTS
    progress(0, count)
    for first in range(0, count, block):
        rows = slice(first, min(first + block, count))
        parts.append(_recalled(asked, rows, recall))
        progress(rows.stop, count)
    arrays = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    status, reason = arrays.pop("status"), arrays.pop("reason")
    free = int(arrays.pop("free").max())
    frequency = first_frequency(robot, trajectory, load, gravity, asked.under)
    return PathErrors(
        start.robot, robot, trajectory, assumption, state, frequency, free, arrays,
        status, reason,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Asked:
    """Arguments of :func:`path_errors` that all blocks of points share."""

    robot: Robot
    trajectory: Trajectory
    load: ArrayLike | None
    gravity: ArrayLike | None
    assumption: str
    state: str
    under: Covariates


def _recalled(asked: _Asked, rows: slice, recall: Recall) -> dict[str, NDArray]:
    """Return the stored or computed results of a block of points."""

    def compute() -> tuple[NDArray, ...]:
        solved = _solve(asked, rows)
        texts = [solved.pop(name).astype(str) for name in ("status", "reason")]
        return np.array(list(solved)), *solved.values(), *texts

    names, *values, status, reason = recall(compute, rows.start, rows.stop)
    arrays = dict(zip(names.tolist(), values, strict=True))
    return arrays | {"status": status.astype(object), "reason": reason.astype(object)}


def _solve(asked: _Asked, rows: slice) -> dict[str, NDArray]:
    """Return the results of a block of points."""
    there = _placed(asked, rows)
    conditions = _conditions(asked, rows, there)
    gravity = conditions.gravity
    motion = _followed(asked, rows, conditions.postures)
    idle = idle_motions(motion)
    if idle is not None:
        motion = _followed(
            asked, rows, motion.postures, momentum_free_rates(motion, idle)
        )
        motion = with_idle_accelerations(motion, idle, gravity)
    loads = inertial_loads(motion, gravity)
    still = np.zeros_like(motion.twists)
    at_rest = replace(motion, twists=still, accelerations=still)
    found = equilibria(conditions, loads)
    assembly = found.assembly
    static = equilibria(conditions, inertial_loads(at_rest, gravity)).assembly
    robot, T = conditions.robot, motion.postures.platform
    platform = robot.index(robot.platform)
    wrenches = found.wrenches - loads.at_tips
    out = {
        "coordinates": motion.postures.coordinates,
        "rates": motion.rates,
        "second_rates": motion.second_rates,
        "platform": T,
        "platform_velocity": _at_origin(motion.twists[:, platform], T),
        "platform_acceleration": np.hstack([
            motion.accelerations[:, platform, :3],
            motion.acceleration_of(platform, T[:, :3, 3]),
        ]),
        "platform_screw": assembly.platform_screw,
        "inertial_screw": assembly.platform_screw - static.platform_screw,
        "energy": assembly.energy,
        "wrench": wrenches,
        "drive_force": _drive_forces(robot, found.joint_wrenches),
        "stress": _stresses(robot, loads, wrenches),
        "compliance": compliances(conditions, asked.state, loads),
    }
    if asked.assumption != "none":
        bounds = bound_pose_error(assembly, asked.assumption)
        out["rotation_error"] = bounds.rotation_error
        out["translation_error"] = bounds.translation_error
    status, reason = _statuses(assembly, _verdicts(asked, rows, there))
    for name in out.keys() - _GEOMETRIC:
        out[name] = np.array(out[name], dtype=float)
        out[name][status != OK] = np.nan
    free = np.full(len(status), motion.free)
    return out | {"status": status, "reason": reason, "free": free}


def _placed(asked: _Asked, rows: slice) -> Posture:
    """Return the postures of a block of points."""
    path, values = asked.trajectory, asked.trajectory.values[rows]
    postures, reasons = placed(asked.robot, path.names, values)
    for i, reason in enumerate(reasons):
        if reason:
            raise BadInput(f"path at {path.times[rows][i]:.6g} s: {reason}")
    return together([one for one in postures if one is not None])


def _conditions(asked: _Asked, rows: slice, there: Posture) -> Conditions:
    """Return the conditions at a block of points."""
    times = asked.trajectory.times
    return path_conditions(
        asked.robot, there, times[rows] - times[0], asked.load, asked.gravity,
        asked.under,
    )  # fmt: skip


def _verdicts(asked: _Asked, rows: slice, there: Posture) -> list[tuple[str, str]]:
    """Return the status of each posture, and the reason if it is not ok."""
    names = asked.trajectory.names
    goals = goals_of(names, asked.robot, asked.trajectory.values[rows])
    target = Target(coordinates=goals) if of_joints(names) else Target(goals)
    return verdicts(asked.robot, target, there.coordinates, there.transforms)


def _followed(
    asked: _Asked, rows: slice, postures: Posture, idle: NDArray | float = 0.0
) -> Motion:
    """Return the motion at a block of points."""
    path = asked.trajectory
    at = path.values[rows], path.first[rows], path.second[rows]
    try:
        return follow_path(postures, path.names, at, idle)
    except NotFollowed as error:
        raise BadInput(
            f"path at {path.times[rows][error.row]:.6g} s: found a singular posture, "
            "in which the platform cannot move with the velocity and acceleration of "
            "the path; expected a path without singular postures"
        ) from None


def _statuses(
    assembly: Assembly, verdict: list[tuple[str, str]]
) -> tuple[NDArray, NDArray]:
    """Return the status of each point, and the reason if it is not ok."""
    status, reason = assembly.status.astype(object), assembly.reason.astype(object)
    for i, (geometric, why) in enumerate(verdict):
        if geometric and (status[i] == OK or geometric == SINGULAR):
            status[i], reason[i] = geometric, why
    return status, reason


def _at_origin(twists: NDArray, T: NDArray) -> NDArray:
    """Return twists (k, 6) at the platform's origin."""
    moved = twists.copy()
    moved[:, 3:] += np.cross(twists[:, :3], T[:, :3, 3])
    return moved


def _drive_forces(robot: Robot, joint_wrenches: NDArray) -> NDArray:
    """Return the force of each drive on the body that it moves, (k, drives)."""
    driven = [i for i, f in enumerate(robot.frames) if f.actuated]
    screws = np.array([own_screw(robot.frames[i]) for i in driven]).reshape(-1, 6)
    forces: NDArray = -np.einsum("kdi,di->kd", joint_wrenches[:, driven], screws)
    return forces


def _stresses(robot: Robot, loads: InertialLoads, tips: NDArray) -> NDArray:
    """Return the largest stress in each link with a stress model, (k, links) [Pa]."""
    links = stressed_links(robot)
    stress = np.full((len(tips), len(links)), np.nan)
    solved = np.isfinite(tips).all(axis=(1, 2))
    for column, link in enumerate(links):
        tip = tips[solved, link.row]
        load = loads.beams.get(link.row)
        if load is None:
            stress[solved, column] = link.peak(tip)
        else:
            frame = robot.frames[link.row]
            stress[solved, column] = beam_stress(frame, load.rows(solved), tip)
    return stress
