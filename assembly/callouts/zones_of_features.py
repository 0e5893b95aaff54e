"""Zones of the callouts of a drawing, for axes, planes and points.

The z axis of a feature is its axis or its normal; the origin is the middle of the
feature.  Widths are as on the drawing: a diameter, or the distance between two planes.
The offset of an axis at height z is e(z) = (TX + z RY, TY - z RX).
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import parse_hole
from forcefit.assembly.callouts.zone import Zone

_SIGNS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))


def offset_rows(z: float) -> NDArray:
    """Return (2, 6) rows of the offset e(z) of an axis at a height z [m]."""
    return np.array([[0, z, 0, 1.0, 0, 0], [-z, 0, 0, 0, 1.0, 0]])


def axis_position(width: float, length: float, bonus: float = 0.0) -> Zone:
    """Return the zone of an axis within a cylinder: position or coaxiality.

    Args:
        width: [m] diameter of the cylinder.
        length: [m] length of the bore, > 0.
        bonus: [m] growth of the diameter from the least to the largest hole (M); 0 for
            no growth.

    Returns:
        Two discs, at the two ends of the bore, which couple shift and tilt.
    """
    ends = tuple(offset_rows(z) * 2 / width for z in (length / 2, -length / 2))
    return Zone(ends, bonus / width)


def axis_position_along(
    width: float, length: float, direction: NDArray, bonus: float = 0.0
) -> Zone:
    """Return the zone of an axis between two planes: position in one direction.

    Args:
        width: [m] distance of the planes.
        length: [m] length of the bore.
        direction: (2,) unit vector normal to the planes, in the feature's x and y.
        bonus: [m] growth of the distance from the least to the largest hole (M); 0 for
            no growth.
    """
    ends = (direction @ offset_rows(z) * 2 / width for z in (length / 2, -length / 2))
    return Zone(tuple(row[None] for row in ends), bonus / width)


def axis_orientation(
    width: float, length: float, direction: NDArray | None = None
) -> Zone:
    """Return the zone of perpendicularity, parallelism or angularity of an axis.

    Args:
        width: [m] diameter; with a direction, the distance of two planes.
        length: [m] length of the bore.
        direction: (2,) unit vector in which the axis may tilt; None for all directions.
    """
    tilt = (offset_rows(1.0) - offset_rows(0.0)) * length / width
    return Zone((tilt if direction is None else (direction @ tilt)[None],))


def plane_position(width: float, size_x: float, size_y: float) -> Zone:
    """Return the zone of a rectangular plane: position or profile.

    Args:
        width: [m] distance of the two planes of the zone.
        size_x: [m] full size of the face along x.
        size_y: [m] full size of the face along y.

    Returns:
        The octahedron |TZ| + size_y/2 |RX| + size_x/2 |RY| <= width/2.
    """
    rows = [
        np.array([[a * size_y / 2, b * size_x / 2, 0, 0, 0, 1.0]]) for a, b in _SIGNS
    ]
    return Zone(tuple(row * 2 / width for row in rows))


def plane_orientation(width: float, size_x: float, size_y: float) -> Zone:
    """Return the zone of parallelism or perpendicularity of a rectangular plane."""
    rows = [np.array([[size_y / 2, b * size_x / 2, 0, 0, 0, 0]]) for b in (1, -1)]
    return Zone(tuple(row * 2 / width for row in rows))


def round_plane_position(width: float, diameter: float) -> Zone:
    """Return the zone of a round plane: position or profile.

    Args:
        width: [m] distance of the two planes of the zone.
        diameter: [m] diameter of the face.

    Returns:
        The double cone |TZ| + diameter/2 |(RX, RY)| <= width/2.
    """
    along, across = np.eye(6)[5:] * 2 / width, np.eye(6)[:2] * diameter / width
    return Zone((along, across), cones=(np.vstack([along, across]),))


def round_plane_orientation(width: float, diameter: float) -> Zone:
    """Return the zone of parallelism or perpendicularity of a round plane."""
    return Zone((np.eye(6)[:2] * diameter / width,))


def point_position(width: float) -> Zone:
    """Return the zone of a point within a ball of a diameter [m]."""
    return Zone((np.hstack([np.zeros((3, 3)), np.eye(3)]) * 2 / width,))


def datum_shift(hole: str, length: float = 0.0) -> Zone:
    """Return the zone of the shift of a hole that is a datum at maximum material.

    Args:
        hole: size of the hole, such as ``"12 H7"``.
        length: [m] length of the hole if it is datum A; 0 if an earlier datum fixes the
            tilt.

    Returns:
        A disc across the hole's axis, or one disc at each of its ends. The diameter is
        the size of the hole minus the least size, so the disc is a point for the
        smallest hole.
    """
    growth = float(np.ptp(parse_hole(hole)[1]))
    heights = (length / 2, -length / 2) if length else (0.0,)
    ends = tuple(offset_rows(z) * 2 / growth for z in heights)
    return Zone(ends, from_zero=True)


def shift_along(tolerance: float, direction: NDArray) -> Zone:
    """Return the zone of a shift by at most a tolerance to each side.

    Args:
        tolerance: [m] largest shift to each side.
        direction: (3,) unit vector of the shift, in the feature's axes.
    """
    row = np.concatenate([np.zeros(3), np.asarray(direction, dtype=float)])
    return Zone((row[None] / tolerance,))
