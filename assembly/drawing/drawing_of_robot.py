"""Conversion of a robot with frames and closures to bodies and joints.

Start with :func:`drawing_of_robot`.  ``frames.py`` contains the inverse conversion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import (
    Drawing,
    DrawnBody,
    DrawnJoint,
    JointNumbers,
)
from forcefit.assembly.drawing.joint_types import FoundJoint, found_joints, has_mass
from forcefit.assembly.drawing.links import beam_start, drawn_link
from forcefit.assembly.drawing.parts import joint_axes, parts_of
from forcefit.assembly.drawing.rigid_bodies import RigidBodies, rigid_bodies
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture, home_posture
from forcefit.assembly.model.inertia import joined_bodies
from forcefit.assembly.model.robot import (
    BASE,
    Frame,
    LibraryLink,
    Robot,
)
from forcefit.inputs.table import BadInput, quoted
from forcefit.results.display import rounded
from forcefit.stiffness.screws import rotation_vector, transform

_SAME = 1e-12  # [rad, or fraction of the robot size] tolerance for equal poses
# attributes of a frame that are converted
_HELD = {
    "name", "parent", "translation", "rotation", "joint", "actuated", "position",
    "limits", "geometric_error", "tolerance", "clearance", "joint_stiffness", "link",
    "locked_at",
    "mass", "centre_of_mass", "inertia", "pitch",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class DrawnRobot:
    """Bodies and joints of a robot, and descriptions of omitted properties.

    Attributes:
        drawing: bodies and joints of the robot.
        frames: names of joint frames after conversion back to frames, by their names in
            the original robot.  Frames of ball, cylindrical and planar joints are not
            included, because their axes change.
        left_out: descriptions of properties that are omitted.
    """

    drawing: Drawing
    frames: Mapping[str, str]
    left_out: tuple[str, ...]


def drawing_of_robot(robot: Robot) -> DrawnRobot:
    """Convert a robot to bodies and joints in its home pose.

    Args:
        robot: robot with frames and closures.

    Returns:
        Bodies and joints, and descriptions of omitted properties.

    Raises:
        BadInput: the robot cannot be described by bodies and joints.
    """
    posture = home_posture(robot)
    rigid = rigid_bodies(robot)
    end = rigid.after[robot.index(robot.platform)]
    if end == 0:
        raise BadInput(
            f"{robot.name}: found a platform that is fixed to the base, expected a "
            "moving platform"
        )
    # frames are not combined if effects refer to frames by name
    sheet = _Sheet(posture, rigid, found_joints(posture, rigid, not robot.has_effects))
    _add_bodies(sheet)
    for i, frame in enumerate(robot.frames):
        if frame.link is not None:
            _add_link(sheet, i)
        if has_mass(frame) and rigid.before[i] != 0:
            _add_mass(sheet, i)
    sheet.joints.extend((found.joint, *found.bodies) for found in sheet.found)
    joints = [
        replace(joint, first=sheet.name_of(first), second=sheet.name_of(second))
        for joint, first, second in sheet.joints
    ]
    drawing = Drawing(
        robot.name, sheet.name_of(end), posture.platform[:3, 3],
        tuple(sheet.bodies.values()), tuple(joints), robot.description,
    )  # fmt: skip
    return DrawnRobot(drawing, _frames(sheet), tuple(_left_out(sheet)))


@dataclass(frozen=True, eq=False)
class _Sheet:
    """Intermediate data of the conversion.

    Attributes:
        posture: the robot in its home pose.
        rigid: rigid bodies of the robot.
        found: joints of the robot.
        bodies: bodies other than the base, by their numbers.
        joints: joints, with the numbers of their two bodies.
        same: number of the body that contains a link, by the number of the rigid body
            at the start of the link.
    """

    posture: Posture
    rigid: RigidBodies
    found: list[FoundJoint]
    bodies: dict[int, DrawnBody] = field(default_factory=dict)
    joints: list[tuple[DrawnJoint, int, int]] = field(default_factory=list)
    same: dict[int, int] = field(default_factory=dict)

    def name_of(self, k: int) -> str:
        """Return the name of the body with a given number."""
        k = self.same.get(k, k)
        return self.bodies[k].name if k else BASE

    def new_name(self, name: str, joint: bool) -> str:
        """Append underscores to a body or joint name until the name is unique."""
        taken = {j.name for j, _, _ in self.joints} | {f.joint.name for f in self.found}
        if not joint:
            taken = {body.name for body in self.bodies.values()} | {BASE}
        while name in taken:
            name += "_"
        return name


def _frames(sheet: _Sheet) -> dict[str, str]:
    """Return names of joint frames after conversion, by their original names."""
    names = {}
    for found in sheet.found:
        if len(found.rows) == 1 or found.joint.kind == "universal":
            parts = parts_of(found.joint)
            for row, part in zip(found.rows, parts, strict=True):
                names[sheet.posture.robot.frames[row].name] = part.name
    return names


def _left_out(sheet: _Sheet) -> list[str]:
    """Return descriptions of properties that bodies and joints do not include."""
    posture, robot = sheet.posture, sheet.posture.robot
    lost = []
    turned = rotation_vector(posture.platform[:3, :3])
    if np.abs(turned).max() > _SAME:
        numbers = ", ".join(f"{rounded(angle):.6g}" for angle in turned)
        lost.append(
            f"axes of the platform, which are rotated by [{numbers}] rad relative to "
            "the base at home; in the new file, this rotation is 0"
        )
    moved = [
        quoted(found.joint.name) for found in sheet.found if len(found.rows) > 1
        and np.abs(posture.coordinates[list(found.rows)]).max() > 1e-9
    ]  # fmt: skip
    if moved:
        names = ", ".join(moved)
        lost.append(f"home coordinates of {names}, which are 0 in the new file")
    grounded = [
        quoted(frame.name) for i, frame in enumerate(robot.frames)
        if has_mass(frame) and sheet.rigid.before[i] == 0
    ]  # fmt: skip
    if grounded:
        lost.append(f"masses that are fixed to the base: {', '.join(grounded)}")
    if posture.mismatch > _SAME:
        lost.append(
            f"nominal closure error of {posture.mismatch:.2g} rad or m, which is 0 in "
            "the new file"
        )
    for name in sorted({each.name for each in fields(Frame)} - _HELD):
        given = [quoted(f.name) for f in robot.frames if np.any(getattr(f, name))]
        lost += [f"{name} of {', '.join(given)}"] if given else []
    return lost


def _add_bodies(sheet: _Sheet) -> None:
    """Add the bodies, which have the names of the platform or of their frames."""
    robot, rigid = sheet.posture.robot, sheet.rigid
    numbers = {rigid.after[robot.index(robot.platform)]: robot.platform}
    first = [i for i, frame in enumerate(robot.frames) if _holds(frame)]
    every = range(len(robot.frames))
    for which, rows in (
        (rigid.before, first), (rigid.before, every), (rigid.after, every)
    ):  # fmt: skip
        for i in rows:
            numbers.setdefault(which[i], robot.frames[i].name)
    numbers.pop(0, None)
    named = {
        robot.frames[row].name: found.joint.name
        for found in sheet.found for row in found.rows
    }  # fmt: skip
    needed = {k for found in sheet.found for k in found.bodies}
    needed |= {k for i, k in enumerate(rigid.before) if _holds(robot.frames[i])}
    needed |= {k for i, k in enumerate(rigid.starts) if robot.frames[i].link}
    needed.add(rigid.after[robot.index(robot.platform)])
    for k, name in sorted(numbers.items()):
        if k in needed:
            sheet.bodies[k] = DrawnBody(
                sheet.new_name(named.get(name, name), joint=False)
            )


def _holds(frame: Frame) -> bool:
    """Return whether a frame has a mass or a link."""
    return has_mass(frame) or frame.link is not None


def _add_mass(sheet: _Sheet, i: int) -> None:
    """Add the mass and moments of inertia of a frame to its body."""
    frame, T = sheet.posture.robot.frames[i], sheet.posture.transforms[i]
    R, k = T[:3, :3], sheet.rigid.before[i]
    body = sheet.bodies[k]
    J = R @ frame.inertia @ R.T
    own = frame.mass, R @ frame.centre_of_mass + T[:3, 3], (J + J.T) / 2
    if has_mass(body):
        own = joined_bodies([(body.mass, body.centre, body.inertia), own])
    mass, centre, inertia = own
    sheet.bodies[k] = replace(body, mass=mass, centre=centre, inertia=inertia)


def _new_body(sheet: _Sheet, name: str) -> int:
    """Add a body, and return its number."""
    k = 1 + max((*sheet.bodies, *sheet.same), default=0)
    sheet.bodies[k] = DrawnBody(sheet.new_name(name, joint=False))
    return k


def _at(point: NDArray) -> NDArray:
    """Return the pose at a point with the axes of the base, (4, 4)."""
    return transform(point, np.eye(3))


def _fix(sheet: _Sheet, name: str, first: int, second: int, T: NDArray) -> DrawnJoint:
    """Add a fixed joint between two bodies, and return it."""
    name = sheet.new_name(name, joint=True)
    joint = DrawnJoint(
        name, "fixed", "", "", T[:3, 3], T[:3, 2], T[:3, 0], T[:3, 0],
        numbers=(JointNumbers(),),
    )  # fmt: skip
    sheet.joints.append((joint, first, second))
    return joint


def _add_link(sheet: _Sheet, i: int) -> None:
    """Add a link between two joints of its body; missing joints are added."""
    robot, rigid = sheet.posture.robot, sheet.rigid
    frame, T = robot.frames[i], sheet.posture.transforms[i]
    start, end = rigid.starts[i], rigid.before[i]
    to = _joint_at(sheet, i, end)
    body = end
    if to is None or end == 0 or sheet.bodies[end].link is not None:
        body = _new_body(sheet, f"{frame.name}.link")
        to = _fix(sheet, f"{frame.name}.tip", body, end, T)
    begin = beam_start(frame, T)
    root = _only_joint(sheet, start, i)
    if root is None or root is to:
        point = T[:3, 3] if begin is None else begin
        root = _fix(sheet, f"{frame.name}.root", start, body, _at(point))
    else:
        sheet.same[start] = body
        del sheet.bodies[start]
    spanned = begin is not None and _distance(sheet, root, begin) < _SAME
    link = drawn_link(frame, T, joint_axes(to), spanned)
    ends = root.name, to.name
    sheet.bodies[body] = replace(sheet.bodies[body], link=link, ends=ends)


def _distance(sheet: _Sheet, joint: DrawnJoint, point: NDArray) -> float:
    """Return the distance of a joint from a point, divided by the robot size."""
    gap = float(np.abs(joint.at - point).max())
    return gap / size_of(sheet.posture.robot)


def _joint_at(sheet: _Sheet, i: int, body: int) -> DrawnJoint | None:
    """Return the joint at the tip of a link, or None if a joint must be added."""
    frame, T = sheet.posture.robot.frames[i], sheet.posture.transforms[i]
    for found in sheet.found:
        joint = found.joint
        if body not in found.bodies or _distance(sheet, joint, T[:3, 3]) > _SAME:
            continue
        same = np.abs(joint_axes(joint)[:3, :3] - T[:3, :3]).max() < _SAME
        if same or not isinstance(frame.link, LibraryLink):
            return joint
    return None


def _only_joint(sheet: _Sheet, body: int, i: int) -> DrawnJoint | None:
    """Return the joint at the start of a link if its body has no other content."""
    robot, rigid = sheet.posture.robot, sheet.rigid
    if (
        body == 0
        or body in sheet.same
        or body == rigid.after[robot.index(robot.platform)]
    ):
        return None
    others = [k for k, f in enumerate(robot.frames) if k != i and (
        (f.link is not None and body in (rigid.starts[k], rigid.before[k]))
        or (has_mass(f) and rigid.before[k] == body)
    )]  # fmt: skip
    joints = [found.joint for found in sheet.found if body in found.bodies]
    return joints[0] if len(joints) == 1 and not others else None
