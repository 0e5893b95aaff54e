"""Convert home poses in base axes to poses relative to the parent frames."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.frame import BASE, Frame
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

PlacedFrame = tuple[Frame, NDArray]  # frame and its home pose (4, 4)


def place_frames(placed: Iterable[PlacedFrame]) -> tuple[Frame, ...]:
    """Set the translation and rotation of frames from their home poses.

    Args:
        placed: frames and their home poses (4, 4) in base axes, parents first.  A home
            pose excludes the motion of the frame's own joint, but includes the
            ``position`` of all preceding joints.

    Returns:
        Frames with translation and rotation relative to their parents.
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
    """Return the transform (4, 4) of a joint at its home position."""
    along = np.array([0.0, 0.0, frame.position])
    if frame.joint == "prismatic":
        return transform(along, np.eye(3))
    return transform(frame.lead * along, rotation_matrix(along))
