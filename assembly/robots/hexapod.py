"""Gough-Stewart platform, 6-UPS, with six driven struts.

A strut between a cardan joint and a ball joint transmits only an axial force.  The
platform stiffness is therefore the sum of k w w^T over the struts, where w is the unit
wrench along a strut.  The robot is not overconstrained, so geometric errors cause no
elastic energy.

Sources:
    Merlet, Parallel Robots (2nd edition, 2006), prototype "left hand": the joint
    centres.  Working height, sections, clearances and drives are assumed values.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import (
    at,
    ball_joint,
    cardan_joint,
    drive_stiffness,
)

BASE_POINTS = (
    (-0.0970, 0.0910), (0.0970, 0.0910), (0.1276, 0.0390),
    (0.0300, -0.1300), (-0.0300, -0.1300), (-0.1276, 0.0390),
)  # fmt: skip
PLATFORM_POINTS = (
    (-0.03000, 0.07300), (0.03000, 0.07300), (0.07822, -0.01052),
    (0.04822, -0.06248), (-0.04822, -0.06248), (-0.07822, -0.01052),
)  # fmt: skip


@dataclass(frozen=True)
class HexapodParameters:
    """Parameters of the robot [m, N/m, Pa]; steel tubes, screws with preloaded nuts."""

    height: float = 0.530
    drive: float = 1.5e7
    radius: float = 0.010
    inner_radius: float = 0.007
    young: float = 210e9
    poisson: float = 0.3
    density: float = 7850.0
    cardan: Clearance = Clearance(radial=5e-6, axial=5e-6)
    ball: Clearance = Clearance(radial=8e-6, axial=8e-6)


def hexapod(parameters: HexapodParameters | None = None) -> Robot:
    """Return the robot at its home pose, with the platform parallel to the base.

    Args:
        parameters: parameters of the robot; by default a :class:`HexapodParameters`
            instance.

    Returns:
        The robot with 42 frames and 5 closures; platform ``leg1.tip``.  The coordinate
        of ``legK.strut`` is the distance between its joint centres.
    """
    P = parameters or HexapodParameters()
    placed: list[PlacedFrame] = []
    for number, (a, b) in enumerate(zip(*points(), strict=True), 1):
        placed += _leg(f"leg{number}", a, b + [0.0, 0.0, P.height], P)
    closures = tuple(("leg1.tip", f"leg{number}.tip") for number in range(2, 7))
    description = "Gough-Stewart platform, 6-UPS, of the size of INRIA's left hand"
    return Robot("hexapod", "leg1.tip", place_frames(placed), closures, description)


def points() -> tuple[NDArray, NDArray]:
    """Return the joint centres in base axes and in platform axes, (6, 3) [m] each."""
    flat = np.zeros((6, 1))
    return np.hstack([BASE_POINTS, flat]), np.hstack([PLATFORM_POINTS, flat])


def _leg(name: str, a: NDArray, b: NDArray, P: HexapodParameters) -> list[PlacedFrame]:
    """Return the frames of a strut from a to b, with its ball joint at b."""
    length = float(np.linalg.norm(b - a))
    along = (b - a) / length
    first = np.cross([0.0, 0.0, 1.0], along)
    second = np.cross(along, first)
    strut = Frame(
        f"{name}.strut", f"{name}.cardan_2", joint="prismatic", actuated=True,
        position=length, joint_stiffness=drive_stiffness(P.drive, "prismatic"),
    )  # fmt: skip
    tube = BeamLink(
        {"radius": P.radius, "inner_radius": P.inner_radius}, P.young, P.poisson,
        P.density, length=length, axis=_in_axes(at(b, first, second), along),
    )  # fmt: skip
    return [
        *cardan_joint(f"{name}.cardan", "base", a, first, second, P.cardan),
        (strut, at(a, along, first)),
        *ball_joint(f"{name}.ball", strut.name, b, first, second, P.ball, tube),
        (Frame(f"{name}.tip", f"{name}.ball_3"), at([0.0, 0.0, P.height])),
    ]


def _in_axes(T: NDArray, vector: NDArray) -> tuple[float, float, float]:
    """Transform a direction from base axes to the axes of a frame."""
    x, y, z = (T[:3, :3].T @ vector).tolist()
    return x, y, z
