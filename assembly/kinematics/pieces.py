"""Beams in pieces: one link as several springs in a row.

A spring at a beam's end is the beam as long as it bends little: its error grows with
the square of the angle.  Cut into n pieces of L / n, each a frame with a spring of its
own, the angle of each falls with n and the error with n squared.  For small motions
nothing changes: beams end to end are one beam.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture
from assembly.model.robot import BeamLink, Frame, Robot, beam_axis
from stiffness.screws import rotation_matrix


@dataclass(frozen=True, eq=False)
class CutRobot:
    """A robot whose beams in pieces are rows of frames.

    Attributes:
        robot: of m frames, m >= n.
        owner: (m,) row of the frame, in the robot that was cut, that each belongs to.
        last: (n,) row here of each of those frames: a beam's last piece ends there.
        back: (m,) [m] from a frame's own origin to the piece's end, along the beam.
    """

    robot: Robot
    owner: NDArray
    last: NDArray
    back: NDArray

    def cut(self, posture: Posture) -> Posture:
        """Return the same posture with a frame for each piece; many in one likewise.

        Args:
            posture: of the robot that was cut, arrays (..., n) and (..., n, 4, 4).

        Returns:
            Arrays (..., m) and (..., m, 4, 4).
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
        """Rows of frames (..., n, k) where their beams end, (..., m, k), else zero."""
        spread = np.zeros((*rows.shape[:-2], len(self.owner), rows.shape[-1]))
        spread[..., self.last, :] = rows
        return spread


def cut_beams(robot: Robot) -> CutRobot:
    """Return a robot with a frame for every piece of its beams.

    Args:
        robot: of n frames.

    Returns:
        The cut robot; the same frames where no beam is in pieces.
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
    """Return frames of one body from its base out, and how far each is from its tip."""
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
