"""Division of a surface into smooth patches."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.interface import Interface
from forcefit.stiffness.surface.primitives import Cone, Plane, Shape
from forcefit.stiffness.surface.recognition import recognise
from forcefit.stiffness.surface.smooth_outline import SmoothOutline, smooth_outline
from forcefit.stiffness.surface.surface import Surface, directed_edges
from forcefit.stiffness.surface.triangle_graph import SHARP, TriangleGraph


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of a surface and their exact shapes.

    Attributes:
        patch: (m,) patch number of each triangle. Patch 0 is the base interface, and
            patch 1 is the tip interface.
        shapes: exact shape of each patch, or a smooth surface through its facets if no
            shape was recognised.
        outlines: parts of the outlines of interfaces without a sharp edge.
    """

    patch: NDArray
    shapes: tuple[Shape, ...]
    outlines: tuple[SmoothOutline, ...] = ()


def find_patches(surface: Surface, base: Interface, tip: Interface) -> Patches:
    """Divide a surface at its sharp edges, and recognise the shapes of the patches.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.

    Returns:
        The patches.

    Raises:
        BadInput: no part of the surface is on an interface, or the interfaces are
            equal.
    """
    patch = np.full(len(surface.triangles), -1)
    shapes: list[Shape] = []
    for number, (name, interface) in enumerate((("base", base), ("tip", tip))):
        members = triangles_on(surface, interface, name)
        if (patch[members] >= 0).any():
            raise BadInput(
                f"{surface.name}: found the same faces for base and tip, expected two "
                "different interfaces"
            )
        patch[members] = number
        shapes.append(interface_shape(interface))
    graph = TriangleGraph(surface)
    for members in graph.smooth_parts(patch < 0):
        for part, shape in recognise(graph, members):
            patch[part] = len(shapes)
            shapes.append(shape)
    return Patches(patch, tuple(shapes), tuple(_outlines(graph, patch, shapes)))


def _outlines(
    graph: TriangleGraph, patch: NDArray, shapes: list[Shape]
) -> list[SmoothOutline]:
    """Find parts of the outlines of interfaces without a sharp edge."""
    one, other = patch[graph.left], patch[graph.right]
    smooth = (graph.cosine > SHARP) & (one != other)
    found = []
    for number in (0, 1):
        touching = smooth & ((one == number) | (other == number))
        across = np.where(one == number, other, one)
        for neighbour in np.unique(across[touching]):
            edges = np.flatnonzero(touching & (across == neighbour))
            owner = np.where(one == number, graph.left, graph.right)[edges]
            ends = graph.directed(edges, owner)
            normals = graph.normals[owner]
            pair = (number, int(neighbour))
            found.append(smooth_outline(graph.points, ends, normals, pair))
    return found


def interface_shape(interface: Interface) -> Shape:
    """Return the exact shape of an interface.

    Args:
        interface: the interface.

    Returns:
        A plane or a cylinder.
    """
    if interface.kind == "bore":
        return Cone(interface.point, interface.direction, interface.radius)
    return Plane(interface.point, interface.direction)


def refuse_common_edges(surface: Surface, base: Interface, tip: Interface) -> None:
    """Reject interfaces with a common edge, for which the stiffness is infinite.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.

    Raises:
        BadInput: the interfaces have a common edge, or no part of the surface is on an
            interface.
    """
    codes: list[NDArray] = []
    for name, interface in (("base", base), ("tip", tip)):
        members = surface.triangles[triangles_on(surface, interface, name)]
        ends = np.sort(directed_edges(members), axis=1)
        codes.append(np.unique(ends[:, 0] * len(surface.points) + ends[:, 1]))
    common = np.intersect1d(codes[0], codes[1])
    if len(common):
        ends = np.array(divmod(int(common[0]), len(surface.points)))
        where = ", ".join(f"{v:.4g}" for v in surface.points[ends].mean(axis=0))
        raise BadInput(
            f"{surface.name}: base {base} and tip {tip} have a common edge near "
            f"({where}) m; the stiffness between rigid faces with a common edge is "
            "infinite; change an interface, or use --interface distributing"
        )


def triangles_on(surface: Surface, interface: Interface, name: str) -> NDArray:
    """Find the triangles on an interface.

    Args:
        surface: surface of the link.
        interface: the interface.
        name: ``"base"`` or ``"tip"``, for error messages.

    Returns:
        (k,) indices of the triangles.

    Raises:
        BadInput: no triangle is on the interface, or the outline of a disc crosses
            triangles.
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
    if interface.kind == "bore":
        # this condition excludes a flat face whose corners are on the cylinder, such as
        # the end of a bar
        middle = corners.mean(axis=1) - interface.point
        middle -= (middle @ interface.direction)[:, None] * interface.direction
        radial = np.abs((normals * middle).sum(axis=1))
        on &= radial > 0.5 * np.linalg.norm(middle, axis=1)
    if interface.kind == "disc":
        out = np.linalg.norm(corners - interface.point, axis=2) / interface.radius
        cut = on & (out < 0.99).any(axis=1) & (out > 1.01).any(axis=1)
        if cut.any():
            raise BadInput(
                f"{surface.name}: the {name} interface {interface} [m] crosses "
                f"{cut.sum()} triangles; the outline of a disc must consist of edges "
                "of triangles"
            )
        on &= (out < 1.002).all(axis=1)
    if not on.any():
        low, high = surface.points.min(axis=0), surface.points.max(axis=0)
        box = ", ".join(
            f"{k} = {a:.5g} .. {b:.5g}"
            for k, a, b in zip("xyz", low, high, strict=True)
        )
        hint = "; the outline of a disc must consist of edges of triangles"
        raise BadInput(
            f"{surface.name}: no face of the surface lies on the {name} interface "
            f"{interface} [m]; the extent of the part is {box} "
            f"m{hint if interface.kind == 'disc' else ''}"
        )
    return np.flatnonzero(on)
