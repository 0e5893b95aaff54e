"""Six-axis serial arm: the PUMA 560.

The arm has no closure and therefore no internal forces.  Errors and clearances add up
along the arm.  A load on the flange deforms the drives, with the compliance J K^-1 J^T,
and the two long bodies.

Sources:
    Corke, Armstrong-Helouvry (1994), A search for consensus among model parameters
    reported for the PUMA 560 robot, IEEE ICRA: the kinematic parameters, standard
    Denavit-Hartenberg.  Armstrong, Khatib, Burdick (1986), The explicit dynamic model
    and inertial parameters of the PUMA 560 arm, IEEE ICRA: the masses.  Corke (2011),
    Robotics, Vision and Control, chapter 7: the home angles, called the "nominal"
    posture.
    Drives, sections and clearances are assumed values.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import drive_stiffness
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

# d, a [m], alpha [rad], mass [kg], drive stiffness [N m/rad]
JOINTS = (
    (0.0, 0.0, math.pi / 2, 0.0, 6e4),
    (0.0, 0.4318, 0.0, 17.4, 6e4),
    (0.15005, 0.0203, -math.pi / 2, 4.8, 3e4),
    (0.4318, 0.0, math.pi / 2, 0.82, 3e3),
    (0.0, 0.0, -math.pi / 2, 0.34, 3e3),
    (0.0, 0.0, 0.0, 0.09, 2e3),
)
HOME = (0.0, math.pi / 4, math.pi, 0.0, math.pi / 4, 0.0)  # [rad] joint angles at home


@dataclass(frozen=True)
class Arm6Parameters:
    """Parameters of the arm: aluminium tubes and preloaded bearings."""

    joints: tuple[tuple[float, ...], ...] = JOINTS
    home: tuple[float, ...] = HOME
    upper_arm: BeamLink = BeamLink({"radius": 0.075, "inner_radius": 0.071}, 70e9, 0.33)
    forearm: BeamLink = BeamLink({"radius": 0.050, "inner_radius": 0.047}, 70e9, 0.33)
    clearance: Clearance = Clearance(radial=5e-6, axial=5e-6, tilt=5e-5, spin=1e-4)


def arm6(parameters: Arm6Parameters | None = None) -> Robot:
    """Return the arm at its home posture.

    Args:
        parameters: parameters of the arm; by default an :class:`Arm6Parameters`
            instance.

    Returns:
        The arm with 7 frames and no closure; platform ``flange``.  A joint's coordinate
        is its Denavit-Hartenberg angle.
    """
    P = parameters or Arm6Parameters()
    parent, step = "base", np.eye(4)
    frames: list[Frame] = []
    part: dict[str, Any] = {}
    bodies = {1: P.upper_arm, 3: P.forearm}
    for k, (d, a, alpha, mass, stiffness) in enumerate(P.joints):
        name = f"joint{k + 1}"
        frames.append(
            Frame(
                name, parent, step[:3, 3], rotation_vector(step[:3, :3]),
                joint="revolute", actuated=True, position=P.home[k],
                joint_stiffness=drive_stiffness(stiffness), clearance=P.clearance,
                **part,
            )
        )  # fmt: skip
        parent, step = name, after_joint(d, a, alpha)
        part = {"mass": mass, "link": bodies.get(k)}
    flange = Frame("flange", parent, step[:3, 3], rotation_vector(step[:3, :3]), **part)
    return Robot("arm6", "flange", (*frames, flange), description="PUMA 560")


def after_joint(d: float, a: float, alpha: float) -> NDArray:
    """Return the transform from one joint to the next at zero joint angle, (4, 4)."""
    return transform([a, 0.0, d], rotation_matrix([alpha, 0.0, 0.0]))
