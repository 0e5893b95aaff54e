"""Meshes of slender or thin-walled straight bars.

The mesher creates elements of similar length in all directions. For a very slender rod
or a thin tube, it therefore takes minutes or does not end. Extrusion of the section
results in a mesh of only a few thousand elements.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.mesh.solid import Solid
from forcefit.stiffness.mesh.straight_bar import straight_bar
from forcefit.stiffness.surface.interface import Interface
from forcefit.stiffness.surface.patches import find_patches
from forcefit.stiffness.surface.primitives import Cone, Plane, Shape
from forcefit.stiffness.surface.surface import Surface
from forcefit.stiffness.surface.true_surface import TrueSurface

# ratio of the length to the width of the section above which a bar is slender
_SLENDER = 50.0
# ratio of wall thickness to width or diameter below which a section is thin-walled
_THIN = 0.04
_LAYERS = 60.0  # number of layers along a bar, without the thin layers at its ends
# thickness of a layer, relative to the width of the section, in a bar that is not
# slender
_LONGEST = 2.0
_PARALLEL = 1e-6  # [rad] largest angle between parallel directions
_SAME = 1e-6  # largest difference between equal positions, relative to the length
_SAME_VOLUME = 1e-3
# tolerance of the sine of the angle between a triangle and the axis, which is 0 for a
# side and 1 for an end
_NEARLY = 0.1


def slender_bar(surface: Surface, base: Interface, tip: Interface) -> Solid | None:
    """Mesh a slender or thin-walled straight bar.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.

    Returns:
        First mesh in the axes of the surface. None if the link is not a round bar, a
        tube, a rectangular bar or a rectangular tube from base to tip, or if it is
        neither slender nor thin-walled.

    Raises:
        BadInput: no part of the surface is on an interface.
    """
    if base.kind == "bore" or tip.kind == "bore":
        return None
    axis = base.direction
    length = float((tip.point - base.point) @ axis)
    axis, length = (axis, length) if length > 0 else (-axis, -length)
    if length == 0 or np.linalg.norm(np.cross(axis, tip.direction)) > _PARALLEL:
        return None
    along = (surface.points - base.point) @ axis
    reach = np.abs([along.min(), along.max() - length]).max()
    # this check is fast and rejects most parts
    if reach > 10 * _SAME * length or not _prismatic(surface, axis):
        return None
    patches = find_patches(surface, base, tip)
    section = _section(patches.shapes[2:], axis)
    if section is None:
        return None
    lengths, center, up = section
    width = lengths.get("height", 2 * lengths.get("radius", 0.0))
    if length < _SLENDER * width and _wall(lengths) > _THIN * width:
        return None
    scaled = {name: value / length for name, value in lengths.items()}
    bar = straight_bar(scaled, max(_LONGEST, length / width / _LAYERS))
    frame = np.column_stack([up, np.cross(axis, up), axis])
    foot = center + ((base.point - center) @ axis) * axis
    volume = TrueSurface(surface, patches).volume
    same = abs(_area(lengths) * length / volume - 1) < _SAME_VOLUME
    return _placed(bar, frame, foot, length) if same else None


def _prismatic(surface: Surface, axis: NDArray) -> bool:
    """Return whether all triangles are nearly parallel or normal to the axis.

    In triangulations of STEP files, the triangles on a cylinder are not exactly
    parallel to its axis.
    """
    a, b, c = np.moveaxis(surface.points[surface.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    slope = np.abs(normal @ axis) / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    return bool(((slope < _NEARLY) | (slope > 1 - _NEARLY)).all())


def _section(
    shapes: tuple[Shape, ...], axis: NDArray
) -> tuple[dict[str, float], NDArray, NDArray] | None:
    """Find the dimensions of the section, a point on the axis, and the y axis."""
    if all(isinstance(shape, Cone) for shape in shapes):
        return _round_section([s for s in shapes if isinstance(s, Cone)], axis)
    if all(isinstance(shape, Plane) for shape in shapes) and len(shapes) in (4, 8):
        return _angular_section([s for s in shapes if isinstance(s, Plane)], axis)
    return None


def _round_section(
    cones: list[Cone], axis: NDArray
) -> tuple[dict[str, float], NDArray, NDArray] | None:
    """Find the dimensions of a round bar or tube."""
    if len(cones) > 2 or not cones:
        return None
    largest = max(cones, key=lambda cone: cone.radius)
    near = _SAME * largest.radius * 1e2
    for cone in cones:
        off = np.cross(cone.point - largest.point, axis)
        tilt = np.linalg.norm(np.cross(cone.axis, axis))
        if tilt > _PARALLEL or abs(cone.slope) > _PARALLEL:
            return None
        if np.linalg.norm(off) > near:
            return None
    lengths = {"radius": largest.radius}
    if len(cones) == 2:
        lengths["inner_radius"] = min(cone.radius for cone in cones)
    up = np.linalg.svd(axis[None])[2][1]
    return lengths, largest.point, up


def _angular_section(
    planes: list[Plane], axis: NDArray
) -> tuple[dict[str, float], NDArray, NDArray] | None:
    """Find the dimensions of a rectangular bar or tube."""
    first = planes[0].normal
    second = np.cross(axis, first)
    middle = np.mean([plane.point for plane in planes], axis=0)
    sizes = []
    for direction in (first, second):
        along = [p for p in planes if abs(p.normal @ direction) > 1 - _PARALLEL]
        places = np.sort([(p.point - middle) @ direction for p in along])
        if len(places) != len(planes) // 2:
            return None
        middle = middle + (places[0] + places[-1]) / 2 * direction
        sizes.append((places[-1] - places[0], np.diff(places)))
    narrow, wide = (0, 1) if sizes[0][0] <= sizes[1][0] else (1, 0)
    lengths = {"width": float(sizes[narrow][0]), "height": float(sizes[wide][0])}
    up = (first, second)[narrow]
    if len(planes) == 8:
        walls = np.array([gaps[k] for _, gaps in sizes for k in (0, 2)])
        if np.ptp(walls) > 1e-4 * walls.max():
            return None
        lengths["wall"] = float(walls.mean())
    return lengths, middle, up


def _wall(lengths: dict[str, float]) -> float:
    """Return the wall thickness [m], which is infinite for a solid section."""
    if "radius" in lengths:
        inner = lengths.get("inner_radius")
        return math.inf if inner is None else lengths["radius"] - inner
    return lengths.get("wall", math.inf)


def _area(lengths: dict[str, float]) -> float:
    """Return the area of a section [m^2]."""
    if "radius" in lengths:
        return math.pi * (
            lengths["radius"] ** 2 - lengths.get("inner_radius", 0.0) ** 2
        )
    width, height = lengths["width"], lengths["height"]
    wall = lengths.get("wall", width / 2)
    return width * height - (width - 2 * wall) * (height - 2 * wall)


def _placed(bar: Solid, frame: NDArray, foot: NDArray, length: float) -> Solid:
    """Transform a bar of unit length along z to the axes of the surface."""

    def moved(shape: Shape | None) -> Shape | None:
        if isinstance(shape, Plane):
            point = foot + length * frame @ shape.point
            return Plane(point, frame @ shape.normal)
        if isinstance(shape, Cone):
            return Cone(foot, frame @ shape.axis, length * shape.radius)
        return shape

    points = foot + length * bar.points @ frame.T
    return replace(bar, points=points, shapes=tuple(moved(s) for s in bar.shapes))
