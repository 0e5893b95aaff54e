"""Degrees of freedom and poses of URDF joints.

Sources:
    ROS wiki, urdf/XML/joint.  The default axis is x.  ``rpy`` are rotations about fixed
    axes.

    Drake, multibody/parsing.  A ``drake:joint`` of type ``universal`` rotates about x,
    then y, and one of type ``planar`` translates along x and y.
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
    """Return the elementary joints of a URDF joint.

    Args:
        node: element of a joint.  A tag with a prefix denotes a joint of Drake.

    Returns:
        Name suffix, kind and axis (3,) of each elementary joint, in order.

    Raises:
        BadInput: the type is unknown, or an axis has zero length.
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
    """Return the pose of an element, (4, 4), from ``xyz`` and its orientation."""
    shift = origin.numbers("xyz", 3, "m", _ZERO)
    if not origin.has("quat_xyzw"):
        turn = from_roll_pitch_yaw(origin.numbers("rpy", 3, "rad", _ZERO))
        return placed(shift, turn)
    x, y, z, w = origin.numbers("quat_xyzw", 4, "-")
    if not any((x, y, z, w)):
        raise origin.bad("quat_xyzw", "found a zero quaternion, expected a rotation")
    return placed(shift, from_quaternion([w, x, y, z]))


def _axis(node: Node, tag: str, default: NDArray) -> NDArray:
    """Return the unit vector in an inner element of a joint, (3,)."""
    axis = node.child(tag)
    return default if axis is None else axis.unit_vector("xyz", default)
