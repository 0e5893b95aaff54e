"""Convex set of possible platform errors.

The inner approximation is the convex hull of the farthest points in many directions.
The outer approximation follows from the support function in these directions.
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
    """Set of possible rotations or translations of the platform.

    Attributes:
        part: ``"rotation"`` or ``"translation"``.
        points: (k, 3) [rad or m] farthest point in each direction, in base axes.
        faces: (m, 3) indices of the points of each triangle of the convex hull; empty
            if the points are coplanar.
        directions: (k, 3) unit vectors.
        heights: (k,) [rad or m] upper bound on the support function in each direction.
    """

    part: str
    points: NDArray
    faces: NDArray
    directions: NDArray
    heights: NDArray

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def slack(self) -> float:
        """Largest distance between both approximations along a direction [rad or m]."""
        inner = (self.points @ self.directions.T).max(axis=0)
        return float(np.max(self.heights - inner))

    def contains(self, error: ArrayLike) -> bool:
        """Return whether an error is in the outer approximation of the set."""
        return bool(np.all(self.directions @ np.asarray(error) <= self.heights))


def possible_errors(assembly: Assembly, part: str, assumption: str) -> ErrorBody:
    """Compute the set of possible platform errors of an assembly.

    Args:
        assembly: the assembly.
        part: ``"rotation"`` or ``"translation"``.
        assumption: assumption of problem (27).

    Returns:
        The set of possible errors.

    Raises:
        BadInput: the part is unknown, or the errors are unbounded because the platform
            moves freely.
        SolverFailed: the cone solver failed.
    """
    if part not in PARTS:
        raise BadInput(f"errors: found {quoted(part)}{nearest(part, PARTS)}")
    reach = reachable_screws(assembly, assumption)
    if reach.unbounded(PARTS[part].start):
        raise BadInput(
            f"{assembly.posture.robot.name}: the {part} error is unbounded, "
            "because the platform moves freely; expected a robot without a free "
            "motion of the platform, or no plot of the errors"
        )
    return error_body(reach, part)


def error_body(reachable: ReachableSet, part: str, count: int = 200) -> ErrorBody:
    """Approximate a set of possible platform errors.

    Args:
        reachable: result of
            :func:`forcefit.assembly.linear.reference.pose_error.reachable_screws`.
        part: ``"rotation"`` or ``"translation"``.
        count: number of directions.

    Returns:
        The approximation.

    Raises:
        ValueError: the part is unknown, or its errors are unbounded.
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
    """Return the triangles of the convex hull, if any."""
    try:
        return ConvexHull(points).simplices
    except QhullError:
        return np.zeros((0, 3), dtype=int)


def even_directions(count: int) -> NDArray:
    """Return evenly distributed unit vectors on a golden spiral.

    Args:
        count: number of vectors.

    Returns:
        (count, 3) unit vectors.
    """
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    flat = np.sqrt(1.0 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
