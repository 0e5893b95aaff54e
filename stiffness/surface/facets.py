"""Smooth surfaces through triangles, for patches of unknown shape.

A point on a facet is projected onto the tangent planes at the three corners. It is then
moved halfway towards the weighted mean of these projections (Boubekeur & Alexa 2008,
Phong tessellation). This displacement is the lift of the point. The lift at the
midpoint of an edge is computed from the normal at each end, and the smaller value is
used. For an arc with the half-angle a, the error is about a^4 times the radius. For
flat facets, it is about a^2 times the radius.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.surface import area_vectors


@dataclass(frozen=True, eq=False)
class Facets:
    """A smooth surface through the corners of triangles.

    Attributes:
        points: (n, 3) [m] corners of the triangles.
        triangles: (m, 3) indices of points, counterclockwise as seen from outside.
        normals: (n, 3) unit normals at the points.
    """

    points: NDArray
    triangles: NDArray
    normals: NDArray = field(init=False)
    _mesh: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        import pyvista

        mesh = pyvista.PolyData.from_regular_faces(self.points, self.triangles)
        object.__setattr__(self, "_mesh", mesh)
        object.__setattr__(self, "normals", self._corner_normals())

    def _corner_normals(self) -> NDArray:
        """Return the means of facet normals at corners, weighted by angle, (n, 3)."""
        facing = area_vectors(self.points, self.triangles)
        facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-300)[:, None]
        corners = self.points[self.triangles]
        total = np.zeros_like(self.points)
        for k in range(3):
            u = corners[:, (k + 1) % 3] - corners[:, k]
            v = corners[:, (k + 2) % 3] - corners[:, k]
            sine = np.linalg.norm(np.cross(u, v), axis=1)
            angle = np.arctan2(sine, np.einsum("ij,ij->i", u, v))
            np.add.at(total, self.triangles[:, k], angle[:, None] * facing)
        return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]

    def edge_lifts(self, edges: NDArray) -> NDArray:
        """Return the distances from edge midpoints to the smooth surface, (e,) [m]."""
        rises = _rises(self.points[edges], self.normals[edges], limited=False)
        return np.asarray(np.linalg.norm(rises, axis=1) / 4)

    def lifts(self) -> NDArray:
        """Return the largest of :meth:`edge_lifts` on each facet, (m,) [m]."""
        sides = [self.edge_lifts(self.triangles[:, [k, k - 1]]) for k in range(3)]
        return np.asarray(np.max(sides, axis=0))

    def distance(self, points: NDArray) -> NDArray:
        """Return the distances of points from the flat facets, (n,) [m]."""
        _, foot = self._mesh.find_closest_cell(points, return_closest_point=True)
        return np.asarray(np.linalg.norm(points - np.atleast_2d(foot), axis=1))

    def signed(self, points: NDArray) -> tuple[NDArray, NDArray]:
        """Return signed distances of points, (n,) [m], and their gradients, (n, 3)."""
        cell, foot = self._mesh.find_closest_cell(points, return_closest_point=True)
        members = self.triangles[np.atleast_1d(cell)]
        foot = np.atleast_2d(foot)
        corners, normals = self.points[members], self.normals[members]
        share = _barycentric(corners, foot)
        lift = np.zeros_like(foot)
        for k in range(3):
            pair = [k, (k + 1) % 3]
            rise = _rises(corners[:, pair], normals[:, pair], limited=True)
            lift += share[:, pair].prod(axis=1, keepdims=True) * rise
        facing = np.einsum("pc,pci->pi", share, normals)
        facing /= np.maximum(np.linalg.norm(facing, axis=1), 1e-300)[:, None]
        return np.einsum("pi,pi->p", points - foot - lift, facing), facing


def _rises(corners: NDArray, normals: NDArray, limited: bool) -> NDArray:
    """Return four times the distances of edge midpoints to the surface, (e, 3) [m]."""
    # The smaller of the lifts computed from the normals at the two ends is used. If
    # their signs differ, as between a flat side and a fillet, the lift is zero.
    along = corners[:, 0] - corners[:, 1]
    heights = np.stack([
        np.einsum("ei,ei->e", sign * along, normals[:, k])
        for k, sign in ((0, 1), (1, -1))
    ])
    if limited:
        same = (heights[0] * heights[1] > 0) * np.sign(heights[0])
        heights = np.tile(same * np.abs(heights).min(axis=0), (2, 1))
    return np.asarray(np.einsum("ke,eki->ei", heights, normals) / 2)


def _barycentric(corners: NDArray, points: NDArray) -> NDArray:
    """Return the barycentric coordinates of points in triangles, (p, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.maximum(np.einsum("pi,pi->p", normal, normal), 1e-300)
    shares = [
        np.einsum(
            "pi,pi->p",
            normal,
            np.cross(
                corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3],
                points - corners[:, (k + 1) % 3],
            ),
        )
        / size
        for k in range(3)
    ]
    return np.stack(shares, axis=1)
