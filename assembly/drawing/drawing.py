"""Bodies and joints of a robot, by points and axes in base axes at home.

All names are unique within the robot: the body ``tube`` in the copy ``leg1`` of a leg
is named ``leg1.tube``.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import Callout
from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.drawing.contacts import Contact
from forcefit.assembly.model.robot import BeamLink, Clearance, Link, LockedAt, MeshLink

# free components of each type: rows of the screw [RX RY RZ TX TY TZ] in the joint's
# axes; the two rotations of a universal joint have separate axes
FREE_ROWS: dict[str, tuple[int, ...]] = {
    "fixed": (),
    "revolute": (2,),
    "prismatic": (5,),
    "helical": (2,),
    "cylindrical": (2, 5),
    "universal": (2, 2),
    "spherical": (0, 1, 2),
    "planar": (2, 3, 4),
}
Direction = tuple[float, float, float] | None
NEAR_X = 0.985  # cosine of 10 deg; nearer to the base's x, the base's y is used


@dataclass(frozen=True, eq=False)
class JointNumbers:
    """Error, clearance and stiffness of one bearing, in the joint's axes.

    Attributes:
        clearance: bounds of the clearance, or None.
        stiffness: (6, 6) [N m/rad .. N/m] K_B, with ``inf`` on the diagonal for rigid
            components and 0 for free motions; or None.
        error: (6,) [rad, m] geometric error delta l.
        tolerance: (6,) [rad, m] standard deviations of the error, or None.
        fit: ISO 286 fit whose mean radial clearance is in ``clearance``, or empty.
        fitted_end: how the tilt follows from the fit; None if the fit determines
            ``radial``.
        contacts: further clearance, given by the sizes of the contacts.
        locked_at: pose at which a fixed joint is bolted, with its clearance before
            bolting; or None.
    """

    clearance: Clearance | None = None
    stiffness: NDArray | None = None
    error: NDArray = field(default_factory=lambda: np.zeros(6))
    tolerance: NDArray | None = None
    fit: str = ""
    fitted_end: FittedEnd | None = None
    contacts: tuple[Contact, ...] = ()
    locked_at: LockedAt | None = None


@dataclass(frozen=True, eq=False)
class DrawnJoint:
    """A joint between two bodies.

    Attributes:
        name: name of the joint.
        kind: a key of :data:`FREE_ROWS`.
        first: name of the first body, or ``"base"``.
        second: name of the second body, which moves along +axis relative to the first
            when the coordinate increases.
        at: (3,) [m] point of the joint, base axes at home.
        axis: (3,) unit vector of the axis; for a universal joint the axis fixed to the
            first body, for a planar joint the normal.
        across: (3,) unit vector of the x axis, perpendicular to ``axis``.
        axis2: (3,) unit vector of the axis of a universal joint that is fixed to the
            second body; equal to ``across`` for other types.
        actuated: whether a drive holds the joint.
        position: [rad or m] coordinate at home.
        limits: [rad or m] smallest and largest coordinate, or None.
        pitch: [m] translation per turn of a helical joint; 0 for other types.
        numbers: error, clearance and stiffness: one entry for the joint, or one for
            each bearing of a universal joint.
    """

    name: str
    kind: str
    first: str
    second: str
    at: NDArray
    axis: NDArray
    across: NDArray
    axis2: NDArray
    actuated: bool = False
    position: float = 0.0
    limits: tuple[float, float] | None = None
    pitch: float = 0.0
    numbers: tuple[JointNumbers, ...] = (JointNumbers(),)


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """A body of a robot.

    Attributes:
        name: name of the body.
        mass: [kg] mass in addition to the mass of its link.
        centre: (3,) [m] centre of that mass, base axes at home.
        inertia: (3, 3) [kg m^2] inertia about this centre, base axes at home.
        axes: (3, 3) base axes, rotated with the copy of the leg, as columns.
        link: elasticity between two of the body's joints, with directions in base axes
            at home; a stiffness matrix is in the axes of the joint ``ends[1]``, at its
            point.
        ends: names of the joints at the two ends of the link; the second is None for
            the platform's point.
    """

    name: str
    mass: float = 0.0
    centre: NDArray = field(default_factory=lambda: np.zeros(3))
    inertia: NDArray = field(default_factory=lambda: np.zeros((3, 3)))
    axes: NDArray = field(default_factory=lambda: np.eye(3))
    link: Link | None = None
    ends: tuple[str, str | None] | None = None


@dataclass(frozen=True, eq=False)
class DrawnCallout:
    """The callouts of a joint's feature on one of its two bodies.

    Attributes:
        body: name of the body, or ``"base"``.
        callout: the callout, with names of joints in place of frames.
        direction: (3,) direction of the zones, base axes at home; None for all.
    """

    body: str
    callout: Callout
    direction: Direction = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """A robot that consists of bodies and joints.

    Attributes:
        name: name of the robot.
        platform: name of the body whose pose error is reported.
        platform_at: (3,) [m] point of the platform whose error is reported, base axes
            at home.
        bodies: bodies in the order of the file.
        joints: joints in the order of the file.
        description: description in one line.
        remarks: defaults of the robot's file that are easily overlooked.
        callouts: tolerances of features.
    """

    name: str
    platform: str
    platform_at: NDArray
    bodies: tuple[DrawnBody, ...]
    joints: tuple[DrawnJoint, ...]
    description: str = ""
    remarks: tuple[str, ...] = ()
    callouts: tuple[DrawnCallout, ...] = ()


def unit(vector: NDArray) -> NDArray:
    """Return the vector divided by its length."""
    return vector / np.linalg.norm(vector)


def perpendicular(axis: NDArray, near: NDArray | None = None) -> NDArray:
    """Return a unit vector perpendicular to an axis.

    Args:
        axis: (3,) unit vector.
        near: (3,) direction that is projected onto the plane perpendicular to the axis;
            None for the base's x, or the base's y if the axis is within 10 deg of x.

    Returns:
        (3,) unit vector.
    """
    if near is None:
        near = np.eye(3)[1 if abs(axis[0]) > NEAR_X else 0]
    return unit(near - (near @ axis) * axis)


def turned_joint(joint: DrawnJoint, T: NDArray) -> DrawnJoint:
    """Return the joint moved by a (4, 4) transform; its numbers do not change."""
    R = T[:3, :3]
    return replace(
        joint, at=R @ joint.at + T[:3, 3], axis=R @ joint.axis,
        across=R @ joint.across, axis2=R @ joint.axis2,
    )  # fmt: skip


def turned_body(body: DrawnBody, T: NDArray) -> DrawnBody:
    """Return the body moved by a (4, 4) transform, with its mass and its link."""
    R = T[:3, :3]
    return replace(
        body, centre=R @ body.centre + T[:3, 3], inertia=R @ body.inertia @ R.T,
        axes=R @ body.axes, link=turned_link(body.link, R),
    )  # fmt: skip


def turned_link(link: Link | None, R: NDArray) -> Link | None:
    """Return the link with its directions expressed in rotated axes.

    Args:
        link: any link; a matrix and a stiffness library contain no directions.
        R: rotation from the present axes to the new axes.

    Returns:
        The link in the new axes.
    """
    if isinstance(link, BeamLink):
        return replace(link, axis=_turned(link.axis, R), up=_turned(link.up, R))
    if isinstance(link, MeshLink):
        turned = _turned(link.frame_up, R)
        return replace(link, axis=_turned(link.axis, R), frame_up=turned)
    return link


def _turned(vector: Direction, R: NDArray) -> Direction:
    """Return a direction expressed in other axes, or None if no direction is given."""
    if vector is None:
        return None
    x, y, z = (R @ np.array(vector)).tolist()
    return x, y, z
