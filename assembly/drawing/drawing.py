"""Data model of robots that are described by bodies and joints.

All names are unique.  For example, the body ``tube`` in the copy ``leg1`` of a leg is
named ``leg1.tube``.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import Callout
from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.drawing.contacts import Contact
from forcefit.assembly.model.robot import BeamLink, Clearance, Link, LockedAt, MeshLink

# free components of the screw [RX RY RZ TX TY TZ] in joint axes, by joint type; the two
# rotations of a universal joint have different axes
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
NEAR_X = 0.985  # cosine of 10 deg


@dataclass(frozen=True, eq=False)
class JointNumbers:
    """Geometric error, clearance and stiffness of a joint or bearing, in joint axes.

    Attributes:
        clearance: clearance bounds, or None.
        stiffness: stiffness K_B, (6, 6) [N m/rad .. N/m], with ``inf`` on the diagonal
            for rigid components and 0 for free motions, or None.
        error: geometric error delta l, (6,) [rad, m].
        tolerance: standard deviations of the error, (6,) [rad, m], or None.
        fit: ISO 286 fit whose mean radial clearance is the bound in ``clearance``;
            empty without a fit.
        fitted_end: relation between the fit and the tilt; None if the fit determines
            the radial clearance.
        contacts: additional frames for a clearance that is computed from the dimensions
            of contacts.
        locked_at: pose at which a fixed joint is bolted, with its clearance before
            bolting, or None.
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
    """Joint between two bodies; all vectors are in base axes in the home pose.

    Attributes:
        name: name of the joint.
        kind: key of :data:`FREE_ROWS`.
        first: name of the first body, or ``"base"``.
        second: name of the second body. If the coordinate increases, this body moves in
            the positive direction of ``axis`` relative to the first body.
        at: position of the joint, (3,) [m].
        axis: unit vector along the axis, (3,).  For a universal joint, this axis is
            fixed to the first body.  For a planar joint, it is the normal.
        across: unit vector along the x axis of the joint, (3,), perpendicular to
            ``axis``.
        axis2: unit vector along the axis of a universal joint that is fixed to the
            second body, (3,); equal to ``across`` for other joint types.
        actuated: whether the joint is driven.
        position: coordinate in the home pose [rad or m].
        limits: minimum and maximum coordinate [rad or m], or None.
        pitch: translation per turn of a helical joint [m]; 0 for other joint types.
        numbers: geometric error, clearance and stiffness. A universal joint has one
            entry for each of its two bearings. All other joints have one entry.
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
    """Body of a robot; all vectors are in base axes in the home pose.

    Attributes:
        name: name of the body.
        mass: mass in addition to the mass of the link [kg].
        centre: centre of the additional mass, (3,) [m].
        inertia: inertia matrix of the additional mass about its centre, (3, 3)
            [kg m^2].
        axes: base axes rotated with the copy of the leg, as columns, (3, 3).
        link: elastic link between two joints of the body.  A stiffness matrix refers to
            the frame of the joint ``ends[1]``.
        ends: names of the joints at both ends of the link; the second name is None if
            the link ends at the reference point of the platform.
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
    """Tolerance callouts of a joint feature on one of its two bodies.

    Attributes:
        body: name of the body, or ``"base"``.
        callout: callouts with joint names instead of frame names.
        direction: direction in which the zone widths are measured, (3,), in base axes;
            None for all directions.
    """

    body: str
    callout: Callout
    direction: Direction = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """Robot that is described by bodies and joints.

    Attributes:
        name: name of the robot.
        platform: name of the platform.
        platform_at: reference point of the platform in base axes, (3,) [m].
        bodies: bodies in the order of the file.
        joints: joints in the order of the file.
        description: description of the robot in one line.
        remarks: remarks on default values in the file.
        callouts: tolerance callouts of features.
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
    """Normalise a vector to length 1."""
    return vector / np.linalg.norm(vector)


def perpendicular(axis: NDArray, near: NDArray | None = None) -> NDArray:
    """Return a unit vector perpendicular to an axis.

    Args:
        axis: unit vector, (3,).
        near: direction that is projected onto the plane normal to the axis, (3,); None
            for the base x axis, or for the y axis if the axis is within 10 deg of x.

    Returns:
        Unit vector, (3,).
    """
    if near is None:
        near = np.eye(3)[1 if abs(axis[0]) > NEAR_X else 0]
    return unit(near - (near @ axis) * axis)


def turned_joint(joint: DrawnJoint, T: NDArray) -> DrawnJoint:
    """Apply a transform (4, 4) to a joint."""
    R = T[:3, :3]
    return replace(
        joint, at=R @ joint.at + T[:3, 3], axis=R @ joint.axis,
        across=R @ joint.across, axis2=R @ joint.axis2,
    )  # fmt: skip


def turned_body(body: DrawnBody, T: NDArray) -> DrawnBody:
    """Apply a transform (4, 4) to a body, including its mass and its link."""
    R = T[:3, :3]
    return replace(
        body, centre=R @ body.centre + T[:3, 3], inertia=R @ body.inertia @ R.T,
        axes=R @ body.axes, link=turned_link(body.link, R),
    )  # fmt: skip


def turned_link(link: Link | None, R: NDArray) -> Link | None:
    """Express the directions of a link in rotated axes.

    Args:
        link: link of any type.  Only beams and meshes have directions.
        R: rotation matrix from the current axes to the new axes.

    Returns:
        Link in the new axes.
    """
    if isinstance(link, BeamLink):
        return replace(link, axis=_turned(link.axis, R), up=_turned(link.up, R))
    if isinstance(link, MeshLink):
        turned = _turned(link.frame_up, R)
        return replace(link, axis=_turned(link.axis, R), frame_up=turned)
    return link


def _turned(vector: Direction, R: NDArray) -> Direction:
    """Express a direction, or None, in rotated axes."""
    if vector is None:
        return None
    x, y, z = (R @ np.array(vector)).tolist()
    return x, y, z
