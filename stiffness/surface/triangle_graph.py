"""Graph of neighbouring surface triangles, with smooth and flat parts."""

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.facets import Facets
from forcefit.stiffness.surface.primitives import Shape
from forcefit.stiffness.surface.surface import Surface, directed_edges

# cosine of 35 degrees; edges with a larger angle separate two patches
SHARP = np.cos(np.radians(35.0))
# relative to the part's size: largest distance of a point on a shape; STL rounds to
# 1e-7
_ON_SHAPE = 2e-6
# largest number of seeds on a surface; remaining triangles stay flat facets
_TRIES = 500


class TriangleGraph:
    """Triangles, their neighbours and the angles between them."""

    def __init__(self, surface: Surface) -> None:
        self.points, self.triangles = surface.points, surface.triangles
        normals = surface.normals()
        self.areas = np.linalg.norm(normals, axis=1)
        self.normals = normals / np.maximum(self.areas, 1e-300)[:, None]
        self.tolerance = _ON_SHAPE * surface.diagonal
        self.tries = _TRIES
        edges = np.sort(directed_edges(self.triangles), axis=1)
        owner = np.repeat(np.arange(len(self.triangles)), 3)
        order = np.lexsort(edges.T)
        self.left, self.right = owner[order[::2]], owner[order[1::2]]
        self.ends = edges[order[::2]]
        self.cosine = np.einsum(
            "ij,ij->i", self.normals[self.left], self.normals[self.right]
        )

    def connected_parts(self, members: NDArray, bend: float) -> NDArray:
        """Number connected parts, bordered by edges with a cosine <= ``bend``."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        keep = members[self.left] & members[self.right] & (self.cosine > bend)
        size = len(self.triangles)
        graph = coo_array(
            (np.ones(keep.sum()), (self.left[keep], self.right[keep])), (size, size)
        )
        return connected_components(graph, directed=False)[1]

    def smooth_parts(self, members: NDArray) -> list[NDArray]:
        """Return the triangle indices of each part between sharp edges."""
        label = self.connected_parts(members, SHARP)
        return [
            np.flatnonzero(members & (label == k)) for k in np.unique(label[members])
        ]

    def directed(self, edges: NDArray, owner: NDArray) -> NDArray:
        """Return the (e, 2) ends of edges in the direction of the owner triangle."""
        ends = self.ends[edges]
        first = (self.triangles[owner] == ends[:, :1]).argmax(axis=1)
        follows = self.triangles[owner, (first + 1) % 3] == ends[:, 1]
        return np.where(follows[:, None], ends, ends[:, ::-1])

    def flat_faces(self, part: NDArray) -> NDArray:
        """Return the flat-face number of each triangle, valid only in the part."""
        inside = np.zeros(len(self.triangles), dtype=bool)
        inside[part] = True
        return self.connected_parts(inside, 1 - 1e-10)

    def lifted(self, part: NDArray) -> Facets:
        """Return a part of unknown shape as lifted facets."""
        used, index = np.unique(self.triangles[part], return_inverse=True)
        return Facets(self.points[used], index.reshape(-1, 3))

    def fits(self, shape: Shape, part: NDArray) -> NDArray:
        """Find the triangles of a part that lie on a shape, by corners and normals."""
        corners = self.points[self.triangles[part]].reshape(-1, 3)
        distances = np.abs(shape.signed(corners)[0]).reshape(-1, 3).max(axis=1)
        centers = corners.reshape(-1, 3, 3).mean(axis=1)
        along = np.einsum("ij,ij->i", shape.signed(centers)[1], self.normals[part])
        return (distances < self.tolerance) & (np.abs(along) > SHARP)
