"""Bodies and joints of a robot, by points and axes in base axes at home.

Every name is that of the whole robot: the body ``tube`` of the copy ``leg1`` is
``leg1.tube`` here.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.callout import Callout
from forcefit.assembly.callouts.fits import FittedEnd
from forcefit.assembly.drawing.contacts import Contact
from forcefit.assembly.model.robot import BeamLink, Clearance, Link, LockedAt, MeshLink

# freedoms of each type: rows of the screw [RX RY RZ TX TY TZ] in the joint's axes; of a
# universal joint its two turns have axes of their own
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
NEAR_X = 0.985  # cosine of 10 deg: nearer to the base's x an axis takes y instead


@dataclass(frozen=True, eq=False)
class JointNumbers:
    """Error, clearance and stiffness of one bearing, in the joint's axes.

    Attributes:
        clearance: bounds, or None.
        stiffness: (6, 6) [N m/rad .. N/m] K_B, ``inf`` on the diagonal where rigid, 0
            along free motions; or None.
        error: (6,) [rad, m] delta l.
        tolerance: (6,) [rad, m] standard deviations of it, or None.
        fit: ISO 286 fit whose mean radial clearance is in ``clearance``, or empty.
        fitted_end: how the tilt follows from the fit; None if ``radial`` does.
        contacts: further clearance, by the sizes of the contacts.
        locked_at: where a fixed joint is bolted, with its clearance before; or None.
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
        name: of the joint.
        kind: a key of :data:`FREE_ROWS`.
        first: name of the first body, or ``"base"``.
        second: name of the second, which moves along +axis relative to the first when
            the coordinate grows.
        at: (3,) [m] its point, base axes at home.
        axis: (3,) unit vector; of a universal joint fixed to the first body; of a
            planar joint the normal.
        across: (3,) unit vector of the x axis, at right angles to ``axis``.
        axis2: (3,) unit vector of a universal joint's axis fixed to the second body,
            for other types as ``across``.
        actuated: whether a drive holds it.
        position: [rad or m] coordinate at home.
        limits: [rad or m] least and largest coordinate, or None.
        pitch: [m] of a helical joint in a turn, 0 of others.
        numbers: one for the joint; for a universal joint one for each bearing.
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
    """A body.

    Attributes:
        name: of the body.
        mass: [kg] in addition to its link's.
        centre: (3,) [m] of that mass, base axes at home.
        inertia: (3, 3) [kg m^2] about the centre, base axes at home.
        axes: (3, 3) the base's axes turned with the copy of the leg, as columns.
        link: elasticity between two of its joints, directions in base axes at home; a
            stiffness in the axes of the joint ``ends[1]``, at its point.
        ends: names of the joints between which the link is; the second is None for the
            platform's point.
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
        callout: with names of joints in place of frames.
        direction: (3,) in which the zones are, base axes at home; None for all.
    """

    body: str
    callout: Callout
    direction: Direction = None


@dataclass(frozen=True, eq=False)
class Drawing:
    """A robot of bodies and joints.

    Attributes:
        name: of the robot.
        platform: name of the body whose pose error is reported.
        platform_at: (3,) [m] its reported point, base axes at home.
        bodies: in the order of the file.
        joints: likewise.
        description: one line.
        remarks: defaults of its file that are easily overlooked.
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
    """The vector divided by its length."""
    return vector / np.linalg.norm(vector)


def perpendicular(axis: NDArray, near: NDArray | None = None) -> NDArray:
    """A unit vector at right angles to an axis.

    Args:
        axis: (3,) unit vector.
        near: (3,) the direction whose part across the axis is taken; None: the base's
            x, or its y where the axis is within 10 deg of x.

    Returns:
        (3,) unit vector.
    """
    if near is None:
        near = np.eye(3)[1 if abs(axis[0]) > NEAR_X else 0]
    return unit(near - (near @ axis) * axis)


def turned_joint(joint: DrawnJoint, T: NDArray) -> DrawnJoint:
    """The joint moved by a (4, 4) transform; its numbers stay, in its own axes."""
    R = T[:3, :3]
    return replace(
        joint, at=R @ joint.at + T[:3, 3], axis=R @ joint.axis,
        across=R @ joint.across, axis2=R @ joint.axis2,
    )  # fmt: skip


def turned_body(body: DrawnBody, T: NDArray) -> DrawnBody:
    """The body moved by a (4, 4) transform, with its mass and its link."""
    R = T[:3, :3]
    return replace(
        body, centre=R @ body.centre + T[:3, 3], inertia=R @ body.inertia @ R.T,
        axes=R @ body.axes, link=turned_link(body.link, R),
    )  # fmt: skip


def turned_link(link: Link | None, R: NDArray) -> Link | None:
    """The link with its directions turned by a (3, 3) rotation.

    Args:
        link: any; a matrix and a library have no directions.
        R: from the present axes to others.

    Returns:
        The link.
    """
    if isinstance(link, BeamLink):
        return replace(link, axis=_turned(link.axis, R), up=_turned(link.up, R))
    if isinstance(link, MeshLink):
        turned = _turned(link.frame_up, R)
        return replace(link, axis=_turned(link.axis, R), frame_up=turned)
    return link


def _turned(vector: Direction, R: NDArray) -> Direction:
    """A direction in other axes, None where it is not given."""
    if vector is None:
        return None
    x, y, z = (R @ np.array(vector)).tolist()
    return x, y, z
