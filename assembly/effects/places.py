"""Frames where effects act: drives and beams of a robot, and changes made to them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.model.robot import BeamLink, Frame, Robot, beam_axis


def drives(robot: Robot) -> tuple[str, ...]:
    """Actuated joints."""
    return tuple(f.name for f in robot.frames if f.actuated)


def turning_drives(robot: Robot) -> tuple[str, ...]:
    """Actuated joints that turn."""
    return tuple(f.name for f in robot.frames if f.actuated and f.joint == "revolute")


def beams(robot: Robot) -> tuple[str, ...]:
    """Frames whose body is a beam, which has an axis along which it lengthens."""
    return tuple(f.name for f in robot.frames if isinstance(f.link, BeamLink))


def with_screws(conditions: Conditions, frame: str, screws: NDArray) -> Conditions:
    """Conditions with more stress-free screws at a frame.

    Args:
        conditions: conditions of R rows.
        frame: where.
        screws: (R, 6) or (6,) [rad, m] in the frame's axes.

    Returns:
        The conditions changed.
    """
    errors = conditions.errors.copy()
    errors[:, conditions.robot.index(frame)] += screws
    return replace(conditions, errors=errors)


def with_frame(
    conditions: Conditions, frame: str, change: Callable[[Frame], Frame]
) -> Conditions:
    """Conditions of a robot with one frame changed."""
    row = conditions.robot.index(frame)
    frames = list(conditions.robot.frames)
    frames[row] = change(frames[row])
    return replace(conditions, robot=replace(conditions.robot, frames=tuple(frames)))


def lengthening(frame: Frame) -> NDArray:
    """(6,) screw of a beam that is longer by 1 m, in the frame's axes."""
    return np.concatenate([np.zeros(3), beam_axis(frame)[1]])


def own_unit(robot: Robot, parameter: str) -> str:
    """``rad`` or ``m``: unit of the motion of the joint that a parameter names."""
    frame = next(f for f in robot.frames if f.name == parameter)
    return "m" if frame.joint == "prismatic" else "rad"
