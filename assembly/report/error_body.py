"""Convex set of possible pose errors of the platform.

The set is approximated from inside by its support points in many directions, and from
outside by its support function in the same directions.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.linear.reference.pose_error import ReachableSet, reachable_screws
from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.results.display import html_table, short_repr

PARTS = {"rotation": slice(0, 3), "translation": slice(3, 6)}


@dataclass(frozen=True, eq=False)
class ErrorBody:
    """Possible rotation or translation errors of the platform.

    Attributes:
        part: ``"rotation"`` or ``"translation"``.
        points: (k, 3) [rad or m] points of the set, base axes; vertices of the inner
        faces: (m, 3) row indices of ``points`` for each face; empty for a flat set.
        directions: (k, 3) unit vectors.
        heights: (k,) [rad or m] certified upper bound along each direction.
    """

    part: str
    points: NDArray
    faces: NDArray
    directions: NDArray
    heights: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slack(self) -> float:
        """[rad or m] largest distance between the outer and the inner polytope."""
        inner = (self.points @ self.directions.T).max(axis=0)
        return float(np.max(self.heights - inner))

    def contains(self, error: ArrayLike) -> bool:
        """Return whether an error (3,) may be in the set; False is certain."""
        return bool(np.all(self.directions @ np.asarray(error) <= self.heights))


def possible_errors(assembly: Assembly, part: str, assumption: str) -> ErrorBody:
    """Compute the set of possible platform errors of an assembled robot.

    Args:
        assembly: assembly at one posture.
        part: ``"rotation"`` or ``"translation"``.
        assumption: assumption of problem (27).

    Returns:
        The set of possible errors.

    Raises:
        BadInput: the part is unknown, or the platform moves freely, so that its errors
            are unbounded.
        SolverFailed: the cone solver failed.
    """
    if part not in PARTS:
        raise BadInput(f"errors: found {quoted(part)}{nearest(part, PARTS)}")
    reach = reachable_screws(assembly, assumption)
    if reach.unbounded(PARTS[part].start):
        raise BadInput(
            f"{assembly.posture.robot.name}: found a free motion of the "
            f"platform, so its {part} error is unbounded; expected a "
            "robot without a free platform motion, or no plot of the error"
        )
    return error_body(reach, part)


def error_body(reachable: ReachableSet, part: str, count: int = 200) -> ErrorBody:
    """Approximate the set of possible errors by means of its support function.

    Args:
        reachable: result of
            :func:`forcefit.assembly.linear.reference.pose_error.reachable_screws`.
        part: ``"rotation"`` or ``"translation"``.
        count: number of directions, evenly distributed.

    Returns:
        The inner and outer approximation of the set.

    Raises:
        ValueError: the part is unknown or unbounded.
        SolverFailed: the cone solver failed.
    """
    if part not in PARTS:
        raise ValueError(f"part is {part!r}, expected 'rotation' or 'translation'")
    if reachable.unbounded(PARTS[part].start):
        raise ValueError(f"the platform moves freely: its {part} is unbounded")
    directions = even_directions(count)
    weights = np.eye(6)[PARTS[part]]
    supports = [reachable.support(d @ weights) for d in directions]
    points = np.array([support.screw[PARTS[part]] for support in supports])
    heights = np.array([support.height for support in supports])
    return ErrorBody(part, points, _faces(points), directions, heights)


def _faces(points: NDArray) -> NDArray:
    """Return the triangles of the convex hull; none if the points are coplanar."""
    try:
        return ConvexHull(points).simplices
    except QhullError:
        return np.zeros((0, 3), dtype=int)


def even_directions(count: int) -> NDArray:
    """Return unit vectors that are evenly distributed along a golden spiral.

    Args:
        count: number of vectors.

    Returns:
        (count, 3) unit vectors.
    """
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    flat = np.sqrt(1.0 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
