"""Lengths of links between the origins of the parent and the frame."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import BeamLink, Frame, Link, MeshLink, Robot
from forcefit.inputs.table import BadInput, quoted
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.screws import rotation_matrix

_SAME_POINT = 1e-9  # [m] largest distance between coincident origins


def with_spans(robot: Robot, home: NDArray) -> Robot:
    """Compute and check the lengths of all links.

    A beam connects both origins in the home pose.  If the parent joint is prismatic or
    helical and its home coordinate is not zero, the distance between the origins
    differs from the translation of the frame and is stored in the beam.

    Args:
        robot: robot as read from a file.
        home: joint coordinates in the home pose (n,) [rad or m].

    Returns:
        Robot in which beams whose length differs from the translation of the frame have
        ``length`` and ``axis``.

    Raises:
        BadInput: the origins of a link coincide, or ``up`` is parallel to its axis.
    """
    links: dict[str, Link] = {}
    for i, frame in enumerate(robot.frames):
        parent = robot.parents[i]
        # A prismatic joint moves its children along z by its coordinate, and a helical
        # joint by its coordinate times its lead.
        travel = own_screw(robot.frames[parent])[5] if parent >= 0 else 0.0
        shift = float(home[parent] * travel)
        shift = shift if abs(shift) > _SAME_POINT else 0.0
        if isinstance(frame.link, BeamLink):
            links[frame.name] = _with_span(frame, frame.link, shift)
        elif isinstance(frame.link, MeshLink):
            _check_mesh(frame, frame.link, shift)
    return robot.with_links(links) if links else robot


def _with_span(frame: Frame, link: BeamLink, shift: float) -> BeamLink:
    """Compute the length of a beam, and check its direction ``up``."""
    if link.length is None or link.axis is None:
        axis = _span(frame, shift)
        length = float(np.linalg.norm(axis))
        x, y, z = (axis / length).tolist()
        spanned = replace(link, length=length, axis=(x, y, z)) if shift else link
    else:
        axis, spanned = np.array(link.axis), link
    try:
        section_axes(axis, link.up)
    except BadInput as error:
        place = f"frame {quoted(frame.name)}.link.beam.up"
        raise BadInput(f"{place}: {error}; expected a different direction") from None
    return spanned


def _check_mesh(frame: Frame, link: MeshLink, shift: float) -> None:
    """Check that the axis and rotation of a mesh are defined."""
    if link.axis is None and shift:
        raise BadInput(
            f"frame {quoted(frame.name)}.link.mesh: found a mesh on a frame "
            f"after a sliding joint with a home position of {shift:g} m; "
            'expected a home position of 0, or the "axis" of the mesh from '
            "base to tip"
        )
    axis = _span(frame, 0.0) if link.axis is None else np.array(link.axis)
    try:
        section_axes(axis, link.frame_up)
    except BadInput as error:
        place = f"frame {quoted(frame.name)}.up"
        raise BadInput(f"{place}: {error}; expected a different direction") from None


def _span(frame: Frame, shift: float) -> NDArray:
    """Return the vector from the parent origin to the frame origin (3,) [m]."""
    span = rotation_matrix(frame.rotation).T @ (frame.translation + [0.0, 0.0, shift])
    if np.linalg.norm(span) < _SAME_POINT:
        mesh = isinstance(frame.link, MeshLink)
        given = 'mesh with "axis"' if mesh else 'beam with "length" and "axis"'
        raise BadInput(
            f"frame {quoted(frame.name)}.link: found a distance of 0 m from the "
            f"parent; expected a translation, or a {given}"
        )
    return span
