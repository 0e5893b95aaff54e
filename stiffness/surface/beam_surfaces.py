"""Surfaces of common link shapes."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, nearest
from forcefit.stiffness.beam.curve import Piece, straight_piece
from forcefit.stiffness.beam.sections import Section, declared_section, round_section
from forcefit.stiffness.surface.surface import Surface, check_surface

# names and defaults of the dimensions of each shape; None if there is no default
SHAPES: dict[str, dict[str, float | None]] = {
    "round": {"length": None, "radius": None},
    "tube": {"length": None, "radius": None, "inner_radius": None},
    "cone": {"length": None, "radius": None, "tip_radius": None},
    "rectangle": {"length": None, "width": None, "height": None},
    "box": {"length": None, "width": None, "height": None, "wall": None},
}
_FACETS = 64


def check_shape(shape: str, lengths: Mapping[str, float]) -> None:
    """Check a shape and its dimensions.

    Args:
        shape: one of ``SHAPES``.
        lengths: dimensions [m] by name.

    Raises:
        BadInput: a name is unknown or missing, or a dimension is not > 0.
    """
    if shape not in SHAPES:
        raise BadInput(f'shape: unknown "{shape}"{nearest(shape, SHAPES)}')
    for name in lengths:
        if name not in SHAPES[shape]:
            raise BadInput(
                f'{shape}: unknown length "{name}"{nearest(name, SHAPES[shape])}'
            )
    for name in SHAPES[shape]:
        if not (name in lengths and 0 < lengths[name] < float("inf")):
            given = f"found {lengths[name]:g}" if name in lengths else "missing"
            raise BadInput(f"{shape}: {name}: {given}, expected a length > 0 [m]")
    if shape == "tube" and lengths["inner_radius"] >= lengths["radius"]:
        raise BadInput(
            "tube: found inner_radius >= radius, expected inner_radius < radius"
        )
    if shape == "box" and 2 * lengths["wall"] >= min(
        lengths["width"], lengths["height"]
    ):
        raise BadInput(
            "box: the wall is so thick that there is no hole; expected a thinner wall"
        )


def shape_surface(shape: str, lengths: Mapping[str, float]) -> Surface:
    """Create the surface of a shape.

    Args:
        shape: one of ``SHAPES``.
        lengths: dimensions [m] by name.

    Returns:
        The closed surface. The axis of the link is z, and the base is at z = 0.

    Raises:
        BadInput: the shape or a dimension is invalid.
    """
    check_shape(shape, lengths)
    L = lengths["length"]
    if shape in {"rectangle", "box"}:
        corner = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2
        # the height is along y, which is the default of ``up`` for a beam along z
        sides = np.array([lengths["width"], lengths["height"]])
        hole = corner * (sides - 2 * lengths["wall"]) if shape == "box" else None
        return _prism(corner * sides, corner * sides, L, shape, hole)
    angle = 2 * np.pi * np.arange(_FACETS) / _FACETS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    r = lengths["radius"]
    if shape == "tube":
        hole = lengths["inner_radius"] * circle
        return _prism(r * circle, r * circle, L, shape, hole)
    tip = lengths["tip_radius"] if shape == "cone" else r
    return _prism(r * circle, tip * circle, L, shape)


def _prism(
    base: NDArray,
    tip: NDArray,
    length: float,
    name: str,
    hole: NDArray | None = None,
) -> Surface:
    """Create the surface between two outlines."""
    count = len(base)
    inner = np.zeros((1, 2)) if hole is None else hole
    layers = [base, tip, inner, inner]
    heights = [0.0, length, 0.0, length]
    points = np.concatenate([
        np.insert(p, 2, z, axis=1) for p, z in zip(layers, heights, strict=True)
    ])
    i = np.arange(count)
    j = (i + 1) % count
    many = len(inner)
    low, high = 2 * count + i % many, 2 * count + many + i % many
    low_j, high_j = 2 * count + j % many, 2 * count + many + j % many
    sides = [(i, j, j + count), (i, j + count, i + count)]
    ends = [(low, j, i), (high, i + count, j + count)]
    if hole is not None:
        ends += [(low, low_j, j), (high, j + count, high_j)]
        sides += [(low, high_j, low_j), (low, high, high_j)]
    triangles = np.concatenate([np.column_stack(t) for t in sides + ends])
    return check_surface(points, triangles, name)


def shape_beam(shape: str, lengths: Mapping[str, float], nu: float) -> list[Piece]:
    """Create the beam of a shape.

    Args:
        shape: one of ``SHAPES``.
        lengths: dimensions [m] by name.
        nu: [-] Poisson's ratio, which determines the shear factors.

    Returns:
        A list with one segment. The beam is along z, and its height is along y.

    Raises:
        BadInput: the shape or a dimension is invalid.
    """
    check_shape(shape, lengths)
    top = [0.0, 0.0, lengths["length"]]
    if shape == "cone":
        r = lengths["radius"]
        taper = lengths["tip_radius"] - r

        def section(t: float) -> Section:
            return round_section(r + taper * t, nu)

        return [straight_piece([0, 0, 0], top, section, [0, 1, 0])]
    constant = declared_section({k: v for k, v in lengths.items() if k != "length"}, nu)
    return [straight_piece([0, 0, 0], top, constant, [0, 1, 0])]
