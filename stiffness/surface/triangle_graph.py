"""Graph of neighbouring triangles of a surface."""

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.facets import Facets
from forcefit.stiffness.surface.primitives import Shape
from forcefit.stiffness.surface.surface import Surface, directed_edges

# cosine of the angle above which an edge is sharp
SHARP = np.cos(np.radians(35.0))
# largest distance of a point on a shape, relative to the size of the part; coordinates
# in STL files are rounded to 1e-7
_ON_SHAPE = 2e-6
# maximum number of facets around which shapes are fitted
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
        """Number the parts that are separated by edges with cos(angle) <= ``bend``."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        keep = members[self.left] & members[self.right] & (self.cosine > bend)
        size = len(self.triangles)
        graph = coo_array(
            (np.ones(keep.sum()), (self.left[keep], self.right[keep])), (size, size)
        )
        return connected_components(graph, directed=False)[1]

    def smooth_parts(self, members: NDArray) -> list[NDArray]:
        """Return the triangles of each part between sharp edges."""
        label = self.connected_parts(members, SHARP)
        return [
            np.flatnonzero(members & (label == k)) for k in np.unique(label[members])
        ]

    def directed(self, edges: NDArray, owner: NDArray) -> NDArray:
        """Return the ends of edges in the direction of the given triangles, (e, 2)."""
        ends = self.ends[edges]
        first = (self.triangles[owner] == ends[:, :1]).argmax(axis=1)
        follows = self.triangles[owner, (first + 1) % 3] == ends[:, 1]
        return np.where(follows[:, None], ends, ends[:, ::-1])

    def flat_faces(self, part: NDArray) -> NDArray:
        """Return the number of the flat face of each triangle in a part."""
        inside = np.zeros(len(self.triangles), dtype=bool)
        inside[part] = True
        return self.connected_parts(inside, 1 - 1e-10)

    def lifted(self, part: NDArray) -> Facets:
        """Return the smooth surface through the triangles of a part."""
        used, index = np.unique(self.triangles[part], return_inverse=True)
        return Facets(self.points[used], index.reshape(-1, 3))

    def fits(self, shape: Shape, part: NDArray) -> NDArray:
        """Find the triangles of a part whose corners and normals agree with a shape."""
        corners = self.points[self.triangles[part]].reshape(-1, 3)
        distances = np.abs(shape.signed(corners)[0]).reshape(-1, 3).max(axis=1)
        centers = corners.reshape(-1, 3, 3).mean(axis=1)
        along = np.einsum("ij,ij->i", shape.signed(centers)[1], self.normals[part])
        return (distances < self.tolerance) & (np.abs(along) > SHARP)
