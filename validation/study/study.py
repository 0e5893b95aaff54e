"""The main job: one robot, every check a study file names, to one folder.

A study file is TOML; ``docs/study.md`` describes it, ``examples/irsbot2.toml`` is one.
Everything in it is read and checked before any work begins.
"""

import os.path
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import POSE, Posture, place_robot
from assembly.linear.energy import Assembly, solve_assembly
from assembly.linear.reach import READINGS
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.links import link_compliance
from assembly.model.mesh_link import mesh_link_stiffness
from assembly.model.random_errors import SIGNS, ErrorDraw, draw_errors, frames_named
from assembly.model.robot import BeamLink, Frame, MatrixLink, MeshLink, Robot
from assembly.report.platform_stiffness import stiffness_of
from assembly.report.results import pose_error_of, solution_of
from assembly.robots import BUILT_IN, load_robot
from assembly.sweeps.sweep import sweep_poses
from assembly.sweeps.targets import parse_grid
from forcefit.inputs.display import html_table, short_repr
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml
from stiffness.surface.surface import UNITS
from validation.crosscheck.crosscheck import Crosscheck, try_crosscheck
from validation.crosscheck.verdict import SCALES, check_scales, verdict
from validation.multibody.simulation import (
    SimulationFailed,
    closing_sequence,
    without_clearance,
)
from validation.study.printed_problems import compare_printed

Progress = Callable[[str, int, int], None]
THEORIES = ("euler", "timoshenko")
_CHECKS = ("reference", "stiffness", "maps", "picture", "crosscheck")


@dataclass(frozen=True, eq=False)
class Study:
    """What a study file asks for.

    Attributes:
        title: of the report.
        robot: with its errors, before links are replaced.
        errors: one sentence on where the errors come from.
        source: of the links' stiffness, ``"beam"`` (as declared) or ``"fea"``.
        meshes: mesh link by frame, for the comparison and for ``"fea"``.
        accuracy: asked of the finite elements.
        pose: nominal platform pose of the detailed checks.
        grid: axes of the maps by pose component; empty for none.
        scales: of the errors in the cross-check; empty for none.
        checks: names of the checks to run.
        asked: those of them that the file asks for by name, by a grid or by scales.
        folder: to write.
    """

    title: str
    robot: Robot
    errors: str
    source: str
    meshes: dict[str, MeshLink]
    accuracy: float
    pose: dict[str, float]
    grid: dict[str, NDArray]
    scales: tuple[float, ...]
    checks: tuple[str, ...]
    asked: tuple[str, ...]
    folder: Path

    __repr__, _repr_html_ = short_repr, html_table


@dataclass(frozen=True, eq=False)
class StudyResults:
    """What a study found; parts that were not asked for are None.

    Attributes:
        study: what was asked.
        robot: with the links used.
        solution: keys of ``assembly solve`` at the study's pose.
        answer: the assembly behind it, None if it cannot be assembled.
        error: bounds of (27) by reading, as ``assembly error`` gives them.
        reference: of :func:`validation.study.printed_problems.compare_printed`.
        stiffness: by frame: K_E of the beam and of the finite elements.
        maps: data set over the grid.
        crosscheck: against the multibody simulation.
        crosscheck_failure: why there is none although it was asked for; empty if so.
        platform_stiffness: K_C there, as ``assembly stiffness`` gives it.
        closing: (k, n, 4, 4) frames while the simulation pulls the closures shut, None
            where there is none to show.
    """

    study: Study
    robot: Robot
    solution: dict[str, Any]
    answer: Assembly | None
    error: dict[str, Any]
    reference: dict[str, Any] | None
    stiffness: dict[str, dict[str, Any]] | None
    maps: Any
    crosscheck: Crosscheck | None
    crosscheck_failure: str
    closing: NDArray | None
    platform_stiffness: dict[str, Any]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def verdicts(self) -> dict[str, str]:
        """Of each independent check that was to be run: passed, failed, or what else.

        ``"no signal"`` where there was nothing to compare, ``"not run"`` where there is
        no assembly to check.
        """
        independent = ("reference", "crosscheck")
        found = {n: "not run" for n in independent if n in self.study.checks}
        if self.reference is not None:
            found["reference"] = self.reference["verdict"]
        if self.crosscheck is not None:
            found["crosscheck"] = verdict(self.crosscheck)
        elif self.crosscheck_failure:
            found["crosscheck"] = "no answer"
        return found

    @property
    def unchecked(self) -> dict[str, str]:
        """What could not be checked, and why."""
        silent = "its errors ask nothing of its springs and play at this pose"
        if not self.robot.errors.any():
            silent = "the robot has no geometric errors; [errors] would give it some"
        why = {"not run": "there is no assembly to check", "no signal": silent}
        found = {k: why[v] for k, v in self.verdicts.items() if v in why}
        if self.reference is not None and "reason" in self.reference:
            found["reference"] = self.reference["reason"]
        if self.crosscheck_failure:
            found["crosscheck"] = self.crosscheck_failure
        if self.maps is not None and not points_solved(self.maps):
            found["maps"] = "none of the grid's points has an answer"
        return found

    @property
    def passed(self) -> bool:
        """Whether the answer is proved and every check holds.

        A check that found nothing to compare does not hold if it was asked for, or if
        no other one ran.
        """
        found, missing = self.verdicts, self.unchecked
        ran = [v for v in found.values() if v != "no signal"]
        return (
            self.solution["status"] == "ok"
            and all(v == "passed" for v in ran)
            and (bool(ran) or not found)
            and not set(missing) & set(self.study.asked)
        )


def read_study(path: Path | str, folder: Path | str | None = None) -> Study:
    """A study from its file.

    Args:
        path: of the TOML file.
        folder: to write, instead of the one the file names.

    Returns:
        The study, everything in it checked.

    Raises:
        BadInput: the file, or the robot it names, breaks a rule.
    """
    path = Path(path)
    root = read_toml(path)
    robot = _robot(root, path.parent)
    robot, errors = _errors(root, robot)
    source, meshes, accuracy = _links(root, robot)
    pose = _pose(root)
    grid = root.text("grid", " ").strip()
    by_key = {"maps": "grid", "crosscheck": "scales"}
    asked_by_key = {check for check, key in by_key.items() if root.has(key)}
    scales = _scales(root)
    checks, named = _checks(root, bool(meshes), bool(grid), bool(scales))
    wanted = tuple(c for c in checks if c in named | asked_by_key)
    asked = root.text("output", f"{path.stem}_study")
    title = root.text("title", f"{robot.name}: forced assembly")
    root.finish()
    try:
        axes = parse_grid(grid) if grid else {}
    except BadInput as error:
        raise root.bad("", str(error)) from None
    folder = Path(folder or asked)
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise BadInput(f"{folder}: found a file, expected a folder or nothing")
    return Study(
        title, robot, errors, source, meshes, accuracy, pose, axes, scales, checks,
        wanted, folder,
    )  # fmt: skip


def _robot(root: Table, folder: Path) -> Robot:
    """The robot: built in, or a file beside the study's."""
    name = root.text("robot", expected="a built-in robot or a robot file")
    if name in BUILT_IN:
        return load_robot(name)
    if not os.path.isfile(folder / name):
        found = f"found {quoted(name)}, neither a built-in robot nor a file beside this"
        raise root.bad("robot", f"{found}{nearest(name, BUILT_IN)}")
    return load_robot(folder / name)


def _errors(root: Table, robot: Robot) -> tuple[Robot, str]:
    """The robot with the errors asked for, and a sentence about them."""
    if not root.has("errors"):
        return robot, "geometric errors as in the robot file"
    table = root.table("errors")
    if table.has("explicit"):
        rows = table.table("explicit")
        errors = np.zeros((len(robot.frames), 6))
        for name in rows.content:
            for frame in _known(rows, name, robot, [name]):
                errors[robot.index(frame)] = rows.array(name, (6,), "rad, m")
        table.finish()
        return robot.with_errors(errors), "geometric errors given in the study file"
    draw = ErrorDraw(
        _frames(table, robot, [f.name for f in robot.frames]),
        tuple(table.array("least", (6,), "rad, m")),
        tuple(table.array("most", (6,), "rad, m")),
        table.integer("seed"),
        table.choice("signs", SIGNS, "literal"),
    )
    least, most = np.array(draw.least), np.array(draw.most)
    if not ((least >= 0) & (least <= most) & (most <= LARGEST_LENGTH)).all():
        expected = f"expected 0 <= least <= most <= {LARGEST_LENGTH:g}"
        raise table.bad("least", f"{expected} in every component")
    table.finish()
    said = "all positive" if draw.signs == "literal" else "random signs"
    sentence = f"geometric errors drawn with seed {draw.seed}, {said}"
    return robot.with_errors(draw_errors(robot, draw)), sentence


def _frames(table: Table, robot: Robot, default: list[str]) -> tuple[str, ...]:
    """Frames named by the key ``frames``."""
    names = table.get("frames", default)
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise table.bad("frames", "expected a list of frame names")
    return _known(table, "frames", robot, names)


def _known(table: Table, key: str, robot: Robot, names: list[str]) -> tuple[str, ...]:
    """Full names of frames; an unknown one is named with its place in the file."""
    try:
        return frames_named(robot, names)
    except BadInput as error:
        raise table.bad(key, str(error)) from None


def _links(root: Table, robot: Robot) -> tuple[str, dict[str, MeshLink], float]:
    """Where link stiffnesses come from, and the meshes of beams to compare."""
    if not root.has("links"):
        return "beam", {}, 0.005
    table = root.table("links")
    source = table.choice("source", ("beam", "fea"), "beam")
    accuracy = table.number("accuracy", "-", 0.005, above=0.0, below=0.5)
    meshes: dict[str, MeshLink] = {}
    if table.has("surface"):
        surface = Path(root.file).parent / table.text("surface")
        if not os.path.isfile(surface):
            raise table.bad("surface", f"no such file: {surface}")
        beams = [f for f in robot.frames if isinstance(f.link, BeamLink)]
        wanted = _frames(table, robot, [f.name for f in beams])
        base, tip = table.text("base"), table.text("tip")
        unit = table.choice("unit", UNITS, "m")
        for frame in beams:
            link = frame.link
            if frame.name in wanted and isinstance(link, BeamLink):
                meshes[frame.name] = MeshLink(
                    surface,
                    base,
                    tip,
                    link.young,
                    link.poisson,
                    link.density,
                    unit,
                    axis=link.axis,
                )
    elif source == "fea":
        raise table.bad("surface", 'missing; expected the surface file of source "fea"')
    table.finish()
    return source, meshes, accuracy


def _pose(root: Table) -> dict[str, float]:
    """The pose of the detailed checks; home if not given."""
    if not root.has("pose"):
        return {}
    table = root.table("pose")
    pose = {k: table.number(k, "m or rad") for k in POSE if table.has(k)}
    table.finish()
    return pose


def _scales(root: Table) -> tuple[float, ...]:
    """Scales of the cross-check."""
    if not root.has("scales"):
        return SCALES
    value = root.get("scales")
    if not isinstance(value, list) or len(value) > 20:
        raise root.bad("scales", "expected a list of factors")
    if not value:
        return ()
    try:
        given = root.array("scales", (len(value),), "-").tolist()
        return tuple(check_scales(given))
    except BadInput as error:
        said = str(error).removeprefix(f"{root.file}: ")
        raise root.bad("", said.replace("scale:", "scales:")) from None


def _checks(
    root: Table, meshes: bool, grid: bool, scales: bool
) -> tuple[tuple[str, ...], set[str]]:
    """Checks to run, all that the file gives the input of; and those it names."""
    possible = {"stiffness": meshes, "maps": grid, "crosscheck": scales}
    if not root.has("checks"):
        return tuple(c for c in _CHECKS if possible.get(c, True)), set()
    table = root.table("checks")
    named = {c for c in _CHECKS if table.has(c)}
    chosen = tuple(c for c in _CHECKS if table.boolean(c, possible.get(c, True)))
    for check in chosen:
        if not possible.get(check, True):
            need = {"stiffness": "[links] surface", "maps": "grid"}.get(check, "scales")
            raise table.bad(check, f'this check needs "{need}" in the study file')
    table.finish()
    return chosen, named


def run_study(study: Study, progress: Progress = lambda *_: None) -> StudyResults:
    """Run every check of a study.

    Args:
        study: of :func:`read_study`.
        progress: called with a check's name, the steps done and their number.

    Returns:
        Everything found; nothing is written yet.

    Raises:
        BadInput: the pose is out of reach, or a surface is not usable.
    """
    wanted = set(study.checks)
    place_robot(study.robot, pose=study.pose)  # out of reach: before the long work
    stiffness, robot = None, study.robot
    if "stiffness" in wanted or study.source == "fea":
        stiffness, robot = _compare_links(study, progress)
    posture = place_robot(robot, pose=study.pose)
    progress("assembly", 0, 1)
    solution = solution_of(posture)
    solved = solution["status"] == "ok"
    answer = solve_assembly(posture) if solved else None
    error = pose_error_of(posture, READINGS)["error"] if solved else None
    progress("assembly", 1, 1)
    reference = None
    if "reference" in wanted and answer is not None:
        progress("reference", 0, 1)
        reference = compare_printed(posture, answer, solution["zone"])
        progress("reference", 1, 1)
    maps = None
    if "maps" in wanted:
        maps = sweep_poses(
            robot, study.grid, lambda d, n: progress("maps", d, n), "frozen"
        )
    check, failure, closing = None, {"reason": ""}, None
    if "crosscheck" in wanted and solved:
        progress("cross-check", 0, 1)
        check, failure = try_crosscheck(posture, study.scales)
        closing = _closing(posture) if check is not None else None
        progress("cross-check", 1, 1)
    return StudyResults(
        study, robot, solution, answer, error or {}, reference, stiffness, maps, check,
        failure.get("reason", ""), closing, stiffness_of(posture),
    )  # fmt: skip


def points_solved(maps: Any) -> int:
    """Number of a grid's points that have an answer."""
    return int((maps["status"] == "ok").sum())


def _closing(posture: Posture) -> NDArray | None:
    """Frames while the tight robot is pulled shut; none where links are not known."""
    tight = replace(posture, robot=without_clearance(posture.robot))
    try:
        return closing_sequence(tight)
    except (BadInput, SimulationFailed):
        return None


def _compare_links(
    study: Study, progress: Progress
) -> tuple[dict[str, dict[str, Any]], Robot]:
    """Beam and finite elements side by side; links replaced where asked."""
    compared: dict[str, dict[str, Any]] = {}
    found: dict[str, MatrixLink] = {}
    for done, (name, mesh) in enumerate(study.meshes.items()):
        progress("finite elements", done, len(study.meshes))
        frame = study.robot.frame(name)
        solved = mesh_link_stiffness(replace(frame, link=mesh), study.accuracy)
        compared[name] = {
            **_beams(frame),
            "fea": solved.stiffness,
            "relative_error_estimate": solved.relative_error_estimate,
            "mesh": dict(solved.mesh),
        }
        found[name] = MatrixLink(solved.stiffness)
    progress("finite elements", len(study.meshes), len(study.meshes))
    robot = (
        study.robot.with_links(dict(found)) if study.source == "fea" else study.robot
    )
    return compared, robot


def _beams(frame: Frame) -> dict[str, NDArray]:
    """K_E of a frame's beam by both theories."""
    assert isinstance(frame.link, BeamLink)
    links = {name: replace(frame.link, theory=name) for name in THEORIES}
    return {
        name: np.linalg.inv(link_compliance(replace(frame, link=link)))
        for name, link in links.items()
    }
