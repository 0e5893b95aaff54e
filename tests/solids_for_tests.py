"""Surfaces and tetrahedral meshes of simple shapes."""

from dataclasses import replace

import numpy as np
from scipy.spatial import Delaunay

from forcefit.stiffness.fem.elements import lame
from forcefit.stiffness.mesh.solid import Solid, boundary_faces
from forcefit.stiffness.surface.filled_solids import FilledSolids
from forcefit.stiffness.surface.primitives import Cone, Plane
from forcefit.stiffness.surface.surface import check_surface

Z = np.array([0.0, 0.0, 1.0])


def constants(mesh, young=60e9, poisson=0.3):
    """Return the Lame constants of each element of a uniform mesh, (t,) [Pa]."""
    return tuple(np.full(len(mesh.cells), one) for one in lame(young, poisson))


def cylinder(radius=0.02, length=0.1, facets=32, tip_radius=None):
    """Return points and triangles of a closed faceted cylinder or cone along z."""
    angle = 2 * np.pi * np.arange(facets) / facets
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    tip_radius = radius if tip_radius is None else tip_radius
    top = tip_radius * ring + [0, 0, length]
    points = np.concatenate([radius * ring, top, [[0, 0, 0], [0, 0, length]]])
    i, j = np.arange(facets), (np.arange(facets) + 1) % facets
    low, high = np.full(facets, 2 * facets), np.full(facets, 2 * facets + 1)
    triangles = np.concatenate([
        np.column_stack([i, j, j + facets]),
        np.column_stack([i, j + facets, i + facets]),
        np.column_stack([low, j, i]),
        np.column_stack([high, i + facets, j + facets]),
    ])
    return points, triangles


def shouldered_shaft(
    large, small, fillet, around, rows, step=(0.05, 0.12), apart=0.004
):
    """Return points and triangles of a shaft along z with a shoulder and a fillet.

    Consecutive rings of points have a distance of about ``apart`` [m] and are rotated
    by half a facet.
    """
    shoulder, end = step
    turn = np.linspace(0, np.pi / 2, rows + 1)
    arc = np.column_stack([small + fillet - fillet * np.sin(turn),
                           shoulder + fillet - fillet * np.cos(turn)])  # fmt: skip
    outline = np.array([[large, 0], [large, shoulder], *arc, [small, end]])
    rings = [outline[:1]]
    for a, b in zip(outline, outline[1:], strict=False):
        count = max(1, round(float(np.linalg.norm(b - a)) / apart))
        rings.append(a + np.linspace(0, 1, count + 1)[1:, None] * (b - a))
    profile = np.concatenate(rings)
    number = np.arange(around)
    angle = 2 * np.pi / around * (number + 0.5 * (np.arange(len(profile))[:, None] % 2))
    height = np.broadcast_to(profile[:, 1:], angle.shape)
    points = np.stack([profile[:, :1] * np.cos(angle), profile[:, :1] * np.sin(angle),
                       height], axis=-1).reshape(-1, 3)  # fmt: skip
    points = np.concatenate([points, [[0, 0, 0], [0, 0, end]]])
    following, triangles = (number + 1) % around, []
    for k in range(len(profile) - 1):
        a, b = k * around + number, k * around + following
        c, d = a + around, b + around
        pair = ((a, b, c), (b, d, c)) if k % 2 == 0 else ((a, b, d), (a, d, c))
        triangles += [np.column_stack(corners) for corners in pair]
    for tip, ring in ((False, number), (True, number + (len(profile) - 1) * around)):
        center = np.full(around, len(points) - 2 + tip)
        other = ring - number + following
        sides = (center, ring, other) if tip else (center, other, ring)
        triangles.append(np.column_stack(sides))
    return points, np.concatenate(triangles)


def box_cells(counts):
    """Divide a unit cube into boxes of six tetrahedra each (Kuhn triangulation)."""
    sizes = np.array(counts) + 1
    grid = np.stack(np.meshgrid(*map(np.arange, sizes), indexing="ij"), axis=-1)
    corner = np.arange(np.prod(sizes)).reshape(sizes)[:-1, :-1, :-1].ravel()
    step = np.array([sizes[1] * sizes[2], sizes[2], 1])
    cells = []
    for order in ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]):
        path = np.cumsum(step[order])
        cells.append(np.column_stack([corner, *(corner + p for p in path)]))
    return grid.reshape(-1, 3) / np.array(counts), np.concatenate(cells)


def outward(points, cells):
    """Reorder the nodes of tetrahedra so that all volumes are positive."""
    a, b, c, d = np.moveaxis(points[cells], 1, 0)
    turned = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) < 0
    cells = cells.copy()
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    return cells


def box_solid(counts, size):
    """Return the mesh of a box; its sides have no known shape."""
    unit, cells = box_cells(counts)
    return _solid(unit * size, cells, size[2], None)


def with_plane_sides(solid):
    """Return the solid with a separate patch for each plane face of its side."""
    corners = solid.points[solid.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("fx,fx->f", normal, corners[:, 0])
    code = np.round(np.column_stack([normal, height / np.ptp(solid.points)]), 9) + 0.0
    patch, shapes = solid.patch.copy(), list(solid.shapes[:2])
    side = np.flatnonzero(patch == 2)
    for each in np.unique(code[side], axis=0):
        members = side[(code[side] == each).all(axis=1)]
        patch[members] = len(shapes)
        first = members[0]
        shapes.append(Plane(corners[first, 0], normal[first]))
    return Solid(solid.points, solid.cells, solid.faces, patch, tuple(shapes))


def masked_solid(counts, size, keep):
    """Return the mesh of a box, reduced to the grid cells that ``keep`` selects."""
    unit, cells = box_cells(counts)
    points = unit * size
    box = np.floor(unit[cells].mean(axis=1) * counts + 1e-9)
    cells = cells[keep((box + 0.5) / counts * size)]
    used, cells = np.unique(cells, return_inverse=True)
    return _solid(points[used], cells.reshape(-1, 4), size[2], None)


def bar_solid(rings, layers, radius, length):
    """Return the mesh of a round bar, extruded from a disc; its side is a cylinder."""
    steps = [np.arange(6 * k) / (6 * k) for k in range(1, rings + 1)]
    spokes = [np.exp(2j * np.pi * t) * k / rings for k, t in enumerate(steps, 1)]
    disc = radius * np.concatenate([[0], *spokes])
    flat = np.column_stack([disc.real, disc.imag])
    triangles = np.sort(Delaunay(flat).simplices, axis=1)
    count = len(flat)
    points = np.concatenate([
        np.insert(flat, 2, z, axis=1) for z in np.linspace(0, length, layers + 1)
    ])
    a, b, c = triangles.T
    up = np.array([a, b, c]) + count
    # each prism is divided by the diagonals from its smallest node numbers
    prism = [np.column_stack(t) for t in ((a, b, c, up[2]), (a, b, up[1], up[2]),
                                          (a, up[0], up[1], up[2]))]  # fmt: skip
    cells = np.concatenate([t + k * count for k in range(layers) for t in prism])
    return _solid(points, cells, length, Cone(np.zeros(3), Z, radius))


def _solid(points, cells, length, side):
    """Return a solid with its base at z = 0, its tip at z = length, and one side."""
    cells = outward(points, cells)
    faces = boundary_faces(cells)
    height = points[faces][..., 2] / length
    on = [(np.abs(height - v) < 1e-12).all(axis=1) for v in (0, 1)]
    patch = np.where(on[0], 0, np.where(on[1], 1, 2))
    planes = Plane(np.zeros(3), Z), Plane(length * Z, Z)
    return Solid(points, cells, faces, patch, (*planes, side))


CUBE = np.array([[x, y, z] for x in (0.0, 0.1) for y in (0.0, 0.1) for z in (0.0, 0.1)])
CUBE_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def bar(facets=32, **kwargs):
    return check_surface(*cylinder(facets=facets, **kwargs), "bar")


def rounded_outline(half_sizes, corner, inset, steps):
    """Return the points of a rectangle with rounded corners, (4 (steps + 1), 2)."""
    centers = np.array(half_sizes) - corner
    angle = np.pi / 2 * np.arange(steps + 1) / steps
    points = []
    for k, signs in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        turn = angle + k * np.pi / 2
        arc = (corner - inset) * np.column_stack([np.cos(turn), np.sin(turn)])
        points.append(arc + centers * signs)
    return np.concatenate(points)


def rounded_block(half_sizes, corner, profile, steps):
    """Return a block with rounded edges.

    Args:
        half_sizes: half side lengths (2,) [m].
        corner: radius of the vertical edges [m].
        profile: (inset, z) of each outline [m].
        steps: number of facets of each rounded edge.
    """
    rings = [
        np.insert(rounded_outline(half_sizes, corner, inset, steps), 2, z, axis=1)
        for inset, z in profile
    ]
    count = len(rings[0])
    i, j = np.arange(count), (np.arange(count) + 1) % count
    triangles = []
    for k in range(len(rings) - 1):
        a, b = k * count, (k + 1) * count
        triangles += [np.column_stack([i + a, j + a, j + b])]
        triangles += [np.column_stack([i + a, j + b, i + b])]
    top, total = (len(rings) - 1) * count, len(rings) * count
    triangles += [np.column_stack([0 * i + total, j, i])]
    triangles += [np.column_stack([0 * i + total + 1, i + top, j + top])]
    ends = [[0, 0, profile[0][1]], [0, 0, profile[-1][1]]]
    points = np.concatenate([*rings, ends])
    return check_surface(points, np.concatenate(triangles), "rounded block")


def fillet_profile(radius, height, steps):
    """Return the profile (inset, z) of a wall with a fillet at its foot."""
    angle = np.pi / 2 * np.arange(steps + 1) / steps
    foot = [(radius * (1 - np.sin(a)), radius * (1 - np.cos(a))) for a in angle]
    return [*foot, (0.0, height)]


def bar_of_two_boxes(width, height, near, far):
    """Return a bar along z that consists of two solids, as in a STEP file."""
    levels = (0.0, near, near + far)
    corners = [[x, y, z] for z in levels for y in (0, height) for x in (0, width)]
    quads = [((0, 2, 3, 1), 0, -1), ((4, 5, 7, 6), 0, 1), ((8, 9, 11, 10), 1, -1)]
    for k in (0, 1):
        for a, b in ((0, 1), (1, 3), (3, 2), (2, 0)):
            quads.append(((4 * k + a, 4 * k + b, 4 * k + 4 + b, 4 * k + 4 + a), k, -1))
    triangles = [t for (a, b, c, d), *_ in quads for t in ((a, b, c), (a, c, d))]
    sides = np.repeat([pair for _, *pair in quads], 2, axis=0)
    return surface_of_solids(
        ("near", "far"), np.array(corners), np.array(triangles), sides
    )


def rod_in_tube(inner, outer, length, facets=48):
    """Return a round rod bonded into a tube along z, as two solids."""
    points, triangles = cylinder(inner, length, facets)
    wide, _ = cylinder(outer, length, facets)
    shift, count = len(points), len(triangles)
    i, j = np.arange(facets), (np.arange(facets) + 1) % facets
    a, b, c, d = shift + i, shift + j, shift + j + facets, shift + i + facets
    mantle = [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    ends = [np.column_stack(t) for t in ((i, j, b), (i, b, a), (j + facets,
            i + facets, d), (j + facets, d, c))]  # fmt: skip
    every = np.concatenate([triangles, *mantle, *ends])
    sides = np.tile([1, -1], (len(every), 1))
    sides[:count] = [0, -1]
    sides[: 2 * facets] = [0, 1]
    return surface_of_solids(
        ("rod", "tube"), np.concatenate([points, wide[: 2 * facets]]), every, sides
    )


def surface_of_solids(names, points, triangles, sides):
    """Return the outer surface of several solids, together with the solids."""
    outer = triangles[(sides < 0).any(axis=1)]
    solids = FilledSolids(names, points, triangles, sides)
    return replace(check_surface(points, outer, "part.step#*"), solids=solids)
