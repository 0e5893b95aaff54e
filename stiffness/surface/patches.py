"""Segmentation of a surface into smooth patches, each with its exact shape."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from stiffness.surface.facets import Facets
from stiffness.surface.interface import Interface
from stiffness.surface.primitives import (
    Cone,
    Plane,
    Shape,
    Torus,
    fit_cone,
    fit_plane,
    fit_sphere,
    fit_torus,
)
from stiffness.surface.surface import Surface, directed_edges

_SHARP = np.cos(np.radians(35.0))  # a sharper edge separates two patches
_ON_SHAPE = 2e-6  # of the part's size: STL's single precision leaves 1e-7
_CIRCLES = 4  # of corners about a torus's axis; any three lie on a torus
_SEEDS = 12  # tries to recognise a shape in the rest of a part
_TRIES = 120  # on one surface; the rest then keeps its facets


@dataclass(frozen=True, eq=False)
class Patches:
    """The patch of each triangle of a surface, and their shapes.

    Attributes:
        patch: (m,) number of each triangle's patch; 0 is the base interface, 1 the tip.
        shapes: of each patch; lifted facets where no simpler one is known.
    """

    patch: NDArray
    shapes: tuple[Shape, ...]


def find_patches(surface: Surface, base: Interface, tip: Interface) -> Patches:
    """Cut a surface at its sharp edges and recognise the shapes.

    Args:
        surface: the link's.
        base: the held interface.
        tip: the loaded interface.

    Returns:
        The patches.

    Raises:
        BadInput: an interface has no part of the surface, or both have the same.
    """
    patch = np.full(len(surface.triangles), -1)
    shapes: list[Shape] = []
    for number, (name, interface) in enumerate((("base", base), ("tip", tip))):
        members = triangles_on(surface, interface, name)
        if (patch[members] >= 0).any():
            raise BadInput(f"{surface.name}: base and tip are the same faces")
        patch[members] = number
        shapes.append(interface_shape(interface))
    graph = _TriangleGraph(surface)
    for members in graph.smooth_parts(patch < 0):
        for part, shape in _recognise(graph, members):
            patch[part] = len(shapes)
            shapes.append(shape or graph.lifted(part))
    return Patches(patch, tuple(shapes))


def interface_shape(interface: Interface) -> Shape:
    """The plane or cylinder of an interface.

    Args:
        interface: plane, disc or bore.

    Returns:
        Its shape.
    """
    if interface.kind == "bore":
        return Cone(interface.point, interface.direction, interface.radius)
    return Plane(interface.point, interface.direction)


def triangles_on(surface: Surface, interface: Interface, name: str) -> NDArray:
    """Triangles of a surface that lie on an interface.

    Args:
        surface: the link's.
        interface: plane, disc or bore.
        name: base or tip, for messages.

    Returns:
        (k,) indices of triangles.

    Raises:
        BadInput: there are none, or a disc's outline runs through triangles.
    """
    near = 1e-5 * surface.diagonal
    if interface.kind == "bore":
        near = max(near, 2e-3 * interface.radius)
    corners = surface.points[surface.triangles]
    normals = surface.normals()
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    on = (interface.distance(corners) < near).all(axis=1)
    along = np.abs(normals @ interface.direction)
    on &= along < 0.5 if interface.kind == "bore" else along > 0.9
    if interface.kind == "disc":
        out = np.linalg.norm(corners - interface.point, axis=2) / interface.radius
        cut = on & (out < 0.99).any(axis=1) & (out > 1.01).any(axis=1)
        if cut.any():
            raise BadInput(
                f"{surface.name}: the {name} interface {interface} [m] cuts "
                f"{cut.sum()} triangles; a disc must be an outline of the surface's "
                "own triangles"
            )
        on &= (out < 1.002).all(axis=1)
    if not on.any():
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        box = ", ".join(
            f"{k} = {a:.5g} .. {b:.5g}"
            for k, a, b in zip("xyz", low, high, strict=True)
        )
        hint = "; a disc must be an outline of the surface's own triangles"
        raise BadInput(
            f"{surface.name}: no face of the surface lies on the {name} interface "
            f"{interface} [m]; the part spans {box} m"
            f"{hint if interface.kind == 'disc' else ''}"
        )
    return np.flatnonzero(on)


class _TriangleGraph:
    """Triangles, their neighbours and the angles between them."""

    def __init__(self, surface: Surface) -> None:
        self.points, self.triangles = surface.points, surface.triangles
        normals = surface.normals()
        self.areas = np.linalg.norm(normals, axis=1)
        self.normals = normals / np.maximum(self.areas, 1e-300)[:, None]
        self.tolerance = _ON_SHAPE * surface.diagonal
        self.tries = _TRIES
        edges = np.sort(directed_edges(self.triangles), axis=1)
        owner = np.repeat(np.arange(len(self.triangles)), 3)
        order = np.lexsort(edges.T)
        self.left, self.right = owner[order[::2]], owner[order[1::2]]
        self.cosine = np.einsum(
            "ij,ij->i", self.normals[self.left], self.normals[self.right]
        )

    def connected_parts(self, members: NDArray, bend: float) -> NDArray:
        """Component of each member; cut where the cosine is below ``bend``."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        keep = members[self.left] & members[self.right] & (self.cosine > bend)
        size = len(self.triangles)
        graph = coo_array(
            (np.ones(keep.sum()), (self.left[keep], self.right[keep])), (size, size)
        )
        return connected_components(graph, directed=False)[1]

    def smooth_parts(self, members: NDArray) -> list[NDArray]:
        """Indices of the triangles of each part between sharp edges."""
        label = self.connected_parts(members, _SHARP)
        return [
            np.flatnonzero(members & (label == k)) for k in np.unique(label[members])
        ]

    def lifted(self, part: NDArray) -> Facets:
        """A part of no known shape."""
        used, index = np.unique(self.triangles[part], return_inverse=True)
        return Facets(self.points[used], index.reshape(-1, 3))

    def fits(self, shape: Shape, part: NDArray) -> NDArray:
        """Which triangles of a part lie on a shape, corners and direction."""
        corners = self.points[self.triangles[part]].reshape(-1, 3)
        distances = np.abs(shape.signed(corners)[0]).reshape(-1, 3).max(axis=1)
        centers = corners.reshape(-1, 3, 3).mean(axis=1)
        along = np.einsum("ij,ij->i", shape.signed(centers)[1], self.normals[part])
        return (distances < self.tolerance) & (np.abs(along) > _SHARP)


def _recognise(
    graph: _TriangleGraph, part: NDArray
) -> list[tuple[NDArray, Shape | None]]:
    """Shapes of a smooth part: one for all of it, else the largest first."""
    shape = _fit(graph, part)
    if shape is not None and graph.fits(shape, part).all():
        return [(part, shape)]
    recognised: list[tuple[NDArray, Shape | None]] = []
    while len(part):
        members, shape = _largest_shape(graph, part)
        if shape is None:
            return recognised + _leftovers(graph, part, separate=bool(recognised))
        recognised.append((members, shape))
        part = np.setdiff1d(part, members)
    return recognised


def _leftovers(
    graph: _TriangleGraph, part: NDArray, separate: bool
) -> list[tuple[NDArray, Shape | None]]:
    """Triangles of no recognised shape; pieces between shapes are fitted once more."""
    if not separate:
        return [(part, None)]
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[part] = True
    pieces = graph.smooth_parts(inside)
    return [(piece, _fit(graph, piece)) for piece in pieces]


def _fit(graph: _TriangleGraph, part: NDArray) -> Shape | None:
    """The simplest shape all corners of a part lie on."""
    points = graph.points[np.unique(graph.triangles[part])]
    normals = graph.normals[part]
    # a few corners decide whether a shape is fitted to all of them
    few = points[:: max(1, len(points) // 50)]
    tries: list[tuple[Callable[[NDArray, NDArray], Shape], int]] = [
        (fit_plane, 3),
        (fit_cone, 7),
        (fit_sphere, 7),
        (fit_torus, 12),
    ]
    for fit, least in tries:
        if len(points) < least:
            break
        if len(few) < len(points) and not _lies_on(fit(few, normals), few, graph):
            continue
        shape = fit(points, normals)
        if _lies_on(shape, points, graph) and _is_certain(shape, points, graph):
            return shape
    return None


def _is_certain(shape: Shape, points: NDArray, graph: _TriangleGraph) -> bool:
    """Whether points are on a torus by no coincidence."""
    # three coaxial circles are always on one: a shoulder and the first facets of its
    # fillet are no torus
    if not isinstance(shape, Torus):
        return True
    offset = points - shape.point
    along = offset @ shape.axis
    distance = np.linalg.norm(offset - along[:, None] * shape.axis, axis=1)
    arc = np.sort(shape.tube * np.arctan2(along, distance - shape.radius))
    circles = 1 + int((np.diff(arc) > 10 * graph.tolerance).sum())
    return circles >= _CIRCLES


def _lies_on(shape: Shape, points: NDArray, graph: _TriangleGraph) -> bool:
    """Whether points are on a shape, to the tolerance of the surface."""
    return bool(np.abs(shape.signed(points)[0]).max() < graph.tolerance)


def _largest_shape(
    graph: _TriangleGraph, part: NDArray
) -> tuple[NDArray, Shape | None]:
    """The largest connected piece of a part that is one shape; none if none is."""
    inside = np.zeros(len(graph.triangles), dtype=bool)
    inside[part] = True
    flat = graph.connected_parts(inside, 1 - 1e-10)
    best, largest, area = None, part[:0], 0.0
    whole = graph.areas[part].sum()
    tried = ~inside
    for _ in range(_SEEDS):
        waiting = part[~tried[part]]
        if len(waiting) == 0 or area > whole / 2 or graph.tries == 0:
            break
        graph.tries -= 1
        seed = waiting[np.argmax(graph.areas[waiting])]
        tried[flat == flat[seed]] = True
        for rings in (0, 2, 4):
            shape = _fit(graph, _ring(graph, inside, flat, seed, rings))
            if shape is None:
                continue
            on = np.zeros_like(inside)
            on[part] = graph.fits(shape, part)
            label = graph.connected_parts(on, _SHARP)
            piece = np.flatnonzero(on & (label == label[seed]))
            tried[piece] = True
            # two coplanar triangles are a facet of a curved shape
            if len(piece) > 2 and graph.areas[piece].sum() > area:
                best, largest, area = shape, piece, float(graph.areas[piece].sum())
    return largest, best


def _ring(
    graph: _TriangleGraph, inside: NDArray, flat: NDArray, seed: int, rings: int
) -> NDArray:
    """A seed with its coplanar neighbours, grown by some rings of graph."""
    members = inside & (flat == flat[seed])
    touch = inside[graph.left] & inside[graph.right] & (graph.cosine > _SHARP)
    left, right = graph.left[touch], graph.right[touch]
    for _ in range(rings):
        grown = np.r_[right[members[left]], left[members[right]]]
        members = members | (inside & np.isin(flat, flat[grown]))
    return np.flatnonzero(members)
