"""Improvement of flat tetrahedra.

When corners are moved onto the shapes of a part, tetrahedra may become flat. If all
corners of a flat tetrahedron are on the boundary, one of its inner edges is split. Each
corner is then moved to the position that maximises the quality of the worst adjacent
tetrahedron. Corners on the boundary stay on their shapes.

Source: Freitag & Ollivier-Gooch (1997) for the optimisation of the worst element.
"""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.lagrange import EDGES
from forcefit.stiffness.mesh.refine import edge_code, edges_of, split_edges
from forcefit.stiffness.mesh.solid import (
    Solid,
    corner_groups,
    corners_on_shapes,
    element_quality,
    meeting_shapes,
    moved_onto_shapes,
    tetrahedra_quality,
)
from forcefit.stiffness.mesh.split_crossing import one_of_each
from forcefit.stiffness.surface.primitives import project

# quality below which a tetrahedron is improved
POOR = 0.08
_ROUNDS = 4
# maximum number of steps in the search for the best position of a corner
_STEPS = 10
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


def fitted(solid: Solid, limit: float | None = None) -> Solid:
    """Move corners onto their shapes, and improve flat tetrahedra.

    Args:
        solid: straight tetrahedra.
        limit: [-] quality below which tetrahedra are improved. The default is
            :data:`POOR`, or less if the solid has worse tetrahedra.

    Returns:
        The improved solid. If the improvement fails, it is the result of
        :func:`moved_onto_shapes`, where some corners are not on their shapes.
    """
    least = float(element_quality(solid).min())
    # elements of an extruded bar are long, and their quality is low
    good = solid.surface is None or least > POOR / 4
    poor = limit or (min(POOR, least / 2) if good else POOR)
    target = corners_on_shapes(solid)
    if np.allclose(target, solid.points, rtol=0, atol=1e-12 * np.abs(target).max()):
        moved = solid
    else:
        moved = replace(solid, points=target)
    for _ in range(_ROUNDS):
        if (element_quality(moved) > poor).all():
            return moved
        moved = _relaxed(_split_inside(moved, poor), poor)
    safe = moved_onto_shapes(solid)
    quality, other = element_quality(moved), element_quality(safe)
    better = (quality < poor).sum() <= (other < poor).sum()
    proper = quality.min() > min(poor / 1e3, other.min())
    return moved if better and proper else safe


def _split_inside(solid: Solid, limit: float) -> Solid:
    """Split an inner edge of each flat tetrahedron with all corners on the boundary."""
    boundary = np.zeros(len(solid.points), dtype=bool)
    boundary[solid.faces] = True
    ends, of_cell = edges_of(solid.cells, len(solid.points))
    code = edge_code(ends, len(boundary))
    outer = np.sort(solid.faces[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    inner = ~np.isin(code, edge_code(outer, len(boundary)))
    poor = (element_quality(solid) < limit) & boundary[solid.cells].all(axis=1)
    if not (poor & inner[of_cell].any(axis=1)).any():
        return solid
    length = np.linalg.norm(np.diff(solid.points[ends], axis=1)[:, 0], axis=1)
    longest = np.where(inner, length, 0.0)[of_cell].argmax(axis=1)
    wanted = np.zeros(len(ends), dtype=bool)
    wanted[of_cell[poor, longest[poor]]] = True
    wanted &= inner
    split = one_of_each(wanted, of_cell)
    return split_edges(solid, ends, of_cell, split)[0]


def _relaxed(solid: Solid, limit: float) -> Solid:
    """Move the corners of flat tetrahedra."""
    points = solid.points.copy()
    shapes_of: dict[int, tuple[int, ...]] = {}
    for key, group in corner_groups(solid):
        shapes_of |= dict.fromkeys(group.tolist(), key)
    corners = np.unique(solid.cells[element_quality(solid) < limit])
    for corner in sorted(corners.tolist(), key=lambda c: c in shapes_of):
        star = solid.cells[(solid.cells == corner).any(axis=1)]
        key = shapes_of.get(corner, ())
        points[corner] = _best_place(solid, points, star, corner, key)
    return replace(solid, points=points)


def _best_place(
    solid: Solid, points: NDArray, star: NDArray, corner: int, key: tuple[int, ...]
) -> NDArray:
    """Return the position of a corner that maximises the worst quality, (3,) [m]."""
    place = points[corner]
    around = points[star]
    mine = star == corner
    best = float(tetrahedra_quality(around).min())
    i, j = EDGES.T
    step = 0.3 * float(np.linalg.norm(around[:, i] - around[:, j], axis=2).mean())
    known = meeting_shapes(solid, key, place[None])
    fixed = any(solid.shapes[p] is None for p in key) or len(known) > 2
    for _ in range(0 if fixed else _STEPS):
        tries = place + step * _DIRECTIONS
        if known:
            near = project(tries, known)
            tries = near[np.linalg.norm(near - tries, axis=1) <= step]
        if len(tries) == 0:
            step /= 2
            continue
        moved = np.broadcast_to(around, (len(tries), *around.shape)).copy()
        moved[:, mine] = tries[:, None]
        worst = tetrahedra_quality(moved.reshape(-1, 4, 3)).reshape(len(tries), -1)
        least = worst.min(axis=1)
        if least.max() > best:
            best, place = float(least.max()), tries[int(least.argmax())]
        else:
            step /= 2
    return place
