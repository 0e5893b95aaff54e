"""Conversion of frames from home poses in base axes to poses relative to parents."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.frame import BASE, Frame
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

PlacedFrame = tuple[Frame, NDArray]  # a frame and its (4, 4) home pose


def place_frames(placed: Iterable[PlacedFrame]) -> tuple[Frame, ...]:
    """Return the frames with the translation and rotation of their home poses.

    Args:
        placed: frames with (4, 4) home poses in base axes, parents first.  A home pose
            excludes the motion of the frame's own joint; all other joints are at their
            ``position``.

    Returns:
        The frames, relative to their parents.
    """
    after = {BASE: np.eye(4)}
    frames = []
    for frame, T in placed:
        step = np.linalg.inv(after[frame.parent]) @ T
        turn = rotation_vector(step[:3, :3])
        frames.append(replace(frame, translation=step[:3, 3], rotation=turn))
        after[frame.name] = T @ own_motion(frame)
    return tuple(frames)


def own_motion(frame: Frame) -> NDArray:
    """Return the (4, 4) motion of a joint at its home position, about or along z."""
    along = np.array([0.0, 0.0, frame.position])
    if frame.joint == "prismatic":
        return transform(along, np.eye(3))
    return transform(frame.lead * along, rotation_matrix(along))
