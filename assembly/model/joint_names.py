"""Names of drawn joints that became several frames, such as ``ball`` of ``ball.first``.

A joint of several freedoms is a series of passive frames at one point, each with one
freedom (:mod:`forcefit.assembly.drawing.parts`).  Its errors, clearance and springs are
on one of them, those of a universal joint on both.  A user names the joint; these
functions return the frames that are meant.  :mod:`forcefit.assembly.model.frame_series`
finds the joints.
"""

import re
from collections.abc import Container, Sequence

from forcefit.assembly.model.frame_series import NamedJoint
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.stiffness.screws import SCREW

# ends of the names of a joint's contacts (assembly/drawing/contacts.py)
_CONTACT = re.compile(
    r"(bore|bearing)_(start|end)|guide(_far)?_(roll|(yaw|pitch)_(start|end))|pad_[1-4]"
    r"|contacts_(start|end|far_end)"
)
# component of the frame slide_x, whose z is the joint's x, for each of a planar joint
_OF_PLANE = (2, 0, 1, 5, 3, 4)


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


def clearance_name(robot: Robot, row: int, bound: str) -> str:
    """Return the name under which a bound of a clearance is shown.

    Args:
        robot: any robot.
        row: of the frame with the clearance.
        bound: ``radial``, ``axial``, ``tilt``, ``spin`` or ``ball``.

    Returns:
        ``"rail.clearance"`` of a contact of the joint ``rail``, because the bounds of
        its contacts follow from the joint's gaps; otherwise ``"hinge.tilt"``.
    """
    if owner_of_contact(robot.frames[row].name, names_of(robot)):
        return f"{joint_of(robot, row)}.clearance"
    return f"{shown_name(robot, row)}.{bound}"


def joint_of(robot: Robot, row: int) -> str:
    """Return the name of the drawn joint to which a frame belongs.

    Args:
        robot: any robot.
        row: of a frame.

    Returns:
        The name of the joint of several frames, or of the joint whose contact the frame
        is (``"foot"`` of ``foot.bore_start``); otherwise the name of the frame.
    """
    frame = robot.frames[row]
    fixed = frame.joint == "fixed"
    owner = owner_of_contact(frame.name, names_of(robot)) if fixed else ""
    name = owner or frame.name
    for joint in robot.joints.values():
        if name in joint.frames:
            return joint.name
    return name


def owner_of_contact(name: str, names: Container[str]) -> str:
    """Return the joint or frame whose contact a frame is, or an empty text.

    Args:
        name: of a frame, such as ``"foot.bore_start"``.
        names: of frames and joints.

    Returns:
        ``"foot"`` if it is one of the names.
    """
    stem, _, end = name.rpartition(".")
    return stem if stem in names and _CONTACT.fullmatch(end) else ""


def closing_names(
    closures: Sequence[Sequence[str]], names: Container[str]
) -> dict[str, str]:
    """Return the names under which the frames are shown that a drawing adds at a loop.

    A drawn joint that closes a loop ends with a frame ``yrail.end``.  If the loop
    closes at the base, the base has a frame ``yrail.base`` there.

    Args:
        closures: pairs of names of frames.
        names: names of frames and joints.

    Returns:
        For each such frame, the name of the joint, or ``"base"``.
    """
    shown: dict[str, str] = {}
    for last, seat in closures:
        stem = last.removesuffix(".end")
        if stem != last and stem in names:
            shown[last] = stem
            if seat == f"{stem}.{BASE}":
                shown[seat] = BASE
    return shown


def moves(robot: Robot, name: str) -> bool:
    """Return whether a frame, or a joint of several frames, has a motion."""
    return name in robot.joints or robot.frame(name).joint != "fixed"


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
