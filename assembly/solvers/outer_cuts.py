"""Bound the farthest screw of a convex set by cuts, in numpy (reference method).

Each support function d.x <= h(d) removes a half space, and the remaining polytope
contains the set.  The farthest corner of the polytope gives an upper bound on the
distance, and the farthest known point of the set gives a lower bound.  The next support
function is in the direction of the farthest corner.

Sources:
    Hoffman (1981), A method for globally minimizing concave functions over convex sets,
    Mathematical Programming 20.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.solvers.one_problem import Support

_MOST = 400  # largest number of support functions
# Distance between each cut and the set, relative to the tolerance, and its minimum
# relative to the size of the set. The polytope around a flat set then has corners.
_SLACK, _LEAST_SLACK = 0.25, 1e-7


def farthest(
    centre: NDArray, half: int, tolerance: float, support: Support
) -> tuple[tuple[float, float], NDArray, int]:
    """Bound the largest rotation or translation of a bounded convex set of screws.

    Args:
        centre: (6,) [rad, m] screw of the set.
        half: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] required difference between the upper and lower bound.
        support: support function of a direction (3,) of this half.

    Returns:
        Lower and upper bound; (6,) the screw that attains the lower bound; and the
        number of support functions, at most 400.  If 400 do not suffice, the bounds are
        wider than required.
    """
    part = slice(half, half + 3)
    best, low = centre, float(np.linalg.norm(centre[part]))
    cuts: list[NDArray] = []
    room: list[float] = []  # [rad or m] distance of each cut from the centre
    directions = [*np.eye(3), *-np.eye(3)]
    while True:
        for direction in directions:
            height, screw, _ = support(direction)
            cuts.append(direction)
            room.append(max(height - float(direction @ centre[part]), 0.0))
            size = float(np.linalg.norm(screw[part]))
            if size > low:
                best, low = screw, size
        slack = max(_SLACK * tolerance, _LEAST_SLACK * max(room), 1e-100)
        corner = _farthest_corner(np.array(cuts), np.array(room) + slack, centre[part])
        high = float(np.linalg.norm(corner))
        if high - low <= tolerance or len(cuts) >= _MOST:
            return (low, max(low, high)), best, len(cuts)
        directions = [corner / high]


def _farthest_corner(cuts: NDArray, room: NDArray, centre: NDArray) -> NDArray:
    """Return the corner of a polytope that is farthest from the origin, (3,)."""
    from scipy.spatial import HalfspaceIntersection

    unit = room.max()
    halfspaces = np.column_stack([cuts, -room / unit])
    corners = HalfspaceIntersection(halfspaces, np.zeros(3)).intersections
    points = centre + unit * corners
    return points[np.linalg.norm(points, axis=1).argmax()]
