"""Quality measures of tetrahedral meshes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.elements import Elements, integration, triangle_areas
from forcefit.stiffness.mesh.lagrange import EDGES
from forcefit.stiffness.mesh.solid import Solid, element_quality
from forcefit.stiffness.surface.surface import directed_edges

_FLAT = 0.01  # quality below which a tetrahedron is reported as flat


def mesh_report(solid: Solid, mesh: Elements) -> dict[str, Any]:
    """Compute the size and the quality measures of a mesh.

    Args:
        solid: straight tetrahedra.
        mesh: elements of the solid.

    Returns:
        Dictionary with ``nodes`` and ``elements``, their numbers; ``volume`` [m^3] and
        ``area`` [m^2]; ``closed``, True if every boundary edge belongs to two faces;
        ``worst_quality`` and ``mean_quality``; ``smallest_angle`` and ``largest_angle``
        [rad] between two faces of a tetrahedron; ``flat_elements``, the number of
        tetrahedra with a quality below 0.01; and ``drawn_out``, True for an extruded
        mesh of a bar, which has long elements. Quality and angles refer to the straight
        tetrahedra before thin layers are added along singular edges.
    """
    quality, angles = element_quality(solid), dihedral_angles(solid)
    edges = np.sort(directed_edges(solid.faces), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    return {
        "nodes": len(mesh.nodes),
        "elements": len(mesh.cells),
        "volume": sum(float(w.sum()) for *_, w in integration(mesh)),
        "area": float(triangle_areas(mesh, mesh.faces)[1].sum()),
        "closed": bool((count % 2 == 0).all()),
        "worst_quality": float(quality.min()),
        "mean_quality": float(quality.mean()),
        "flat_elements": int((quality < _FLAT).sum()) if solid.surface else 0,
        "drawn_out": solid.surface is None,
        "smallest_angle": float(angles.min()),
        "largest_angle": float(angles.max()),
    }


def volume_error(solid: Solid, mesh: Elements) -> float:
    """Bound the relative difference between the volumes of the mesh and of the part.

    Args:
        solid: straight tetrahedra.
        mesh: elements of the solid.

    Returns:
        [-] bound, or zero if the surface is unknown.
    """
    if solid.surface is None:
        return 0.0
    volume = sum(float(w.sum()) for *_, w in integration(mesh))
    off = abs(volume - solid.surface.volume) + solid.surface.unsure_volume
    return off / solid.surface.volume


def dihedral_angles(solid: Solid) -> NDArray:
    """Compute the angles between faces of tetrahedra.

    Args:
        solid: straight tetrahedra.

    Returns:
        (t, 6) [rad] angles at the edges 01 02 03 12 13 23.
    """
    corners = solid.points[solid.cells]
    angles = []
    for i, j in EDGES:
        k, l = (v for v in range(4) if v not in (i, j))
        along = corners[:, j] - corners[:, i]
        # the two opposite corners, projected onto a plane normal to the edge
        one, other = (np.cross(along, corners[:, v] - corners[:, i]) for v in (k, l))
        across = np.linalg.norm(np.cross(one, other), axis=1)
        angles.append(np.arctan2(across, np.einsum("ij,ij->i", one, other)))
    return np.stack(angles, axis=1)
