"""Clavel's Delta robot, R-(SS)2: three driven arms move the platform by pairs of rods.

The rods can rotate about their own axes, so the robot has 9 degrees of freedom, 3 of
the platform and 6 of the rods.  The robot is not overconstrained, so geometric errors
cause no elastic energy.

Sources:
    Williams, The Delta parallel robot: kinematics solutions, Ohio University (2016):
    the dimensions of ABB's FlexPicker IRB 360-1/1600 and worked examples.  Sections,
    clearances and drives are assumed values.  Clavel (1990), US patent 4976582, for the
    architecture.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import at, ball_joint, drive_stiffness
from forcefit.inputs.table import BadInput

AZIMUTHS = (-math.pi / 2, math.pi / 6, 5 * math.pi / 6)  # [rad] directions of the legs


@dataclass(frozen=True)
class DeltaParameters:
    """Parameters of the Delta robot [m, N m/rad]; the rods are carbon fibre tubes."""

    # side of the base triangle; the drives are at the midpoints of its sides
    base_side: float = 0.567
    # side of the platform triangle, with the rods at its corners
    platform_side: float = 0.076
    arm: float = 0.524
    rod: float = 1.244
    rod_distance: float = 0.131  # distance between the two rods of a leg
    home: float = -0.9  # height of the platform
    drive: float = 2e4
    arm_link: BeamLink = BeamLink(
        {"radius": 0.030, "inner_radius": 0.027}, 90e9, 0.3, density=1600.0
    )
    rod_link: BeamLink = BeamLink(
        {"radius": 0.007, "inner_radius": 0.005}, 120e9, 0.3, density=1600.0
    )
    ball: Clearance = Clearance(radial=20e-6, axial=20e-6)

    @property
    def base_radius(self) -> float:
        """Distance from the centre to the drives [m]."""
        return self.base_side * math.sqrt(3) / 6

    @property
    def platform_radius(self) -> float:
        """Distance from the platform centre to the middle of a pair of rods [m]."""
        return self.platform_side * math.sqrt(3) / 3


def delta(parameters: DeltaParameters | None = None) -> Robot:
    """Return the robot at its home pose, on its vertical axis.

    Args:
        parameters: parameters of the robot; by default a :class:`DeltaParameters`
            instance.

    Returns:
        The robot with 48 frames and 5 closures; platform ``leg1.a_tip``.  The
        coordinate of a drive is the angle of its arm below the base plane.

    Raises:
        BadInput: the home pose is out of reach.
    """
    P = parameters or DeltaParameters()
    angle = drive_angle(P, AZIMUTHS[0], np.array([0.0, 0.0, P.home]))
    placed: list[PlacedFrame] = []
    for number, azimuth in enumerate(AZIMUTHS, 1):
        placed += _leg(f"leg{number}", azimuth, angle, P)
    tips = [f"leg{number}.{rod}_tip" for number in (1, 2, 3) for rod in "ab"]
    closures = tuple((tips[0], tip) for tip in tips[1:])
    description = "Delta of the size of the FlexPicker IRB 360-1/1600"
    return Robot("delta", tips[0], place_frames(placed), closures, description)


def drive_angle(
    parameters: DeltaParameters, azimuth: float, position: NDArray
) -> float:
    """Return the angle of one arm below the base plane, with the elbow outward.

    Args:
        parameters: parameters of the robot.
        azimuth: [rad] direction of the leg.
        position: (3,) [m] position of the platform.

    Returns:
        [rad] coordinate of the drive.

    Raises:
        BadInput: the position is out of reach.
    """
    P = parameters
    out, across = _radial(azimuth)
    # vector in the leg plane from the drive to the platform end of the rods
    x = position @ out + P.platform_radius - P.base_radius
    z = -position[2]
    reach = math.hypot(x, z)
    rod = math.sqrt(max(0.0, P.rod**2 - float(position @ across) ** 2))
    if not abs(P.arm - rod) <= reach <= P.arm + rod:
        raise BadInput(
            f"delta: a leg requires a reach of {reach:.6g} m, its arm and rods reach "
            f"{abs(P.arm - rod):.6g} to {P.arm + rod:.6g} m"
        )
    cosine = (reach**2 + P.arm**2 - rod**2) / (2 * reach * P.arm)
    return math.atan2(z, x) - math.acos(cosine)


def _radial(azimuth: float) -> tuple[NDArray, NDArray]:
    """Return the radial and tangential unit vectors in the base plane."""
    c, s = math.cos(azimuth), math.sin(azimuth)
    return np.array([c, s, 0.0]), np.array([-s, c, 0.0])


def _leg(
    name: str, azimuth: float, angle: float, P: DeltaParameters
) -> list[PlacedFrame]:
    """Return the frames of a driven arm and its two rods."""
    out, across = _radial(azimuth)
    foot = P.base_radius * out
    arm = math.cos(angle) * out - math.sin(angle) * np.array([0.0, 0.0, 1.0])
    elbow = foot + P.arm * arm
    platform = np.array([0.0, 0.0, P.home])
    drive = Frame(f"{name}.drive", joint="revolute", actuated=True, position=angle,
                  joint_stiffness=drive_stiffness(P.drive))  # fmt: skip
    placed: list[PlacedFrame] = [
        (drive, at(foot, across, out)),
        (Frame(f"{name}.elbow", drive.name, link=P.arm_link), at(elbow, across, arm)),
    ]
    for rod, sign in (("a", 1.0), ("b", -1.0)):
        aside = sign * P.rod_distance / 2 * across
        far = platform + P.platform_radius * out + aside
        placed += _rod(f"{name}.{rod}", f"{name}.elbow", elbow + aside, far, across, P)
        tip = Frame(f"{name}.{rod}_tip", f"{name}.{rod}_low_3")
        placed.append((tip, at(platform)))
    return placed


def _rod(
    name: str,
    parent: str,
    near: NDArray,
    far: NDArray,
    across: NDArray,
    P: DeltaParameters,
) -> list[PlacedFrame]:
    """Return the frames of a rod between two ball joints."""
    along = (far - near) / np.linalg.norm(far - near)
    third = np.cross(along, across)
    high = ball_joint(f"{name}_high", parent, near, across, third, P.ball)
    above = f"{name}_high_3"
    return high + ball_joint(f"{name}_low", above, far, along, across, P.ball,
                             P.rod_link)  # fmt: skip
