"""Orthoglide: translational robot with three perpendicular linear drives.

Each PRPaR leg consists of a slide, a hinge, a parallelogram and a second hinge parallel
to the first.  A leg prevents rotation of the platform about two axes, so three of the
six constraints of the three legs are redundant.  Each planar parallelogram adds three
redundant constraints.  The degree of overconstraint is therefore twelve, and errors
cause internal forces.

With the slide coordinates r, the platform position p and the leg length L, the leg
along x imposes (p_x - r_x)^2 + p_y^2 + p_z^2 = L^2.  At home, where p = 0 and r = -L,
the Jacobian is the identity matrix.

Sources:
    Chablat, Wenger (2003), Architecture optimization of a 3-DOF translational parallel
    mechanism for machining applications, the Orthoglide, IEEE Trans. Robotics and
    Automation 19: the architecture and its isotropic point.  Pashkevich, Chablat,
    Wenger (2009), Stiffness analysis of overconstrained parallel manipulators,
    Mechanism and Machine Theory 44: elastic bodies and joints.  Dimensions are similar
    to those of the prototype.  Sections, clearances and drives are assumed values.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.placed_frames import PlacedFrame, place_frames
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots.placing import at, drive_stiffness, pin


@dataclass(frozen=True)
class OrthoglideParameters:
    """Parameters of the robot [m, N/m]; aluminium bars, preloaded ball bearings."""

    leg: float = 0.310
    width: float = 0.080  # width of the parallelograms
    # distance from the platform's centre to the ends of the legs
    platform: float = 0.030
    drive: float = 5e7
    link: BeamLink = BeamLink(
        {"radius": 0.012, "inner_radius": 0.009}, 70e9, 0.33, density=2700.0
    )
    clearance: Clearance = Clearance(radial=5e-6, axial=10e-6, tilt=2e-4)


def orthoglide(parameters: OrthoglideParameters | None = None) -> Robot:
    """Return the robot at its isotropic point.

    Args:
        parameters: parameters of the robot; by default an :class:`OrthoglideParameters`
            instance.

    Returns:
        The robot with 30 frames and 5 closures; platform ``x.tip``.  The coordinate of
        ``x.slide`` is r_x.
    """
    P = parameters or OrthoglideParameters()
    axes = np.eye(3)
    placed: list[PlacedFrame] = []
    for k, name in enumerate("xyz"):
        placed += _leg(name, axes[k], axes[(k + 1) % 3], P)
    closures = (
        *((f"{name}.bar_a", f"{name}.bar_b") for name in "xyz"),
        ("x.tip", "y.tip"), ("x.tip", "z.tip"),
    )  # fmt: skip
    description = "Orthoglide, PRPaR legs, at its isotropic point"
    return Robot("orthoglide", "x.tip", place_frames(placed), closures, description)


def _leg(
    name: str, along: NDArray, hinge: NDArray, P: OrthoglideParameters
) -> list[PlacedFrame]:
    """Return the frames of a leg along a base axis, with hinges along a second axis."""
    near, far = -(P.leg + P.platform) * along, -P.platform * along
    slide = Frame(
        f"{name}.slide", joint="prismatic", actuated=True, position=-P.leg,
        joint_stiffness=drive_stiffness(P.drive, "prismatic"),
    )  # fmt: skip
    placed: list[PlacedFrame] = [
        (slide, at(far, along, hinge)),
        (pin(f"{name}.hinge", slide.name, P.clearance), at(near, hinge, along)),
    ]
    normal = np.cross(along, hinge)
    for side, sign in (("a", 1.0), ("b", -1.0)):
        aside = sign * P.width / 2 * hinge
        foot = pin(f"{name}.foot_{side}", f"{name}.hinge", P.clearance)
        end = pin(f"{name}.end_{side}", foot.name, P.clearance, P.link)
        placed += [
            (foot, at(near + aside, normal, along)),
            (end, at(far + aside, normal, along)),
            (Frame(f"{name}.bar_{side}", end.name), at(far, hinge, along)),
        ]
    wrist = pin(f"{name}.wrist", f"{name}.bar_a", P.clearance)
    tip = Frame(f"{name}.tip", wrist.name)
    return [*placed, (wrist, at(far, hinge, along)), (tip, at(np.zeros(3)))]
