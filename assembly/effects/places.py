"""Frames at which effects can act, and changes of the conditions at a frame."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.frame import between_origins
from forcefit.assembly.model.robot import BeamLink, Frame, Robot, beam_axis

_LEAST = 1e-6  # [m] smallest distance between both ends of a body with a length


def drives(robot: Robot) -> tuple[str, ...]:
    """Return the actuated joints."""
    return tuple(f.name for f in robot.frames if f.actuated)


def turning_drives(robot: Robot) -> tuple[str, ...]:
    """Return the actuated joints whose coordinate is an angle."""
    return tuple(f.name for f in robot.frames if f.actuated and f.turns)


def beams(robot: Robot) -> tuple[str, ...]:
    """Return the frames whose bodies are beams."""
    return tuple(f.name for f in robot.frames if isinstance(f.link, BeamLink))


def bodies(robot: Robot) -> tuple[str, ...]:
    """Return the frames whose bodies have a length."""
    return tuple(
        f.name
        for f in robot.frames
        if isinstance(f.link, BeamLink) or np.linalg.norm(f.translation) > _LEAST
    )


def growing(robot: Robot) -> tuple[str, ...]:
    """Return the beams, or all bodies with a length if there are no beams."""
    return beams(robot) or bodies(robot)


def body_axis(frame: Frame) -> tuple[float, NDArray]:
    """Return the length and direction of a body.

    Args:
        frame: frame of the body.

    Returns:
        Length [m] and direction (3,) of the beam, in the frame's axes.  Without a beam,
        they refer to the line from the parent's origin to the frame's origin.
    """
    if isinstance(frame.link, BeamLink):
        return beam_axis(frame)
    along = between_origins(frame)
    length = float(np.linalg.norm(along))
    return length, along / length


def with_screws(conditions: Conditions, frame: str, screws: NDArray) -> Conditions:
    """Add stress-free screws at a frame to the conditions.

    Args:
        conditions: conditions of R measurements.
        frame: name of the frame.
        screws: (R, 6) or (6,) [rad, m] screws in the frame's axes.

    Returns:
        The modified conditions.
    """
    errors = conditions.errors.copy()
    errors[:, conditions.robot.index(frame)] += screws
    return replace(conditions, errors=errors)


def with_frame(
    conditions: Conditions, frame: str, change: Callable[[Frame], Frame]
) -> Conditions:
    """Replace one frame of the robot to which the conditions belong."""
    row = conditions.robot.index(frame)
    frames = list(conditions.robot.frames)
    frames[row] = change(frames[row])
    return replace(conditions, robot=replace(conditions.robot, frames=tuple(frames)))


def lengthening(frame: Frame) -> NDArray:
    """Return the screw of a body that is longer by 1 m, in the frame's axes, (6,)."""
    return np.concatenate([np.zeros(3), body_axis(frame)[1]])


def own_unit(robot: Robot, parameter: str) -> str:
    """Return the unit of a joint coordinate, ``rad`` or ``m``."""
    frame = next(f for f in robot.frames if f.name == parameter)
    return "m" if frame.joint == "prismatic" else "rad"
