"""Names of drawn joints that became several frames, such as ``ball`` of ``ball.first``.

A joint of several freedoms is a series of passive frames at one point, each with one
freedom (:mod:`forcefit.assembly.drawing.parts`).  Its errors, clearance and springs are on one
of them, those of a universal joint on both.  A user names the joint; these functions
return the frames that are meant.
"""

from dataclasses import dataclass

import numpy as np

from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import SCREW

_SAME = 1e-9  # [m] distance below which the frames of one joint are at one point
# ends of the frames' names with their joints, from the first body to the second
_SERIES: dict[tuple[tuple[str, str], ...], str] = {
    (("first", "revolute"), ("second", "revolute")): "universal",
    (
        ("first", "revolute"),
        ("second", "revolute"),
        ("third", "revolute"),
    ): "spherical",
    (("turn", "revolute"), ("slide", "prismatic")): "cylindrical",
    (
        ("slide_x", "prismatic"),
        ("slide_y", "prismatic"),
        ("turn", "revolute"),
    ): "planar",
}
# component of the frame slide_x, whose z is the joint's x, for each of a planar joint
_OF_PLANE = (2, 0, 1, 5, 3, 4)


@dataclass(frozen=True)
class NamedJoint:
    """A joint of several frames.

    Attributes:
        name: of the joint.
        kind: ``"universal"``, ``"spherical"``, ``"cylindrical"`` or ``"planar"``.
        frames: names of its frames with a freedom, parents first.
        main: name of the frame at the joint's point and in its axes.
        carriers: names of the frames with its geometric errors: two of a universal
            joint, one of others.
    """

    name: str
    kind: str
    frames: tuple[str, ...]
    main: str
    carriers: tuple[str, ...]


def joints_of(robot: Robot) -> dict[str, NamedJoint]:
    """Return the joints of several frames by name, in the order of the frames.

    Args:
        robot: any robot; joints are recognised by the names, the kinds and the common
            point of their frames, so that a converted file has them too.
    """
    stems: dict[str, list[str]] = {}
    known = {frame.name for frame in robot.frames}
    for frame in robot.frames:
        stem, dot, _ = frame.name.rpartition(".")
        if dot and frame.passive and stem not in known:
            stems.setdefault(stem, []).append(frame.name)
    found = (_joint(robot, stem, names) for stem, names in stems.items())
    return {joint.name: joint for joint in found if joint is not None}


def _joint(robot: Robot, stem: str, names: list[str]) -> NamedJoint | None:
    """The joint of the frames whose names begin alike, None if they are not one."""
    ends = tuple((name[len(stem) + 1 :], robot.frame(name).joint) for name in names)
    kind = _SERIES.get(ends) or _SERIES.get(ends[::-1])
    if kind is None or not _at_one_point(robot, stem, names):
        return None
    ordered = names if ends in _SERIES else names[::-1]
    main = ordered[2] if kind == "planar" else ordered[0]
    carriers = ordered if kind == "universal" else ordered[:1]
    return NamedJoint(stem, kind, tuple(names), main, tuple(carriers))


def _at_one_point(robot: Robot, stem: str, names: list[str]) -> bool:
    """Whether frames follow each other at one point, only contacts between them."""
    first, row = robot.index(names[0]), robot.index(names[-1])
    T = np.eye(4)
    while row != first:
        T = robot.fixed_transforms[row] @ T
        row = int(robot.parents[row])
        if row < 0 or not robot.frames[row].name.startswith(f"{stem}."):
            return False
    return float(np.abs(T[:3, 3]).max()) <= _SAME


def row_of(robot: Robot, name: str) -> int:
    """Return the row of the frame at the point and in the axes of a joint.

    Args:
        robot: any robot.
        name: of a frame, or of a joint of several frames.

    Returns:
        For a joint, the row of ``first`` of a universal or a spherical joint, and of
        ``turn`` of a cylindrical or a planar one.

    Raises:
        BadInput: neither a frame nor a joint has this name.
    """
    joint = robot.joints.get(name)
    return robot.index(name if joint is None else joint.main)


def error_rows(robot: Robot, name: str) -> list[tuple[int, list[int]]]:
    """Return where the geometric error of a joint is.

    Args:
        robot: any robot.
        name: of a frame, or of a joint of several frames.

    Returns:
        For each frame, two of a universal joint, whose bearings each have the error,
        and one otherwise: its row, and its component for each of RX .. TZ in the
        joint's axes.

    Raises:
        BadInput: neither a frame nor a joint has this name.
    """
    joint = robot.joints.get(name)
    if joint is None:
        return [(robot.index(name), [*range(6)])]
    order = _OF_PLANE if joint.kind == "planar" else range(6)
    return [(robot.index(frame), [*order]) for frame in joint.carriers]


def error_label(robot: Robot, row: int, component: int) -> str:
    """Return the name of an error, such as ``ball.TX``.

    Args:
        robot: any robot.
        row: of a frame.
        component: of the frame, 0 to 5 for RX .. TZ.

    Returns:
        Name and component of the joint of several frames if no other frame has its
        errors, and of the frame otherwise.
    """
    name = robot.frames[row].name
    for joint in robot.joints.values():
        if joint.carriers == (name,):
            plane = joint.kind == "planar"
            own = _OF_PLANE.index(component) if plane else component
            return f"{joint.name}.{SCREW[own]}"
    return f"{name}.{SCREW[component]}"


def shown_name(robot: Robot, row: int) -> str:
    """Return the name under which the clearance and the springs of a frame are shown.

    Args:
        robot: any robot.
        row: of a frame.

    Returns:
        The name of the joint of several frames if no other frame has its clearance and
        springs, and of the frame otherwise.
    """
    name = robot.frames[row].name
    for joint in robot.joints.values():
        if name == joint.main and joint.kind != "universal":
            return joint.name
    return name


def names_of(robot: Robot) -> list[str]:
    """Return the names of all frames, and of all joints of several frames."""
    return [*(frame.name for frame in robot.frames), *robot.joints]


def joint_paths(joint: NamedJoint, path: str) -> list[str]:
    """Return the paths of frames that a path of a joint's number means.

    Args:
        joint: of several frames.
        path: such as ``"ball.clearance.ball"`` or ``"cross.geometric_error.rx"``, also
            without the leg of the joint.

    Returns:
        The same with the frame that has the number: two of a universal joint, none if
        the path is not of this joint.
    """
    for name in (joint.name, joint.name.partition(".")[2]):
        if name and path.startswith(f"{name}."):
            break
    else:
        return []
    keys = path[len(name) + 1 :].split(".")
    error = keys[0] in {"geometric_error", "tolerance"}
    if error and joint.kind == "planar" and keys[-1].upper() in SCREW:
        keys[-1] = SCREW[_OF_PLANE[SCREW.index(keys[-1].upper())]].lower()
    both = error or joint.kind == "universal"
    frames = joint.carriers if both else (joint.main,)
    return [".".join([frame, *keys]) for frame in frames]
