"""A body's farthest screw, bracketed by cuts: the reference, in numpy.

Each support function d.x <= h(d) cuts a half space off; what the cuts leave is a
polytope that holds the body.  Its farthest corner is an upper bound, the farthest point
that a support attains a lower one, and the next cut is made across that corner.

Sources:
    Hoffman (1981), A method for globally minimizing concave functions over convex sets,
    Mathematical Programming 20.
"""

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.one_problem import Support

_MOST = 400  # support functions
# what every cut leaves around the body, so that a flat one has corners, too: of the
# tolerance, and at least of its size
_SLACK, _LEAST_SLACK = 0.25, 1e-7


def farthest(
    centre: NDArray, half: int, tolerance: float, support: Support
) -> tuple[tuple[float, float], NDArray, int]:
    """Bracket the largest size of half a screw of a bounded convex body.

    Args:
        centre: (6,) [rad, m] a screw of the body.
        half: 0 for the rotation, 3 for the translation.
        tolerance: [rad or m] required difference of upper and lower bound.
        support: of a direction (3,) of that half.

    Returns:
        Lower and upper bound, (6,) the screw that attains the lower, and how many
        support functions it took: no more than 400, with which the bounds may be wider
        than asked.
    """
    part = slice(half, half + 3)
    best, low = centre, float(np.linalg.norm(centre[part]))
    cuts: list[NDArray] = []
    room: list[float] = []  # from the centre to each cut
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
    """(3,) the corner of {cuts (x - centre) <= room} of the largest size."""
    from scipy.spatial import HalfspaceIntersection

    unit = room.max()
    halfspaces = np.column_stack([cuts, -room / unit])
    corners = HalfspaceIntersection(halfspaces, np.zeros(3)).intersections
    points = centre + unit * corners
    return points[np.linalg.norm(points, axis=1).argmax()]
