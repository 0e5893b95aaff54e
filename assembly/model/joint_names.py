"""Names of joints that consist of several frames, such as ``ball`` of ``ball.first``.

A joint of several freedoms is a series of passive frames at one point, each with one
freedom (:mod:`forcefit.assembly.drawing.parts`).  One of these frames has the geometric
error, the clearance and the springs of the joint.  In a universal joint, both frames
have them.  A user names the joint; the functions of this module return the frames of
that joint.  :mod:`forcefit.assembly.model.frame_series` finds the joints.
"""

from collections.abc import Container, Sequence

from forcefit.assembly.model.frame_series import NamedJoint
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.stiffness.screws import SCREW

# ends of the names of the frames that model contacts (assembly/drawing/contacts.py)
BORE = "bore_start", "bore_end"
BEARING = "bearing_start", "bearing_end"
_TURNS = "roll", "yaw_start", "yaw_end", "pitch_start", "pitch_end"
GUIDE, GUIDE_FAR = (
    tuple(f"{name}_{turn}" for turn in _TURNS) for name in ("guide", "guide_far")
)
PAD = "pad_1", "pad_2", "pad_3", "pad_4", "pad_5"
# frames at which two chains of contacts begin and meet
CHAIN_START, CHAIN_END, FAR_END = "contacts_start", "contacts_end", "contacts_far_end"
_CONTACTS = {
    *BORE, *BEARING, *GUIDE, *GUIDE_FAR, *PAD, CHAIN_START, CHAIN_END, FAR_END,
}  # fmt: skip
# for each component of a planar joint, the component of its frame slide_x, whose z axis
# is the joint's x axis
_OF_PLANE = (2, 0, 1, 5, 3, 4)


def row_of(robot: Robot, name: str) -> int:
    """Return the row of the frame at the point and in the axes of a joint.

    Args:
        robot: any robot.
        name: name of a frame, or of a joint that consists of several frames.

    Returns:
        The index of the frame.  For a universal or a spherical joint, this is its frame
        ``first``; for a cylindrical or a planar joint, its frame ``turn``.

    Raises:
        BadInput: neither a frame nor a joint has this name.
    """
    joint = robot.joints.get(name)
    return robot.index(name if joint is None else joint.main)


def error_rows(robot: Robot, name: str) -> list[tuple[int, list[int]]]:
    """Return the frames and components that contain the geometric error of a joint.

    Args:
        robot: any robot.
        name: name of a frame, or of a joint that consists of several frames.

    Returns:
        For each frame with an error, its index, and its component for each of RX .. TZ
        in the joint's axes.  A universal joint has two such frames, because each of its
        bearings has the error.  Every other joint has one.

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
        row: index of the frame.
        component: component of the frame's error, 0 to 5 for RX .. TZ.

    Returns:
        Name and component of the joint to which the frame belongs, if no other frame
        has errors of that joint.  Otherwise the name and component of the frame.
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
        row: index of the frame.

    Returns:
        The name of the joint to which the frame belongs, if no other frame has
        clearance or springs of that joint.  Otherwise the name of the frame.
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
        row: index of the frame that has the clearance.
        bound: key of the bound: ``radial``, ``axial``, ``tilt``, ``spin`` or ``ball``.

    Returns:
        For a contact of the joint ``rail``, ``"rail.clearance"``, because the bounds of
        the contacts follow from the gaps of the joint.  Otherwise a name such as
        ``"hinge.tilt"``.
    """
    if owner_of_contact(robot.frames[row].name, names_of(robot)):
        return f"{joint_of(robot, row)}.clearance"
    return f"{shown_name(robot, row)}.{bound}"


def joint_of(robot: Robot, row: int) -> str:
    """Return the name of the drawn joint to which a frame belongs.

    Args:
        robot: any robot.
        row: index of the frame.

    Returns:
        The name of the joint to which the frame belongs.  For a contact such as
        ``foot.bore_start``, this is the joint ``foot``.  A frame of no such joint has
        its own name.
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
    """Return the joint or frame to which a contact belongs, or an empty text.

    Args:
        name: name of a frame, such as ``"foot.bore_start"``.
        names: names of frames and joints.

    Returns:
        ``"foot"`` for this example, if ``"foot"`` is one of ``names``.  Empty for a
        frame that is not a contact.
    """
    stem, _, end = name.rpartition(".")
    return stem if stem in names and end in _CONTACTS else ""


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
    """Return whether a frame, or a joint of several frames, can move."""
    return name in robot.joints or robot.frame(name).joint != "fixed"


def names_of(robot: Robot) -> list[str]:
    """Return the names of all frames, and of all joints of several frames."""
    return [*(frame.name for frame in robot.frames), *robot.joints]


def joint_paths(joint: NamedJoint, path: str) -> list[str]:
    """Return the paths of the frames' numbers that one path of a joint's number means.

    Args:
        joint: joint that consists of several frames.
        path: path such as ``"ball.clearance.ball"`` or ``"cross.geometric_error.rx"``.
            The name of the leg at its beginning can be omitted.

    Returns:
        Paths in which the joint is replaced by the frame that has the number: two paths
        for a universal joint, and none if the path does not belong to this joint.
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
