"""Assignment of the boundary of a mesh to the patches of a surface."""

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.mesh.cut_along import cut_along
from forcefit.stiffness.mesh.improve import fitted
from forcefit.stiffness.mesh.solid import Solid, boundary_faces, element_quality
from forcefit.stiffness.surface.decimate import euler_characteristic
from forcefit.stiffness.surface.patches import Patches
from forcefit.stiffness.surface.surface import Surface
from forcefit.stiffness.surface.true_surface import TrueSurface


class MeshFailed(BadInput):
    """Error of a mesh generation from a valid surface."""


def fit_to_patches(
    points: NDArray, cells: NDArray, surface: Surface, patches: Patches
) -> Solid:
    """Assign boundary triangles to patches, and move corners onto the exact shapes.

    Args:
        points: (n, 3) [m] positions of the corners.
        cells: (t, 4) corners of the tetrahedra, in either orientation.
        surface: surface of the link.
        patches: patches of the surface.

    Returns:
        The solid. A corner is moved only as far as no tetrahedron becomes inverted.

    Raises:
        MeshFailed: the volumes of mesh and part differ by more than 2 %, the numbers of
            holes differ, or no face is on an interface.
    """
    points, cells = _positive_cells(points, cells)
    faces = boundary_faces(cells)
    patch = _nearest_patch(points, faces, surface, patches)
    walls = {outline.patches: outline.wall for outline in patches.outlines}
    true = TrueSurface(surface, patches)
    solid = Solid(points, cells, faces, patch, patches.shapes, walls, true)
    for outline in patches.outlines:
        solid = cut_along(solid, outline)
    solid = fitted(solid)
    volume = float(solid.volumes().sum())
    if abs(volume / surface.volume - 1) > 0.02:
        raise MeshFailed(
            f"{surface.name}: the volume of the mesh is {volume:.6g} m^3, expected "
            f"{surface.volume:.6g} m^3 inside the surface"
        )
    if (least := float(element_quality(solid).min())) <= 0:
        raise MeshFailed(
            f"{surface.name}: an element is inverted, and its quality is {least:.2g}"
        )
    # a missing hole in a thin wall changes the stiffness but hardly the volume
    holes, expected = (euler_characteristic(f) for f in (faces, surface.triangles))
    if holes != expected:
        raise MeshFailed(
            f"{surface.name}: the mesh has Euler characteristic {holes}, expected "
            f"{expected} as for the surface; holes or other details are missing"
        )
    for number, name in enumerate(("base", "tip")):
        if not (solid.patch == number).any():
            raise MeshFailed(
                f"{surface.name}: found no face of the mesh on the {name} interface"
            )
    return solid


def _positive_cells(points: NDArray, cells: NDArray) -> tuple[NDArray, NDArray]:
    """Remove unused points, and orient all tetrahedra to positive volume."""
    used, cells = np.unique(cells, return_inverse=True)
    points, cells = points[used], cells.reshape(-1, 4)
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    turned = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return points, cells


def _nearest_patch(
    points: NDArray, faces: NDArray, surface: Surface, patches: Patches
) -> NDArray:
    """Find the nearest patch with a similar normal to each boundary face."""
    import pyvista

    mesh = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    outward = surface.normals()
    outward /= np.maximum(np.linalg.norm(outward, axis=1), 1e-300)[:, None]
    center = corners.mean(axis=1)
    size = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    best, patch = np.full(len(faces), np.inf), np.zeros(len(faces), dtype=int)
    for weight in (0.0, 0.4, 0.8):
        for k in range(3 if weight else 1):
            sample = center + weight * (corners[:, k] - center)
            cell, near = mesh.find_closest_cell(sample, return_closest_point=True)
            apart = np.linalg.norm(near - sample, axis=1) / size
            bend = 1 - np.einsum("ij,ij->i", normals, outward[cell])
            score = bend + apart + 0.05 * weight
            better = score < best
            best[better], patch[better] = score[better], patches.patch[cell[better]]
    return patch
