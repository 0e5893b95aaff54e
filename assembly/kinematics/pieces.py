"""Divide beams into elements in series.

The error of a single spring at the end of a beam is proportional to the square of the
bending angle.  If the beam is divided into n elements, each a frame with a spring, the
bending angle of an element is proportional to 1 / n and the error to 1 / n^2.  Results
for small motions do not change.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.robot import BeamLink, Frame, Robot, beam_axis
from forcefit.stiffness.screws import rotation_matrix


@dataclass(frozen=True, eq=False)
class CutRobot:
    """Robot whose beams are divided into elements, each of which is a frame.

    Attributes:
        robot: robot of m frames, m >= n.
        owner: (m,) index of the original frame for each frame of the divided robot.
        last: (n,) index of the last element of each original frame.
        back: (m,) [m] distance along the beam between the end of the element and the
            origin of the original frame.
    """

    robot: Robot
    owner: NDArray
    last: NDArray
    back: NDArray

    def cut(self, posture: Posture) -> Posture:
        """Return one or many postures with a frame for each element.

        Args:
            posture: posture of the original robot, with arrays (..., n) and (..., n, 4,
                4).

        Returns:
            Posture of the divided robot, with arrays (..., m) and (..., m, 4, 4).
        """
        T = posture.transforms[..., self.owner, :, :].copy()
        for row in np.flatnonzero(self.back):
            _, axis = beam_axis(posture.robot.frames[self.owner[row]])
            shift = T[..., row, :3, :3] @ (self.back[row] * axis)
            T[..., row, :3, 3] -= shift
        q = np.zeros((*posture.coordinates.shape[:-1], len(self.owner)))
        q[..., self.last] = posture.coordinates
        return Posture(self.robot, q, T, posture.mismatch)

    def spread(self, rows: NDArray) -> NDArray:
        """Return an array (..., m, k) that is zero except at the last elements."""
        spread = np.zeros((*rows.shape[:-2], len(self.owner), rows.shape[-1]))
        spread[..., self.last, :] = rows
        return spread


def cut_beams(robot: Robot) -> CutRobot:
    """Return a robot with one frame for every beam element.

    Args:
        robot: robot of n frames.

    Returns:
        The divided robot. If no beam has several elements, the frames are the frames of
        ``robot``.
    """
    frames: list[Frame] = []
    owner, last, back = [], [], []
    for row, frame in enumerate(robot.frames):
        for piece, behind in _pieces(frame):
            frames.append(piece)
            owner.append(row)
            back.append(behind)
        last.append(len(frames) - 1)
    whole = len(frames) == len(robot.frames)
    cut = robot if whole else replace(robot, frames=tuple(frames))
    return CutRobot(cut, np.array(owner), np.array(last), np.array(back))


def _pieces(frame: Frame) -> list[tuple[Frame, float]]:
    """Return the elements of a body from base to tip, and distances from the tip."""
    link = frame.link
    if not isinstance(link, BeamLink) or link.pieces == 1:
        return [(frame, 0.0)]
    length, axis = beam_axis(frame)
    step = length / link.pieces
    x, y, z = axis.tolist()
    part = replace(link, pieces=1, length=step, axis=(x, y, z))
    turn = rotation_matrix(frame.rotation)
    pieces, parent = [], frame.parent
    for k in range(1, link.pieces):
        behind = length - k * step
        start = frame.translation - turn @ (behind * axis)
        piece = Frame(
            f"{frame.name}.piece{k}", parent,
            start if k == 1 else step * axis,
            frame.rotation if k == 1 else np.zeros(3), link=part,
        )  # fmt: skip
        pieces.append((piece, behind))
        parent = piece.name
    tip = replace(
        frame, parent=parent, link=part, translation=step * axis, rotation=np.zeros(3)
    )
    return [*pieces, (tip, 0.0)]
