"""Tolerance zones of drawing callouts for axes, planes and points.

The z axis of a feature is its axis or normal, and the origin is its centre.  As on a
drawing, a zone width is a diameter or the distance between two planes.  The
displacement of an axis at height z is e(z) = (TX + z RY, TY - z RX).
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import parse_hole
from forcefit.assembly.callouts.zone import Zone

_SIGNS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))


def offset_rows(z: float) -> NDArray:
    """Return the matrix of the displacement e(z) of an axis at height z [m], (2, 6)."""
    return np.array([[0, z, 0, 1.0, 0, 0], [-z, 0, 0, 0, 1.0, 0]])


def axis_position(width: float, length: float, bonus: float = 0.0) -> Zone:
    """Return the zone of an axis within a cylinder, for position or coaxiality.

    Args:
        width: diameter of the cylinder [m].
        length: length of the bore [m], > 0.
        bonus: growth of the diameter from the smallest to the largest hole [m] for the
            modifier (M); 0 without growth.

    Returns:
        Zone in which the displacements at both ends of the bore are in a disc.
    """
    ends = tuple(offset_rows(z) * 2 / width for z in (length / 2, -length / 2))
    return Zone(ends, bonus / width)


def axis_position_along(
    width: float, length: float, direction: NDArray, bonus: float = 0.0
) -> Zone:
    """Return the zone of an axis between two planes, for position in one direction.

    Args:
        width: distance between the planes [m].
        length: length of the bore [m].
        direction: unit vector normal to the planes, (2,), in x and y of the feature.
        bonus: growth of the distance from the smallest to the largest hole [m] for the
            modifier (M); 0 without growth.
    """
    ends = (direction @ offset_rows(z) * 2 / width for z in (length / 2, -length / 2))
    return Zone(tuple(row[None] for row in ends), bonus / width)


def axis_orientation(
    width: float, length: float, direction: NDArray | None = None
) -> Zone:
    """Return the zone of an axis for perpendicularity, parallelism or angularity.

    Args:
        width: diameter [m], or distance between two planes if ``direction`` is given.
        length: length of the bore [m].
        direction: unit vector normal to the planes, (2,); None for all directions.
    """
    tilt = (offset_rows(1.0) - offset_rows(0.0)) * length / width
    return Zone((tilt if direction is None else (direction @ tilt)[None],))


def plane_position(width: float, size_x: float, size_y: float) -> Zone:
    """Return the zone of a rectangular plane for position or profile.

    Args:
        width: distance between the planes that limit the zone [m].
        size_x: side length of the face along x [m].
        size_y: side length of the face along y [m].

    Returns:
        Octahedron |TZ| + size_y/2 |RX| + size_x/2 |RY| <= width/2.
    """
    rows = [
        np.array([[a * size_y / 2, b * size_x / 2, 0, 0, 0, 1.0]]) for a, b in _SIGNS
    ]
    return Zone(tuple(row * 2 / width for row in rows))


def plane_orientation(width: float, size_x: float, size_y: float) -> Zone:
    """Return the zone of a rectangular plane for parallelism or perpendicularity."""
    rows = [np.array([[size_y / 2, b * size_x / 2, 0, 0, 0, 0]]) for b in (1, -1)]
    return Zone(tuple(row * 2 / width for row in rows))


def round_plane_position(width: float, diameter: float) -> Zone:
    """Return the zone of a round plane for position or profile.

    Args:
        width: distance between the planes that limit the zone [m].
        diameter: diameter of the face [m].

    Returns:
        Double cone |TZ| + diameter/2 |(RX, RY)| <= width/2.
    """
    along, across = np.eye(6)[5:] * 2 / width, np.eye(6)[:2] * diameter / width
    return Zone((along, across), cones=(np.vstack([along, across]),))


def round_plane_orientation(width: float, diameter: float) -> Zone:
    """Return the zone of a round plane for parallelism or perpendicularity."""
    return Zone((np.eye(6)[:2] * diameter / width,))


def point_position(width: float) -> Zone:
    """Return the zone of a point within a ball with a given diameter [m]."""
    return Zone((np.hstack([np.zeros((3, 3)), np.eye(3)]) * 2 / width,))


def datum_shift(hole: str, length: float = 0.0) -> Zone:
    """Return the zone of the shift of a datum hole with maximum material condition.

    Args:
        hole: size of the hole, for example ``"12 H7"``.
        length: length of the hole if it is datum A [m]; 0 if a preceding datum
            constrains the tilt.

    Returns:
        Disc normal to the axis of the hole, or a disc at each end.  Its diameter is the
        difference between the size of the hole and the smallest size.
    """
    growth = float(np.ptp(parse_hole(hole)[1]))
    heights = (length / 2, -length / 2) if length else (0.0,)
    ends = tuple(offset_rows(z) * 2 / growth for z in heights)
    return Zone(ends, from_zero=True)


def shift_along(tolerance: float, direction: NDArray) -> Zone:
    """Return the zone of a displacement along one direction.

    Args:
        tolerance: maximum displacement in positive and negative direction [m].
        direction: unit vector of the displacement in feature axes, (3,).
    """
    row = np.concatenate([np.zeros(3), np.asarray(direction, dtype=float)])
    return Zone((row[None] / tolerance,))
