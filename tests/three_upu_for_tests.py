"""3-UPU robot of Seoul National University (SNU).

In the home pose, the axes of all universal joints are horizontal, so that each leg
transmits a couple about the vertical.  With locked drives, the platform retains two
rotational degrees of freedom in this pose and in all poses above the centre of the base
(Zlatanov, Bonev, Gosselin 2002; Walter, Husty, Pfurner 2009).
"""

import numpy as np

from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.stiffness.screws import rotation_vector

BASE, PLATFORM, HEIGHT = 0.24, 0.08, 0.45  # [m] radii of base and platform, and height
LENGTH = float(np.hypot(BASE - PLATFORM, HEIGHT))  # [m] length of a leg at home
ERRORS = 1e-3  # [rad] largest angular error; the linear errors are a tenth [m]
_PLAY = Clearance(radial=1e-5, axial=1e-5, tilt=2e-4)


def three_upu(seed=None):
    """Return the robot; with a seed, its frames have random errors."""
    frames = []
    for leg in range(3):
        frames += _leg(f"leg{leg + 1}", 2 * np.pi * leg / 3)
    closures = [(f"leg{k}.tip", "leg1.tip") for k in (2, 3)]
    robot = Robot("snu", "leg1.tip", tuple(frames), tuple(closures))
    if seed is None:
        return robot
    errors = np.random.default_rng(seed).uniform(-1, 1, (len(frames), 6)) * ERRORS
    errors[:, 3:] /= 10
    return robot.with_errors(errors)


def _leg(name, angle):
    """Return the six frames of the leg at an angle about z."""
    radial = np.array([np.cos(angle), np.sin(angle), 0.0])
    tangent = np.array([-np.sin(angle), np.cos(angle), 0.0])
    along = ((PLATFORM - BASE) * radial + [0, 0, HEIGHT]) / LENGTH
    up = np.array([0.0, 0.0, 1.0])
    poses = {  # orientation of each frame in base axes
        "base": np.eye(3),
        "u1": _axes(up, radial), "u2": _axes(up, tangent),
        "slide": _axes(tangent, along), "v2": _axes(up, tangent),
        "v1": _axes(up, radial), "tip": np.eye(3),
    }  # fmt: skip
    shifts = {"u1": BASE * radial, "tip": -PLATFORM * radial}
    kinds = {"slide": {"joint": "prismatic", "actuated": True, "position": LENGTH,
                       "joint_stiffness": np.diag([np.inf] * 5 + [2e7])},
             "v2": {"joint": "revolute", "link": _rod(poses["v2"].T @ along)},
             "u1": {"joint": "revolute"}, "tip": {}}  # fmt: skip
    names = list(poses)
    frames = []
    for parent, own in zip(names, names[1:], strict=False):
        turn = rotation_vector(poses[parent].T @ poses[own])
        shift = poses[parent].T @ shifts.get(own, np.zeros(3))
        fields = kinds.get(own, {"joint": "revolute", "clearance": _PLAY})
        before = "base" if parent == "base" else f"{name}.{parent}"
        frames.append(Frame(f"{name}.{own}", before, shift, turn, **fields))
    return frames


def _axes(x, z):
    """Return the rotation matrix with axis z and with x orthogonalised to z."""
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _rod(axis):
    """Return the beam of a leg along an axis."""
    return BeamLink({"radius": 0.015}, 2.1e11, 0.3, length=LENGTH, axis=tuple(axis))
