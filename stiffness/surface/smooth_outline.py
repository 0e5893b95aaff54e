"""Outlines of interfaces without a sharp edge.

Where an interface continues smoothly into a fillet, the common line of the two tangent
shapes is poorly determined by their equations. The line is therefore computed as the
intersection of the interface and a wall, which is the surface through the line and
normal to the interface.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.facets import Facets
from forcefit.stiffness.surface.primitives import Shape, fit_cone, fit_plane

# cosine of the largest change of direction at a smooth corner of an outline
_CORNER = np.cos(np.radians(35.0))
# largest distance of the outline from its wall, relative to the size of the outline
_ON_WALL = 1e-5
_CIRCLE = 10  # smallest number of corners of a polygon that approximates a circle


@dataclass(frozen=True, eq=False)
class SmoothOutline:
    """Part of the outline of an interface without a sharp edge.

    Attributes:
        patches: patch numbers of the interface and of the adjacent patch.
        wall: surface through the outline, normal to the interface.
        ends: (e, 2, 3) [m] ends of the edges of the outline.
        side: 1 if signed distances from the wall are positive outside the interface,
            otherwise -1.
    """

    patches: tuple[int, int]
    wall: Shape
    ends: NDArray
    side: float

    def outside(self, points: NDArray) -> NDArray:
        """Return distances from the wall, negative inside the interface, (n,) [m]."""
        return self.side * self.wall.signed(points)[0]

    def distance(self, points: NDArray) -> NDArray:
        """Return the distances of points from the nearest edge, (n,) [m]."""
        start, along = self.ends[:, 0], self.ends[:, 1] - self.ends[:, 0]
        square = np.maximum(np.einsum("ei,ei->e", along, along), 1e-300)
        nearest = np.full(len(points), np.inf)
        for first in range(0, len(points), 4096):
            offset = points[first : first + 4096, None] - start
            share = np.clip(np.einsum("pei,ei->pe", offset, along) / square, 0, 1)
            gap = np.linalg.norm(offset - share[..., None] * along, axis=2)
            nearest[first : first + 4096] = gap.min(axis=1)
        return nearest


def smooth_outline(
    points: NDArray, edges: NDArray, normals: NDArray, patches: tuple[int, int]
) -> SmoothOutline:
    """Create an outline from its edges.

    Args:
        points: (n, 3) [m] positions of the corners of the surface.
        edges: (e, 2) indices of the ends of each edge, counterclockwise around the
            interface.
        normals: (e, 3) unit normal of the interface at each edge.
        patches: patch numbers of the interface and of the adjacent patch.

    Returns:
        The outline. Its wall is a plane or a cone, or consists of facets if neither
        fits.
    """
    ends = points[edges]
    along = ends[:, 1] - ends[:, 0]
    outward = np.cross(along, normals)
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-300)[:, None]
    wall = _wall(points, edges, normals, outward)
    step = 0.01 * np.linalg.norm(along, axis=1)[:, None] * outward
    middle = ends.mean(axis=1)
    rise = wall.signed(middle + step)[0] - wall.signed(middle - step)[0]
    return SmoothOutline(patches, wall, ends, 1.0 if rise.sum() > 0 else -1.0)


def _wall(points: NDArray, edges: NDArray, normals: NDArray, outward: NDArray) -> Shape:
    """Fit a wall through the edges, normal to the interface."""
    size = float(np.linalg.norm(np.ptp(points[edges.ravel()], axis=0)))
    across = size * normals[:, None]
    standing = np.concatenate([points[edges] + across, points[edges] - across])
    corners = standing.reshape(-1, 3)
    for fit, least in ((fit_plane, 1), (fit_cone, _CIRCLE)):
        if len(np.unique(edges)) < least:
            continue
        shape: Shape = fit(corners, outward)
        if np.abs(shape.signed(corners)[0]).max() < _ON_WALL * size:
            return shape
    return _faceted_wall(points[edges], edges, across, outward)


def _faceted_wall(
    ends: NDArray, edges: NDArray, across: NDArray, outward: NDArray
) -> Facets:
    """Create a wall of two triangles for each edge."""
    corners = np.concatenate([ends - across, ends + across], axis=1)
    label = np.arange(4 * len(ends)).reshape(-1, 4)
    begins = {int(start): k for k, start in enumerate(edges[:, 0])}
    for k, end in enumerate(edges[:, 1]):
        after = begins.get(int(end))
        if after is not None and outward[k] @ outward[after] > _CORNER:
            label[after, [0, 2]] = label[k, [1, 3]]
    used, label = np.unique(label, return_inverse=True)
    label = label.reshape(-1, 4)
    triangles = np.concatenate([label[:, [0, 1, 3]], label[:, [0, 3, 2]]])
    return Facets(corners.reshape(-1, 3)[used], triangles)
