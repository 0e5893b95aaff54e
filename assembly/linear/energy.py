"""The least energy that closes a manipulator, problem (22): one answer or many.

Compiled from the frames' poses to the certificate (:mod:`assembly.linear.lanes`), with
loads and without.  What this does not cover, or where its certificate falls short, is
solved by the reference (:mod:`assembly.linear.reference`), and the answer says so.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.assembled import Assembly, all_loads
from assembly.linear.assemblies import (
    COMPILED,
    OUTCOMES,
    Assemblies,
    excess_of,
    solve_again,
)
from assembly.linear.closure import checked_size, linearise
from assembly.linear.lanes import assemble_side_by_side
from assembly.linear.load import FrameLoads, no_loads
from assembly.linear.reference import (
    CannotAssemble,
    least_energy,
    without_own_springs,
)
from assembly.linear.robot_structure import Structure, structure_of
from assembly.linear.rounding import (
    SPREAD,
    closure_rounding,
    drop_zeros,
    stiffness_spread,
)
from assembly.linear.solutions import Solutions
from assembly.linear.within_bounds import bounds_matter, solve_within_bounds
from assembly.model.clearance import Compliant
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.robot import Robot
from assembly.solvers.method import Method, check_method

__all__ = [
    "Assemblies", "Assembly", "CannotAssemble", "minimise_energies",
    "minimise_under_loads", "solve_assembly",
]  # fmt: skip

# structure, frames, errors, closure errors of the frames, rows to fill
_Given = tuple[Structure, NDArray, NDArray, NDArray, Solutions]


@overload
def solve_assembly(
    posture: Posture, load: ArrayLike | None = None, bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None, errors: None = None, method: Method = "compiled",
) -> Assembly: ...  # fmt: skip


@overload
def solve_assembly(
    posture: Sequence[Posture], load: ArrayLike | None = None,
    bodies: ArrayLike | None = None, gravity: ArrayLike | None = None,
    errors: ArrayLike | None = None, method: Method = "compiled",
) -> Assemblies: ...  # fmt: skip


@overload
def solve_assembly(
    posture: Posture, load: ArrayLike | None = None, bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None, *, errors: ArrayLike,
    method: Method = "compiled",
) -> Assemblies: ...  # fmt: skip


def solve_assembly(
    posture: Posture | Sequence[Posture],
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    errors: ArrayLike | None = None,
    method: Method = "compiled",
) -> Assembly | Assemblies:
    """Close a manipulator at least energy, problem (22), under optional loads.

    Args:
        posture: where the robot stands; its errors, clearances, links and joint
            springs are the robot's.  Or many postures of one robot.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes; energy
            minus its work is then what is minimised.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames, each at its
            frame's origin, base axes.
        gravity: (3,) [m/s^2] base axes; links with a density and bodies with a mass
            then have weight.
        errors: (k, n, 6) [rad, m] geometric errors in place of the robot's, a set for
            each of k postures, or k sets at one.
        method: ``"compiled"``, and the reference where that does not prove its answer;
            or ``"reference"``, numpy and Clarabel alone.  The answer's ``method`` says
            which gave it.

    Returns:
        The assembled manipulator; :func:`assembly.linear.certificate.unproved` says
        where its certificate falls short even so.  Of many postures or sets
        of errors all of them, where one without a solution says so and raises nothing.

    Raises:
        CannotAssemble: a closure is open that no clearance and no spring can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver gave up.
        ValueError: errors do not fit the robot or the postures, or no such method.
    """
    check_method(method)
    if isinstance(posture, Posture) and errors is None:
        return _solve_one(posture, load, bodies, gravity, method)
    postures = [posture] if isinstance(posture, Posture) else list(posture)
    robot = postures[0].robot
    sets = None if errors is None else np.asarray(errors, dtype=float)
    T = np.array([p.transforms for p in postures])
    mismatch = np.array([p.mismatch for p in postures])
    if load is None and bodies is None and gravity is None:
        return minimise_energies(robot, T, sets, mismatch, method=method)
    where = posture if isinstance(posture, Posture) else Posture(
        robot, np.array([p.coordinates for p in postures]), T, float(mismatch.max())
    )  # fmt: skip
    loads = all_loads(where, load, bodies, gravity)
    at = partial(_posture_at, robot, T, sets, mismatch)
    return minimise_under_loads(
        robot, T, loads, lambda i: _solve_one(at(i), load, bodies, gravity, method),
        sets, mismatch, method,
    )  # fmt: skip


def _solve_one(
    posture: Posture, load: ArrayLike | None, bodies: ArrayLike | None,
    gravity: ArrayLike | None, method: Method,
) -> Assembly:  # fmt: skip
    """One posture: compiled, or, in doubt or if asked, by the reference."""
    if method == "reference":
        return least_energy(posture, load, bodies, gravity)
    frame_loads = None
    if load is not None or bodies is not None or gravity is not None:
        frame_loads = all_loads(posture, load, bodies, gravity) or None
    assembly = _compiled_assembly(posture, load, frame_loads)
    if assembly is not None:
        return assembly
    return least_energy(posture, load, bodies, gravity)


def _compiled_assembly(
    posture: Posture, load: ArrayLike | None, frame_loads: FrameLoads | None,
    bounded_motion: bool = False,
) -> Assembly | None:  # fmt: skip
    """One posture; None where it is left to the reference."""
    robot = posture.robot
    rounding = _rounding_of(robot)
    joints, structure = structure_of(robot, "elastic", bounded_motion)
    # a copy: the address of an array that may be written is found three times as fast
    T = np.array(posture.transforms, ndmin=4)
    out = _solve_compiled(
        robot, T, robot.errors[None],
        np.array([posture.mismatch]), "elastic", len(joints.links),
        None if frame_loads is None else frame_loads.rows(1),
        bounded_motion=bounded_motion,
    )  # fmt: skip
    if bounds_matter(structure, out.outcome)[0]:
        return _compiled_assembly(posture, load, frame_loads, True)
    if out.outcome[0] >= COMPILED:
        return None
    residual = out.residual + rounding
    loaded = frame_loads is not None
    drop_zeros(out.energy, out.bound, out.multipliers, residual, loaded)
    multipliers = out.multipliers[0]
    # without loads no wrenches mean no deformation but rounding
    bent = len(out.elastic) > 0 and (loaded or np.count_nonzero(multipliers) > 0)
    assembly = Assembly(
        linearisation=linearise(posture),
        joints=joints,
        load=np.zeros(6) if load is None else np.array(load, dtype=float),
        frame_loads=frame_loads or no_loads(robot.errors.size),
        elastic=out.elastic[0] if bent else np.zeros(len(joints.links)),
        clearances=out.clearances[0],
        motions=out.motions[0],
        multipliers=multipliers,
        energy_without_clearance=float(out.without_clearance[0]),
        method="compiled",
    )
    # known already, and so not computed again when somebody asks
    vars(assembly).update(
        energy=float(out.energy[0]), platform_screw=out.platform_screw[0]
    )
    return assembly


@lru_cache(maxsize=32)  # of one robot at many postures
def _rounding_of(robot: Robot) -> float:
    """[rad, lengths] what rounding may leave open in a robot's closures."""
    joints, _ = structure_of(robot)
    return float(closure_rounding(robot.errors, joints, checked_size(robot)))


def _any_load(loads: NDArray | None, count: int) -> NDArray:
    """(k,) bool: which points are under loads."""
    if loads is None:
        return np.zeros(count, dtype=bool)
    return np.broadcast_to(np.any(loads, axis=(1, 2, 3)), (count,))


def _solve_compiled(
    robot: Robot, T: NDArray, errors: NDArray, mismatch: NDArray, compliant: Compliant,
    springs: int, loads: NDArray | None, method: Method = "compiled",
    bounded_motion: bool = False,
) -> Solutions:  # fmt: skip
    """Rows of k points, and of the deformations of so many springs."""
    joints, structure = structure_of(robot, compliant, bounded_motion)
    count = len(errors) if len(T) == 1 else len(T)
    out = Solutions(
        outcome=np.zeros(count, dtype=np.int64),
        energy=np.zeros(count),
        bound=np.zeros(count),
        without_clearance=np.zeros(count),
        work=np.zeros(count),
        platform_screw=np.zeros((count, 6)),
        clearances=np.zeros((count, joints.cones.shape[1])),
        motions=np.zeros((count, joints.free.shape[1])),
        multipliers=np.zeros((count, 6 * len(robot.closures))),
        residual=np.zeros(count),
        elastic=np.zeros((count if springs else 0, springs)),
    )
    given = structure, T, errors, mismatch, out
    if method == "reference":
        out.outcome[:] = OUTCOMES.index("asked")
    elif stiffness_spread(joints, structure.size) > SPREAD:
        out.outcome[:] = OUTCOMES.index("uncertified")  # left to the reference
    elif loads is None:
        _fill(given, None)
    else:  # points that no load acts on have the bits of those without
        loaded = _any_load(loads, len(loads))
        for some, acting in ((loaded, loads), (~loaded, None)):
            if some.all():
                _fill(given, acting)
            elif some.any():
                _fill_some(some, given, acting)
    return out


def _fill(given: _Given, loads: NDArray | None) -> None:
    """Every point; zeros are the answer where nothing has to move."""
    if loads is not None or np.count_nonzero(given[2][:1]) or given[2].any():
        assemble_side_by_side(*given, loads)


def _fill_some(some: NDArray, given: _Given, loads: NDArray | None) -> None:
    """Fill the rows of some of the points."""
    structure, T, errors, mismatch, out = given
    again = Solutions._make(rows[some] if len(rows) else rows for rows in out)
    own = errors[some] if len(errors) > 1 else errors
    _fill(
        (structure, T[some], own, mismatch[some], again),
        None if loads is None else loads[some],
    )
    for rows, solved in zip(out, again, strict=True):
        if len(rows):
            rows[some] = solved


def minimise_energies(
    robot: Robot,
    transforms: ArrayLike,
    errors: ArrayLike | None = None,
    mismatch: ArrayLike = 0.0,
    compliant: Compliant = "elastic",
    method: Method = "compiled",
) -> Assemblies:
    """Close a manipulator at least energy, problem (22), at many points.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base, as of
            :attr:`~assembly.kinematics.posture.Posture.transforms`; one row serves k
            sets of errors.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: one number or one for each row of ``transforms`` [rad, m], nominal
            closure error of the frames.
        compliant: ``"elastic"``, or ``"hinged"``: compliant joints turn freely about
            their own axis, see :func:`assembly.linear.closure.virtual_joints`.
        method: as of :func:`solve_assembly`.

    Returns:
        Energies, screws and certificates, in the order given.

    Raises:
        ValueError: a shape does not fit the robot, a value is not finite, or no such
            method.
    """
    check_method(method)
    # writable and in C order, whatever comes: the kernels are compiled for one kind
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count, n = len(T), len(robot.frames)
    errors = robot.errors if errors is None else np.asarray(errors, dtype=float)
    sets = len(errors) if count == 1 and errors.ndim == 3 else count
    if T.shape != (count, n, 4, 4) or errors.shape not in {(n, 6), (sets, n, 6)}:
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
    at = partial(_posture_at, robot, T, all_errors, off)

    def one(i: int) -> Assembly:
        assembly = _solve_one(at(i), None, None, None, method)
        return without_own_springs(assembly) if compliant == "hinged" else assembly

    return _minimise_all(robot, T, all_errors, off, compliant, None, one, method)


def minimise_under_loads(
    robot: Robot, transforms: NDArray, loads: FrameLoads,
    one: Callable[[int], Assembly], errors: NDArray | None = None,
    mismatch: ArrayLike = 0.0, method: Method = "compiled",
) -> Assemblies:  # fmt: skip
    """The same under loads.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base; one row serves k sets of
            errors.
        loads: (6n,), or a row for each of ``transforms``, as of
            :func:`assembly.linear.load.loads_on_frames`.
        one: solves a point by itself, by the same method.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: one number or one for each row of ``transforms`` [rad, m], nominal
            closure error of the frames.
        method: as of :func:`solve_assembly`.

    Returns:
        Energies, screws and certificates, in the order given.
    """
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    own = robot.errors if errors is None else errors
    own = np.require(own.reshape(-1, T.shape[1], 6), requirements=["C", "W"])
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (len(T),)).copy()
    return _minimise_all(robot, T, own, off, "elastic", loads.rows(len(T)), one, method)


def _minimise_all(
    robot: Robot, T: NDArray, errors: NDArray, off: NDArray, compliant: Compliant,
    loads: NDArray | None, one: Callable[[int], Assembly], method: Method,
) -> Assemblies:  # fmt: skip
    """All points compiled, unless asked otherwise; one by one what that leaves."""
    joints, structure = structure_of(robot, compliant)
    out = _solve_compiled(robot, T, errors, off, compliant, 0, loads, method)
    bounded = solve_within_bounds(
        structure, (T, errors, off, loads), out,
        lambda T, errors, off, loads: _solve_compiled(
            robot, T, errors, off, compliant, 0, loads, bounded_motion=True
        ),
    )  # fmt: skip
    excess = excess_of(out.clearances, structure.starts)
    if bounded.size:
        cones = structure_of(robot, compliant, True)[1].starts
        excess = np.fmax(excess, excess_of(bounded, cones))
    count = len(out.outcome)
    energies = Assemblies(
        energy=out.energy,
        bound=out.bound,
        energy_without_clearance=out.without_clearance,
        work=out.work,
        platform_screw=out.platform_screw,
        closure_residual=out.residual,
        clearance_excess=excess,
        clearances=out.clearances,
        bounded=bounded,
        motions=out.motions,
        multipliers=out.multipliers,
        outcome=out.outcome,
        method=np.where(out.outcome < COMPILED, "compiled", "reference").astype(object),
        loaded=_any_load(loads, count),
        status=np.full(count, "ok", dtype=object),
        reason=np.full(count, "", dtype=object),
        joints=joints,
        one=one,
    )
    for i in np.flatnonzero(out.outcome >= COMPILED).tolist():
        solve_again(energies, i)
    residual = energies.closure_residual
    residual = residual + closure_rounding(errors, joints, structure.size)
    drop_zeros(
        energies.energy, energies.bound, energies.multipliers, residual, energies.loaded
    )
    return energies


def _posture_at(
    robot: Robot, T: NDArray, errors: NDArray | None, mismatch: NDArray, i: int
) -> Posture:
    """Posture i, of the robot with errors i."""
    own = robot.errors if errors is None else errors[i if len(errors) > 1 else 0]
    # one robot for all where the errors are its own: its columns are cached
    erring = robot if np.array_equal(own, robot.errors) else robot.with_errors(own)
    where = i if len(T) > 1 else 0
    unknown = np.full(len(robot.frames), np.nan)
    return Posture(erring, unknown, T[where], float(mismatch[where]))
