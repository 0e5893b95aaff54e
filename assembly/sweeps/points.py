"""Computation of the quantities at the points of a sweep.

Points are solved in blocks. If a point has no solution, the variables ``status`` and
``reason`` contain the reason. The result at a point does not depend on the other points
of its block.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.posture import Posture, place_many, place_many_joints
from forcefit.assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import PoseError, bound_pose_error
from forcefit.assembly.linear.zone import MARGINS, zone_margin
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import assemble_row, read
from forcefit.assembly.model.joint_names import row_of
from forcefit.assembly.model.link_stress import peak_stresses, stressed_links
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import (
    BEYOND_SINGULARITY,
    INVALID_ROBOT,
    OF_POINTS,
    OK,
    OUT_OF_REACH,
    SINGULAR,
    SOLVER_FAILED,
)
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.report.first_order import MOST_ENERGY, off_by
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.bolted import bolt_generators, bolted_errors
from forcefit.assembly.sweeps.point_conditions import (
    assemble_rows,
    is_loaded,
    point_conditions,
)
from forcefit.assembly.sweeps.point_kinematics import note_geometry
from forcefit.assembly.sweeps.point_stiffness import (
    nominal_stiffnesses,
    stiffness_parts,
    tangent_stiffnesses,
)
from forcefit.assembly.sweeps.quantities import (
    TEXTS,
    Question,
    computed,
    record_of,
    record_type,
)
from forcefit.assembly.sweeps.targets import goals_of, of_joints
from forcefit.inputs.table import BadInput

_PAGE = 256  # number of draws that are generated together


@dataclass(frozen=True, eq=False)
class Points:
    """Points of a sweep.

    Attributes:
        values: (k, p) values of the varied parameters.
        rows: (k, components) components of the postures.
        draws: (k,) index of the random draw; not used without random errors.
    """

    values: NDArray
    rows: NDArray
    draws: NDArray

    def part(self, some: slice) -> "Points":
        """Return selected points."""
        return Points(self.values[some], self.rows[some], self.draws[some])


@dataclass(frozen=True, eq=False)
class SolvedPoints:
    """Results at k points.

    Attributes:
        records: (k,) records of type :func:`record_type`; NaN without a solution.
        texts: for each name in :data:`TEXTS`, nonempty texts by point index.
    """

    records: NDArray
    texts: dict[str, dict[int, str]]


def solve_points(question: Question, points: Points) -> SolvedPoints:
    """Solve points of a sweep.

    Args:
        question: quantities of the sweep.
        points: points in the order of the sweep.

    Returns:
        The results in the same order.
    """
    count = len(points.rows)
    whole = record_of(computed(question))
    solved = SolvedPoints(np.zeros(count, whole), {t: {} for t in TEXTS})
    for name in solved.records.dtype.names or ():
        if name != "status":
            solved.records[name] = np.nan
    for run in _runs(points.values):
        _solve_variant(question, points.part(run), solved, run.start)
    stored = record_type(question)
    if stored == whole:
        return solved
    records = np.zeros(count, stored)
    for name in stored.names or ():
        records[name] = solved.records[name]
    return SolvedPoints(records, solved.texts)


def _runs(rows: NDArray) -> Iterator[slice]:
    """Yield the index ranges of consecutive equal rows."""
    steps = np.flatnonzero(np.any(rows[1:] != rows[:-1], axis=1)) + 1
    edges = [0, *steps.tolist(), len(rows)]
    for first, last in zip(edges, edges[1:], strict=False):
        yield slice(first, last)


@lru_cache(maxsize=4)
def _robots(question: Question, values: tuple[float, ...]) -> tuple[Robot, Robot]:
    """Return the robot of a design with errors and without errors."""
    robot = question.robot
    if question.design is not None:
        robot = question.design.robot(dict(zip(question.varied, values, strict=True)))
    return robot, robot.with_errors(np.zeros_like(robot.errors))


def _solve_variant(
    question: Question, points: Points, solved: SolvedPoints, first: int
) -> None:
    """Solve points of one design, and store the results from record ``first`` on."""
    count = len(points.rows)
    runs = list(_runs(points.rows))
    starts = [run.start for run in runs]
    try:
        robot, perfect = _robots(question, tuple(points.values[0].tolist()))
        goals = goals_of(question.components, robot, points.rows[starts])
        place = place_many_joints if of_joints(question.components) else place_many
        postures, reasons = place(robot, goals)
    except BadInput as error:
        _fail(solved, range(first, first + count), INVALID_ROBOT, str(error))
        return
    rows = [range(first + run.start, first + run.stop) for run in runs]
    reached = [i for i, posture in enumerate(postures) if posture is not None]
    said = note_geometry(
        question, robot, goals[reached], [p for p in postures if p is not None],
        [rows[i] for i in reached], solved.records, solved.texts["near_singularity"],
    )  # fmt: skip
    status_of = dict(zip(reached, said, strict=True))
    reachable: list[tuple[int, Posture]] = []
    far: list[tuple[int, str]] = []
    for i, posture in enumerate(postures):
        status, reason = status_of.get(i, (OUT_OF_REACH, reasons[i]))
        if posture is None or status not in ("", BEYOND_SINGULARITY):
            _fail(solved, rows[i], status, reason)
            continue
        reachable += [(row, posture) for row in rows[i]]
        # A posture beyond a singularity is solved, but its status is reported.
        if status:
            far += [(row, reason) for row in rows[i]]
    if not reachable:
        return
    rows_reached = np.array([row for row, _ in reachable])
    postures_reached = [posture for _, posture in reachable]
    errors = None
    if question.sources is not None:
        errors = _errors(question, robot, points.draws[rows_reached - first])
    _solve_or_split(
        question, robot, perfect, postures_reached, errors, solved, rows_reached
    )
    for row, reason in far:
        if solved.records["status"][row] == 0:
            _fail(solved, range(row, row + 1), BEYOND_SINGULARITY, reason)


def _solve_or_split(
    question: Question, robot: Robot, perfect: Robot, postures: list[Posture],
    errors: NDArray | None, solved: SolvedPoints, rows: NDArray,
) -> None:  # fmt: skip
    """Solve reachable points together or, if a solver fails, separately."""
    try:
        _solve_reached(question, robot, perfect, postures, errors, solved, rows)
    except (np.linalg.LinAlgError, SolverFailed) as error:
        if len(rows) == 1:
            row = int(rows[0])
            _fail(solved, range(row, row + 1), SOLVER_FAILED, str(error))
            return
        for i in range(len(rows)):
            one = slice(i, i + 1)
            own_errors = None if errors is None else errors[one]
            _solve_or_split(
                question, robot, perfect, postures[one], own_errors, solved, rows[one]
            )


def _fail(solved: SolvedPoints, rows: range, status: str, reason: str) -> None:
    """Store the status and the reason of points without a solution."""
    solved.records["status"][rows.start : rows.stop] = OF_POINTS.index(status)
    solved.texts["reason"].update(dict.fromkeys(rows, reason))


def _errors(question: Question, robot: Robot, draws: NDArray) -> NDArray:
    """Return random errors, (k, n, 6) [rad, m], including errors of bolted joints."""
    pages = {page: _page(question, page) for page in np.unique(draws // _PAGE).tolist()}
    own, which = np.unique(draws, return_inverse=True)
    errors = np.array([pages[d // _PAGE][d % _PAGE] for d in own.tolist()])
    return bolted_errors(robot, errors, bolt_generators(robot, question.seed, own))[
        which
    ]


@lru_cache(maxsize=8)
def _page(question: Question, page: int) -> NDArray:
    """Return the errors of 256 consecutive draws, (256, n, 6) [rad, m]."""
    sources = question.sources
    assert sources is not None
    return sources.errors(sources.draw(page * _PAGE, _PAGE, question.seed))


def _solve_reached(
    question: Question, robot: Robot, perfect: Robot, postures: list[Posture],
    errors: NDArray | None, solved: SolvedPoints, rows: NDArray,
) -> None:  # fmt: skip
    """Solve reachable points, and store results and status."""
    out = solved.records
    conditions = point_conditions(question, robot, postures, errors)
    if robot.has_effects:
        robot, errors = conditions.robot, conditions.errors
        perfect = robot.with_errors(np.zeros_like(robot.errors))
    there = replace(conditions.postures, robot=robot)
    failed: dict[int, str] = {}
    for key, compliant in MARGINS.items():
        zone = zone_margin(there, compliant, errors=errors)
        out[key][rows] = zone.margin
        failed = {i: r for i, r in enumerate(zone.unproved) if r} | failed
    wrenches = at_tips = None
    if is_loaded(conditions):
        energies, wrenches, at_tips = assemble_rows(conditions)
    else:
        energies = solve_assembly(there, errors=errors)
    ok = _solved_rows(energies, failed, solved, rows)
    rows_ok = rows[ok]
    for key, values in (
        ("energy", energies.energy), ("platform_screw", energies.platform_screw),
        ("closure_residual", energies.closure_residual()),
        ("clearance_excess", energies.clearance_excess()),
        ("duality_gap", energies.duality_gap()),
    ):  # fmt: skip
        out[key][rows_ok] = values[ok]
    if question.reads_otherwise and ok:
        out["reading"][rows_ok] = read(conditions.take(ok), energies.platform_screw[ok])
    if wrenches is None and (question.wrenches or question.strength is not None):
        wrenches = energies.wrenches
    if wrenches is not None:
        own = np.zeros_like(wrenches) if at_tips is None else at_tips
        _record_wrenches(question, robot, wrenches[ok], own[ok], solved, rows_ok)
    if question.clearance_only:
        _bound_clearance_only(replace(there, robot=perfect), solved, rows)
    if question.assumption is not None and ok:
        bounds = bound_pose_error(energies, question.assumption)
        _record_bounds(bounds, solved, rows)
    if question.stiffness:
        tangents = replace(conditions, robot=robot)
        _record_stiffness(question, tangents, solved, rows)
    if question.frequencies:
        _record_frequencies(question.frequencies, robot, conditions, solved, rows)
    if question.linearisation:
        for i in ok:
            _compare_finite(conditions, i, solved, int(rows[i]))


def _solved_rows(
    energies: Assembly, failed: Mapping[int, str], solved: SolvedPoints, rows: NDArray
) -> list[int]:
    """Return the points with a solution, and store the status of all other points."""
    ok = []
    for i, row in enumerate(rows.tolist()):
        status, reason = energies.status[i], energies.reason[i]
        if i in failed:
            status, reason = SOLVER_FAILED, failed[i]
        if status == OK:
            ok.append(i)
        else:
            _fail(solved, range(row, row + 1), status, reason)
    return ok


def _record_wrenches(
    question: Question, robot: Robot, wrenches: NDArray, at_tips: NDArray,
    solved: SolvedPoints, rows: NDArray,
) -> None:  # fmt: skip
    """Store wrenches at the requested frames and the stress of links."""
    out = solved.records
    if question.wrenches:
        chosen = [row_of(robot, name) for name in question.wrenches]
        out["wrench"][rows] = (wrenches - at_tips)[:, chosen]
    if question.strength is not None:
        stress = peak_stresses(robot, wrenches, at_tips)
        out["stress"][rows] = stress
        errors = [link.relative_error for link in stressed_links(robot)]
        out["stress_error"][rows] = errors
        with np.errstate(divide="ignore"):
            out["safety"][rows] = question.strength / stress.max(axis=1)


def _record_stiffness(
    question: Question, conditions: Conditions, solved: SolvedPoints, rows: NDArray
) -> None:
    """Store the platform stiffness."""
    state = question.stiffness
    T = conditions.transforms
    runs = list(_runs(T.reshape(len(T), -1)))
    if state == "nominal":
        starts = [run.start for run in runs]
        quantities, reasons = nominal_stiffnesses(conditions.postures[starts])
    else:
        quantities, reasons = tangent_stiffnesses(conditions, state)
        runs = [slice(i, i + 1) for i in range(len(T))]
    every = computed(question)["share"].dims["part"]
    shares = np.zeros((len(runs), len(every), 6))
    columns = [every.index(p) for p in stiffness_parts(conditions.robot, state)]
    shares[:, columns] = quantities["share"]
    quantities = quantities | {"share": shares}
    for key, values in quantities.items():
        for i, run in enumerate(runs):
            solved.records[key][rows[run]] = values[i]
    for i, reason in reasons.items():
        for row in rows[runs[i]].tolist():
            solved.texts["reason"].setdefault(row, reason)


def _record_frequencies(
    count: int, robot: Robot, conditions: Conditions, solved: SolvedPoints,
    rows: NDArray,
) -> None:  # fmt: skip
    """Store the natural frequencies of each posture."""
    T = conditions.transforms
    for run in _runs(T.reshape(len(T), -1)):
        i = run.start
        there = Posture(
            robot, conditions.coordinates[i], T[i], float(conditions.mismatch[i])
        )
        try:
            frequencies = natural_modes(there, count).frequencies
        except BadInput:
            continue  # no body with mass can move
        solved.records["frequency"][rows[run], : len(frequencies)] = frequencies


def _record_bounds(bounds: PoseError, solved: SolvedPoints, rows: NDArray) -> None:
    """Store pose error bounds, or the status if they cannot be computed."""
    out = solved.records
    for i in np.flatnonzero(out["status"][rows] == 0).tolist():
        row = int(rows[i])
        if bounds.status[i] != OK:
            _fail(solved, range(row, row + 1), bounds.status[i], bounds.reason[i])
            continue
        out["rotation_error"][row] = bounds.rotation_error[i]
        out["translation_error"][row] = bounds.translation_error[i]


def _bound_clearance_only(
    perfect: Posture, solved: SolvedPoints, rows: NDArray
) -> None:
    """Store pose error bounds, problem (27), without geometric errors."""
    T = perfect.transforms
    runs = list(_runs(T.reshape(len(T), -1)))
    starts = [run.start for run in runs]
    bounds = bound_pose_error(solve_assembly(perfect[starts]), "frozen")
    for i, run in enumerate(runs):
        solved.records["rotation_error_clearance"][rows[run]] = bounds.rotation_error[i]
        solved.records["translation_error_clearance"][rows[run]] = (
            bounds.translation_error[i]
        )
        if bounds.status[i] != OK:
            for row in rows[run].tolist():
                reason = f"clearances alone: {bounds.reason[i]}"
                solved.texts["reason"].setdefault(row, reason)


def _compare_finite(
    conditions: Conditions, i: int, solved: SolvedPoints, row: int
) -> None:
    """Store the difference between the linear and the exact solution at a point."""
    out = solved.records
    try:
        exact = assemble_row(replace(conditions, exact=True), i)
        assert isinstance(exact, ExactAssembly)
        difference = exact.linearisation_error
    except (SolverFailed, CannotAssemble) as error:
        # The linear solution is valid without its linearisation error.
        solved.texts["reason"][row] = f"linearisation error unknown: {error}"
        return
    if abs(difference.relative_energy) > MOST_ENERGY:
        _fail(solved, range(row, row + 1), SINGULAR, off_by(difference.relative_energy))
    out["linearisation_rotation"][row] = np.linalg.norm(difference.rotation)
    out["linearisation_translation"][row] = np.linalg.norm(difference.translation)
    out["linearisation_energy"][row] = difference.relative_energy
