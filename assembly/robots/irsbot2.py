"""Reconstruction of the IRSBot-2 of section IV of the paper.

The two legs extend along the x axis; leg 2 is leg 1 rotated by pi about z0.  In each
leg, a parallelogram (proximal module) carries an elbow body of constant orientation.
Two parallel links between universal joints (distal module) carry the platform.  The
axes of the universal joints are not public.  The axes used here reproduce the mobility
in the paper throughout the workspace.

The index of a frame in the paper is its position in :data:`NAMES`, counted from 1.
Errors act at the frames :data:`ERROR_FRAMES`.

======  ===========================================================================
symbol  meaning [m, rad]
======  ===========================================================================
b       distance from the base's origin to the parallelogram's first joint
d       fixed side of the parallelogram; alpha is its angle to the platform plane
f g e   offsets from the parallelogram to the universal joints, in base axes
p a     offsets from the distal universal joints to the platform, in base axes
L1 L2   moving side of the parallelogram, links of the distal module
beta    azimuth and (alpha_d) altitude of the universal joints' body-fixed axis
======  ===========================================================================

Source:
    the paper, section IV-A, for every number.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_vector, transform

NAMES = (
    "drive", "elbow", "idler", "idler_end",
    "elbow_a", "elbow_a_first", "elbow_a_second", "link_a", "wrist_a", "platform_a",
    "elbow_b", "elbow_b_first", "elbow_b_second", "link_b", "wrist_b", "link_b_tip",
    "loop1_elbow", "loop1_idler", "loop2_platform", "loop2_link", "tip",
)  # fmt: skip
ERROR_FRAMES = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")
# [rad, m] minimum absolute values of the random error components in the paper
ERROR_LEAST = (1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6)
# [rad, m] maximum absolute values of the random error components in the paper
ERROR_MOST = (2e-2, 2e-2, 2e-2, 2e-4, 2e-4, 2e-4)

_PARENTS = {
    "drive": "base", "elbow": "drive", "idler": "base", "idler_end": "idler",
    "elbow_a": "elbow", "elbow_a_first": "elbow_a",
    "elbow_a_second": "elbow_a_first", "link_a": "elbow_a_second",
    "wrist_a": "link_a", "platform_a": "wrist_a",
    "elbow_b": "elbow", "elbow_b_first": "elbow_b",
    "elbow_b_second": "elbow_b_first", "link_b": "elbow_b_second",
    "wrist_b": "link_b", "link_b_tip": "wrist_b",
    "loop1_elbow": "elbow", "loop1_idler": "idler_end",
    "loop2_platform": "platform_a", "loop2_link": "link_b_tip", "tip": "platform_a",
}  # fmt: skip
_REVOLUTE = ("drive", "elbow", "idler", "idler_end")


@dataclass(frozen=True)
class IRSBot2Parameters:
    """Nominal parameters of the paper [m, rad, Pa, N m/rad, N/m], by its symbols."""

    a: float = 0.050
    b: float = 0.083
    d: float = 0.106
    e: float = 0.003342
    f: float = 0.080
    g: float = 0.166
    p: float = 0.050
    L1: float = 0.321
    L2: float = 0.452
    alpha: float = math.pi / 6
    alpha_d: float = math.pi / 4
    beta: float = math.pi / 2
    r: float = 0.040
    E: float = 60e9
    nu: float = 0.3
    clearance: Clearance = Clearance(radial=29e-6, axial=29e-6, tilt=7.55e-4, spin=10.0)
    K_B: tuple[float, ...] = (1e8, 1e8, 1.0, 3.51e8, 3.51e8, 4.39e8)
    theory: str = "euler"


def irsbot2(
    parameters: IRSBot2Parameters | None = None, x: float = 0.0, z: float = -0.5
) -> Robot:
    """Return the robot, whose joint coordinates are all zero in its home pose.

    Args:
        parameters: parameters of the robot; by default the parameters of the paper.
        x: [m] x coordinate of the platform in the home pose.
        z: [m] z coordinate of the platform in the home pose.

    Returns:
        The robot with 42 frames and 5 closures; platform ``leg1.tip``, parallel to the
        base.

    Raises:
        BadInput: the home pose is out of reach.
    """
    parameters = parameters or IRSBot2Parameters()
    turned = transform(np.zeros(3), np.diag([-1.0, -1.0, 1.0]))
    frames: list[Frame] = []
    for leg, sign in (("leg1", 1.0), ("leg2", -1.0)):
        placed = _leg(parameters, sign * x, z)
        if sign < 0:
            placed = {name: turned @ T for name, T in placed.items()}
            # The tips of both legs are parallel to the base.
            placed["tip"] = placed["tip"] @ turned
        frames += _frames(leg, placed, parameters)
    loops = [
        (f"{leg}.{a}", f"{leg}.{b}")
        for leg in ("leg1", "leg2")
        for a, b in (("loop1_elbow", "loop1_idler"), ("loop2_platform", "loop2_link"))
    ]
    description = "IRSBot-2 of the paper, nominal (reconstruction)"
    closures = (*loops, ("leg1.tip", "leg2.tip"))
    return Robot("irsbot2", "leg1.tip", tuple(frames), closures, description)


def drive_angle(parameters: IRSBot2Parameters, x: float, z: float) -> float:
    """Return the angle between the moving sides of leg 1 and the x axis.

    Args:
        parameters: parameters of the robot.
        x: [m] x coordinate of the platform for leg 1, or its negative for leg 2.
        z: [m] z coordinate of the platform.

    Returns:
        [rad] the angle q.

    Raises:
        BadInput: the position is out of reach.
    """
    P = parameters
    along = np.array([x - (P.b + P.f - P.p), z - P.e])
    n = math.hypot(*along)
    L2 = _planar_length(P)
    cosine = (n**2 + P.L1**2 - L2**2) / (2 * n * P.L1)
    if not -1.0 <= cosine <= 1.0:
        raise BadInput(
            f"irsbot2: pose x = {x:g}, z = {z:g} m requires a reach of {n:.6g} m, "
            f"the links reach {abs(P.L1 - L2):.6g} to {P.L1 + L2:.6g} m"
        )
    return math.atan2(along[1], along[0]) + math.acos(cosine)


def _planar_length(P: IRSBot2Parameters) -> float:
    """Return the length [m] of the distal links projected along y."""
    return math.sqrt(P.L2**2 - (P.g - P.a) ** 2)


def _leg(P: IRSBot2Parameters, x: float, z: float) -> dict[str, NDArray]:
    """Return the frames of leg 1 in base axes at a platform position."""
    q = drive_angle(P, x, z)
    arm = np.array([math.cos(q), 0.0, math.sin(q)])
    side = P.d * np.array([math.cos(P.alpha), 0.0, math.sin(P.alpha)])
    A = np.array([P.b, 0.0, 0.0])
    C = A + P.L1 * arm
    platform = np.array([x, 0.0, z])
    # Revolute axes are perpendicular to the x-z plane. The x axes are along the moving
    # side of the parallelogram.
    swing = _axes(arm, np.array([0.0, -1.0, 0.0]))
    placed = {
        "drive": transform(A, swing), "elbow": transform(C, swing),
        "idler": transform(A + side, swing),
        "idler_end": transform(C + side, swing),
        "loop1_elbow": transform(C + side, np.eye(3)),
        "loop1_idler": transform(C + side, np.eye(3)),
        "tip": transform(platform, np.eye(3)),
    }  # fmt: skip
    for which, y in (("a", 1.0), ("b", -1.0)):
        near = C + [P.f, y * P.g, P.e]
        far = platform + [P.p, y * P.a, 0.0]
        placed |= _link(P, which, y, near, far)
    placed["loop2_platform"] = placed["loop2_link"] = placed["link_b_tip"]
    return placed


def _link(
    P: IRSBot2Parameters, which: str, y: float, near: NDArray, far: NDArray
) -> dict[str, NDArray]:
    """Return the frames of one distal link and its two universal joints."""
    along = (far - near) / np.linalg.norm(far - near)
    level, rise = math.cos(P.alpha_d), math.sin(P.alpha_d)
    fixed = np.array([level * math.cos(P.beta), y * level * math.sin(P.beta), -rise])
    # link B is the reflection of link A in the plane y = 0
    own = y * np.cross(fixed, along)
    own /= np.linalg.norm(own)
    up = np.array([0.0, 0.0, 1.0])
    end = "platform_a" if which == "a" else "link_b_tip"
    return {
        f"elbow_{which}": transform(near, np.eye(3)),
        f"elbow_{which}_first": transform(near, _axes(np.cross(up, fixed), fixed)),
        f"elbow_{which}_second": transform(near, _axes(np.cross(fixed, own), own)),
        f"link_{which}": transform(far, _axes(along, own)),
        f"wrist_{which}": transform(far, _axes(np.cross(own, fixed), fixed)),
        end: transform(far, np.eye(3)),
    }


def _axes(x: NDArray, z: NDArray) -> NDArray:
    """Return the rotation matrix with given x and z axes."""
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _frames(leg: str, placed: dict[str, NDArray], P: IRSBot2Parameters) -> list[Frame]:
    """Return the frames of a leg with their joints and links."""
    frames = []
    for name in NAMES:
        above = _PARENTS[name]
        T = placed[name]
        if above != "base":
            T = np.linalg.inv(placed[above]) @ T
        parent = above if above == "base" else f"{leg}.{above}"
        frames.append(
            Frame(
                f"{leg}.{name}", parent, T[:3, 3], rotation_vector(T[:3, :3]),
                **_joint(name, P),
            )
        )  # fmt: skip
    return frames


def _joint(name: str, P: IRSBot2Parameters) -> dict:
    """Return the joint, clearance and link of a frame."""
    part: dict = {}
    if name in _REVOLUTE or name.endswith(("_first", "_second", "link_a", "link_b")):
        part = {"joint": "revolute", "actuated": name == "drive"}
    if name.endswith("_first") or name.startswith("wrist"):
        part = {"joint": "revolute", "joint_stiffness": np.diag(P.K_B)}
    if name.endswith("_second") or name in {"link_a", "link_b"}:
        part["clearance"] = P.clearance
    if name in {"link_a", "link_b"}:
        part["link"] = BeamLink({"radius": P.r}, P.E, P.nu, theory=P.theory)
    return part
