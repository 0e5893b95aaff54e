"""Hoeken's linkage: a planar four-bar linkage that traces a straight line.

In units of the crank length, ground link, coupler and rocker have the lengths 2, 2.5
and 2.5.  The tracing point extends beyond the coupler pin by the length of the coupler.
Crank pin, rocker foot and tracing point are on a circle about the coupler pin.  The
lines from the foot to the other two points are therefore perpendicular (Thales), and

    P = [2, 0] + 2 sqrt((5 + cos t) / (5 - 4 cos t)) [sin t, 2 - cos t],

where t is the angle between crank and ground link.  The height of the point is exactly
4 for t = 90, 180 and 270 degrees.

Sources:
    Norton, Design of Machinery, chapter 3, Hoeken's linkage: the proportions.  Size,
    sections and clearances are assumed values.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BASE, BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import drive_stiffness, pin
from forcefit.assembly.robots.planar import direction, in_plane


@dataclass(frozen=True)
class FourBarParameters:
    """Parameters of the linkage [m, rad, N m/rad]; aluminium bars, plain bearings."""

    crank: float = 0.1
    home: float = math.pi
    drive: float = 5e3
    link: BeamLink = BeamLink(
        {"width": 0.010, "height": 0.025}, 70e9, 0.33, density=2700.0
    )
    clearance: Clearance = Clearance(radial=20e-6, axial=50e-6, tilt=5e-4)


def four_bar(parameters: FourBarParameters | None = None) -> Robot:
    """Return the linkage at its home angle.

    Args:
        parameters: parameters of the linkage; by default a :class:`FourBarParameters`
            instance.

    Returns:
        The linkage with 8 frames and 1 closure.  The platform ``point`` is the tracing
        point.  The coordinate of the driven joint ``crank`` is its angle to the ground
        link.
    """
    P = parameters or FourBarParameters()
    foot, tip, middle, point = (P.crank * p for p in corners(P.home))
    coupler = math.atan2(*(middle - tip)[::-1])
    rocker = math.atan2(*(middle - foot)[::-1])
    crank = Frame("crank", joint="revolute", actuated=True, position=P.home,
                  joint_stiffness=drive_stiffness(P.drive))  # fmt: skip
    placed: list[PlacedFrame] = [
        (crank, in_plane([0, 0])),
        (pin("crank_pin", "crank", P.clearance, P.link), in_plane(tip, P.home)),
        (Frame("middle", "crank_pin", link=P.link), in_plane(middle, coupler)),
        (Frame("point", "middle", link=P.link), in_plane(point)),
        (pin("rocker_pin", "middle", P.clearance), in_plane(middle, coupler)),
        (Frame("end_coupler", "rocker_pin"), in_plane(middle, rocker)),
        (pin("rocker", BASE, P.clearance), in_plane(foot, rocker)),
        (Frame("end_rocker", "rocker", link=P.link), in_plane(middle, rocker)),
    ]
    description = "Hoeken's straight-line four-bar linkage"
    closures = (("end_coupler", "end_rocker"),)
    return Robot("four_bar", "point", place_frames(placed), closures, description)


def corners(angle: float) -> tuple[NDArray, ...]:
    """Return the pin positions at a crank angle, in units of the crank length.

    Args:
        angle: [rad] angle of the crank to the ground link.

    Returns:
        Rocker foot, crank pin, coupler pin and tracing point, (2,) each.
    """
    foot, tip = np.array([2.0, 0.0]), direction(angle)
    to_pin = tip - foot
    # By Thales' theorem, the line from the foot to the point is perpendicular to the
    # line from the foot to the crank pin, and the point has a distance of 5 from the
    # crank pin.
    across = np.array([to_pin[1], -to_pin[0]]) / np.linalg.norm(to_pin)
    point = foot + np.sqrt(25.0 - to_pin @ to_pin) * across
    return foot, tip, (tip + point) / 2, point
