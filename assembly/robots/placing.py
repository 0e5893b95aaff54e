"""Create the frames of built-in robots from their home poses in base axes.

A tree of frames requires the pose of each frame relative to its parent.  Joints with
several degrees of freedom are modelled as coincident revolute joints, two for a cardan
joint and three for a ball joint.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame
from forcefit.assembly.model.robot import Clearance, Frame, Link
from forcefit.stiffness.screws import transform


def at(
    origin: ArrayLike, z: ArrayLike = (0, 0, 1), x: ArrayLike = (1, 0, 0)
) -> NDArray:
    """Return the transform of a frame, given its origin and two of its axes.

    Args:
        origin: (3,) [m] origin of the frame.
        z: (3,) direction of the z axis, of any length.
        x: (3,) direction of the x axis; its component along z is removed.

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
    """Return a passive revolute joint with its body."""
    return Frame(name, parent, joint="revolute", clearance=clearance, link=link)


def cardan_joint(
    name: str, parent: str, origin: NDArray, first: NDArray, second: NDArray,
    clearance: Clearance | None = None,
) -> list[PlacedFrame]:  # fmt: skip
    """Return a cardan joint, modelled as two perpendicular revolute joints.

    Args:
        name: name of the joint; its frames are ``name_1`` and ``name_2``.
        parent: frame that carries the joint.
        origin: (3,) [m] centre of the joint.
        first: (3,) axis fixed to the parent.
        second: (3,) axis fixed to the child, perpendicular to the first.
        clearance: clearance of the joint, assigned to its second frame.

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
    """Return a ball joint, modelled as three revolute joints at one point.

    The axes are perpendicular at home. The joint is singular if the second revolute
    joint is rotated by a right angle.

    Args:
        name: name of the joint; its frames are ``name_1`` to ``name_3``.
        parent: frame that carries the joint.
        origin: (3,) [m] centre of the joint.
        first: (3,) axis fixed to the parent.
        second: (3,) middle axis; the third is perpendicular to both.
        clearance: clearance of the joint, assigned to its last frame.
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
    """Return the joint stiffness of a drive that is elastic along its motion.

    Args:
        stiffness: [N m/rad or N/m] stiffness of the drive.
        joint: ``"revolute"`` or ``"prismatic"``.

    Returns:
        (6, 6) matrix whose diagonal is infinite except for RZ or TZ.
    """
    own = 5 if joint == "prismatic" else 2
    diagonal = np.full(6, np.inf)
    diagonal[own] = stiffness
    return np.diag(diagonal)
