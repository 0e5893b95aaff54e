"""Calibrated geometry, which includes the known geometric errors of a robot."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects import apply_effects
from forcefit.assembly.exchange.xml_file import counted
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.model.robot import BeamLink, MatrixLink, Robot
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

# names of effects that do not depend on pose, temperature or load
CONSTANT = ("encoder_offset", "link_length")


def with_calibration(home: Posture) -> Robot:
    """Add the known geometric errors of a robot to its nominal geometry.

    Args:
        home: home posture of a robot with geometric errors and effects.

    Returns:
        Robot whose frames include the geometric errors and constant effects.  The robot
        has no geometric errors and no effects.

    Raises:
        BadInput: an effect has an invalid value.
    """
    robot = home.robot
    constant = {k: v for k, v in robot.effects.items() if k in CONSTANT}
    plain = replace(home, robot=robot.without_effects())
    errors = apply_effects(as_declared(plain, None), constant).errors[0]
    frames = []
    for frame, T, error in zip(
        robot.frames, robot.fixed_transforms, errors, strict=True
    ):
        if error.any():
            off = transform(error[3:], rotation_matrix(error[:3]))
            T = T @ off
            turn = rotation_vector(T[:3, :3])
            frame = replace(
                frame, translation=T[:3, 3], rotation=turn, geometric_error=np.zeros(6)
            )
        frames.append(frame)
    return replace(robot.without_effects(), frames=tuple(frames))


def not_rigid(robot: Robot) -> tuple[str, ...]:
    """Describe the properties of a robot that a model of rigid bodies omits."""
    frames = robot.frames
    kinds = {
        "elastic links": [f.name for f in frames if f.link is not None],
        "joint stiffnesses": [f.name for f in frames if f.joint_stiffness is not None],
        "clearances": [f.name for f in frames if f.clearance is not None],
        "masses of links that are not beams": [
            f.name
            for f in frames
            if not isinstance(f.link, BeamLink | MatrixLink | None)
        ],
        "effects": [
            *(name for name in robot.effects if name not in CONSTANT),
            *(f"those of session {session}" for session in robot.session_effects),
            *(function.title for function in robot.functions),
        ],
    }
    return tuple(line for what, names in kinds.items() for line in counted(what, names))
