"""Frames of a joint: one frame for each degree of freedom, all at the same point."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.contacts import Contact
from forcefit.assembly.drawing.drawing import FREE_ROWS, DrawnJoint, JointNumbers
from forcefit.assembly.model.joint_names import CHAIN_END, CHAIN_START, FAR_END
from forcefit.stiffness.screws import transform

_FLIP = np.diag([1.0, -1.0, -1.0])  # rotation by 180 degrees about x
_FLIP_SCREW = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class Part:
    """Frame of a joint.

    Attributes:
        name: name of the frame.
        kind: ``"fixed"``, ``"revolute"`` or ``"prismatic"``, about or along its z axis.
        pose: home pose before the joint motion, (4, 4).
        position: coordinate in the home pose [rad or m].
        numbers: error, clearance and stiffness of this frame.
        contact: whether the frame represents a contact.
    """

    name: str
    kind: str
    pose: NDArray
    position: float
    numbers: JointNumbers
    contact: bool = False


@dataclass(frozen=True, eq=False)
class Parallel:
    """Second chain of frames between the same two bodies.

    Attributes:
        start: name of the parent frame of the chain.
        parts: frames of the chain; the last frame closes a loop with the first chain.
        meets: name of the frame in the first chain that coincides with this last frame.
    """

    start: str
    parts: list[Part]
    meets: str


def parts_of(joint: DrawnJoint, reverse: bool = False) -> list[Part]:
    """Return the frames of a joint from its first to its second body.

    Args:
        joint: joint of any type.
        reverse: whether the order is from the second to the first body.  The motion,
            errors and springs of the joint do not depend on the order.

    Returns:
        At least one frame.
    """
    every = _all_parts(joint)
    parts = _passed([part for part, chain in every if chain == 0], reverse)
    if any(chain == 1 for _, chain in every):
        at = 1 + max(i for i, part in enumerate(parts) if part.contact)
        parts.insert(at, _bare(joint, CHAIN_END))
        if parts[0].contact:  # both chains begin at this frame
            parts.insert(0, _bare(joint, CHAIN_START))
    return parts


def parallel_parts(joint: DrawnJoint, reverse: bool = False) -> Parallel | None:
    """Return the second chain of contacts of a joint.

    Args:
        joint: joint of any type.
        reverse: whether the order is from the second to the first body.

    Returns:
        The chain, or None if the contacts form one chain.
    """
    chain = [part for part, k in _all_parts(joint) if k == 1]
    if not chain:
        return None
    parts = parts_of(joint, reverse)
    contacts = [i for i, part in enumerate(parts) if part.contact]
    start, meets = parts[contacts[0] - 1].name, parts[contacts[-1] + 1].name
    end = _bare(joint, FAR_END)
    return Parallel(start, [*_passed(chain, reverse), end], meets)


def every_part(joint: DrawnJoint, reverse: bool = False) -> list[Part]:
    """Return the frames of a joint, followed by the frames of its second chain."""
    chain = parallel_parts(joint, reverse)
    return [*parts_of(joint, reverse), *(chain.parts if chain else ())]


def _bare(joint: DrawnJoint, suffix: str) -> Part:
    """Return a fixed frame at a joint, at which two chains begin or end."""
    name = f"{joint.name}.{suffix}"
    return Part(name, "fixed", joint_axes(joint), 0.0, JointNumbers())


def _all_parts(joint: DrawnJoint) -> list[tuple[Part, int]]:
    """Return the frames of a joint from its first body, and the chain of each frame."""
    parts: list[tuple[Part, int]] = []
    for row, numbers in zip(_motions(joint), _shares(joint), strict=True):
        part = _part(joint, *row, numbers)
        contacts = [
            (_contact_part(joint, row[0], part.pose, c), c.chain)
            for c in numbers.contacts
        ]
        own = [(part, 0)]
        # contact frames come after the frames of a planar joint, and before the frames
        # of any other joint
        parts += [*own, *contacts] if joint.kind == "planar" else [*contacts, *own]
    return parts


def _passed(parts: list[Part], reverse: bool) -> list[Part]:
    """Return the frames of a joint in the order of the spanning tree."""
    return [_reversed(part) for part in reversed(parts)] if reverse else parts


def _contact_part(
    joint: DrawnJoint, suffix: str, pose: NDArray, contact: Contact
) -> Part:
    """Return the fixed frame of a contact; ``pose`` is the home pose of the joint."""
    name = ".".join(filter(None, (joint.name, suffix, contact.suffix)))
    end = contact.end
    if end is not None:
        parts = ".".join(filter(None, (joint.name, suffix, end.parts)))
        end = replace(end, parts=parts)
    numbers = JointNumbers(clearance=contact.clearance, fit=contact.fit, fitted_end=end)
    return Part(name, "fixed", pose @ contact.pose, 0.0, numbers, contact=True)


def joint_axes(joint: DrawnJoint) -> NDArray:
    """Return the home pose of a joint, (4, 4), with z along ``axis``."""
    return _axes(joint.at, joint.axis, joint.across)


def _axes(at: NDArray, z: NDArray, x: NDArray) -> NDArray:
    """Return the pose at a point with given axes z and x, (4, 4)."""
    return transform(at, np.column_stack([x, np.cross(z, x), z]))


def _motions(joint: DrawnJoint) -> list[tuple[str, str, NDArray, NDArray]]:
    """Return the name suffix, joint type, z axis and x axis of each frame."""
    z, x, second = joint.axis, joint.across, joint.axis2
    y = np.cross(z, x)
    if joint.kind == "cylindrical":
        return [("turn", "revolute", z, x), ("slide", "prismatic", z, x)]
    if joint.kind == "universal":
        return [
            ("first", "revolute", z, x),
            ("second", "revolute", second, _across(z, second)),
        ]
    if joint.kind == "spherical":
        return [
            ("first", "revolute", z, x),
            ("second", "revolute", x, y),
            ("third", "revolute", y, z),
        ]
    if joint.kind == "planar":
        return [
            ("slide_x", "prismatic", x, y),
            ("slide_y", "prismatic", y, z),
            ("turn", "revolute", z, x),
        ]
    return [("", joint.kind, z, x)]


def _across(vector: NDArray, axis: NDArray) -> NDArray:
    """Return the direction of a vector's component normal to an axis, (3,)."""
    rest = vector - (vector @ axis) * axis
    return rest / np.linalg.norm(rest)


def _shares(joint: DrawnJoint) -> list[JointNumbers]:
    """Return the error, clearance and stiffness of each frame of a joint."""
    own = joint.numbers[0]
    if joint.kind == "universal":
        return [joint.numbers[0], joint.numbers[-1]]
    if joint.kind == "cylindrical":
        return [own, JointNumbers()]
    if joint.kind == "spherical":
        return [own, JointNumbers(), JointNumbers()]
    if joint.kind == "planar":
        # the first frame has the geometric error, the last frame has the contact
        placed = JointNumbers(error=_from_axes(own.error), tolerance=_size(own))
        contact = replace(own, error=np.zeros(6), tolerance=None)
        return [placed, JointNumbers(), contact]
    return [own]


# permutation that expresses a screw in the axes of the first frame of a planar joint
_TO_SLIDE = np.array([1, 2, 0, 4, 5, 3])


def _from_axes(screw: NDArray) -> NDArray:
    """Express a screw of a planar joint in the axes of its first frame, (6,)."""
    return screw[_TO_SLIDE]


def _size(numbers: JointNumbers) -> NDArray | None:
    """Return the tolerance of a planar joint in the axes of its first frame, (6,)."""
    return None if numbers.tolerance is None else numbers.tolerance[_TO_SLIDE]


def _part(
    joint: DrawnJoint, suffix: str, kind: str, z: NDArray, x: NDArray,
    numbers: JointNumbers,
) -> Part:  # fmt: skip
    """Return a frame of a joint."""
    name = f"{joint.name}.{suffix}" if suffix else joint.name
    position = 0.0 if suffix else joint.position
    if len(FREE_ROWS[joint.kind]) > 1 and joint.kind != "universal":
        numbers = replace(numbers, stiffness=_held(numbers.stiffness, kind))
    return Part(name, kind, _axes(joint.at, z, x), position, numbers)


def _held(K: NDArray | None, kind: str) -> NDArray | None:
    """Return K_B for a frame, which is rigid along the motions of other frames."""
    if K is None:
        return None
    K = K.copy()
    own = 5 if kind == "prismatic" else 2
    for row in range(6):
        if row != own and K[row, row] == 0.0:
            K[row, row] = np.inf
    return K


def _reversed(part: Part) -> Part:
    """Return the frame for the order from second to first body, with z reversed."""
    own = part.numbers
    K = own.stiffness
    numbers = JointNumbers(
        clearance=own.clearance,
        stiffness=None if K is None else _flipped(K),
        error=-_FLIP_SCREW * own.error,
        tolerance=own.tolerance,
        locked_at=own.locked_at,
        fit=own.fit,
        fitted_end=own.fitted_end,
    )
    pose = part.pose @ transform(np.zeros(3), _FLIP)
    return replace(part, pose=pose, numbers=numbers)


def _flipped(K: NDArray) -> NDArray:
    """Return K_B in axes that are rotated by 180 degrees about x, (6, 6)."""
    signs = np.outer(_FLIP_SCREW, _FLIP_SCREW)
    return np.where(np.isinf(K), K, np.where(np.isinf(K), 0.0, K) * signs)
