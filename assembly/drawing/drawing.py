"""Data model of a drawing: bodies and joints, given in base axes at home.

All names are unique within the robot.  For example, the body ``tube`` in the copy
``leg1`` of a leg is named ``leg1.tube``.
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
    """Error, clearance and stiffness of a joint or bearing, in the joint axes.

    Attributes:
        clearance: clearance bounds, or None.
        stiffness: K_B (6, 6) [N m/rad .. N/m], with ``inf`` on the diagonal for rigid
            components and 0 for free motions; or None.
        error: geometric error delta l (6,) [rad, m].
        tolerance: standard deviations of the error (6,) [rad, m], or None.
        fit: ISO 286 fit whose mean radial clearance is in ``clearance``, or empty.
        fitted_end: data that relate the tilt to the fit; None if the fit determines
            ``radial``.
        contacts: additional clearance, given by the dimensions of contacts.
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
    """Joint between two bodies; all vectors are in base axes at home.

    Attributes:
        name: name of the joint.
        kind: key of :data:`FREE_ROWS`.
        first: name of the first body, or ``"base"``.
        second: name of the second body, which moves in the positive direction of
            ``axis`` relative to the first body when the coordinate increases.
        at: position of the joint (3,) [m].
        axis: unit vector along the axis (3,): for a universal joint, the axis fixed to
            the first body; for a planar joint, the normal.
        across: unit vector along the x axis (3,), perpendicular to ``axis``.
        axis2: unit vector along the axis of a universal joint that is fixed to the
            second body (3,); equal to ``across`` for all remaining types.
        actuated: whether a drive holds the joint.
        position: coordinate at home [rad or m].
        limits: minimum and maximum coordinate [rad or m], or None.
        pitch: translation per turn of a helical joint [m]; 0 for all remaining types.
        numbers: error, clearance and stiffness: one entry per bearing for a universal
            joint, otherwise one entry.
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
    """Body of a robot; all vectors are in base axes at home.

    Attributes:
        name: name of the body.
        mass: mass in addition to the mass of the link [kg].
        centre: centre of this additional mass (3,) [m].
        inertia: moments of inertia about this centre (3, 3) [kg m^2].
        axes: base axes rotated with the copy of the leg, as columns (3, 3).
        link: elastic link between two joints of the body; a stiffness matrix refers to
            the position and axes of the joint ``ends[1]``.
        ends: names of the joints at both ends of the link; the second one is None for
            the reference point of the platform.
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
        callout: callouts in which frame names are replaced by joint names.
        direction: direction in which the zones are measured (3,), in base axes at home;
            None for all directions.
    """

    body: str
    callout: Callout
    direction: Direction = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """Robot that consists of bodies and joints.

    Attributes:
        name: name of the robot.
        platform: name of the body whose pose error is reported.
        platform_at: reference point of the platform (3,) [m], in base axes at home.
        bodies: bodies in file order.
        joints: joints in file order.
        description: one-line description.
        remarks: default values in the file that are easily overlooked.
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
        axis: unit vector (3,).
        near: direction that is projected onto the plane normal to the axis (3,); None
            for the base x axis, or the y axis if the axis is within 10 deg of x.

    Returns:
        Unit vector (3,).
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
        link: link; stiffness matrices and library entries contain no directions.
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
    """Express a direction in rotated axes; None stays None."""
    if vector is None:
        return None
    x, y, z = (R @ np.array(vector)).tolist()
    return x, y, z
