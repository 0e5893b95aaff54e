"""A surface with fewer triangles for the mesher, whose time depends on their number.

Long thin triangles, which CAD programs make for bars and bores, cost pytetwild much
time, because it cuts its first tetrahedra along all of them.  Corners of the mesh are
later projected onto the part's exact shapes, so the surface for the mesher may be
coarser.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.surface.surface import Surface, directed_edges, signed_volume

_VOLUME = 0.01  # accepted relative difference of the enclosed volumes
# shares of the number of triangles, tried in this order
_PARTS = 0.01 * 1.4 ** np.arange(13)


def coarser_surface(surface: Surface, tolerance: float) -> tuple[NDArray, NDArray]:
    """Return the coarsest surface within a tolerance that a dozen attempts find.

    Args:
        surface: closed surface.
        tolerance: [m] largest distance between both surfaces, evaluated at the corners
            of the given surface, and at the corners, edge middles and centres of the
            coarser one.

    Returns:
        Points (n, 3) [m] and triangles (m, 3) of a closed surface with the same genus
        and a volume within 1 %; those of the given surface if no attempt succeeds.

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
    """Return the [m] distance of the point that is farthest from a mesh."""
    _, near = mesh.find_closest_cell(points, return_closest_point=True)  # type: ignore[attr-defined]
    return float(np.linalg.norm(near - points, axis=1).max())


def _closed(triangles: NDArray) -> bool:
    """Return whether every edge belongs to two triangles."""
    edges = np.sort(directed_edges(triangles), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def euler_characteristic(triangles: NDArray) -> int:
    """Return corners minus edges plus triangles: 2 - 2 genus for each closed shell.

    Args:
        triangles: (m, 3) corners.

    Returns:
        The characteristic, summed over all shells.
    """
    edges = np.sort(directed_edges(triangles), axis=1)
    corners = len(np.unique(triangles))
    return corners - len(np.unique(edges, axis=0)) + len(triangles)
