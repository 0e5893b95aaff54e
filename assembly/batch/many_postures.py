"""Problem (22) at many postures, or for many errors, at once.

Compiled from the frames' poses to the certificate
(:mod:`assembly.batch.compiled_energy`): tens of microseconds a point.  A point that
road does not cover, or whose certificate falls short, is solved again by
:mod:`assembly.linear.energy`, and counted.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture
from assembly.linear.closure import VirtualJoints, closure_signs, virtual_joints
from assembly.linear.energy import (
    CannotAssemble,
    solve_assembly,
    without_own_springs,
)
from assembly.linear.rounding import (
    SPREAD,
    closure_rounding,
    drop_zeros,
    stiffness_spread,
)
from assembly.linear.zone import zone_margin
from assembly.model.clearance import clearance_bounds
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.robot import Robot
from assembly.solvers.conic import GAP, GAP_WITHOUT_PLAY, SolverFailed
from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

    from assembly.batch.compiled_reduction import Structure

# which road answered, by the codes of assembly.batch.compiled_energy; those after
# the second handed the point to the slower road, for the reason named
ROADS = (
    "dual Newton", "interior point", "rigid rows", "rank in doubt", "uncertified",
    "bounded joint",
)  # fmt: skip
_COMPILED = 2


@dataclass(frozen=True, eq=False)
class Energies:
    """Least energies of k points, each with its certificate.

    Attributes:
        energy: (k,) [J] stored; NaN where there is no answer, see ``status``.
        bound: (k,) [J] certified lower bound.
        energy_without_play: (k,) [J] what closing would cost with clearances at zero.
        platform_screw: (k, 6) [rad, m] pose error at the platform's origin, base axes.
        closure_residual: (k,) [rad, reference lengths] largest gap left in a closure.
        clearance_excess: (k,) [-] by how much the worst clearance leaves its cone.
        clearances: (k, nu) in units of the cones of :attr:`joints`; NaN where the
            bound of a passive joint's own motion mattered.
        motions: (k, nq) [rad, m] free motions of :attr:`joints`; NaN likewise.
        multipliers: (k, 6 closures) of the scaled closure rows.
        road: (k,) index into :data:`ROADS`.
        status: (k,) ``"ok"``, ``"cannot assemble"``, or ``"solver failed"`` where
            there is no answer or its certificate falls short.
        reason: (k,) what was said where the status is not ok.
        joints: what may move.
    """

    energy: NDArray
    bound: NDArray
    energy_without_play: NDArray
    platform_screw: NDArray
    closure_residual: NDArray
    clearance_excess: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray
    road: NDArray
    status: NDArray
    reason: NDArray
    joints: VirtualJoints

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        return points_dataset({
            "energy": self.energy,
            "duality_gap": self.gap,
            "energy_without_play": self.energy_without_play,
            "platform_screw": self.platform_screw,
            "closure_residual": self.closure_residual,
            "clearance_excess": self.clearance_excess,
            "status": self.status,
            "reason": self.reason,
        })

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")

    @cached_property
    def gap(self) -> NDArray:
        """(k,) [J] certified: no energy is more than this above the least possible."""
        return np.maximum(0.0, self.energy - self.bound)

    @cached_property
    def certified(self) -> NDArray:
        """(k,) bool: gap <= 1e-8 of the energy + 1e-12 of that without play."""
        allowed = GAP * self.energy + GAP_WITHOUT_PLAY * self.energy_without_play
        return (self.gap <= allowed) & (self.status == "ok")

    def fallbacks(self) -> dict[str, int]:
        """How many points the slower road solved, by reason."""
        return {
            name: int(np.sum(self.road == code))
            for code, name in enumerate(ROADS)
            if code >= _COMPILED and np.any(self.road == code)
        }


def minimise_energies(
    robot: Robot,
    transforms: ArrayLike,
    errors: ArrayLike | None = None,
    mismatch: ArrayLike = 0.0,
    compliant: str = "elastic",
) -> Energies:
    """Close a manipulator at least energy, problem (22), at many points.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base, as of
            :attr:`~assembly.kinematics.posture.Posture.transforms`.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        compliant: ``"elastic"``, or ``"hinged"``: compliant joints turn freely about
            their own axis, see :func:`assembly.linear.closure.virtual_joints`.

    Returns:
        Energies, screws and certificates, in the order given.

    Raises:
        ValueError: a shape does not fit the robot, or a value is not finite.
    """
    from assembly.batch.compiled_energy import Answers, assemble_all

    # writable and in C order, whatever comes: the kernels are compiled for one kind
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count, n = len(T), len(robot.frames)
    errors = robot.errors if errors is None else np.asarray(errors, dtype=float)
    if T.shape != (count, n, 4, 4) or errors.shape not in {(n, 6), (count, n, 6)}:
        raise ValueError(
            f"minimise_energies: transforms have shape {T.shape} and errors "
            f"{errors.shape}, expected (k, {n}, 4, 4) and ({n}, 6) or (k, {n}, 6)"
        )
    if not (np.isfinite(T).all() and np.all(np.abs(errors) <= LARGEST_LENGTH)):
        raise ValueError(
            "minimise_energies: transforms or errors are not all finite, or an error "
            f"is larger than {LARGEST_LENGTH:g} [rad, m]"
        )
    all_errors = np.require(errors.reshape(-1, n, 6), requirements=["C", "W"])
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (count,)).copy()
    joints, structure = structure_of(robot, compliant)
    nu, nq = joints.cones.shape[1], joints.free.shape[1]
    out = Answers(
        np.zeros(count, dtype=np.int64),
        np.zeros(count), np.zeros(count), np.zeros(count), np.zeros((count, 6)),
        np.zeros((count, nu)), np.zeros((count, nq)),
        np.zeros((count, 6 * len(robot.closures))), np.zeros(count),
    )  # fmt: skip
    if stiffness_spread(joints, structure.size) > SPREAD:
        out.road[:] = ROADS.index("uncertified")  # what rounds is for the other road
    else:
        assemble_all(structure, T, all_errors, off, out)
    answers = Energies(
        out.energy, out.bound, out.without_play, out.platform_screw, out.open,
        _excess(out.clearances, structure.starts), out.clearances, out.motions,
        out.multipliers, out.road,
        np.full(count, "ok", dtype=object), np.full(count, "", dtype=object), joints,
    )  # fmt: skip
    for i in np.flatnonzero(out.road >= _COMPILED).tolist():
        # one robot for all where the errors are its own: its columns are kept
        here = all_errors[i if len(all_errors) > 1 else 0]
        own = robot if np.array_equal(here, robot.errors) else robot.with_errors(here)
        posture = Posture(own, np.full(n, np.nan), T[i], float(off[i]))
        _solve_slowly(posture, compliant, answers, i)
    left = answers.closure_residual
    left = left + closure_rounding(all_errors, joints, structure.size)
    drop_zeros(answers.energy, answers.bound, answers.multipliers, left)
    return answers


def _excess(clearances: NDArray, starts: NDArray) -> NDArray:
    """(k,) [-] by how much the worst clearance leaves its cone."""
    if not clearances.shape[1]:
        return np.zeros(len(clearances))
    sizes = np.sqrt(np.add.reduceat(clearances**2, starts[:-1], axis=1))
    return np.maximum(0.0, sizes.max(axis=1) - 1.0)


def _solve_slowly(posture: Posture, compliant: str, answers: Energies, i: int) -> None:
    """Row i of the answers by the slower road."""
    a = answers
    for values in (a.energy, a.bound, a.energy_without_play, a.platform_screw,
                   a.closure_residual, a.clearance_excess, a.clearances, a.motions,
                   a.multipliers):  # fmt: skip
        values[i] = np.nan
    try:
        one = solve_assembly(posture)
        if compliant == "hinged":
            one = without_own_springs(one)
    except CannotAssemble as error:
        a.status[i], a.reason[i] = "cannot assemble", str(error)
        return
    except SolverFailed as error:
        a.status[i], a.reason[i] = "solver failed", str(error)
        return
    a.energy[i] = one.energy
    a.energy_without_play[i] = one.energy_without_play
    a.platform_screw[i] = one.platform_screw
    a.closure_residual[i] = one.closure_residual()
    a.clearance_excess[i] = one.clearance_excess()
    if one.clearances.shape == a.clearances[i].shape:
        a.clearances[i], a.motions[i] = one.clearances, one.motions
    a.bound[i], a.multipliers[i] = one.bound, one.multipliers
    if one.unproved:
        a.status[i], a.reason[i] = "solver failed", one.unproved


@dataclass(frozen=True, eq=False)
class Margins:
    """Zone margins of k points, each with its certificate.

    Attributes:
        margin: (k,) factor on all clearances at which it just assembles; inf where
            none does, NaN where the solver failed.
        bound: (k,) certified lower bound, within 1e-8 of the margin where the compiled
            road answered.
        slower: (k,) bool, solved by :func:`assembly.linear.zone.zone_margin`.
        reason: (k,) what was said where the solver failed, or what of the margin is
            not proved; else empty.
    """

    margin: NDArray
    bound: NDArray
    slower: NDArray
    reason: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        return points_dataset({
            "margin": self.margin,
            "margin_bound": self.bound,
            "reason": self.reason,
        })

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")


def zone_margins(
    robot: Robot, transforms: ArrayLike, compliant: str = "rigid",
    mismatch: ArrayLike = 0.0, errors: ArrayLike | None = None,
) -> Margins:  # fmt: skip
    """Margins of problem (21) at many postures, or for many errors.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        errors: (k, n, 6) [rad, m] geometric errors; the robot's if absent.

    Returns:
        The margins, in the order given.

    Raises:
        ValueError: ``compliant`` is something else.
    """
    from assembly.batch.compiled_zone import all_margins

    if compliant not in {"rigid", "free"}:
        raise ValueError(f"compliant is {compliant!r}, expected 'rigid' or 'free'")
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count, n = len(T), len(robot.frames)
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (count,)).copy()
    joints, structure = structure_of(robot, compliant)
    margin, bound = np.full(count, np.nan), np.full(count, np.nan)
    road, reason = np.ones(count, dtype=np.int64), np.full(count, "", dtype=object)
    own = None if errors is None else np.array(errors, dtype=float)
    if joints.scaled.all() and len(joints.scaled):
        if own is None:
            same = robot.errors.copy()
            all_margins(structure, T, same, off, margin, bound, road)
        else:
            for i in range(count):
                one = slice(i, i + 1)
                all_margins(
                    structure, T[one], own[i], off[one], margin[one],
                    bound[one], road[one],
                )  # fmt: skip
    for i in np.flatnonzero(road).tolist():
        here = robot if own is None else robot.with_errors(own[i])
        posture = Posture(here, np.full(n, np.nan), T[i], float(off[i]))
        margin[i] = bound[i] = np.nan
        try:
            zone = zone_margin(posture, compliant)
        except SolverFailed as error:
            reason[i] = str(error)
            continue
        reason[i] = zone.unproved
        margin[i] = np.inf if zone.margin is None else zone.margin
        bound[i] = np.inf if zone.bound is None else zone.bound
    return Margins(margin, bound, road > 0, reason)


@lru_cache(maxsize=32)
def structure_of(
    robot: Robot, compliant: str = "elastic"
) -> tuple[VirtualJoints, "Structure"]:
    """What may move, and the robot as the compiled roads read it.

    Args:
        robot: any.
        compliant: as for :func:`assembly.linear.closure.virtual_joints`.

    Returns:
        The columns; the same as arrays.
    """
    from assembly.batch.compiled_reduction import Structure

    joints = virtual_joints(robot, compliant)
    on_path = robot.on_path[robot.index(robot.platform)]
    signs = closure_signs(robot).T.astype(float)
    patterns, pattern_of = np.unique(signs, axis=0, return_inverse=True)
    # springs that enter the same closures, and the platform's path, act as one
    spring_frame, springs = _own_columns(joints.elastic)
    acting = np.any(signs[spring_frame] != 0.0, axis=1)
    key = 2 * pattern_of[spring_frame] + on_path[spring_frame]
    order = np.lexsort((np.arange(len(key)), key))
    order = order[acting[order]]
    keys, starts = np.unique(key[order], return_index=True)
    cone_frame, cones = _own_columns(joints.cones)
    free_frame, free = _own_columns(joints.free)
    turns = compliant in {"free", "hinged"}
    bounds = clearance_bounds(robot, "free" if turns else "elastic")
    bounds = bounds[:, [0, 0, 1, 2, 2, 3]]
    free_axis = np.abs(free).argmax(axis=1) if len(free) else np.zeros(0, dtype=int)
    cone_axis = np.abs(cones).argmax(axis=1) if len(cones) else np.zeros(0, dtype=int)
    limit = bounds[free_frame, free_axis]
    cone_count = int(joints.group.max(initial=-1)) + 1
    structure = Structure(
        size_of(robot), robot.index(robot.platform), on_path.astype(float),
        patterns, pattern_of.astype(np.int64),
        np.ascontiguousarray(springs[order]), spring_frame[order], order,
        np.append(starts, len(order)).astype(np.int64), keys // 2,
        (keys % 2).astype(float),
        cone_frame, cone_axis, cones.sum(axis=1),
        np.searchsorted(joints.group, np.arange(cone_count + 1)).astype(np.int64),
        free_frame, free_axis, limit,
    )  # fmt: skip
    return joints, structure


def _own_columns(columns: NDArray) -> tuple[NDArray, NDArray]:
    """Frame and (count, 6) own-axes screw of each column, which has but one frame."""
    blocks = columns.T.reshape(columns.shape[1], len(columns) // 6, 6)
    frame = np.abs(blocks).max(axis=2).argmax(axis=1) if len(blocks) else np.zeros(0)
    frame = frame.astype(np.int64)
    return frame, np.ascontiguousarray(blocks[np.arange(len(blocks)), frame])
