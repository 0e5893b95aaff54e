"""Reading, validation and writing of robot files (``docs/robot_files.md``)."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import FittedEnd, parse_fit
from forcefit.assembly.drawing.frames import robot_of_drawing
from forcefit.assembly.files.bolt_file import read_locked_at
from forcefit.assembly.files.callout_file import read_frame_callouts
from forcefit.assembly.files.callout_writing import callout_table
from forcefit.assembly.files.drawing_file import is_drawing, read_drawing
from forcefit.assembly.files.effect_file import effect_tables, with_effects
from forcefit.assembly.files.inertia_file import read_inertia
from forcefit.assembly.files.joint_file import (
    joint_table,
    read_clearance,
    read_fit,
    read_fitted_end,
    read_joint_stiffness,
    read_pitch,
)
from forcefit.assembly.files.link_file import link_table, read_link
from forcefit.assembly.files.toml_text import file_text
from forcefit.assembly.kinematics.callout_maps import place_callouts
from forcefit.assembly.kinematics.placed_callout import fits_by_parts
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.frame import FORCE_CONTROL
from forcefit.assembly.model.inertia import six_moments
from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH
from forcefit.assembly.model.link_span import with_spans
from forcefit.assembly.model.robot import (
    BASE,
    JOINTS,
    Frame,
    MeshLink,
    Robot,
)
from forcefit.inputs.table import (
    BadInput,
    Table,
    describe,
    nearest,
    quoted,
    read_toml,
)
from forcefit.inputs.writing import (
    ROBOT,
    check_writable,
    path_from,
    write_text,
)
from forcefit.stiffness.screws import rotation_matrix, rotation_vector

Closing = Callable[[Robot], Robot]
_LONGEST_NAME = 200  # [characters] maximum length of a name
# maximum number of frames, which limits the time to close the loops
MOST_FRAMES = 2000


def read_robot(path: Path | str, close: Closing | None = None) -> Robot:
    """Read a robot file.

    Args:
        path: ``.toml`` file in the format of ``docs/robot_files.md``.
        close: function that closes the loops of the robot in the file; None if they are
            already closed.

    Returns:
        Robot with closed nominal loops in the home pose.  Link meshes and libraries are
        read later by :func:`forcefit.assembly.files.solved_links.solve_links`.

    Raises:
        BadInput: the file is invalid, or a loop is not closed.
    """
    return robot_of(read_toml(Path(path)), Path(path).stem, close)


def robot_of(root: Table, name: str, close: Closing | None = None) -> Robot:
    """Return the robot that the root table of a robot file describes.

    Args:
        root: root table, in which paths are relative to the folder of ``root.file``.
        name: default name of the robot.
        close: function that closes the loops; see :func:`read_robot`.

    Returns:
        Robot with closed nominal loops in the home pose.

    Raises:
        BadInput: the table is invalid, or a loop is not closed.
    """
    robot = declared_robot(root, name)
    try:
        robot = robot if close is None else close(robot)
        home = home_posture(robot)
        place_callouts(home)  # raises BadInput if a callout contradicts the geometry
        return with_spans(robot, home.coordinates)
    except BadInput as error:
        raise BadInput(f"{root.file}: {error}") from None


def declared_robot(root: Table, name: str) -> Robot:
    """Return the robot that a root table describes, without closing its loops.

    Args:
        root: root table of a robot file.
        name: default name of the robot.

    Returns:
        Robot, in which the lengths of beams may be unknown.

    Raises:
        BadInput: the table is invalid.
    """
    name = root.text("name", name, longest=_LONGEST_NAME)
    description = root.get("description", "")
    if not isinstance(description, str):
        fault = f"found {describe(description)}, expected a string"
        raise root.bad("description", fault)
    version = root.get("format", 1)
    if isinstance(version, bool) or version not in (1, 2):
        raise root.bad("format", f"found {describe(version)}, expected 1 | 2")
    ranges = _learned_range(root)
    point, diagnosis = _reference_point(root), _diagnosis(root)
    effects = root.tables("effect")
    robot = (_drawn if is_drawing(root) else _framed)(root, name, description)
    robot = replace(
        robot, learned_range=ranges, reference_point=point, diagnosis=diagnosis,
        remarks=(*robot.remarks, *_fit_remarks(robot)),
    )  # fmt: skip
    return with_effects(robot, effects)


def _drawn(root: Table, name: str, description: str) -> Robot:
    """Return the robot in a file of format 2 (bodies and joints)."""
    drawing = read_drawing(root, name, description)
    root.finish()
    try:
        robot = robot_of_drawing(drawing)
    except BadInput as error:
        raise BadInput(f"{root.file}: {error}") from None
    if len(robot.frames) > MOST_FRAMES:
        fault = f"found joints and bodies with {len(robot.frames)} frames in total"
        raise root.bad("", f"{fault}, expected at most {MOST_FRAMES}")
    return robot


def _framed(root: Table, name: str, description: str) -> Robot:
    """Return the robot in a file of format 1 (frames and closures)."""
    platform = root.text("platform", expected="the name of a frame")
    tables = root.tables("frame"), root.tables("closure")
    root.tables("tolerance")  # marked as known; read when all frames are known
    root.finish()
    if not 0 < len(tables[0]) <= MOST_FRAMES:
        fault = f"found {len(tables[0])}" if tables[0] else "missing"
        raise root.bad(
            "frame", f"{fault}; expected 1 to {MOST_FRAMES} tables [[frame]]"
        )
    frames = tuple(_frame(table) for table in tables[0])
    names = [frame.name for frame in frames]
    closures = tuple(_closure(table, names) for table in tables[1])
    callouts = read_frame_callouts(root, names)
    _check_known(root, "platform", platform, names)
    ends = _fitted_ends(tables[0])
    try:
        robot = Robot(
            name, platform, frames, closures, description,
            remarks=_remarks(tables[0]), callouts=callouts,
            fits={t.content["name"]: fit for t in tables[0] if (fit := read_fit(t))},
            fitted_ends=ends,
        )  # fmt: skip
        _check_meeting_frames(robot)
    except BadInput as error:
        raise BadInput(f"{root.file}: {error}") from None
    return robot


def _learned_range(root: Table) -> dict[str, tuple[float, float]]:
    """Return the range of each variable in the data for identification."""
    ranges: dict[str, tuple[float, float]] = {}
    if not root.has("learned_range"):
        return ranges
    table = root.table("learned_range")
    for name in table.content:
        least, most = table.array(name, (2,), "its unit")
        if least > most:
            fault = f"found [{least:g}, {most:g}], expected the smaller number first"
            raise table.bad(name, fault)
        ranges[name] = (float(least), float(most))
    table.finish()
    return ranges


def _reference_point(root: Table) -> tuple[float, float, float] | None:
    """Return the reference point of the measurements for identification, or None."""
    if not root.has("reference_point"):
        return None
    x, y, z = root.array("reference_point", (3,), "m", largest=LARGEST_LENGTH).tolist()
    return x, y, z


def _diagnosis(root: Table) -> dict[str, Any]:
    """Return the diagnosis, with the absolute path of its covariance file."""
    # texts, numbers and lists are not interpreted
    content: dict[str, Any] = {}
    if root.has("diagnosis"):
        table = root.table("diagnosis")
        for key in list(table.content):
            value = table.get(key)
            if not _is_record(value):
                fault = f"found {describe(value)}, expected texts, numbers or lists"
                raise table.bad(key, fault)
            content[key] = value
        table.finish()
    if root.has("covariance"):
        content["covariance"] = root.text("covariance", expected="a path")
    path = content.get("covariance")
    if isinstance(path, str):
        content["covariance"] = str((Path(root.file).parent / path).resolve())
    return content


def _is_record(value: object) -> bool:
    """Return whether a value is a text, finite number, boolean, or a list of these."""
    if isinstance(value, list):
        return all(_is_record(one) for one in value)
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, str | int)


def _remarks(tables: list[Table]) -> tuple[str, ...]:
    """Return a remark on frames whose ``dh`` parameters do not include ``alpha``."""
    # the Denavit-Hartenberg parameter alpha is rarely zero, in contrast to a, d and
    # theta
    dh = {table.content["name"]: table.content.get("dh") for table in tables}
    without_alpha = [
        quoted(name) for name, given in dh.items() if given and "alpha" not in given
    ]
    if not without_alpha:
        return ()
    return (f"dh without alpha, which is set to 0: {', '.join(without_alpha)}",)


def _fitted_ends(tables: list[Table]) -> dict[str, FittedEnd]:
    """Return the fits that determine a bound on a rotation, by frame.

    Fits between the same components must be equal.
    """
    ends: dict[str, FittedEnd] = {}
    fits: dict[str, str] = {}
    for table in tables:
        end, fit = read_fitted_end(table), read_fit(table)
        name = table.content["name"]
        parts = name if end is None else end.parts
        if fit and fits.setdefault(parts, fit) != fit:
            found = f"found {quoted(fit)} for the parts {quoted(parts)}"
            expected = f"expected {quoted(fits[parts])} as at an earlier frame"
            raise table.table("clearance").bad("fit", f"{found}, {expected}")
        if end is not None:
            ends[name] = end
    return ends


def _fit_remarks(robot: Robot) -> tuple[str, ...]:
    """Return a remark on the mean radial clearances of fits."""
    texts = []
    for name, text in fits_by_parts(robot).items():
        fit = parse_fit(text)
        mean, (least, most) = 1e6 * fit.mean_radial, (1e6 * r for r in fit.radial)
        texts.append(
            f"{quoted(name)} {text}, {mean:.4g} um of {least:.4g} to {most:.4g}"
        )
    return (f"mean radial clearance of fits: {'; '.join(texts)}",) if texts else ()


def _frame(table: Table) -> Frame:
    """Read a ``[[frame]]`` table."""
    name = table.text("name", longest=_LONGEST_NAME)
    table.place = f"frame {quoted(name)}"
    joint = table.choice("joint", JOINTS, "fixed")
    actuated = table.boolean("actuated", False)
    given = [key for key in ("position", "limits") if table.has(key)]
    if joint == "fixed" and (actuated or given):
        key = "actuated" if actuated else given[0]
        message = f'found {key} on a fixed joint; expected joint = "revolute" | '
        raise table.bad(key, message + f'"prismatic" | "helical", or no {key}')
    translation, rotation = _placement(table)
    passive = joint != "fixed" and not actuated
    own = (5 if joint == "prismatic" else 2) if passive else None
    clearance, bolt = read_locked_at(
        table, joint == "fixed", read_clearance(table, joint)
    )
    frame = Frame(
        name=name,
        parent=table.text("parent", expected='the name of a frame, or "base"'),
        translation=translation,
        rotation=rotation,
        joint=joint,
        pitch=read_pitch(table, joint),
        actuated=actuated,
        position=table.number("position", "rad or m", 0.0, largest=LARGEST_LENGTH),
        limits=_limits(table),
        geometric_error=_numbers(table, "geometric_error", 6, "rad, m"),
        tolerance=_tolerance(table),
        clearance=clearance,
        locked_at=bolt,
        joint_stiffness=read_joint_stiffness(table, own),
        drive_force=_drive_force(table, passive),
        link=read_link(table, rotation_matrix(rotation).T @ translation),
        mass=table.number("mass", "kg", 0.0, least=0.0, largest=1e40),
        centre_of_mass=_numbers(table, "centre_of_mass", 3, "m"),
        inertia=read_inertia(table),
    )
    if not isinstance(frame.link, MeshLink) and "up" in table.content:
        raise table.bad(
            "up",
            'found "up" in a frame without a mesh link; remove it, because it '
            "only orients a mesh about its axis",
        )
    table.finish()
    return frame


def _numbers(table: Table, key: str, count: int, unit: str) -> NDArray:
    """Return an array of lengths or angles, which is zero by default."""
    zero = np.zeros(count)
    return table.array(key, (count,), unit, zero, largest=LARGEST_LENGTH)


def _drive_force(table: Table, passive: bool) -> float:
    """Return the drive force on a passive joint, which is 0 by default."""
    if table.has("drive_force") and not passive:
        fault = f"found a force on a joint that is not passive; {FORCE_CONTROL}"
        raise table.bad("drive_force", fault)
    return table.number("drive_force", "N m or N", 0.0, largest=LARGEST)


def _limits(table: Table) -> tuple[float, float] | None:
    """Return the minimum and maximum commanded coordinate, or None."""
    if not table.has("limits"):
        return None
    least, most = table.array("limits", (2,), "rad or m", largest=LARGEST_LENGTH)
    if not least < most:
        message = f"found [{least:g}, {most:g}], expected the smaller number first"
        raise table.bad("limits", message)
    return float(least), float(most)


def _tolerance(table: Table) -> NDArray | None:
    """Return the standard deviations of the geometric error, or None."""
    if not table.has("tolerance"):
        return None
    sigma = table.array("tolerance", (6,), "rad, m", largest=LARGEST_LENGTH)
    if sigma.min() < 0:
        message = f"found the number {sigma.min():g}, expected 6 numbers >= 0 [rad, m]"
        raise table.bad("tolerance", message)
    return sigma


def _placement(table: Table) -> tuple[NDArray, NDArray]:
    """Return the translation and rotation vector of a frame."""
    given = [key for key in ("translation", "rotation") if table.has(key)]
    if not table.has("dh"):
        return (
            _numbers(table, "translation", 3, "m"),
            _numbers(table, "rotation", 3, "rad"),
        )
    if given:
        message = (
            f'found {given[0]} together with "dh"; both place the frame, '
            "expected only one of them"
        )
        raise table.bad(given[0], message)
    dh = table.table("dh")
    units = {"theta": "rad", "d": "m", "a": "m", "alpha": "rad"}
    theta, d, a, alpha = (
        dh.number(key, unit, 0.0, largest=LARGEST_LENGTH) for key, unit in units.items()
    )
    dh.finish()
    # Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha)
    translation = np.array([a * math.cos(theta), a * math.sin(theta), d])
    turn = rotation_matrix([0, 0, theta]) @ rotation_matrix([alpha, 0, 0])
    return translation, rotation_vector(turn)


def _closure(table: Table, names: list[str]) -> tuple[str, str]:
    """Read a ``[[closure]]`` table."""
    value = table.require("frames", "two frame names")
    table.finish()
    proper = isinstance(value, list) and all(isinstance(v, str) for v in value)
    if not proper or len(value) != 2 or value[0] == value[1]:
        message = f"found {describe(value)}, expected two different frame names"
        raise table.bad("frames", message)
    for name in value:
        _check_known(table, "frames", name, names)
    return value[0], value[1]


def _check_known(table: Table, key: str, name: str, names: list[str]) -> None:
    """Check that a frame with a given name exists."""
    if name == BASE:
        message = (
            'found "base"; expected a frame (add a fixed frame with parent "base")'
        )
        raise table.bad(key, message)
    if name not in names:
        hint = nearest(name, names)
        message = f"found {quoted(name)}, expected the name of a frame{hint}"
        raise table.bad(key, message)


def _check_meeting_frames(robot: Robot) -> None:
    """Check that the frames of closures and of the platform are rigidly connected."""
    meeting = {"platform": [robot.platform]}
    for number, pair in enumerate(robot.closures, 1):
        meeting[f"closure[{number}].frames"] = list(pair)
    for place, names in meeting.items():
        for name in names:
            frame = robot.frame(name)
            keys = ("clearance", "locked_at", "joint_stiffness")
            has = [key for key in keys if getattr(frame, key) is not None]
            if frame.joint != "fixed" or has:
                fault = has[0] if has else f"a {frame.joint} joint"
                raise BadInput(
                    f"{place}: found {fault} at frame {quoted(name)}; expected a fixed "
                    "joint without clearance or joint_stiffness; add such a frame"
                )


def write_robot(robot: Robot, path: Path | str) -> None:
    """Write a robot file from which :func:`read_robot` reads the same robot.

    Args:
        robot: robot to write.
        path: path of the output file.  Paths of meshes and libraries are made relative
            to its folder.

    Raises:
        BadInput: the file cannot be written, or the existing file was not written by
            this function and may contain comments.
    """
    check_writable(path, ROBOT)
    table = robot_table(robot, Path(path).parent)
    frames, closures = table.pop("frame"), table.pop("closure", [])
    callouts = table.pop("tolerance", [])
    effects, diagnosis = table.pop("effect", []), table.pop("diagnosis", {})
    kinds = {
        "frame": frames, "closure": closures, "tolerance": callouts, "effect": effects
    }  # fmt: skip
    write_text(file_text(table, kinds, diagnosis), path)


def robot_table(robot: Robot, folder: Path | None = None) -> dict[str, Any]:
    """Return the content of a robot file.

    Args:
        robot: robot to write.
        folder: folder of the output file, to which paths are made relative.

    Returns:
        Keys and values, from which :func:`robot_of` reads the same robot.
    """
    table = root_table(robot, folder)
    table["frame"] = [frame_table(frame, folder) for frame in robot.frames]
    for frame in table["frame"]:
        if frame["name"] in robot.fits:
            _write_fit(frame["clearance"], robot, frame["name"])
    if robot.closures:
        table["closure"] = [{"frames": list(pair)} for pair in robot.closures]
    if robot.callouts:
        table["tolerance"] = [callout_table(callout) for callout in robot.callouts]
    if robot.has_effects:
        table["effect"] = effect_tables(robot)
    return table


def _write_fit(clearance: dict[str, Any], robot: Robot, name: str) -> None:
    """Replace the mean clearance at a frame by its fit."""
    end = robot.fitted_ends.get(name)
    del clearance["radial" if end is None else end.bound]
    clearance["fit"] = robot.fits[name]
    if end is not None:
        clearance |= {"length": end.length, "parts": end.parts}
        clearance |= {} if end.bound == "tilt" else {"bound": end.bound}


def root_table(robot: Robot, folder: Path | None = None) -> dict[str, Any]:
    """Return the content of a robot file without frames and closures.

    Args:
        robot: robot to write.
        folder: folder of the output file, to which paths are made relative.

    Returns:
        Keys and values.
    """
    table: dict[str, Any] = {"name": robot.name}
    if robot.description:
        table["description"] = robot.description
    table["platform"] = robot.platform
    if robot.learned_range:
        table["learned_range"] = dict(robot.learned_range)
    if robot.reference_point is not None:
        table["reference_point"] = list(robot.reference_point)
    if robot.diagnosis:
        table["diagnosis"] = dict(robot.diagnosis)
        path = table["diagnosis"].get("covariance")
        if path and folder is not None:
            table["diagnosis"]["covariance"] = path_from(folder.resolve(), path)
    return table


def frame_table(frame: Frame, folder: Path | None = None) -> dict[str, Any]:
    """Return the content of a ``[[frame]]`` table without default values.

    Args:
        frame: frame of a robot.
        folder: folder of the output file, to which paths are made relative.

    Returns:
        Keys and values in the file format.
    """
    table: dict[str, Any] = {"name": frame.name, "parent": frame.parent}
    table["translation"] = frame.translation.tolist()
    table["rotation"] = frame.rotation.tolist()
    if frame.joint != "fixed":
        table |= {"joint": frame.joint, "position": frame.position}
        if frame.pitch:
            table["pitch"] = frame.pitch
        if frame.actuated:
            table["actuated"] = True
        if frame.limits is not None:
            table["limits"] = list(frame.limits)
    bolt, error = frame.locked_at, frame.geometric_error
    if bolt is not None:
        error = error - bolt.screw
    if np.any(error):
        table["geometric_error"] = error.tolist()
    if frame.tolerance is not None:
        table["tolerance"] = frame.tolerance.tolist()
    table |= joint_table(frame.clearance, bolt, frame.joint_stiffness)
    if frame.drive_force:
        table["drive_force"] = frame.drive_force
    if frame.link is not None:
        table |= link_table(frame.link, folder)
    if frame.mass:
        table["mass"] = frame.mass
    if np.any(frame.centre_of_mass):
        table["centre_of_mass"] = frame.centre_of_mass.tolist()
    if np.any(frame.inertia):
        table["inertia"] = six_moments(frame.inertia)
    return table
