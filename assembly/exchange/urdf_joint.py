"""Degrees of freedom and poses of URDF joints.

Sources:
    ROS wiki, urdf/XML/joint: the default axis is x; rpy are rotations about fixed axes.
    Drake, multibody/parsing: a universal ``drake:joint`` rotates about x, then y; a
    planar one translates along x and y.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import ball, slides
from forcefit.assembly.exchange.orientation import (
    from_quaternion,
    from_roll_pitch_yaw,
    onto,
)
from forcefit.assembly.exchange.xml_file import Node, placed

_ONE_FREEDOM = {"revolute": "revolute", "continuous": "revolute",
                "prismatic": "prismatic", "fixed": "fixed"}  # fmt: skip
_KINDS = (*_ONE_FREEDOM, "spherical", "ball", "universal", "planar", "floating")
_KINDS_OF_DRAKE = ("ball", "universal", "planar")
_ZERO = np.zeros(3)


def joint_freedoms(node: Node) -> list[tuple[str, str, NDArray]]:
    """Return name, kind and axis per degree of freedom of a joint, or of a fixed joint.

    Args:
        node: element of a joint; a prefix marks a joint of Drake, with Drake's axes.

    Returns:
        The degrees of freedom, in the order in which they move the child.

    Raises:
        BadInput: the type is unknown, or an axis has no direction.
    """
    own_axes = ":" in node.tag
    kind = node.choice("type", _KINDS_OF_DRAKE if own_axes else _KINDS, "")
    x, y, z = np.eye(3)
    if kind in {"spherical", "ball"}:
        return ball()
    if kind == "floating":
        return slides() + ball()
    if kind == "fixed":
        return [("", "fixed", z)]
    if own_axes and kind in {"universal", "planar"}:
        turn, second = np.eye(3), y
        first = x
    else:
        first = _axis(node, "axis", x)
        turn = onto(first)
        second = turn[:, 1]
    if kind == "universal":
        second = _axis(node, "axis2", second)
        return [("first", "revolute", first), ("second", "revolute", second)]
    if kind == "planar":
        return [("tx", "prismatic", turn[:, 0]), ("ty", "prismatic", turn[:, 1]),
                ("rz", "revolute", turn[:, 2])]  # fmt: skip
    return [("", _ONE_FREEDOM[kind], first)]


def pose_of(origin: Node) -> NDArray:
    """Return the (4, 4) pose of an element from ``xyz`` and ``rpy`` or a quaternion."""
    shift = origin.numbers("xyz", 3, "m", _ZERO)
    if not origin.has("quat_xyzw"):
        turn = from_roll_pitch_yaw(origin.numbers("rpy", 3, "rad", _ZERO))
        return placed(shift, turn)
    x, y, z, w = origin.numbers("quat_xyzw", 4, "-")
    if not any((x, y, z, w)):
        raise origin.bad("quat_xyzw", "found a zero quaternion, expected a rotation")
    return placed(shift, from_quaternion([w, x, y, z]))


def _axis(node: Node, tag: str, default: NDArray) -> NDArray:
    """Return the unit direction (3,) in an inner element of a joint."""
    axis = node.child(tag)
    return default if axis is None else axis.unit_vector("xyz", default)
