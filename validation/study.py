"""The main job: one robot, every check a study file names, to one folder.

A study file is TOML; ``docs/study.md`` describes it, ``examples/irsbot2.toml`` is one.
Everything in it is read and checked before any work begins.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.draw import SIGNS, ErrorDraw, draw_errors, frames_named
from assembly.energy import Assembly, solve_assembly
from assembly.links import link_compliance
from assembly.mesh_link import mesh_link_stiffness
from assembly.pose_error import READINGS
from assembly.posture import POSE, Posture, place_robot
from assembly.results import pose_error_of, solution_of
from assembly.robot import BeamLink, Frame, MatrixLink, MeshLink, Robot
from assembly.robots import BUILT_IN, load_robot
from assembly.sweeps.sweep import sweep_poses
from assembly.sweeps.targets import parse_grid
from stiffness.reading import BadInput, Table, read_toml
from stiffness.surface import UNITS
from validation.crosscheck import Crosscheck, try_crosscheck
from validation.multibody.simulation import (
    SimulationFailed,
    closing_sequence,
    without_clearance,
)

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
    folder: Path


@dataclass(frozen=True, eq=False)
class StudyResults:
    """What a study found; parts that were not asked for are None.

    Attributes:
        study: what was asked.
        robot: with the links used.
        solution: keys of ``assembly solve`` at the study's pose.
        answer: the assembly behind it, None if it cannot be assembled.
        error: bounds of (27) by reading, as ``assembly error`` gives them.
        reference: energy, pose error and margins by the transcription in cvxpy, and
            the largest relative differences.
        stiffness: by frame: K_E of the beam and of the finite elements.
        maps: data set over the grid.
        crosscheck: against the multibody simulation.
        crosscheck_failure: why there is none although it was asked for; empty if so.
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

    @property
    def passed(self) -> bool:
        """Whether every check that was run holds."""
        return (
            self.solution["status"] == "ok"
            and (self.reference is None or self.reference["passed"])
            and (self.crosscheck is None or self.crosscheck.passed)
            and not self.crosscheck_failure
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
    name = root.text("robot")
    robot = load_robot(name if name in BUILT_IN else path.parent / name)
    robot, errors = _errors(root, robot)
    source, meshes, accuracy = _links(root, robot)
    pose = _pose(root)
    grid = root.text("grid", " ").strip()
    scales = _scales(root)
    checks = _checks(root, bool(meshes), bool(grid), bool(scales))
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
        folder,
    )  # fmt: skip


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
    if np.any(np.array(draw.least) > np.array(draw.most)):
        raise table.bad("least", "larger than most; expected least <= most")
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
                    surface, base, tip, link.young, link.poisson, link.density, unit
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
    value = root.get("scales", [1.0, 0.5, 0.25, 0.125])
    if not isinstance(value, list) or len(value) > 20:
        raise root.bad("scales", "expected a list of factors")
    return tuple(root.array("scales", (len(value),), "-", np.array(value, dtype=float)))


def _checks(root: Table, meshes: bool, grid: bool, scales: bool) -> tuple[str, ...]:
    """Checks to run: those asked for, else all that the file gives the input of."""
    possible = {"stiffness": meshes, "maps": grid, "crosscheck": scales}
    if not root.has("checks"):
        return tuple(c for c in _CHECKS if possible.get(c, True))
    table = root.table("checks")
    chosen = tuple(c for c in _CHECKS if table.boolean(c, possible.get(c, True)))
    for check in chosen:
        if not possible.get(check, True):
            need = {"stiffness": "[links] surface", "maps": "grid"}.get(check, "scales")
            raise table.bad(check, f'this check needs "{need}" in the study file')
    table.finish()
    return chosen


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
        reference = _compare_reference(posture, answer, solution["zone"], progress)
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
        failure.get("reason", ""), closing,
    )  # fmt: skip


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


def _compare_reference(
    posture: Posture, answer: Assembly, zone: dict[str, Any], progress: Progress
) -> dict[str, Any]:
    """The printed problems in cvxpy, and the largest relative differences."""
    from assembly.reference import reference_energy, reference_margin

    progress("reference", 0, 3)
    energy, screw = reference_energy(posture)
    progress("reference", 1, 3)
    margins = {}
    for done, key in enumerate(("rigid", "free"), 2):
        margins[key] = reference_margin(posture, key)
        progress("reference", done, 3)
    ours = {"rigid": zone["margin"], "free": zone["margin_free"]}
    scale = max(answer.energy, 1e-6 * answer.energy_without_play)
    difference = {
        "energy": abs(energy - answer.energy) / scale,
        "margin": _relative(ours["rigid"], margins["rigid"]),
        "margin_free": _relative(ours["free"], margins["free"]),
    }
    return {
        "energy": energy,
        "platform_screw": screw,
        "margin": margins["rigid"],
        "margin_free": margins["free"],
        "relative_difference": difference,
        "tolerance": 1e-6,
        "passed": max(difference.values()) < 1e-6,
    }


def _relative(a: float | None, b: float | None) -> float:
    """Relative difference of two margins; zero if neither exists."""
    if a is None or b is None:
        return 0.0 if a is b else np.inf
    return abs(a - b) / max(abs(a), abs(b), 1e-12)
