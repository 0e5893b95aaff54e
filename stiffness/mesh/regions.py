"""Regions of different materials, and the faces between them.

Tetrahedra are split along known faces of regions, such as the planes of a box or the
faces between two solids.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.cut_face import (
    ON_FACE,
    CutFace,
    cut,
    face_code,
    faces_inside,
    without_chords,
)
from forcefit.stiffness.mesh.improve import fitted
from forcefit.stiffness.mesh.lagrange import FACES
from forcefit.stiffness.mesh.refine import edge_code
from forcefit.stiffness.mesh.solid import Solid

_POOR = 0.2  # smallest quality of a tetrahedron that can follow a curved face
# A connected part of the mesh is assigned to a region if the region contains more than
# this fraction of its volume.
_AGREED = 0.9


@dataclass(frozen=True, eq=False)
class Region:
    """Region of a link made of one material.

    Attributes:
        where: function of points, (n, 3) [m], that returns True for points in the
            region.
        faces: faces of the region, at which elements are split. Without faces, whole
            elements are assigned to the region.
    """

    where: Callable[[NDArray], NDArray]
    faces: tuple[CutFace, ...] = ()


def region_of_cells(solid: Solid, regions: tuple[Region, ...]) -> NDArray:
    """Find the region of each tetrahedron.

    Args:
        solid: straight tetrahedra.
        regions: regions. In an overlap, the last region is used.

    Returns:
        (t,) number of the region, starting from 1; 0 outside all regions.
    """
    centers = solid.points[solid.cells].mean(axis=1)
    return region_of_places(centers, regions, solid.region)


def region_of_places(
    places: NDArray, regions: tuple[Region, ...], cut_region: NDArray | None
) -> NDArray:
    """Find the region of each point.

    Args:
        places: (n, 3) [m] points.
        regions: regions. In an overlap, the last region is used.
        cut_region: (n,) number of the region of the tetrahedron around each point, for
            regions at whose faces elements were split; None if no elements were split.

    Returns:
        (n,) number of the region, starting from 1; 0 outside all regions.
    """
    label = np.zeros(len(places), dtype=int) if cut_region is None else cut_region
    for number, region in enumerate(regions, 1):
        if cut_region is None or not region.faces:
            inside = region.where(places) & (number > label)
            label = np.where(inside, number, label)
    return label


def cut_by_regions(solid: Solid, regions: tuple[Region, ...]) -> Solid:
    """Split the tetrahedra of a mesh along the faces of regions.

    Args:
        solid: straight tetrahedra.
        regions: regions of the link.

    Returns:
        The split solid, with the region of each tetrahedron.
    """
    if not any(region.faces for region in regions):
        return solid
    for region in regions:
        for face in region.faces:
            solid = cut(solid, face)
    label = np.zeros(len(solid.cells), dtype=int)
    places, piece = _places_inside(solid), _pieces(solid)
    volumes = solid.volumes()
    whole = np.bincount(piece, volumes)
    for number, region in enumerate(regions, 1):
        if region.faces:
            inside = region.where(places)
            share = (np.bincount(piece, volumes * inside) / whole)[piece]
            inside = np.where(share > _AGREED, True, inside)
            label[np.where(share < 1 - _AGREED, False, inside)] = number
    solid = _between_regions(fitted(replace(solid, region=label)))
    return fitted(without_chords(solid), _POOR)


def is_jagged(solid: Solid, regions: tuple[Region, ...]) -> bool:
    """Return whether the border of a region passes through tetrahedra.

    Args:
        solid: straight tetrahedra.
        regions: regions of the link.

    Returns:
        True if a region has no faces, or if tetrahedra could not be split.
    """
    if not regions:
        return False
    if solid.region is None or not all(region.faces for region in regions):
        return True
    _, owners = faces_inside(solid.cells)
    one, other = solid.region[owners].T
    return bool((one != other).sum() > len(solid.inner))


def material_edges(solid: Solid, regions: tuple[Region, ...]) -> NDArray:
    """Find the boundary edges between two regions.

    Args:
        solid: straight tetrahedra.
        regions: regions of the link.

    Returns:
        (e, 2) corners of each edge.
    """
    if not regions:
        return np.zeros((0, 2), dtype=int)
    return edges_between(solid, region_of_cells(solid, regions))


def edges_between(solid: Solid, region: NDArray) -> NDArray:
    """Find the boundary edges between given regions of tetrahedra.

    Args:
        solid: straight tetrahedra.
        region: (t,) number of the region of each tetrahedron.

    Returns:
        (e, 2) corners of each edge.
    """
    count = len(solid.points)
    label = region[_owners(solid)]
    pairs = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    code = edge_code(pairs, count).ravel()
    order = np.argsort(code, kind="stable")
    code, face = code[order][::2], order // 3
    chosen = code[label[face[::2]] != label[face[1::2]]]
    return np.column_stack([chosen // count, chosen % count])


def _owners(solid: Solid) -> NDArray:
    """Return the tetrahedron of each boundary triangle, (f,)."""
    known = face_code(solid.cells[:, FACES], len(solid.points)).ravel()
    order = np.argsort(known)
    wanted = face_code(solid.faces, len(solid.points))
    place = np.searchsorted(known, wanted, sorter=order)
    return np.asarray(order[place] // len(FACES))


def _places_inside(solid: Solid) -> NDArray:
    """Return a point inside each tetrahedron, (t, 3) [m]."""
    on = np.zeros(len(solid.points), dtype=bool)
    on[solid.inner] = True
    off = ~on[solid.cells]
    weight = 0.125 + 0.5 * off / np.maximum(off.sum(axis=1), 1)[:, None]
    weight /= weight.sum(axis=1)[:, None]
    return np.asarray(np.einsum("tc,tcx->tx", weight, solid.points[solid.cells]))


def _pieces(solid: Solid) -> NDArray:
    """Return the number of the connected part that contains each tetrahedron, (t,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces, owners = faces_inside(solid.cells)
    count = len(solid.points)
    cuts = np.isin(face_code(faces, count), face_code(solid.inner, count))
    joined = owners[~cuts].T
    shape = (len(solid.cells),) * 2
    graph = coo_array((np.ones(joined.shape[1]), tuple(joined)), shape)
    return np.asarray(connected_components(graph, directed=False)[1])


def _between_regions(solid: Solid) -> Solid:
    """Remove ``inner`` triangles that are not between two regions."""
    assert solid.region is not None
    faces, owners = faces_inside(solid.cells)
    one, other = solid.region[owners].T
    faces, count = faces[one != other], len(solid.points)
    between, known = face_code(faces, count), face_code(solid.inner, count)
    kept = np.isin(known, between)
    inner, patch = [solid.inner[kept]], [solid.inner_patch[kept]]
    lacking = faces[~np.isin(between, known)]
    # a corner that was moved onto the boundary may also be on the face
    close = ON_FACE * float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    for number in np.unique(solid.inner_patch):
        shape = solid.shapes[number]
        assert shape is not None
        off = np.abs(shape.signed(solid.points[lacking].reshape(-1, 3))[0])
        on = (off.reshape(-1, 3) < close).all(axis=1)
        inner.append(lacking[on])
        patch.append(np.full(int(on.sum()), number))
        lacking = lacking[~on]
    return replace(
        solid, inner=np.concatenate(inner), inner_patch=np.concatenate(patch)
    )
