"""Planar five-bar robot, 5R, with two driven arms and two distal arms.

Sources:
    Campos, Bourbonnais, Bonev, Bigras (2010), Development of a five-bar parallel robot
    with large workspace, ASME IDETC: size of DexTAR, whose four arms have equal length.
    Dimensions are rounded.  Sections and clearances are assumed values.
"""

from dataclasses import dataclass

import numpy as np

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import pin
from forcefit.assembly.robots.planar import PlanarLeg, arm_angle, in_plane, two_arms


@dataclass(frozen=True)
class FiveBarParameters:
    """Parameters of the robot [m]; aluminium arms and small ball bearings."""

    base: float = 0.120  # distance between the drives on the x axis
    home: tuple[float, float] = (0.0, 0.140)
    leg: PlanarLeg = PlanarLeg(
        near=0.090,
        far=0.090,
        link=BeamLink({"width": 0.010, "height": 0.016}, 70e9, 0.33, density=2700.0),
        drive=1e3,
        clearance=Clearance(radial=5e-6, axial=10e-6, tilt=3e-4),
    )


def five_bar(parameters: FiveBarParameters | None = None) -> Robot:
    """Return the robot in its home pose, with both elbows outward.

    Args:
        parameters: parameters of the robot; by default a :class:`FiveBarParameters`
            instance.

    Returns:
        The robot with 9 frames and 1 closure.  The platform ``left.tip`` is on the
        right distal arm.  The coordinate of a drive is the angle between its arm and
        the x axis.

    Raises:
        BadInput: the home pose is out of reach.
    """
    P = parameters or FiveBarParameters()
    tip = np.array(P.home)
    placed: list[PlacedFrame] = []
    for name, side in (("left", 1), ("right", -1)):
        foot = np.array([-side * P.base / 2, 0.0])
        leg = P.leg
        angle = arm_angle("five_bar", foot, tip, leg.near, leg.far, side)
        placed += two_arms(name, foot, angle, tip, leg)
    placed += [
        (pin("left.pin", "left.arm", P.leg.clearance), in_plane(tip)),
        (Frame("left.tip", "left.pin"), in_plane(tip)),
        (Frame("right.tip", "right.arm"), in_plane(tip)),
    ]
    description = "Planar five-bar robot with equal arms"
    closures = (("left.tip", "right.tip"),)
    return Robot("five_bar", "left.tip", place_frames(placed), closures, description)
