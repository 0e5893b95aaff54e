"""Reduction of the number of surface triangles, to save meshing time.

CAD programs create long thin triangles for bars and bores. These slow pytetwild down,
because it cuts its first tetrahedra along all triangles. Mesh corners are later
projected onto the exact shapes of the part, so the mesher may read a coarser surface.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.surface import Surface, directed_edges, signed_volume

_VOLUME = 0.01  # accepted relative difference of the enclosed volumes
# trial numbers of triangles relative to the original number, in this order
_PARTS = 0.01 * 1.4 ** np.arange(13)


def coarser_surface(surface: Surface, tolerance: float) -> tuple[NDArray, NDArray]:
    """Coarsen a surface within a tolerance; return the best of a dozen attempts.

    Args:
        surface: closed surface.
        tolerance: [m] largest distance between both surfaces, evaluated at the corners
            of the given surface and at the corners, edge midpoints and centres of the
            coarser surface.

    Returns:
        Points (n, 3) [m] and triangles (m, 3) of a closed surface with the same genus,
        and the same volume within 1 %. If no attempt succeeds, the given surface.

    Sources:
        Garland & Heckbert (1997) for the quadric decimation, as implemented in VTK.
    """
    import pyvista

    original = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    characteristic = euler_characteristic(surface.triangles)
    for part in _PARTS:
        fewer = original.decimate(1 - part)
        if fewer.n_cells < 4:
            continue
        points = np.array(fewer.points, dtype=float)
        triangles = np.array(fewer.regular_faces, dtype=int)
        if not _closed(triangles) or (
            euler_characteristic(triangles) != characteristic
        ):
            continue
        volume = signed_volume(points, triangles)
        if abs(volume / surface.volume - 1) > _VOLUME:
            continue
        a, b, c = np.moveaxis(points[triangles], 1, 0)
        samples = [points, (a + b) / 2, (b + c) / 2, (c + a) / 2, (a + b + c) / 3]
        if (
            _distance(fewer, surface.points) <= tolerance
            and _distance(original, np.concatenate(samples)) <= tolerance
        ):
            return points, triangles
    return surface.points, surface.triangles


def _distance(mesh: object, points: NDArray) -> float:
    """Return the distance [m] of the farthest point from a mesh."""
    _, near = mesh.find_closest_cell(points, return_closest_point=True)  # type: ignore[attr-defined]
    return float(np.linalg.norm(near - points, axis=1).max())


def _closed(triangles: NDArray) -> bool:
    """Check whether every edge belongs to two triangles."""
    edges = np.sort(directed_edges(triangles), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def euler_characteristic(triangles: NDArray) -> int:
    """Return vertices minus edges plus triangles: 2 - 2 genus for each closed shell.

    Args:
        triangles: (m, 3) corners.

    Returns:
        The Euler characteristic, summed over all shells.
    """
    edges = np.sort(directed_edges(triangles), axis=1)
    corners = len(np.unique(triangles))
    return corners - len(np.unique(edges, axis=0)) + len(triangles)
