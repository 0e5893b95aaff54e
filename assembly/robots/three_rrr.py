"""Planar 3-RRR robot with three legs of two arms and a triangular platform.

Sources:
    Gosselin, Angeles (1988), The optimum kinematic design of a planar
    three-degree-of-freedom parallel manipulator, J. Mechanisms, Transmissions and
    Automation in Design 110: the architecture and its inverse kinematics.  Dimensions,
    sections and clearances are assumed values.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import pin
from forcefit.assembly.robots.planar import (
    PlanarLeg,
    arm_angle,
    direction,
    in_plane,
    two_arms,
)


@dataclass(frozen=True)
class ThreeRRRParameters:
    """Parameters of the robot [m]; aluminium arms and small ball bearings."""

    base_radius: float = 0.300
    platform_radius: float = 0.080
    home: tuple[float, float] = (0.0, 0.0)
    leg: PlanarLeg = PlanarLeg(
        near=0.160,
        far=0.160,
        link=BeamLink({"width": 0.012, "height": 0.025}, 70e9, 0.33, density=2700.0),
        drive=4e3,
        clearance=Clearance(radial=10e-6, axial=20e-6, tilt=3e-4),
    )

    def feet(self) -> NDArray:
        """Return the positions of the drives on a circle, (3, 2) [m]."""
        return self.base_radius * _triangle()

    def corners(self) -> NDArray:
        """Return the positions of the platform pins in platform axes, (3, 2) [m]."""
        return self.platform_radius * _triangle()


def three_rrr(parameters: ThreeRRRParameters | None = None) -> Robot:
    """Return the robot at its home pose, with the platform parallel to the base.

    Args:
        parameters: parameters of the robot; by default a :class:`ThreeRRRParameters`
            instance.

    Returns:
        The robot with 15 frames and 2 closures; platform ``leg1.tip``, the centre of
        the triangle.  The coordinate of a drive is the angle between its arm and the x
        axis.

    Raises:
        BadInput: the home pose is out of reach.
    """
    P = parameters or ThreeRRRParameters()
    leg = P.leg
    placed: list[PlacedFrame] = []
    pairs = zip(P.feet(), P.corners(), strict=True)
    for number, (foot, corner) in enumerate(pairs, 1):
        name, end = f"leg{number}", corner + P.home
        angle = arm_angle("3rrr", foot, end, leg.near, leg.far, side=1)
        placed += two_arms(name, foot, angle, end, leg)
        joint = pin(f"{name}.pin", f"{name}.arm", leg.clearance)
        placed += [
            (joint, in_plane(end)),
            (Frame(f"{name}.tip", joint.name), in_plane(P.home)),
        ]
    description = "Planar 3-RRR robot"
    closures = (("leg1.tip", "leg2.tip"), ("leg1.tip", "leg3.tip"))
    return Robot("3rrr", "leg1.tip", place_frames(placed), closures, description)


def _triangle() -> NDArray:
    """Return the corners of an equilateral triangle in the unit circle, (3, 2)."""
    return np.array([direction(math.pi * (1 / 2 + 2 * k / 3)) for k in range(3)])
