"""Splitting of a mesh along the smooth outline of an interface.

The mesher follows only the sharp edges of a surface. Where an interface continues into
a fillet, mesh triangles cross the outline of the interface. To obtain the exact area of
the interface, corners near the outline are moved onto the outline, and edges that still
cross the outline are split.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.refine import edge_code
from forcefit.stiffness.mesh.solid import Solid
from forcefit.stiffness.mesh.split_crossing import split_crossing
from forcefit.stiffness.surface.smooth_outline import SmoothOutline

# largest distance from the outline at which a corner is moved onto the outline,
# relative to the shortest edge at the corner
_NEAR = 0.3
_REACH = 0.005  # largest displacement of a corner, relative to the size of the part


def cut_along(solid: Solid, outline: SmoothOutline) -> Solid:
    """Split a mesh so that no boundary triangle crosses the outline of an interface.

    Args:
        solid: straight tetrahedra.
        outline: outline of an interface.

    Returns:
        The split solid. Each triangle near the outline is assigned to the patch on its
        side of the outline.
    """

    def crossing(finer: Solid, on: NDArray, ends: NDArray) -> tuple[NDArray, NDArray]:
        return _crossing_edges(finer, outline, on, ends)

    solid, on = split_crossing(solid, _corners_on(solid, outline), crossing)
    return replace(solid, patch=_sides(solid, outline, on))


def _members(solid: Solid, outline: SmoothOutline) -> NDArray:
    """Return which boundary triangles are on a patch next to the outline, (f,)."""
    return np.isin(solid.patch, outline.patches)


def _boundary_edges(solid: Solid, outline: SmoothOutline) -> NDArray:
    """Return the edges of the triangles on both patches, (k, 2)."""
    faces = solid.faces[_members(solid, outline)]
    pairs = np.sort(faces[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    return np.unique(pairs, axis=0)


def _corners_on(solid: Solid, outline: SmoothOutline) -> NDArray:
    """Return whether each corner is on the outline, (n,)."""
    pairs = _boundary_edges(solid, outline)
    length = np.linalg.norm(
        solid.points[pairs[:, 0]] - solid.points[pairs[:, 1]], axis=1
    )
    shortest = np.full(len(solid.points), np.inf)
    for k in (0, 1):
        np.minimum.at(shortest, pairs[:, k], length)
    corners = np.unique(pairs)
    points = solid.points[corners]
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    reach = np.minimum(_NEAR * shortest[corners], _REACH * size)
    near = np.abs(outline.outside(points)) < reach
    near &= outline.distance(points) < shortest[corners]
    on = np.zeros(len(solid.points), dtype=bool)
    on[corners[near]] = True
    return on


def _crossing_edges(
    solid: Solid, outline: SmoothOutline, on: NDArray, ends: NDArray
) -> tuple[NDArray, NDArray]:
    """Return which edges cross the outline, and at which fraction, both (e,)."""
    pairs = _boundary_edges(solid, outline)
    index = np.searchsorted(edge_code(ends, len(on)), edge_code(pairs, len(on)))
    start, end = solid.points[pairs].swapaxes(0, 1)
    low, high = outline.outside(start), outline.outside(end)
    across = (low * high < 0) & ~on[pairs].any(axis=1)
    share = np.zeros(len(ends))
    part = np.divide(low, low - high, out=np.zeros_like(low), where=across)
    place = start + part[:, None] * (end - start)
    length = np.linalg.norm(end - start, axis=1)
    across[across] = outline.distance(place[across]) < _NEAR * length[across]
    crossing = np.zeros(len(ends), dtype=bool)
    crossing[index[across]] = True
    share[index] = part
    return crossing, share


def _sides(solid: Solid, outline: SmoothOutline, on: NDArray) -> NDArray:
    """Assign the triangles near the outline to the patch on their side."""
    patch = solid.patch.copy()
    near = np.flatnonzero(_members(solid, outline) & on[solid.faces].any(axis=1))
    corners = solid.points[solid.faces[near]]
    away = outline.outside(corners.reshape(-1, 3)).reshape(-1, 3)
    # corners on the outline are on neither side of the outline
    mean = np.where(on[solid.faces[near]], 0.0, away).sum(axis=1)
    mean = np.where(on[solid.faces[near]].all(axis=1), away.sum(axis=1), mean)
    patch[near] = np.where(mean > 0, outline.patches[1], outline.patches[0])
    return patch
