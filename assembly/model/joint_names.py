"""Find the frames of joints that consist of several frames.

A joint with several degrees of freedom is a series of coincident passive frames, for
example ``ball.first``, each with one degree of freedom
(:mod:`forcefit.assembly.drawing.parts`). The geometric error, clearance and springs of
the joint are assigned to one of these frames, or to both frames of a universal joint.
The joints are identified by :mod:`forcefit.assembly.model.frame_series`.
"""

from collections.abc import Container, Sequence

from forcefit.assembly.model.frame_series import NamedJoint
from forcefit.assembly.model.robot import BASE, Robot
from forcefit.stiffness.screws import SCREW

# name endings of the frames that model contacts (assembly/drawing/contacts.py)
BORE = "bore_start", "bore_end"
BEARING = "bearing_start", "bearing_end"
_TURNS = "roll", "yaw_start", "yaw_end", "pitch_start", "pitch_end"
GUIDE, GUIDE_FAR = (
    tuple(f"{name}_{turn}" for turn in _TURNS) for name in ("guide", "guide_far")
)
PAD = "pad_1", "pad_2", "pad_3", "pad_4", "pad_5"
# frames at which two chains of contacts start and end
CHAIN_START, CHAIN_END, FAR_END = "contacts_start", "contacts_end", "contacts_far_end"
_CONTACTS = {
    *BORE, *BEARING, *GUIDE, *GUIDE_FAR, *PAD, CHAIN_START, CHAIN_END, FAR_END,
}  # fmt: skip
# Component of a screw in the frame slide_x for each component in the axes of a planar
# joint. The z axis of this frame is the x axis of the joint.
_OF_PLANE = (2, 0, 1, 5, 3, 4)


def row_of(robot: Robot, name: str) -> int:
    """Return the index of the frame that has the origin and the axes of a joint.

    Args:
        robot: robot with the joint.
        name: name of a frame, or of a joint that consists of several frames.

    Returns:
        Index of the frame, which is ``first`` for a universal or spherical joint and
        ``turn`` for a cylindrical or planar joint.

    Raises:
        BadInput: neither a frame nor a joint has this name.
    """
    joint = robot.joints.get(name)
    return robot.index(name if joint is None else joint.main)


def error_rows(robot: Robot, name: str) -> list[tuple[int, list[int]]]:
    """Return the frames and components to which the geometric error of a joint belongs.

    Args:
        robot: robot with the joint.
        name: name of a frame, or of a joint that consists of several frames.

    Returns:
        For each of these frames, its index and the components that correspond to RX ..
        TZ in the joint axes.  A universal joint has two such frames, one per bearing;
        other joints have one.

    Raises:
        BadInput: neither a frame nor a joint has this name.
    """
    joint = robot.joints.get(name)
    if joint is None:
        return [(robot.index(name), [*range(6)])]
    order = _OF_PLANE if joint.kind == "planar" else range(6)
    return [(robot.index(frame), [*order]) for frame in joint.carriers]


def error_label(robot: Robot, row: int, component: int) -> str:
    """Return the name of an error component, for example ``ball.TX``.

    Args:
        robot: robot with the frame.
        row: index of the frame.
        component: index of the component at the frame, 0 to 5 for RX .. TZ.

    Returns:
        Name and component of the joint if its error belongs to this frame alone,
        otherwise name and component of the frame.
    """
    name = robot.frames[row].name
    for joint in robot.joints.values():
        if joint.carriers == (name,):
            plane = joint.kind == "planar"
            own = _OF_PLANE.index(component) if plane else component
            return f"{joint.name}.{SCREW[own]}"
    return f"{name}.{SCREW[component]}"


def shown_name(robot: Robot, row: int) -> str:
    """Return the name that is printed for the clearance and springs of a frame.

    Args:
        robot: robot with the frame.
        row: index of the frame.

    Returns:
        Name of the joint if its clearance and springs belong to this frame alone,
        otherwise the name of the frame.
    """
    name = robot.frames[row].name
    for joint in robot.joints.values():
        if name == joint.main and joint.kind != "universal":
            return joint.name
    return name


def clearance_name(robot: Robot, row: int, bound: str) -> str:
    """Return the name that is printed for a clearance bound.

    Args:
        robot: robot with the frame.
        row: index of the frame with the clearance.
        bound: key of the bound: ``radial``, ``axial``, ``tilt``, ``spin`` or ``ball``.

    Returns:
        A name such as ``"hinge.tilt"``.  The name for all contacts of a joint ``rail``
        is ``"rail.clearance"``.
    """
    if owner_of_contact(robot.frames[row].name, names_of(robot)):
        return f"{joint_of(robot, row)}.clearance"
    return f"{shown_name(robot, row)}.{bound}"


def joint_of(robot: Robot, row: int) -> str:
    """Return the name of the joint to which a frame belongs.

    Args:
        robot: robot with the frame.
        row: index of the frame.

    Returns:
        Name of the joint, for example ``foot`` for the contact ``foot.bore_start``.
        Without such a joint, the name of the frame.
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
    """Return the name of the joint or frame to which a contact belongs.

    Args:
        name: name of a frame, for example ``"foot.bore_start"``.
        names: names of all frames and joints.

    Returns:
        The name, for example ``"foot"``, if it is in ``names``; an empty string if the
        frame is not a contact.
    """
    stem, _, end = name.rpartition(".")
    return stem if stem in names and end in _CONTACTS else ""


def closing_names(
    closures: Sequence[Sequence[str]], names: Container[str]
) -> dict[str, str]:
    """Return the printed names of the frames that are added at loop closures.

    In a robot described by bodies and joints, a joint ``yrail`` that closes a loop ends
    with a frame ``yrail.end``.  If the loop is closed at the base, a frame
    ``yrail.base`` is added to the base.

    Args:
        closures: pairs of frame names.
        names: names of all frames and joints.

    Returns:
        Name of the joint, or ``"base"``, for each added frame.
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
    """Return whether a joint, given by its name or its frame, can move."""
    return name in robot.joints or robot.frame(name).joint != "fixed"


def names_of(robot: Robot) -> list[str]:
    """Return the names of all frames and of all joints with several frames."""
    return [*(frame.name for frame in robot.frames), *robot.joints]


def joint_paths(joint: NamedJoint, path: str) -> list[str]:
    """Convert the parameter path of a joint to the parameter paths of its frames.

    Args:
        joint: joint that consists of several frames.
        path: path such as ``"ball.clearance.ball"`` or ``"cross.geometric_error.rx"``,
            with or without the leg name.

    Returns:
        Paths with frame names in place of the joint name: two paths for a universal
        joint, and none if the path does not belong to this joint.
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
