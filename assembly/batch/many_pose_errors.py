"""Bounds of the pose error, problem (27), at many postures or for many errors at once.

Compiled from the solutions of (22) to the brackets
(:mod:`assembly.batch.compiled_reach`): some tenths of a millisecond a point.  A point
that this does not cover falls back to :mod:`assembly.linear.pose_error`, and is
counted; reading ``budget`` always does.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.batch.many_postures import Energies, minimise_energies
from assembly.batch.robot_structure import structure_of
from assembly.kinematics.posture import Posture
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.pose_error import PoseError, bound_pose_error
from assembly.linear.reach import READINGS
from assembly.model.robot import Robot
from assembly.solvers.conic import SolverFailed
from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

    from assembly.batch.compiled_reach import ClearanceLoads
    from assembly.batch.compiled_reduction import Structure


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Certified bounds of the largest pose errors of k points.

    Attributes:
        rotation_error: (k, 2) [rad] lower and upper; NaN without a solution of (22).
        translation_error: (k, 2) [m] likewise.
        rotation_screw: (k, 6) [rad, m] attains the lower bound of the rotation.
        translation_screw: (k, 6) [rad, m] attains that of the translation.
        supports: (k,) support functions computed.
        fallback: (k,) bool, solved by
            :func:`assembly.linear.pose_error.bound_pose_error`.
        status: (k,) ``"ok"``, ``"cannot assemble"``, or ``"solver failed"`` where
            there is no solution or its certificate falls short.
        reason: (k,) message where the status is not ok.
    """

    rotation_error: NDArray
    translation_error: NDArray
    rotation_screw: NDArray
    translation_screw: NDArray
    supports: NDArray
    fallback: NDArray
    status: NDArray
    reason: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        return points_dataset({
            "rotation_error": self.rotation_error,
            "translation_error": self.translation_error,
            "rotation_screw": self.rotation_screw,
            "translation_screw": self.translation_screw,
            "status": self.status,
            "reason": self.reason,
        })

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")


def bound_pose_errors(
    robot: Robot,
    transforms: ArrayLike,
    reading: str = "frozen",
    errors: ArrayLike | None = None,
    mismatch: ArrayLike = 0.0,
    energies: Energies | None = None,
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
) -> PoseErrors:
    """Bracket the largest rotation and translation errors at many points.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        reading: ``"frozen"``, ``"free"`` or ``"budget"``, see
            :mod:`assembly.linear.pose_error`.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        energies: of :func:`assembly.batch.many_postures.minimise_energies` for the same
            arguments, if known.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point whose error is meant.

    Returns:
        The bounds, in the order given.

    Raises:
        ValueError: the reading is unknown, or a shape does not fit the robot.
    """
    from assembly.batch.compiled_reach import FALLBACK, SOLVED, Bounds, bound_all

    if reading not in READINGS:
        raise ValueError(f"reading is {reading!r}, expected one of {READINGS}")
    if energies is None:
        energies = minimise_energies(robot, transforms, errors, mismatch)
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count = len(T)
    if len(energies.energy) != count:
        raise ValueError(
            f"bound_pose_errors: energies of {len(energies.energy)} points, expected "
            f"{count}, one for each of the transforms"
        )
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (count,)).copy()
    tolerance = np.array([tolerance_rotation, tolerance_translation], dtype=float)
    bounds = Bounds(
        rotation=np.full((count, 2), np.nan),
        translation=np.full((count, 2), np.nan),
        rotation_screw=np.full((count, 6), np.nan),
        translation_screw=np.full((count, 6), np.nan),
        supports=np.zeros(count, np.int64),
        outcome=np.full(count, SOLVED, np.int64),
    )
    solved = energies.status == "ok"
    bounds.outcome[~np.isfinite(energies.clearances).all(axis=1)] = FALLBACK
    bounds.outcome[~solved] = FALLBACK
    if reading == "budget":
        bounds.outcome[:] = FALLBACK
    else:
        structure, column_of, loads = _clearance_loads(
            robot, T, reading, errors, off, energies, bounds.outcome
        )
        bound_all(
            structure, T, off, energies.platform_screw.copy(),
            np.ascontiguousarray(energies.clearances[:, column_of]),
            _motions(robot, structure, energies), loads,
            np.asarray(offset, dtype=float).copy(), tolerance, bounds,
        )  # fmt: skip
    pose_errors = PoseErrors(
        rotation_error=bounds.rotation,
        translation_error=bounds.translation,
        rotation_screw=bounds.rotation_screw,
        translation_screw=bounds.translation_screw,
        supports=bounds.supports,
        fallback=(bounds.outcome == FALLBACK) & solved,
        status=energies.status.copy(),
        reason=energies.reason.copy(),
    )
    options = {
        "energy_budget": energy_budget, "tolerance_rotation": tolerance_rotation,
        "tolerance_translation": tolerance_translation, "offset": offset,
    }  # fmt: skip
    own = robot.errors if errors is None else np.asarray(errors, dtype=float)
    for i in np.flatnonzero(pose_errors.fallback).tolist():
        of_point = own if own.ndim == 2 else own[i]
        same = np.array_equal(of_point, robot.errors)
        erring = robot if same else robot.with_errors(of_point)
        posture = Posture(
            erring, np.full(len(robot.frames), np.nan), T[i], float(off[i])
        )
        _bound_fallback(posture, reading, options, pose_errors, i)
    return pose_errors


def _bound_fallback(
    posture: Posture, reading: str, options: Mapping, bounds: PoseErrors, i: int
) -> None:
    """Row i of the bounds by the fallback."""
    try:
        one = bound_pose_error(solve_assembly(posture), reading, **options)
    except CannotAssemble as error:
        bounds.status[i], bounds.reason[i] = "cannot assemble", str(error)
        return
    except SolverFailed as error:
        bounds.status[i], bounds.reason[i] = "solver failed", str(error)
        return
    _store(one, bounds, i)
    if one.unproved:
        bounds.status[i], bounds.reason[i] = "solver failed", one.unproved


def _store(one: PoseError, bounds: PoseErrors, i: int) -> None:
    """Bounds of one point as row i."""
    bounds.rotation_error[i] = one.rotation_error
    bounds.translation_error[i] = one.translation_error
    bounds.rotation_screw[i] = one.rotation_screw
    bounds.translation_screw[i] = one.translation_screw
    bounds.supports[i] = one.cuts


def _clearance_loads(
    robot: Robot, T: NDArray, reading: str, errors: ArrayLike | None, off: NDArray,
    energies: Energies, outcome: NDArray,
) -> tuple["Structure", NDArray, "ClearanceLoads"]:  # fmt: skip
    """What may move, its clearances' columns in (22), and the loads on them."""
    from assembly.batch.compiled_reach import FALLBACK, ClearanceLoads

    _, moving = structure_of(robot, "free" if reading == "free" else "rigid")
    loaded, solution = structure_of(robot)[1], energies
    if reading == "free":
        # turning about the own axis costs nothing here: a clearance is held only if it
        # stays loaded without those soft springs
        loaded = structure_of(robot, "hinged")[1]
        solution = minimise_energies(robot, T, errors, off, "hinged")
        outcome[~np.isfinite(solution.clearances).all(axis=1)] = FALLBACK
    column_of = _places(_cones(moving), _cones(structure_of(robot)[1]))
    places = _places(_cones(moving), _cones(loaded))
    cone_of = np.searchsorted(loaded.starts, places, side="right") - 1
    loads = ClearanceLoads(
        structure=loaded,
        multipliers=solution.multipliers,
        clearances=solution.clearances,
        energy=solution.energy,
        without_clearance=solution.energy_without_clearance,
        cone_of=cone_of[moving.starts[:-1]].astype(np.int64),
    )
    return moving, column_of, loads


def _motions(robot: Robot, moving: "Structure", energies: Energies) -> NDArray:
    """(k, nq) [rad, m] free motions of (22) where they have a bound, 0 elsewhere."""
    motions = np.zeros((len(energies.motions), len(moving.free_bound)))
    bounded = np.flatnonzero(np.isfinite(moving.free_bound))
    places = zip(moving.free_frame[bounded], moving.free_axis[bounded], strict=True)
    structure = structure_of(robot)[1]
    among = zip(structure.free_frame, structure.free_axis, strict=True)
    motions[:, bounded] = energies.motions[:, _places(places, among)]
    return motions


def _cones(structure: "Structure") -> Iterable[tuple[int, int]]:
    """Frame and axis of every clearance."""
    return zip(structure.cone_frame, structure.cone_axis, strict=True)


def _places(
    some: Iterable[tuple[int, int]], among: Iterable[tuple[int, int]]
) -> NDArray:
    """Columns in another reading of the same frames and axes."""
    place = {(int(j), int(axis)): i for i, (j, axis) in enumerate(among)}
    return np.array([place[int(j), int(axis)] for j, axis in some], dtype=np.int64)
