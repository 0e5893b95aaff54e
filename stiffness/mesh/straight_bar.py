"""Tetrahedral meshes of straight bars by extrusion of their sections.

A triangulated section is extruded along z in layers. Layers are thin at the clamped
ends and thicker in between, where the displacements agree with beam theory. In each
layer, the prism over a triangle is divided into three tetrahedra. The diagonal of each
side starts at the corner with the smallest number, so that neighbours have the same
diagonal (Dompierre et al. 1999). Each wall has one element across its thickness.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.solid import Solid, boundary_faces
from forcefit.stiffness.surface.primitives import Cone, Plane, Shape

_AROUND = 8  # smallest number of elements around a circle
# largest distance between an arc and its chord, relative to the length of the bar
_OFF = 0.008
# largest ratio of the squared angle of an element [rad^2] to wall / radius, so that
# chords stay in the wall
_IN_WALL = 1.0
_FLAT = 4.0  # largest aspect ratio of an element in the section
_GROWTH = 2.0  # ratio of the thicknesses of consecutive layers
_LONGEST = 2.0  # thickness of the thickest layer, relative to the width of the section
_UP = np.array([0.0, 0.0, 1.0])


def straight_bar(section: Mapping[str, float], longest: float = _LONGEST) -> Solid:
    """Mesh a bar of unit length along z.

    Args:
        section: dimensions of the section divided by the length of the bar, with the
            names of :func:`forcefit.stiffness.beam.sections.declared_section`.
        longest: thickness of the thickest layer, relative to the width of the section.

    Returns:
        First mesh. Patch 0 is at z = 0, and patch 1 is at z = 1. The section's y and z
        axes are along x and y.
    """
    flat, triangles = _round(section) if "radius" in section else _angular(section)
    heights = _heights(_thinnest(section), longest * float(np.ptp(flat[:, 0])))
    points = np.concatenate([np.insert(flat, 2, z, axis=1) for z in heights])
    a, b, c = np.sort(triangles, axis=1).T
    up = len(flat)
    prism = np.concatenate([
        np.column_stack(corners)
        for corners in ((a, b, c, c + up), (a, b, b + up, c + up),
                        (a, a + up, b + up, c + up))
    ])  # fmt: skip
    layers = up * np.arange(len(heights) - 1)
    cells = (layers[:, None, None] + prism).reshape(-1, 4)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    turned = np.linalg.det(edges) < 0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    faces = boundary_faces(cells)
    side, shapes = _sides(section, points[faces])
    middle = points[faces, 2].mean(axis=1)
    patch = np.select([middle < 1e-9, middle > 1.0 - 1e-9], [0, 1], 2 + side)
    ends = (Plane(0.0 * _UP, _UP), Plane(_UP, _UP))
    return Solid(points, cells, faces, patch, (*ends, *shapes))


def _thinnest(section: Mapping[str, float]) -> float:
    """Return the smallest wall thickness of a section."""
    if "radius" in section:
        return section["radius"] - section.get("inner_radius", 0.0)
    return min(section.values())


def _heights(first: float, longest: float) -> NDArray:
    """Return the heights of the borders between layers, from 0 to 1."""
    steps = [min(first, 0.25)]
    while sum(steps) < 0.5:
        steps.append(min(_GROWTH * steps[-1], longest))
    half = np.cumsum([0.0, *steps]) / (2 * sum(steps))
    return np.concatenate([half, 1.0 - half[-2::-1]])


def _round(section: Mapping[str, float]) -> tuple[NDArray, NDArray]:
    """Triangulate a disc or a ring."""
    radius, inner = section["radius"], section.get("inner_radius", 0.0)
    angle = min(
        2 * np.pi / _AROUND, math.sqrt(_IN_WALL * (radius - inner) / radius),
        math.sqrt(8 * _OFF / radius),
    )  # fmt: skip
    count = math.ceil(2 * np.pi / angle)
    radii = [inner, radius] if inner else [0.5 * radius, radius]
    angles = 2 * np.pi * np.arange(count) / count
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    points = [r * circle for r in radii]
    i, j = np.arange(count), (np.arange(count) + 1) % count
    triangles = [(i, j, i + count), (j, i + count, j + count)]
    if not inner:
        points.append(np.zeros((1, 2)))
        triangles.append((i, j, np.full(count, 2 * count)))
    corners = np.concatenate([np.column_stack(three) for three in triangles])
    return np.concatenate(points), corners


def _angular(section: Mapping[str, float]) -> tuple[NDArray, NDArray]:
    """Triangulate a rectangle, a rectangular tube or an I-section."""
    width, height = section["width"], section["height"]
    x_cuts, y_cuts = [width / 2], [height / 2]
    if "wall" in section:
        x_cuts.append(width / 2 - section["wall"])
        y_cuts.append(height / 2 - section["wall"])
    if "web" in section:
        x_cuts.append(section["web"] / 2)
        y_cuts.append(height / 2 - section["flange"])
    longest = _FLAT * _thinnest(section)
    x, y = (_divided(np.sort([*cuts, *(-c for c in cuts)]), longest)
            for cuts in (x_cuts, y_cuts))  # fmt: skip
    X, Y = ((v[1:] + v[:-1]) / 2 for v in (x, y))
    far_x, far_y = np.abs(X)[:, None] > x_cuts[-1], np.abs(Y) > y_cuts[-1]
    solid = np.ones((len(X), len(Y)), dtype=bool)
    if "wall" in section:
        solid = far_x | far_y
    if "web" in section:
        solid = ~far_x | far_y
    number = np.arange(len(x) * len(y)).reshape(len(x), len(y))
    a, b = number[:-1, :-1][solid], number[1:, :-1][solid]
    c, d = number[:-1, 1:][solid], number[1:, 1:][solid]
    corners = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, c, d])])
    used, corners = np.unique(corners, return_inverse=True)
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid[used], corners.reshape(-1, 3)


def _divided(cuts: NDArray, longest: float) -> NDArray:
    """Divide intervals until none is longer than ``longest``."""
    parts = [
        np.linspace(low, high, math.ceil((high - low) / longest - 1e-9) + 1)[:-1]
        for low, high in zip(cuts, cuts[1:], strict=False)
    ]
    return np.append(np.concatenate(parts), cuts[-1])


def _sides(
    section: Mapping[str, float], corners: NDArray
) -> tuple[NDArray, tuple[Shape | None, ...]]:
    """Return the side of each boundary face, (f,), and the shapes of the sides."""
    if "radius" in section:
        radii = [r for r in (section["radius"], section.get("inner_radius")) if r]
        off = np.linalg.norm(corners[:, 0, :2], axis=1)[:, None] - radii
        return np.abs(off).argmin(axis=1), tuple(Cone(0 * _UP, _UP, r) for r in radii)
    # sides normal to x and sides normal to y are planes
    return np.ptp(corners[:, :, :2], axis=1).argmin(axis=1), (None, None)
