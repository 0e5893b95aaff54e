"""Legs of planar robots, each with a driven arm, an elbow and a second arm."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame
from forcefit.assembly.robots.placing import at, drive_stiffness, pin
from forcefit.inputs.table import BadInput


@dataclass(frozen=True)
class PlanarLeg:
    """Parameters of the legs of a planar robot.

    Attributes:
        near: [m] length of the driven arm.
        far: [m] length of the second arm.
        link: section and material of both arms.
        drive: [N m/rad] stiffness of the drive.
        clearance: clearance of every pin.
    """

    near: float
    far: float
    link: BeamLink
    drive: float
    clearance: Clearance


def in_plane(point: ArrayLike, angle: float = 0.0) -> NDArray:
    """Return the transform at (x, y) [m], rotated about z by an angle [rad], (4, 4)."""
    x, y = np.asarray(point, dtype=float)
    return at([x, y, 0.0], x=[math.cos(angle), math.sin(angle), 0.0])


def direction(angle: float) -> NDArray:
    """Return the unit vector at an angle [rad] to the x axis, (2,)."""
    return np.array([math.cos(angle), math.sin(angle)])


def arm_angle(
    robot: str, foot: ArrayLike, tip: ArrayLike, near: float, far: float, side: int
) -> float:
    """Return the angle of the first arm of a two-arm chain between two points.

    Args:
        robot: name of the robot, for the error message.
        foot: (2,) [m] centre of rotation of the first arm.
        tip: (2,) [m] end of the second arm.
        near: [m] length of the first arm.
        far: [m] length of the second arm.
        side: 1 if the elbow is to the left of the line from foot to tip, otherwise -1.

    Returns:
        [rad] angle to the x axis.

    Raises:
        BadInput: the tip is out of reach.
    """
    along = np.asarray(tip, dtype=float) - foot
    reach = math.hypot(*along)
    if not abs(near - far) <= reach <= near + far or reach == 0.0:
        raise BadInput(
            f"{robot}: the home pose requires a reach of {reach:.6g} m, the arms reach "
            f"{abs(near - far):.6g} to {near + far:.6g} m"
        )
    cosine = (reach**2 + near**2 - far**2) / (2 * reach * near)
    return math.atan2(along[1], along[0]) + side * math.acos(cosine)


def two_arms(
    name: str, foot: NDArray, angle: float, tip: NDArray, leg: PlanarLeg
) -> list[PlacedFrame]:
    """Return the drive, the elbow and the frame at the end of the second arm.

    The coordinate of the drive is the angle between its arm and the x axis.

    Args:
        name: name of the leg.
        foot: (2,) [m] position of the drive.
        angle: [rad] angle of the driven arm at home.
        tip: (2,) [m] end of the second arm at home.
        leg: parameters of the leg.

    Returns:
        Frames ``drive``, ``elbow`` (a pin) and ``arm`` (fixed).
    """
    elbow = foot + leg.near * direction(angle)
    along = tip - elbow
    second = math.atan2(along[1], along[0])
    drive = Frame(
        f"{name}.drive", joint="revolute", actuated=True, position=angle,
        joint_stiffness=drive_stiffness(leg.drive),
    )  # fmt: skip
    joint = pin(f"{name}.elbow", drive.name, leg.clearance, leg.link)
    arm = Frame(f"{name}.arm", joint.name, link=leg.link)
    return [
        (drive, in_plane(foot)),
        (joint, in_plane(elbow, angle)),
        (arm, in_plane(tip, second)),
    ]
