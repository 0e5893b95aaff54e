"""Conversion of MJCF joints and keyframes to joints with one degree of freedom."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import HERE, Joint, ball, motion, slides
from forcefit.assembly.exchange.mjcf_orientation import Angles
from forcefit.assembly.exchange.orientation import from_quaternion
from forcefit.assembly.exchange.xml_file import Node, placed
from forcefit.inputs.errors import quoted

_ZERO = np.zeros(3)


def several_freedoms(given: Node, name: str, kind: str, offset: NDArray) -> list[Joint]:
    """Return the joints of a ball joint or of a free body.

    Args:
        given: element with its default attributes.
        name: name of the joint.
        kind: ``"ball"`` or ``"free"``.
        offset: pose of the element's frame relative to the body, (4, 4).

    Returns:
        Joints with one degree of freedom, in order.  Their bodies are not set.

    Raises:
        BadInput: a number is invalid.
    """
    freedoms = ball() if kind == "ball" else slides() + ball()
    anchor = np.eye(4)
    if kind == "ball":
        anchor = offset @ placed(given.numbers("pos", 3, "m", _ZERO), np.eye(3))
    last = len(freedoms) - 1
    return [
        Joint(
            f"{name}.{part}", one, "", "",
            placement=anchor if i == 0 else HERE, axis=axis,
            after=np.linalg.inv(anchor) if i == last else HERE,
        )
        for i, (part, one, axis) in enumerate(freedoms)
    ]  # fmt: skip


def one_freedom(
    given: Node, name: str, kind: str, offset: NDArray, angles: Angles
) -> Joint:
    """Return a hinge or slide joint with its spring.

    Args:
        given: element with its default attributes.
        name: name of the joint.
        kind: ``"revolute"`` or ``"prismatic"``.
        offset: pose of the element's frame relative to the body, (4, 4).
        angles: angle conventions of the file.

    Returns:
        The joint.  Its bodies are not set.

    Raises:
        BadInput: a number is invalid, or the axis has zero length.
    """
    unit = angles.unit
    pos = given.numbers("pos", 3, "m", _ZERO)
    anchor = offset @ placed(pos, np.eye(3))
    axis = given.unit_vector("axis", np.array([0.0, 0.0, 1.0]))
    ref = given.number("ref", "angle or m", 0.0)
    ref *= unit if kind == "revolute" else 1.0
    joint = Joint(name, kind, "", "", anchor, axis, np.linalg.inv(anchor))
    stiffness, rest = 0.0, 0.0
    if len(given.optional("stiffness").split()) == 1:
        stiffness = given.number("stiffness", "N m/rad or N/m")
        rest = given.number("springref", "angle or m", 0.0)
        rest *= unit if kind == "revolute" else 1.0
    # in the initial pose of the file, the joint coordinate is ``ref``
    return replace(
        joint, placement=anchor @ motion(joint, -ref), position=ref,
        stiffness=stiffness, rest=rest, limits=_limits(given, kind, angles),
    )  # fmt: skip


def _limits(node: Node, kind: str, angles: Angles) -> tuple[float, float] | None:
    """Return the range of a hinge or slide joint; None if it is not limited."""
    limited = node.optional("limited") or "auto"
    binds = limited == "true" or (limited == "auto" and angles.range_limits)
    if not node.has("range") or not binds:
        return None
    ends = node.text("range").split()
    if len(ends) != 2:
        raise node.bad("range", f"found {quoted(' '.join(ends))}, expected 2 numbers")
    unit = angles.unit if kind == "revolute" else 1.0
    return node.limits(ends[0], ends[1], unit)


def at_key(key: Node, joint: Joint, values: NDArray) -> Joint:
    """Set the home pose of a joint from a keyframe.

    Args:
        key: keyframe element.
        joint: joint with one degree of freedom, or the first elementary joint of a ball
            or free joint, to which the entire motion is assigned.
        values: one number, a quaternion, or a position and a quaternion.

    Returns:
        The joint in the home pose.

    Raises:
        BadInput: a quaternion is zero.
    """
    if len(values) == 1:
        return replace(joint, position=float(values[0]))
    quaternion = values[-4:]
    if not quaternion.any():
        raise key.bad("qpos", f"found a zero quaternion for {quoted(joint.name)}")
    turn = placed(
        values[:-4] if len(values) == 7 else _ZERO, from_quaternion(quaternion)
    )
    # values are the world pose of a free body, or the rotation of a ball joint
    return replace(
        joint, placement=turn if len(values) == 7 else joint.placement @ turn
    )
