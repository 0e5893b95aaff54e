"""Orientations in MJCF, which can be specified by one of five attributes."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.orientation import from_euler, from_quaternion, onto
from forcefit.assembly.exchange.xml_file import Node, placed
from forcefit.inputs.errors import describe
from forcefit.stiffness.screws import rotation_matrix


@dataclass(frozen=True)
class Angles:
    """Angle conventions of a file.

    Attributes:
        unit: unit of angles [rad]: 1 for radians, pi / 180 for degrees.
        sequence: axes of the Euler angles; capital letters denote fixed axes.
        range_limits: whether a joint with a range but without ``limited`` is limited.
    """

    unit: float
    sequence: str
    range_limits: bool = True

    @staticmethod
    def of(root: Node) -> "Angles":
        """Return the conventions from the compiler elements of a file."""
        unit, sequence, automatic = "degree", "xyz", "true"
        for compiler in root.children("compiler"):
            unit = compiler.choice("angle", ("degree", "radian"), unit)
            sequence = compiler.text("eulerseq", sequence)
            automatic = compiler.text("autolimits", automatic)
            if len(sequence) != 3 or not set(sequence.lower()) <= set("xyz"):
                raise compiler.bad(
                    "eulerseq",
                    f"found {describe(sequence)}, expected three axis letters out of "
                    "x, y, z, X, Y, Z",
                )
            compiler.choice("coordinate", ("local",), "local")
        return Angles(
            1.0 if unit == "radian" else math.pi / 180, sequence, automatic == "true"
        )


def orientation(node: Node, angles: Angles) -> NDArray:
    """Return the orientation of an element.

    Args:
        node: element with ``quat``, ``axisangle``, ``euler``, ``xyaxes`` or ``zaxis``.
        angles: angle conventions of the file.

    Returns:
        Rotation matrix (3, 3); the identity if the element has none of the attributes.

    Raises:
        BadInput: a direction has zero length, or the number of values is wrong.
    """
    if node.has("quat"):
        q = node.numbers("quat", 4, "-")
        if not q.any():
            raise node.bad(
                "quat", "found 0 0 0 0, expected a quaternion with a norm above 0"
            )
        return from_quaternion(q)
    if node.has("axisangle"):
        x, y, z, angle = node.numbers("axisangle", 4, "-, angle")
        axis = np.array([x, y, z])
        if not axis.any():
            raise node.bad("axisangle", "found the axis 0 0 0, expected a nonzero axis")
        return rotation_matrix(angle * angles.unit * axis / np.linalg.norm(axis))
    if node.has("euler"):
        given = node.numbers("euler", 3, "angle") * angles.unit
        return from_euler(given, angles.sequence)
    if node.has("xyaxes"):
        given = node.numbers("xyaxes", 6, "-")
        z = np.cross(given[:3], given[3:])
        if not z.any():
            raise node.bad("xyaxes", "found parallel axes, expected two directions")
        x, z = given[:3] / np.linalg.norm(given[:3]), z / np.linalg.norm(z)
        return np.stack([x, np.cross(z, x), z], axis=1)
    if node.has("zaxis"):
        return onto(node.unit_vector("zaxis"))
    return np.eye(3)


def site_pose(node: Node, angles: Angles) -> NDArray:
    """Return the pose of a site or shape.

    Args:
        node: element with ``pos`` and an orientation, or with two end points in
            ``fromto``.
        angles: angle conventions of the file.

    Returns:
        Pose (4, 4). For two end points, the origin is their midpoint, and z points from
        the second to the first end point.

    Raises:
        BadInput: both ``pos`` and ``fromto`` are given, or the two end points coincide.
    """
    if not node.has("fromto"):
        return placed(
            node.numbers("pos", 3, "m", np.zeros(3)), orientation(node, angles)
        )
    ends = node.numbers("fromto", 6, "m")
    along = ends[:3] - ends[3:]
    length = float(np.linalg.norm(along))
    if node.has("pos") or length < 1e-12:
        raise node.bad(
            "fromto",
            "found equal points, or pos together with fromto; expected two "
            "different points and no pos",
        )
    return placed((ends[:3] + ends[3:]) / 2, onto(along / length))
