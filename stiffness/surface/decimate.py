"""Reduction of the number of triangles of a surface.

The surfaces of bars and bores from CAD programs consist of long thin triangles, for
which the mesher is slow. Because mesh corners are moved onto the exact shapes after
meshing, a coarser surface is sufficient for the mesher.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.surface import Surface, directed_edges, signed_volume

_VOLUME = 0.01  # largest accepted relative difference between the enclosed volumes
# tested ratios of the number of triangles to the original number
_PARTS = 0.01 * 1.4 ** np.arange(13)


def coarser_surface(surface: Surface, tolerance: float) -> tuple[NDArray, NDArray]:
    """Reduce the number of triangles of a surface within a tolerance.

    Args:
        surface: closed surface.
        tolerance: [m] largest accepted distance between the two surfaces.

    Returns:
        Points, (n, 3) [m], and triangles, (m, 3), of a closed surface with the same
        number of holes, and with the same volume to 1 %. If there is no such surface,
        the result is the given surface.

    Sources:
        Garland & Heckbert (1997) for the decimation, as implemented in VTK.
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
    """Return the largest distance of points from a mesh [m]."""
    _, near = mesh.find_closest_cell(points, return_closest_point=True)  # type: ignore[attr-defined]
    return float(np.linalg.norm(near - points, axis=1).max())


def _closed(triangles: NDArray) -> bool:
    """Return whether every edge belongs to two triangles."""
    edges = np.sort(directed_edges(triangles), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def euler_characteristic(triangles: NDArray) -> int:
    """Return the number of vertices minus edges plus triangles.

    Args:
        triangles: (m, 3) corners of the triangles.

    Returns:
        The Euler characteristic, which is 2 - 2 g for a closed surface with g holes.
    """
    edges = np.sort(directed_edges(triangles), axis=1)
    corners = len(np.unique(triangles))
    return corners - len(np.unique(edges, axis=0)) + len(triangles)
