"""Exact surface of a part, and distances from it.

The shape of a patch extends beyond a smooth border of the patch. A point on the
boundary of a mesh is therefore compared with the shape of the nearest facet.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.facets import Facets
from forcefit.stiffness.surface.patches import Patches
from forcefit.stiffness.surface.surface import Surface
from forcefit.stiffness.surface.triangle_graph import SHARP, TriangleGraph

_UNSURE = 0.3  # relative uncertainty of the distance from facets to an unknown shape
# quadrature points on a triangle, exact to degree 4 (Dunavant 1985)
_NEAR, _FAR = 0.445948490915965, 0.091576213509771
_PLACES = np.concatenate([np.full((3, 3), a) + (1 - 3 * a) * np.eye(3)
                          for a in (_NEAR, _FAR)])  # fmt: skip
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


class TrueSurface:
    """Facets of a surface and the recognised shapes.

    Attributes:
        volume: [m^3] volume inside the exact surface.
        unsure_volume: [m^3] uncertainty of the volume due to patches of unknown shape.
    """

    def __init__(self, surface: Surface, patches: Patches) -> None:
        self._surface, self._patches = surface, patches
        between = self._volumes_between()
        unknown = np.array([isinstance(s, Facets) for s in patches.shapes])
        self.volume = surface.volume + float(between.sum())
        self.unsure_volume = _UNSURE * float(np.abs(between[unknown]).sum())

    @cached_property
    def tangent(self) -> NDArray:
        """Whether each patch has a border without a sharp edge, (p,) bool."""
        graph, patch = TriangleGraph(self._surface), self._patches.patch
        one, other = patch[graph.left], patch[graph.right]
        smooth = (graph.cosine > SHARP) & (one != other)
        return np.isin(
            np.arange(len(self._patches.shapes)), [one[smooth], other[smooth]]
        )

    @cached_property
    def _mesh(self) -> Any:
        import pyvista

        surface = self._surface
        return pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)

    def outside(self, points: NDArray, normals: NDArray) -> NDArray:
        """Compute the distances of boundary points from the exact surface.

        Args:
            points: (n, 3) [m] points on the boundary of a mesh.
            normals: (n, 3) outward normals of the mesh at these points.

        Returns:
            (n,) [m] distances, negative for points inside the surface.
        """
        cell = np.atleast_1d(self._mesh.find_closest_cell(points))
        patch = self._patches.patch[cell]
        away = np.zeros(len(points))
        for number in np.unique(patch):
            some = patch == number
            distance, slope = self._patches.shapes[number].signed(points[some])
            facing = np.einsum("ni,ni->n", slope, normals[some])
            away[some] = distance * np.sign(facing)
        return away

    def _volumes_between(self) -> NDArray:
        """Compute the volume between facets and shape of each patch, (p,) [m^3]."""
        surface, patches = self._surface, self._patches
        areas = surface.normals()
        volumes = np.zeros(len(patches.shapes))
        for number, shape in enumerate(patches.shapes):
            members = np.flatnonzero(patches.patch == number)
            corners = surface.points[surface.triangles[members]]
            places = np.einsum("qk,mkx->mqx", _PLACES, corners)
            distance, slope = shape.signed(places.reshape(-1, 3))
            slope = slope.reshape(places.shape)
            # The distance along the normal of the facet is the distance from the shape
            # times the component of its gradient along this normal.
            flux = np.einsum("mqx,mx->mq", slope, areas[members])
            gap = -distance.reshape(flux.shape) * flux
            volumes[number] = float((gap @ _WEIGHTS).sum())
        return volumes
