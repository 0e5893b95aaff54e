"""Minimum energy needed to close a manipulator, problem (22), at one or many points.

The compiled method (:mod:`forcefit.assembly.linear.lanes`) computes all steps from the
poses of the frames to the certificate, with and without loads.  The reference method
(:mod:`forcefit.assembly.linear.reference`) solves points that the compiled method does
not cover or cannot certify.  The field ``method`` of the result contains the method.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture, together
from forcefit.assembly.linear.assembled import Assembly, all_loads
from forcefit.assembly.linear.certificate import unproved
from forcefit.assembly.linear.closure import (
    VirtualJoints,
    checked_size,
    linearise,
    virtual_joints,
)
from forcefit.assembly.linear.lanes import assemble_side_by_side
from forcefit.assembly.linear.load import FrameLoads, driven, no_loads
from forcefit.assembly.linear.reference.energy import CannotAssemble, least_energy
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.linear.robot_structure import Structure, structure_of
from forcefit.assembly.linear.rounding import (
    SPREAD,
    closure_rounding,
    drop_zeros,
    stiffness_spread,
)
from forcefit.assembly.linear.solution import with_known
from forcefit.assembly.model.given_load import Load, given_load
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import (
    CANNOT_ASSEMBLE,
    NO_EQUILIBRIUM,
    OK,
    SOLVER_FAILED,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import Method, check_method, log_reference

__all__ = ["Assembly", "CannotAssemble", "solve_assembly"]

# Outcome codes of assembly/kernels/linear/energies.h. For codes >= _LEFT, the kernel
# has no result. The codes _AT_BOUNDS can be due to an omitted motion limit.
_LEFT, _AT_BOUNDS = 2, (5, 6)
_STATUS: dict[type[Exception], str] = {
    CannotAssemble: CANNOT_ASSEMBLE,
    FreeMotion: NO_EQUILIBRIUM,
    SolverFailed: SOLVER_FAILED,
}
_NUMBERS = ("energy", "bound", "tight", "work", "residual", "excess")
_VECTORS = ("clearances", "motions", "multipliers", "elastic")
# result arrays of k points by name; "tight" is the energy without clearance
_Rows = dict[str, NDArray]


@overload
def solve_assembly(
    posture: Posture, load: Load | None = None, bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None, errors: None = None, method: Method = "compiled",
    carried: ArrayLike | None = None,
) -> Assembly[float]: ...  # fmt: skip


@overload
def solve_assembly(
    posture: Sequence[Posture], load: Load | None = None,
    bodies: ArrayLike | None = None, gravity: ArrayLike | None = None,
    errors: ArrayLike | None = None, method: Method = "compiled",
    carried: ArrayLike | None = None,
) -> Assembly[NDArray]: ...  # fmt: skip


@overload
def solve_assembly(
    posture: Posture, load: Load | None = None, bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None, *, errors: ArrayLike,
    method: Method = "compiled", carried: ArrayLike | None = None,
) -> Assembly[NDArray]: ...  # fmt: skip


def solve_assembly(
    posture: Posture | Sequence[Posture],
    load: Load | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    errors: ArrayLike | None = None,
    method: Method = "compiled",
    carried: ArrayLike | None = None,
) -> Assembly:
    """Close a manipulator with minimum energy, problem (22), under optional loads.

    Args:
        posture: configuration of a robot, including its errors, clearances, links and
            joint springs; or a sequence of k postures of one robot.
        load: (6,) or (k, 6) [N m, N] wrench on the platform at its origin, base axes;
            or a mapping of components such as ``{"fz": -50}``.  Under a load, the
            energy minus the work of the load is minimised.
        bodies: (n, 6) or (k, n, 6) [N m, N] wrenches on the bodies of all frames, each
            at its frame's origin, base axes.
        gravity: (3,) or (k, 3) [m/s^2] gravity vector in base axes.  It acts on links
            with a density and on bodies with a mass.
        errors: (k, n, 6) [rad, m] geometric errors that replace those of the robot: one
            set for each of k postures, or k sets at one posture.
        method: ``"compiled"`` falls back on the reference method for points that the
            compiled method cannot certify; ``"reference"`` uses only numpy and
            Clarabel.  The field ``method`` of the result contains the method used for
            each point.
        carried: (n, 6) or (k, n, 6) [N m, N] wrenches on the bodies that the joints of
            all frames carry, each at its frame's origin, base axes.

    Returns:
        The assembled manipulator.  Use
        :func:`forcefit.assembly.linear.certificate.unproved` to list the properties
        that remain unproved.  For many postures or sets of errors, one object contains
        all points.  A point without a solution does not raise an exception; instead,
        the field ``reason`` contains the message.

    Raises:
        CannotAssemble: clearances and springs cannot close the loops.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver did not converge.
        ValueError: the errors do not fit the robot or the postures, a transform is not
            finite, an error exceeds 1e6 rad or m, or ``method`` is unknown.
    """
    check_method(method)
    if not isinstance(posture, Posture):
        posture = together(posture)
    if isinstance(load, Mapping):
        load = given_load(load)
    loads = no_loads(posture.robot.errors.size)
    given = any(one is not None for one in (load, bodies, gravity, carried))
    if given or driven(posture.robot):
        loads = all_loads(posture, load, bodies, gravity, carried)
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    if posture.transforms.ndim == 3 and errors is None and loads.body.ndim == 1:
        return _solve_one(posture, wrench, loads, method)
    sets = None if errors is None else np.asarray(errors, dtype=float)
    return _solve_many(posture, sets, wrench, loads, False, method)


def with_free_own_axes(assembly: Assembly) -> Assembly:
    """Solve (22) with compliant joints that move freely about their z axis.

    Args:
        assembly: assembly of many points.

    Returns:
        Assembly of the same points under the same loads, see ``own_axes_free`` of
        :func:`forcefit.assembly.linear.closure.virtual_joints`.
    """
    posture, load, loads = assembly.posture, assembly.load, assembly.frame_loads
    return _solve_many(posture, assembly.errors, load, loads, True, "compiled")


def together_at(posture: Posture, points: Sequence[Assembly | Exception]) -> Assembly:
    """Combine separately solved points into one object.

    Args:
        posture: k postures of a robot.  Its springs and clearances may differ from
            those of the individual points.
        points: k assemblies, or the exception raised at a point without a solution.

    Returns:
        Assembly of all points; an index selects one of them.
    """
    joints, count = virtual_joints(posture.robot), len(points)
    rows = _empty(joints, count)
    rows |= {"excess": np.zeros(count)} | _unsaid(count)
    none = no_loads(posture.robot.errors.size)
    many = _of_rows(posture, joints, rows, np.zeros(6), none, None)
    for i, point in enumerate(points):
        _record(rows, many.apart, i, point)
        many.apart[i] = point
    _certify(rows, many)
    return many


def failure_status(error: Exception) -> str:
    """Return the status that corresponds to an exception.

    Args:
        error: :class:`CannotAssemble`, :class:`FreeMotion` or :class:`SolverFailed`.

    Returns:
        The status, as defined in the public format.
    """
    return next(status for kind, status in _STATUS.items() if isinstance(error, kind))


def _solve_one(
    posture: Posture, load: NDArray, loads: FrameLoads, method: Method
) -> Assembly:
    """Solve problem (22) at one posture, by the compiled method if possible."""
    robot = posture.robot
    if method == "reference":
        return least_energy(posture, load, loads)
    rounding, acting = _rounding_of(robot), loads.rows() if loads else None
    # The copy is writable; C++ accesses writable arrays faster.
    T = np.array(posture.transforms, ndmin=4)
    off = np.array([posture.mismatch])
    for bounded in (False, True):
        joints, structure = structure_of(robot, bounded_motion=bounded)
        rows = _compiled(joints, structure, T, robot.errors[None], off, acting)
        if rows["outcome"][0] < _LEFT:
            break
        if bounded or not _bounds_matter(structure, rows["outcome"])[0]:
            log_reference(robot.name, "minimum energy", 1, 1)
            return least_energy(posture, load, loads)
    multipliers, residual = rows["multipliers"], rows["residual"] + rounding
    drop_zeros(rows["energy"], rows["bound"], multipliers, residual, acting is not None)
    if acting is None and not np.count_nonzero(multipliers):
        rows["elastic"][:] = 0.0  # Without wrenches, all deformations are round-off.
    assembly = Assembly(
        linearisation=linearise(posture), joints=joints, load=load, frame_loads=loads,
        method="compiled", energy_without_clearance=float(rows["tight"][0]),
        **{key: rows[key][0] for key in _VECTORS},
    )  # fmt: skip
    known = {key: rows[key][0] for key in ("energy", "platform_screw")}
    return with_known(assembly, known)


@lru_cache(maxsize=32)  # called for one robot at many postures
def _rounding_of(robot: Robot) -> float:
    """Return the closure error that round-off can cause [rad, reference lengths]."""
    joints, _ = structure_of(robot)
    return float(closure_rounding(robot.errors, joints, checked_size(robot)))


def _solve_many(
    posture: Posture, errors: NDArray | None, load: NDArray, loads: FrameLoads,
    own_axes_free: bool, method: Method,
) -> Assembly:  # fmt: skip
    """Solve all points; use the reference method where the compiled method fails."""
    robot = posture.robot
    T, sets, off = _checked(posture, errors)
    joints, structure = structure_of(robot, True, own_axes_free)
    acting = loads.rows() if loads else None
    # Only the loads differ between the points.
    if acting is not None and len(T) == len(sets) == 1:
        sets = np.repeat(sets, len(acting), axis=0)
    count = len(sets) if len(T) == 1 else len(T)
    rows = _compiled(joints, structure, T, sets, off, acting, method)
    rows["excess"] = _excess_of(rows["clearances"], structure.starts)
    held = _bounds_matter(structure, rows["outcome"])
    within = None
    if held.any():
        given, own_joints = (T, sets, off, acting), (robot, True, own_axes_free, True)
        within = _within_bounds(*structure_of(*own_joints), held, given, rows)
    rows |= _unsaid(count)
    if len(T) == 1 and posture.transforms.ndim > 3:
        posture = posture[0]
    own = None if errors is None else np.broadcast_to(sets, (count, *sets.shape[1:]))
    points = _of_rows(posture, joints, rows, load, loads, own)
    left = np.flatnonzero(rows["outcome"] >= _LEFT).tolist()
    if left and method == "compiled":
        log_reference(robot.name, "minimum energy", len(left), count)
    for i in left:
        one = points[i]
        _record(rows, points.apart, i, _by_reference(one, own_axes_free))
    residual = rows["residual"] + closure_rounding(sets, joints, structure.size)
    _drop_rounding(rows, residual, points.loaded)
    _certify(rows, points)
    return points if within is None else points.with_held(*within)


def _bounds_matter(structure: Structure, outcome: NDArray) -> NDArray:
    """Return a mask of points where an omitted joint motion limit can be active."""
    return np.isin(outcome, _AT_BOUNDS) & bool(np.isfinite(structure.free_bound).any())


def _within_bounds(
    joints: VirtualJoints, structure: Structure, matter: NDArray,
    given: tuple[NDArray, NDArray, NDArray, NDArray | None], rows: _Rows,
) -> tuple[NDArray, VirtualJoints, _Rows]:  # fmt: skip
    """Solve points again with the motion limits of passive joints.

    Returns:
        Indices of the selected points, their virtual joints, and their results.
        Results whose shape does not depend on the virtual joints are also stored in
        ``rows``.
    """
    held = np.flatnonzero(matter)
    T, sets, off, acting = (
        part if part is None or len(part) == 1 else part[held] for part in given
    )
    assert T is not None
    assert sets is not None
    assert off is not None
    again = _compiled(joints, structure, T, sets, off, acting)
    again["excess"] = _excess_of(again["clearances"], structure.starts)
    proved = again["outcome"] < _LEFT
    held, again = held[proved], {name: part[proved] for name, part in again.items()}
    for name, part in again.items():
        own = rows[name].shape[1:] == part.shape[1:]
        rows[name][held] = part if own else np.nan
    return held, joints, again


def _checked(
    posture: Posture, errors: NDArray | None
) -> tuple[NDArray, NDArray, NDArray]:
    """Check and return transforms, geometric errors and nominal closure errors."""
    n = len(posture.robot.frames)
    given = posture.robot.errors if errors is None else errors
    T = posture.transforms.reshape(-1, *posture.transforms.shape[-3:])
    sets = given.reshape(-1, *given.shape[-2:])
    fit = len(T) == 1 or len(sets) in {1, len(T)}
    if not fit or T.shape[1:] != (n, 4, 4) or sets.shape[1:] != (n, 6):
        raise ValueError(
            f"solve_assembly: transforms of shape {posture.transforms.shape} and "
            f"errors of shape {given.shape}, expected (k, {n}, 4, 4) and ({n}, 6) or "
            f"(k, {n}, 6)"
        )
    if not (np.isfinite(T).all() and np.all(np.abs(sets) <= LARGEST_LENGTH)):
        raise ValueError(
            "solve_assembly: transforms or errors are not all finite, or an error "
            f"is larger than {LARGEST_LENGTH:g} [rad, m]"
        )
    off = np.broadcast_to(np.asarray(posture.mismatch, dtype=float), (len(T),))
    # The kernels require writable arrays in C order.
    T, sets, off = (
        np.require(array, dtype=float, requirements=["C", "W"])
        for array in (T, sets, off)
    )
    return T, sets, off


def _compiled(
    joints: VirtualJoints, structure: Structure, T: NDArray, errors: NDArray,
    mismatch: NDArray, loads: NDArray | None, method: Method = "compiled",
) -> _Rows:  # fmt: skip
    """Solve k points by the compiled method, and mark points that it cannot certify."""
    count = len(errors) if len(T) == 1 else len(T)
    rows = _empty(joints, count)
    given = structure, T, errors, mismatch
    if method == "reference" or stiffness_spread(joints, structure.size) > SPREAD:
        rows["outcome"][:] = _LEFT
    elif loads is None:
        _fill(given, rows, None)
    # Some points may be unloaded although other points have loads.
    else:
        loaded = np.any(loads, axis=(1, 2, 3))
        for some, acting in ((loaded, loads), (~loaded, None)):
            if some.all():
                _fill(given, rows, acting)
            elif some.any():
                _fill_some(some, given, rows, acting)
    return rows


def _empty(joints: VirtualJoints, count: int) -> _Rows:
    """Allocate the result arrays of k points that the compiled method fills."""
    return {
        "outcome": np.zeros(count, dtype=np.int64),
        "energy": np.zeros(count),
        "bound": np.zeros(count),
        "tight": np.zeros(count),
        "work": np.zeros(count),
        "platform_screw": np.zeros((count, 6)),
        "clearances": np.zeros((count, joints.cones.shape[1])),
        "motions": np.zeros((count, joints.free.shape[1])),
        "multipliers": np.zeros((count, 6 * len(joints.robot.closures))),
        "residual": np.zeros(count),
        "elastic": np.zeros((count, joints.elastic.shape[1])),
    }


def _unsaid(count: int) -> _Rows:
    """Allocate the result arrays that the compiled method does not fill."""
    texts = {"method": "compiled", "status": OK, "reason": ""}
    rows = {name: np.full(count, text, dtype=object) for name, text in texts.items()}
    return rows | {name: np.zeros(count) for name in ("gap", "potential", "least")}


def _certify(rows: _Rows, points: Assembly) -> None:
    """Compute the duality gap, potential and lower energy bound of each point."""
    energy, bound, loads = rows["energy"], rows["bound"], points.frame_loads
    rows["gap"][:] = np.maximum(0.0, energy - bound)
    on_errors = loads.body @ points.posture.robot.errors.ravel()
    if points.errors is not None:
        on_errors = np.vecdot(loads.body, points.errors.reshape(len(energy), -1))
    rows["potential"][:] = energy - rows["work"] - on_errors
    rows["least"][:] = bound - rows["work"] - on_errors


def _fill(given: tuple[Any, ...], rows: _Rows, loads: NDArray | None) -> None:
    """Solve problems with errors or loads; the results of all others remain zero."""
    if loads is not None or np.count_nonzero(given[2][:1]) or given[2].any():
        structure, T, errors, mismatch = given
        assemble_side_by_side(structure, T, errors, mismatch, loads, rows)


def _fill_some(
    some: NDArray, given: tuple[Any, ...], rows: _Rows, loads: NDArray | None
) -> None:
    """Solve the selected points and store their results."""
    structure, *points = given
    part = {name: values[some] for name, values in rows.items()}
    own = (array[some] if len(array) > 1 else array for array in points)
    _fill((structure, *own), part, None if loads is None else loads[some])
    for name, solved in part.items():
        rows[name][some] = solved


def _of_rows(
    posture: Posture, joints: VirtualJoints, rows: _Rows, load: NDArray,
    loads: FrameLoads, errors: NDArray | None,
) -> Assembly:  # fmt: skip
    """Return an assembly of many points from the arrays in ``rows``."""
    known = {"_gap": "gap", "_residual": "residual", "_excess": "excess"}
    known |= {"bound": "least"}
    known |= {k: k for k in ("energy", "work", "platform_screw", "potential")}
    points = Assembly(
        linearisation=linearise(posture), joints=joints, load=load, frame_loads=loads,
        elastic=rows["elastic"], clearances=rows["clearances"],
        motions=rows["motions"], multipliers=rows["multipliers"],
        energy_without_clearance=rows["tight"], method=rows["method"],
        status=rows["status"], reason=rows["reason"], errors=errors,
    )  # fmt: skip
    return with_known(points, {name: rows[key] for name, key in known.items()})


def _by_reference(where: Assembly, own_axes_free: bool) -> Assembly | Exception:
    """Return the result of the reference method for one problem, or its exception."""
    try:
        return least_energy(where.posture, where.load, where.frame_loads, own_axes_free)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return error


def _record(
    rows: _Rows, apart: dict[int, Assembly | Exception], i: int,
    found: Assembly | Exception,
) -> None:  # fmt: skip
    """Store the result of one problem in ``rows``, or in ``apart`` if shapes differ."""
    rows["method"][i] = "reference"
    if isinstance(found, Exception):
        for name in (*_NUMBERS, "platform_screw", *_VECTORS):
            rows[name][i] = np.nan
        rows["status"][i], rows["reason"][i] = failure_status(found), str(found)
        apart[i] = found
        return
    rows["energy"][i], rows["work"][i] = found.energy, found.work
    rows["bound"][i] = found.energy - found.duality_gap()
    rows["tight"][i] = found.energy_without_clearance
    rows["residual"][i] = found.closure_residual()
    rows["excess"][i] = found.clearance_excess()
    rows["platform_screw"][i] = found.platform_screw
    rows["multipliers"][i] = found.multipliers
    names = ("clearances", "motions", "elastic")
    parts = {name: getattr(found, name) for name in names}
    own = all(rows[name][i].shape == part.shape for name, part in parts.items())
    for name, part in parts.items():
        rows[name][i] = part if own else np.nan
    if not own:
        apart[i] = found
    open_ = unproved(found)
    if open_:
        rows["status"][i], rows["reason"][i] = SOLVER_FAILED, open_


def _drop_rounding(rows: _Rows, residual: NDArray, loaded: NDArray) -> None:
    """Set energies, wrenches and deformations that are only round-off to zero."""
    multipliers = rows["multipliers"]
    drop_zeros(rows["energy"], rows["bound"], multipliers, residual, loaded)
    # Without loads and wrenches, all deformations are round-off.
    rows["elastic"][~(loaded | multipliers.any(axis=1))] = 0.0


def _excess_of(clearances: NDArray, starts: NDArray) -> NDArray:
    """Return the largest relative excess of a clearance over its bound."""
    if not clearances.shape[1]:
        return np.zeros(len(clearances))
    squares = np.add.reduceat(clearances.T**2, starts[:-1], axis=0)
    return np.maximum(0.0, np.sqrt(squares.max(axis=0)) - 1.0)
