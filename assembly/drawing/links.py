"""Conversion of links between bodies and frames."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import DrawnBody, turned_link
from forcefit.assembly.model.frame import between_origins
from forcefit.assembly.model.robot import (
    BeamLink,
    Frame,
    LibraryLink,
    Link,
    MatrixLink,
    MeshLink,
    beam_axis,
)
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.screws import screw_map

_SAME_POINT = 1e-9  # [m] largest distance between coincident points
_SAME_AXES = 1e-12  # largest difference between equal axes
_PARALLEL = 1e-6  # smallest sine of the angle between a beam and the z axis


def link_at_tip(
    body: DrawnBody, base: NDArray, tip: NDArray, reverse: bool = False
) -> Link | None:
    """Express the link of a body in the frame at its tip.

    Args:
        body: body with a link.
        base: home pose of the end nearer to the robot base, (4, 4).
        tip: home pose of the end farther from the robot base, (4, 4).
        reverse: whether ``tip`` is the start of the link.

    Returns:
        Link with directions in tip axes.  Beams have a length and an axis.

    Raises:
        BadInput: both ends coincide, or a library link is reversed.
    """
    link, R = body.link, tip[:3, :3]
    place = f"body {quoted(body.name)}.link"
    if isinstance(link, MatrixLink):
        return _reversed_matrix(link, base, tip) if reverse else link
    if isinstance(link, LibraryLink):
        if reverse:
            raise BadInput(
                f'{place}.library: found that the joint "to" is nearer to the base '
                'than the joint "from", expected the reverse order'
            )
        return link
    span = tip[:3, 3] - base[:3, 3]
    length = float(np.linalg.norm(span))
    if isinstance(link, BeamLink | MeshLink):
        given = link.axis
        if given is None and length < _SAME_POINT:
            raise BadInput(f"{place}: found that the joints at both ends coincide")
        along = np.array(given) * (-1 if reverse else 1) if given else span / length
        x, y, z = along.tolist()
        link = replace(link, axis=(x, y, z))
    if isinstance(link, BeamLink):
        up = link.up or _default_up(body, np.array(link.axis))
        link = replace(link, up=up, length=link.length or length)
    if isinstance(link, MeshLink) and reverse:
        link = replace(link, base=link.tip, tip=link.base)
    return turned_link(link, R.T)


def _default_up(body: DrawnBody, along: NDArray) -> tuple[float, float, float]:
    """Return the z axis of the body, or its x axis for a beam along z."""
    x, _, z = body.axes.T
    unit = along / np.linalg.norm(along)
    a, b, c = (x if np.linalg.norm(np.cross(unit, z)) < _PARALLEL else z).tolist()
    return a, b, c


def _reversed_matrix(link: MatrixLink, base: NDArray, tip: NDArray) -> MatrixLink:
    """Transform a stiffness matrix from the base end to the tip end of a link."""
    turn = base[:3, :3].T @ tip[:3, :3]
    M = screw_map(base[:3, :3].T @ (tip[:3, 3] - base[:3, 3]), turn)
    K = M.T @ link.stiffness @ M
    return MatrixLink((K + K.T) / 2)


def beam_start(frame: Frame, T: NDArray) -> NDArray | None:
    """Return the point at which the beam of a frame begins.

    Args:
        frame: frame of a robot.
        T: home pose of the frame, (4, 4).

    Returns:
        Point in base axes, (3,) [m]; None for other links.
    """
    if isinstance(frame.link, BeamLink):
        length, axis = beam_axis(frame)
        return T[:3, 3] - length * (T[:3, :3] @ axis)
    return None


def drawn_link(frame: Frame, T: NDArray, to: NDArray, spanned: bool) -> Link:
    """Express the link of a frame in the axes of a body.

    Args:
        frame: frame with a link.
        T: home pose of the frame, (4, 4).
        to: home pose of the joint at the end of the link, (4, 4), at the frame origin.
        spanned: whether a beam begins and ends at its two joints.

    Returns:
        Link with directions in base axes.  A stiffness matrix is in joint axes.
    """
    link, R = frame.link, T[:3, :3]
    if isinstance(link, MatrixLink):
        turn = np.kron(np.eye(2), to[:3, :3].T @ R)
        same = np.abs(turn - np.eye(6)).max() < _SAME_AXES
        K = link.stiffness if same else turn @ link.stiffness @ turn.T
        return MatrixLink((K + K.T) / 2)
    if isinstance(link, BeamLink):
        length, axis = beam_axis(frame)
        x, y, z = axis.tolist()
        up = tuple(section_axes(axis, link.up)[:, 2].tolist())
        link = replace(link, length=length, axis=(x, y, z), up=up)
        link = turned_link(link, R)
        assert isinstance(link, BeamLink)
        return replace(link, length=None, axis=None) if spanned else link
    if isinstance(link, MeshLink):
        return turned_link(replace(link, axis=_mesh_axis(frame, link)), R) or link
    assert link is not None
    return link


def _mesh_axis(frame: Frame, link: MeshLink) -> tuple[float, float, float]:
    """Return the direction of a mesh from base to tip in frame axes."""
    x, y, z = (link.axis or between_origins(frame))[:3]
    return float(x), float(y), float(z)
