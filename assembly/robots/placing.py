"""Frames given by their home poses, seen from the base.

A robot's table is easiest to check in base axes; a tree of frames needs each one seen
from its parent, after the parent's joint.  Joints with more than one degree of freedom
are coincident revolute joints: a cardan joint of two, a ball joint of three.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.model.placed_frames import PlacedFrame
from assembly.model.robot import Clearance, Frame, Link
from stiffness.screws import transform


def at(
    origin: ArrayLike, z: ArrayLike = (0, 0, 1), x: ArrayLike = (1, 0, 0)
) -> NDArray:
    """A frame by its origin and two of its axes.

    Args:
        origin: (3,) [m].
        z: (3,) direction of the z axis, of any length.
        x: (3,) direction of the x axis; its part along z is dropped.

    Returns:
        (4, 4) transform.
    """
    c = np.asarray(z, dtype=float) / np.linalg.norm(z)
    a = np.asarray(x, dtype=float)
    a = a - (a @ c) * c
    a = a / np.linalg.norm(a)
    return transform(origin, np.column_stack([a, np.cross(c, a), c]))


def pin(
    name: str, parent: str, clearance: Clearance | None = None, link: Link | None = None
) -> Frame:
    """A passive revolute joint, with the body that leads to it."""
    return Frame(name, parent, joint="revolute", clearance=clearance, link=link)


def cardan_joint(
    name: str, parent: str, origin: NDArray, first: NDArray, second: NDArray,
    clearance: Clearance | None = None,
) -> list[PlacedFrame]:  # fmt: skip
    """Two revolute joints at one point, their axes at right angles.

    Args:
        name: of the joint; its frames are ``name_1`` and ``name_2``.
        parent: the frame that carries it.
        origin: (3,) [m] its centre.
        first: (3,) axis fixed to the parent.
        second: (3,) axis fixed to the child, at right angles to the first.
        clearance: of the whole joint, assigned to its second frame.

    Returns:
        The two frames.
    """
    one, two = f"{name}_1", f"{name}_2"
    return [
        (pin(one, parent), at(origin, first, second)),
        (pin(two, one, clearance), at(origin, second, first)),
    ]


def ball_joint(
    name: str, parent: str, origin: NDArray, first: NDArray, second: NDArray,
    clearance: Clearance | None = None, link: Link | None = None,
) -> list[PlacedFrame]:  # fmt: skip
    """Three revolute joints at one point, their axes at right angles at home.

    It is singular where the second joint has turned by a right angle.

    Args:
        name: of the joint; its frames are ``name_1`` to ``name_3``.
        parent: the frame that carries it.
        origin: (3,) [m] its centre.
        first: (3,) axis fixed to the parent.
        second: (3,) the axis between; the third is at right angles to both.
        clearance: of the whole joint, assigned to its last frame.
        link: elasticity of the body between the parent and this joint.

    Returns:
        The three frames.
    """
    third = np.cross(first, second)
    one, two, three = (f"{name}_{k}" for k in (1, 2, 3))
    return [
        (pin(one, parent, link=link), at(origin, first, second)),
        (pin(two, one), at(origin, second, third)),
        (pin(three, two, clearance), at(origin, third, first)),
    ]


def drive_stiffness(stiffness: float, joint: str = "revolute") -> NDArray:
    """Joint stiffness of a drive that is elastic along its own motion only.

    Args:
        stiffness: [N m/rad or N/m] of the drive.
        joint: ``"revolute"`` or ``"prismatic"``.

    Returns:
        (6, 6) infinite on the diagonal but for RZ or TZ.
    """
    own = 5 if joint == "prismatic" else 2
    diagonal = np.full(6, np.inf)
    diagonal[own] = stiffness
    return np.diag(diagonal)
