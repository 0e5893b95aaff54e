"""Regions of different materials, and a mesh cut along the planes between them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from stiffness.mesh.lagrange import FACES
from stiffness.mesh.refine import edge_code, edges_of
from stiffness.mesh.solid import Solid, corners_on_shapes
from stiffness.mesh.split_crossing import split_crossing
from stiffness.surface.primitives import Plane

_NEAR = 0.3  # of the shortest edge at a corner: it is moved onto the plane
_REACH = 0.005  # of the part's size: a corner is moved by no more
_LEAST = 0.2  # of a tetrahedron's volume that is left when its corners are moved


@dataclass(frozen=True, eq=False)
class Region:
    """Part of a link of one material.

    Attributes:
        where: which of the points (n, 3) [m] are in it.
        planes: of its faces, along which the mesh is cut; a face of another shape is
            as jagged as the elements.
    """

    where: Callable[[NDArray], NDArray]
    planes: tuple[Plane, ...] = ()


def region_of_cells(solid: Solid, regions: tuple[Region, ...]) -> NDArray:
    """The region of each tetrahedron.

    Args:
        solid: any.
        regions: later ones count more.

    Returns:
        (t,) 1 for the first region, and so on; 0 outside all.
    """
    centers = solid.points[solid.cells].mean(axis=1)
    label = np.zeros(len(centers), dtype=int)
    for number, region in enumerate(regions, 1):
        label[region.where(centers)] = number
    return label


def cut_by_regions(solid: Solid, regions: tuple[Region, ...]) -> Solid:
    """Cut a mesh so that regions' plane faces are faces of tetrahedra.

    Args:
        solid: any.
        regions: of the link.

    Returns:
        The solid, whose ``kept`` planes its corners stay on.
    """
    for region in regions:
        for plane in region.planes:
            solid = _cut(solid, plane)
    return solid


def material_edges(solid: Solid, regions: tuple[Region, ...]) -> NDArray:
    """Edges of the boundary between two regions, at which stresses are singular.

    Args:
        solid: any.
        regions: of the link.

    Returns:
        (e, 2) corners.
    """
    if not regions:
        return np.zeros((0, 2), dtype=int)
    count = len(solid.points)
    label = region_of_cells(solid, regions)[_owners(solid)]
    pairs = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]], axis=2)
    code = edge_code(pairs, count).ravel()
    order = np.argsort(code, kind="stable")
    code, face = code[order][::2], order // 3
    chosen = code[label[face[::2]] != label[face[1::2]]]
    return np.column_stack([chosen // count, chosen % count])


def _owners(solid: Solid) -> NDArray:
    """(f,) the tetrahedron of each boundary triangle."""
    total = np.int64(len(solid.points))

    def code(corners: NDArray) -> NDArray:
        a, b, c = np.moveaxis(np.sort(corners, axis=-1), -1, 0)
        return np.asarray((a * total + b) * total + c)

    known = code(solid.cells[:, FACES]).ravel()
    order = np.argsort(known)
    place = np.searchsorted(known, code(solid.faces), sorter=order)
    return np.asarray(order[place] // len(FACES))


def _cut(solid: Solid, plane: Plane) -> Solid:
    """Cut a mesh along a plane, through all of it: regions' edges are cut as well."""
    size = float(np.linalg.norm(np.ptp(solid.points, axis=0)))
    solid, on = _onto(replace(solid, kept=(*solid.kept, plane)), plane, size)

    def crossing(finer: Solid, on: NDArray, ends: NDArray) -> tuple[NDArray, NDArray]:
        low, high = np.where(on, 0.0, plane.signed(finer.points)[0])[ends].T
        across = low * high < 0
        share = np.divide(low, low - high, out=np.zeros_like(low), where=across)
        return across, share

    return split_crossing(solid, on, crossing)[0]


def _onto(solid: Solid, plane: Plane, size: float) -> tuple[Solid, NDArray]:
    """Corners near a plane moved onto it, and which lie on it."""
    ends, _ = edges_of(solid.cells, len(solid.points))
    start, end = solid.points[ends].swapaxes(0, 1)
    length = np.linalg.norm(end - start, axis=1)
    reach = np.full(len(solid.points), _REACH * size)
    for k in (0, 1):
        np.minimum.at(reach, ends[:, k], _NEAR * length)
    height = plane.signed(solid.points)[0]
    near = np.abs(height) < reach
    target = solid.points - np.where(near, height, 0.0)[:, None] * plane.normal
    # those of the boundary stay on their shapes: another place on the plane, or none
    target = np.where(
        near[:, None], corners_on_shapes(replace(solid, points=target)), solid.points
    )
    on = near & (np.abs(plane.signed(target)[0]) < 1e-12 * size)
    already, before = np.abs(height) < 1e-12 * size, solid.volumes()
    while True:
        points = np.where(on[:, None], target, solid.points)
        moved = replace(solid, points=points)
        bad = np.unique(solid.cells[moved.volumes() < _LEAST * before])
        if not (on[bad] & ~already[bad]).any():
            return moved, on
        on[bad] &= already[bad]
