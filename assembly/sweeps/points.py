"""Points of a sweep, solved: margins, energy, wrenches, errors, singularities.

Points are solved in blocks.  A point that has no answer says why in its ``status`` and
``reason`` and stops nothing; no point's numbers depend on the others of its block.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_pose_errors import bound_pose_errors
from assembly.batch.many_postures import Energies, minimise_energies, zone_margins
from assembly.exact.exact import ExactAssembly
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import Posture, place_many, place_many_joints
from assembly.linear.closure import closure_signs
from assembly.linear.energy import CannotAssemble
from assembly.linear.singularity import KINDS, find_singularities
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import assemble_row, read
from assembly.model.link_stress import peak_stresses
from assembly.model.robot import Robot
from assembly.platform_stiffness.many_stiffnesses import platform_stiffnesses
from assembly.solvers.conic import SolverFailed
from assembly.sweeps.quantities import STATUSES, TEXTS, Question, record_type
from assembly.sweeps.situations import (
    assemble_situations,
    is_loaded,
    situations,
)
from assembly.sweeps.targets import goals_of, of_joints
from forcefit.inputs.table import BadInput
from stiffness.screws import screw_map

_PAGE = 256  # draws made at a time


@dataclass(frozen=True, eq=False)
class Points:
    """Some points of a sweep.

    Attributes:
        values: (k, p) of the numbers that vary.
        rows: (k, components) of the postures.
        draws: (k,) number of the draw of errors; not used without sources.
    """

    values: NDArray
    rows: NDArray
    draws: NDArray

    def part(self, some: slice) -> "Points":
        """Some of them."""
        return Points(self.values[some], self.rows[some], self.draws[some])


@dataclass(frozen=True, eq=False)
class Found:
    """What was found at k points.

    Attributes:
        records: (k,) of :func:`record_type`; NaN where there is no answer.
        texts: by name, those of :data:`TEXTS`, the text of points that have one.
    """

    records: NDArray
    texts: dict[str, dict[int, str]]


def solve_points(question: Question, points: Points) -> Found:
    """Everything asked for, at some points.

    Args:
        question: what is asked.
        points: neighbours in the sweep, so that those of one posture follow another.

    Returns:
        Rows in the order of the points.
    """
    count = len(points.rows)
    found = Found(np.zeros(count, record_type(question)), {t: {} for t in TEXTS})
    for name in found.records.dtype.names or ():
        if name != "status":
            found.records[name] = np.nan
    for run in _runs(points.values):
        _solve_variant(question, points.part(run), found, run.start)
    return found


def _runs(rows: NDArray) -> Iterator[slice]:
    """Stretches of equal rows."""
    steps = np.flatnonzero(np.any(rows[1:] != rows[:-1], axis=1)) + 1
    edges = [0, *steps.tolist(), len(rows)]
    for first, last in zip(edges, edges[1:], strict=False):
        yield slice(first, last)


@lru_cache(maxsize=4)
def _robots(question: Question, values: tuple[float, ...]) -> tuple[Robot, Robot]:
    """The robot of a design, and the same without errors."""
    robot = question.robot
    if question.design is not None:
        robot = question.design.robot(dict(zip(question.varied, values, strict=True)))
    return robot, robot.with_errors(np.zeros_like(robot.errors))


def _solve_variant(
    question: Question, points: Points, found: Found, first: int
) -> None:
    """Points of one design, into rows ``first`` .. of what is found."""
    count = len(points.rows)
    runs = list(_runs(points.rows))
    starts = [run.start for run in runs]
    try:
        robot, perfect = _robots(question, tuple(points.values[0].tolist()))
        goals = goals_of(question.components, robot, points.rows[starts])
        place = place_many_joints if of_joints(question.components) else place_many
        postures, reasons = place(robot, goals)
    except BadInput as error:
        _fail(found, range(first, first + count), "invalid robot", str(error))
        return
    reached = []
    for run, posture, reason in zip(runs, postures, reasons, strict=True):
        rows = range(first + run.start, first + run.stop)
        if posture is None:
            _fail(found, rows, "out of reach", reason)
        else:
            reached += [(row, posture) for row in rows]
    if not reached:
        return
    at = np.array([row for row, _ in reached])
    some = [posture for _, posture in reached]
    errors = None
    if question.sources is not None:
        errors = _errors(question, points.draws[at - first])
    _solve_or_split(question, robot, perfect, some, errors, found, at)


def _solve_or_split(
    question: Question, robot: Robot, perfect: Robot, postures: list[Posture],
    errors: NDArray | None, found: Found, rows: NDArray,
) -> None:  # fmt: skip
    """Points whose posture exists; where one breaks the others', one at a time."""
    try:
        _solve_reached(question, robot, perfect, postures, errors, found, rows)
    except (np.linalg.LinAlgError, SolverFailed) as error:
        if len(rows) == 1:
            row = int(rows[0])
            _fail(found, range(row, row + 1), "solver failed", str(error))
            return
        for i in range(len(rows)):
            one = slice(i, i + 1)
            own = None if errors is None else errors[one]
            _solve_or_split(
                question, robot, perfect, postures[one], own, found, rows[one]
            )


def _fail(found: Found, rows: range, status: str, reason: str) -> None:
    """Points without an answer."""
    found.records["status"][rows.start : rows.stop] = STATUSES.index(status)
    found.texts["reason"].update(dict.fromkeys(rows, reason))


def _errors(question: Question, draws: NDArray) -> NDArray:
    """(k, n, 6) [rad, m] the errors of some draws."""
    pages = {page: _page(question, page) for page in np.unique(draws // _PAGE).tolist()}
    return np.array([pages[d // _PAGE][d % _PAGE] for d in draws.tolist()])


@lru_cache(maxsize=8)
def _page(question: Question, page: int) -> NDArray:
    """(256, n, 6) [rad, m] errors of draws 256 page .."""
    sources = question.sources
    assert sources is not None
    return sources.errors(sources.draw(page * _PAGE, _PAGE, question.seed))


def _solve_reached(
    question: Question, robot: Robot, perfect: Robot, postures: list[Posture],
    errors: NDArray | None, found: Found, rows: NDArray,
) -> None:  # fmt: skip
    """Points whose posture exists; most of what fails is a status already."""
    out = found.records
    T = np.array([posture.transforms for posture in postures])
    _note_singularities(question, robot, T, found, rows)
    here = situations(question, robot, postures, errors)
    T, off = here.transforms, here.mismatch
    if robot.effects:
        robot, errors = here.robot, here.errors
        perfect = robot.with_errors(np.zeros_like(robot.errors))
    failed: dict[int, str] = {}
    for key, compliant in (("margin", "rigid"), ("margin_free", "free")):
        zone = zone_margins(robot, T, compliant, off, errors)
        out[key][rows] = zone.margin
        failed = {i: r for i, r in enumerate(zone.reason) if r} | failed
    wrenches = None
    if is_loaded(here):
        energies, wrenches = assemble_situations(here)
    else:
        energies = minimise_energies(robot, T, errors, off)
    good = []
    for i, row in enumerate(rows.tolist()):
        status, reason = energies.status[i], energies.reason[i]
        if i in failed:
            status, reason = "solver failed", failed[i]
        if status == "ok":
            good.append(i)
        else:
            _fail(found, range(row, row + 1), status, reason)
    at = rows[good]
    for key, values in (
        ("energy", energies.energy), ("platform_screw", energies.platform_screw),
        ("closure_residual", energies.closure_residual),
        ("clearance_excess", energies.clearance_excess),
        ("duality_gap", energies.gap),
    ):  # fmt: skip
        out[key][at] = values[good]
    if question.reads_otherwise and good:
        out["reading"][at] = read(here.take(good), energies.platform_screw[good])
    if wrenches is None and (question.wrenches or question.strength is not None):
        wrenches = _wrenches(robot, T, energies)
    if question.wrenches and wrenches is not None:
        chosen = [robot.index(name) for name in question.wrenches]
        out["wrench"][at] = wrenches[good][:, chosen]
    if question.strength is not None and wrenches is not None:
        stress = peak_stresses(robot, wrenches[good])
        out["stress"][at] = stress
        with np.errstate(divide="ignore"):
            out["safety"][at] = question.strength / stress.max(axis=1)
    if question.play_alone:
        _bound_play(perfect, T, off, found, rows)
    if question.reading is not None and good:
        _bound(question, robot, T, errors, off, energies, found, rows)
    if question.stiffness:
        _note_stiffness(robot, T, off, found, rows)
    if question.linearisation:
        for i in good:
            _compare_finite(here, i, found, int(rows[i]))


def _note_singularities(
    question: Question, robot: Robot, T: NDArray, found: Found, rows: NDArray
) -> None:
    """Distances to singularities, and the names of those that are near."""
    # all draws of a posture share its singularities
    runs = list(_runs(T.reshape(len(T), -1)))
    near = find_singularities(robot, T[[run.start for run in runs]])
    names = near.names(robot, question.near)
    distances = np.stack([getattr(near, kind) for kind in KINDS], axis=1)
    condition = near.condition
    for i, run in enumerate(runs):
        found.records["singular_distance"][rows[run]] = distances[i]
        found.records["condition"][rows[run]] = condition[i]
        if names[i]:
            found.texts["near_singularity"].update(
                dict.fromkeys(rows[run].tolist(), names[i])
            )


def _note_stiffness(
    robot: Robot, T: NDArray, off: NDArray, found: Found, rows: NDArray
) -> None:
    """K_C once a posture; errors do not change it, draws of a posture share it."""
    runs = list(_runs(T.reshape(len(T), -1)))
    starts = [run.start for run in runs]
    answer = platform_stiffnesses(robot, T[starts], off[starts])
    along = np.stack([answer.along(axis) for axis in np.eye(6)], axis=1)
    by_axis = [list(answer.shares(axis).values()) for axis in np.eye(6)]
    shares = np.array(by_axis).transpose(2, 1, 0)
    out = found.records
    for i, run in enumerate(runs):
        out["compliance"][rows[run]] = answer.compliance[i]
        out["stiffness"][rows[run]] = along[i]
        out["eigen_stiffness"][rows[run]] = answer.eigen_stiffnesses[i]
        out["stiffness_condition"][rows[run]] = answer.condition[i]
        out["share"][rows[run]] = shares[i]


def _wrenches(robot: Robot, T: NDArray, energies: Energies) -> NDArray:
    """(k, n, 6) [N m, N] wrench through every frame without loads, in its axes."""
    size = size_of(robot)
    closures = energies.multipliers.reshape(len(T), -1, 6) / ([1] * 3 + [size] * 3)
    at_platform = np.einsum("cf,kcs->kfs", closure_signs(robot), closures)
    origin = T[:, None, robot.index(robot.platform), :3, 3]
    paths = screw_map(T[..., :3, 3] - origin, T[..., :3, :3])
    return np.einsum("kfji,kfj->kfi", paths, at_platform)


def _bound(
    question: Question, robot: Robot, T: NDArray, errors: NDArray | None, off: NDArray,
    energies: Energies, found: Found, rows: NDArray,
) -> None:  # fmt: skip
    """Bounds of (27) where (22) has an answer; their failure is the point's."""
    bounds = bound_pose_errors(
        robot, T, question.reading or "", errors, off, energies
    )  # fmt: skip
    out = found.records
    for i in np.flatnonzero(out["status"][rows] == 0).tolist():
        row = int(rows[i])
        if bounds.status[i] != "ok":
            _fail(found, range(row, row + 1), bounds.status[i], bounds.reason[i])
            continue
        out["rotation_error"][row] = bounds.rotation_error[i]
        out["translation_error"][row] = bounds.translation_error[i]


def _bound_play(
    perfect: Robot, T: NDArray, off: NDArray, found: Found, rows: NDArray
) -> None:
    """Bounds of (27) by play alone, once a posture."""
    runs = list(_runs(T.reshape(len(T), -1)))
    starts = [run.start for run in runs]
    bounds = bound_pose_errors(perfect, T[starts], "frozen", None, off[starts])
    for i, run in enumerate(runs):
        found.records["rotation_error_play"][rows[run]] = bounds.rotation_error[i]
        found.records["translation_error_play"][rows[run]] = bounds.translation_error[i]
        if bounds.status[i] != "ok":
            for row in rows[run].tolist():
                reason = f"play alone: {bounds.reason[i]}"
                found.texts["reason"].setdefault(row, reason)


def _compare_finite(here: Conditions, i: int, found: Found, row: int) -> None:
    """What the linear closures cost at a point."""
    out = found.records
    try:
        exact = assemble_row(replace(here, exact=True), i)
        assert isinstance(exact, ExactAssembly)
        gap = exact.linearisation_error
    except (SolverFailed, CannotAssemble) as error:
        # the linear answer stands: only what it is worth is not known
        found.texts["reason"][row] = f"linearisation error unknown: {error}"
        return
    out["linearisation_rotation"][row] = np.linalg.norm(gap.rotation)
    out["linearisation_translation"][row] = np.linalg.norm(gap.translation)
    out["linearisation_energy"][row] = gap.relative_energy
