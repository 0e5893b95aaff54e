"""Read a study file, which contains a robot and the checks to run.

The file format (TOML) is described in ``docs/study.md``.  An example is
``examples/irsbot2.toml``.  The whole file is validated before any computation.
"""

import os.path
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.closing import closing_of
from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.linear.load import driven
from forcefit.assembly.model.joint_names import error_rows
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.random_errors import (
    SIGNS,
    ErrorDraw,
    draw_errors,
    frames_named,
)
from forcefit.assembly.model.robot import BeamLink, MeshLink, Robot
from forcefit.assembly.robots import BUILT_IN
from forcefit.assembly.steps.bolted import bolt_joints, loose_over_poses
from forcefit.assembly.sweeps.targets import parse_grid
from forcefit.inputs.table import BadInput, Table, nearest, quoted, read_toml
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.surface.surface import UNITS
from forcefit.stiffness.surface.surface_files import named_solid
from forcefit.validation.crosscheck.verdict import SCALES, check_scales
from forcefit.validation.study.drawn_tolerances import (
    IN_BOUNDS,
    DrawnTolerances,
    read_statistics,
)
from forcefit.validation.study.service import Service, read_service

_CHECKS = ("reference", "stiffness", "maps", "picture", "crosscheck")


@dataclass(frozen=True, eq=False)
class Study:
    """Content of a study file.

    Attributes:
        title: title of the report.
        robot: robot with its geometric errors, and with the links in the robot file.
        errors: sentence on the origin of the errors.
        source: source of the link stiffness, ``"beam"`` (as declared) or ``"fea"``.
        meshes: mapping from frame to meshed link.
        accuracy: required accuracy of the finite elements.
        pose: nominal platform pose for the detailed checks.
        grid: mapping from pose component to its values in the maps; empty without maps.
        scales: scales of the errors in the cross-check; empty without a cross-check.
        checks: names of the checks to run.
        asked: names of the checks that are explicitly requested in the file.
        folder: folder of the report.
        files: files that were read: the study file, a robot file, surfaces.
        service: results requested for the robot under load; None without a table
            ``[service]``.
        statistics: results requested for the drawing tolerances; None for a robot
            without them.
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
    files: tuple[Path, ...] = ()
    service: Service | None = None
    statistics: DrawnTolerances | None = None

    __repr__, _repr_html_ = short_repr, html_table


def read_study(
    path: Path | str, folder: Path | str | None = None, *, links: bool = True
) -> Study:
    """Read a study file.

    Args:
        path: path of the TOML file.
        folder: folder of the report; None for the folder in the file.
        links: whether to compute the stiffness of meshed links.  The study requires it.

    Returns:
        The validated study.

    Raises:
        BadInput: the study file or the robot file is invalid.
    """
    path = Path(path)
    root = read_toml(path)
    robot = _robot(root, path.parent, links)
    robot, errors = _errors(root, robot)
    if root.has("rest") or root.has("mismatch"):
        errors = "; ".join([errors, *robot.remarks])
    errors = "; ".join([errors, *loose_over_poses(robot)])
    source, meshes, accuracy = _links(root, robot)
    pose = _pose(root)
    grid = root.text("grid", " ").strip()
    by_key = {"maps": "grid", "crosscheck": "scales"}
    asked_by_key = {check for check, key in by_key.items() if root.has(key)}
    scales = _scales(root)
    service = read_service(root, robot, links)
    statistics = read_statistics(root, robot)
    if robot.callouts or robot.fits:
        errors = f"{errors}; {IN_BOUNDS}"
    checks, named = _checks(root, bool(meshes), bool(grid), bool(scales))
    threads = [quoted(frame.name) for frame in robot.frames if frame.pitch]
    if threads and "crosscheck" in checks:
        fault = f"found helical joints ({', '.join(threads)}), which are not simulated"
        raise root.bad("checks", f"{fault}; set crosscheck = false under [checks]")
    wanted = tuple(c for c in checks if c in named | asked_by_key)
    wanted += ("service",) if service is not None else ()
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
        title=title,
        robot=robot,
        errors=errors,
        source=source,
        meshes=meshes,
        accuracy=accuracy,
        pose=pose,
        grid=axes,
        scales=scales,
        checks=checks,
        asked=wanted,
        folder=folder,
        files=_files(path, root, meshes),
        service=service,
        statistics=statistics,
    )


def _files(path: Path, root: Table, meshes: dict[str, MeshLink]) -> tuple[Path, ...]:
    """Return the files of a study without duplicates."""
    robot = path.parent / root.text("robot")
    surfaces = (named_solid(mesh.surface)[0] for mesh in meshes.values())
    return tuple(
        dict.fromkeys([path, *([robot] if robot.is_file() else []), *surfaces])
    )


def _robot(root: Table, folder: Path, links: bool) -> Robot:
    """Load a built-in robot or a robot file, and close its kinematic loops."""
    if not root.has("robot") and (root.has("frame") or root.has("body")):
        line = f'robot = "{Path(root.file).name}"'
        expected = f"a study file, in the simplest case with the one line {line}"
        raise root.bad("", f"found a robot file, expected {expected}")
    name = root.text("robot", expected="a built-in robot or a robot file")
    if name in BUILT_IN:
        return _closed(root, name, links)
    if not os.path.isfile(folder / name):
        problem = (
            f"found {quoted(name)}, neither a built-in robot nor a file in this folder"
        )
        raise root.bad("robot", f"{problem}{nearest(name, BUILT_IN)}")
    return _closed(root, folder / name, links)


def _closed(root: Table, name: Path | str, links: bool) -> Robot:
    """Return the robot with closed loops, as requested by ``rest`` or ``mismatch``."""
    rest = root.text("rest") if root.has("rest") else None
    mismatch = root.choice("mismatch", ("spring",)) if root.has("mismatch") else None
    own_errors = not root.has("errors")
    try:
        robot = load_robot(name, closing_of(rest, mismatch, own_errors=own_errors))
        if driven(robot):
            raise root.bad(
                "robot",
                "found a robot with drive_force; expected one without drive_force, "
                "because a study computes error bounds without load; use assembly "
                "solve for this robot",
            )
        return robot
    except BadInput as error:
        for key, option in (("rest", "--rest: "), ("mismatch", "--mismatch spring: ")):
            _, found, reason = str(error).partition(option)
            if found:
                raise root.bad(key, reason) from None
        raise


def _errors(root: Table, robot: Robot) -> tuple[Robot, str]:
    """Return the robot with the requested errors, and their origin as text."""
    if not root.has("errors"):
        return robot, "geometric errors as in the robot file"
    closing = root.has("rest") or root.has("mismatch")
    fixed = robot.declared_errors if closing else np.zeros_like(robot.errors)
    table = root.table("errors")
    if table.has("explicit"):
        rows = table.table("explicit")
        errors = np.zeros((len(robot.frames), 6))
        for name in rows.content:
            for whole in _known(rows, name, robot, [name]):
                for row, order in error_rows(robot, whole):
                    errors[row, order] = rows.array(name, (6,), "rad, m")
        table.finish()
        given = "geometric errors given in the study file"
        return bolt_joints(robot.with_errors(fixed + errors)), given
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
    signs = "all positive" if draw.signs == "literal" else "random signs"
    sentence = f"geometric errors drawn with seed {draw.seed}, {signs}"
    return bolt_joints(robot.with_errors(fixed + draw_errors(robot, draw))), sentence


def _frames(table: Table, robot: Robot, default: list[str]) -> tuple[str, ...]:
    """Read the frames listed under the key ``frames``."""
    names = table.get("frames", default)
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise table.bad("frames", "expected a list of frame names")
    return _known(table, "frames", robot, names)


def _known(table: Table, key: str, robot: Robot, names: list[str]) -> tuple[str, ...]:
    """Return the full names of frames, and raise BadInput for an unknown name."""
    try:
        return frames_named(robot, names)
    except BadInput as error:
        raise table.bad(key, str(error)) from None


def _links(root: Table, robot: Robot) -> tuple[str, dict[str, MeshLink], float]:
    """Read the source of the link stiffness and the meshed links."""
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
                    surface=surface,
                    base=base,
                    tip=tip,
                    young=link.young,
                    poisson=link.poisson,
                    density=link.density,
                    unit=unit,
                    axis=link.axis,
                )
    elif source == "fea":
        raise table.bad("surface", 'missing; expected the surface file of source "fea"')
    table.finish()
    return source, meshes, accuracy


def _pose(root: Table) -> dict[str, float]:
    """Read the pose of the detailed checks; the default is the home pose."""
    if not root.has("pose"):
        return {}
    table = root.table("pose")
    pose = {k: table.number(k, "m or rad") for k in POSE if table.has(k)}
    table.finish()
    return pose


def _scales(root: Table) -> tuple[float, ...]:
    """Read the scales of the cross-check."""
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
        message = str(error).removeprefix(f"{root.file}: ")
        raise root.bad("", message.replace("scale:", "scales:")) from None


def _checks(
    root: Table, meshes: bool, grid: bool, scales: bool
) -> tuple[tuple[str, ...], set[str]]:
    """Return the checks to run, and the checks that the file requests."""
    possible = {"stiffness": meshes, "maps": grid, "crosscheck": scales}
    if not root.has("checks"):
        return tuple(c for c in _CHECKS if possible.get(c, True)), set()
    table = root.table("checks")
    named = {c for c in _CHECKS if table.has(c)}
    chosen = tuple(c for c in _CHECKS if table.boolean(c, possible.get(c, True)))
    for check in chosen:
        if not possible.get(check, True):
            need = {"stiffness": "[links] surface", "maps": "grid"}.get(check, "scales")
            raise table.bad(
                check,
                f'found true, but this check needs "{need}" in the study file; '
                "add it or set this check to false",
            )
    table.finish()
    return chosen, named
