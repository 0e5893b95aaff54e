"""Volumes, areas and moments of inertia of simple shapes."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_SHELL = 1e-6  # [m] thickness of an ellipsoidal shell


def volume(shape: str, sizes: Sequence[float]) -> float:
    """Return the volume of a solid shape.

    Args:
        shape: ``box``, ``sphere``, ``ellipsoid``, ``cylinder``, ``capsule`` or
            ``cone``.
        sizes: dimensions of the shape [m]: three edges of a box, radius of a sphere,
            three half axes of an ellipsoid, or radius and length of the other shapes.
            The length of a capsule does not include its caps.

    Returns:
        Volume [m^3].
    """
    if shape == "box":
        return math.prod(sizes)
    if shape in {"sphere", "ellipsoid"}:
        return 4 / 3 * math.pi * math.prod(sizes if len(sizes) == 3 else [sizes[0]] * 3)
    radius, length = sizes
    round_bar = math.pi * radius**2 * length
    if shape == "capsule":
        return round_bar + 4 / 3 * math.pi * radius**3
    return round_bar / 3 if shape == "cone" else round_bar


def area(shape: str, sizes: Sequence[float]) -> float:
    """Return the surface area of a shape.

    Args:
        shape: ``box``, ``sphere``, ``cylinder`` or ``capsule``.
        sizes: dimensions of the shape [m]; see :func:`volume`.

    Returns:
        Area [m^2].
    """
    if shape == "box":
        a, b, c = sizes
        return 2 * (a * b + b * c + c * a)
    if shape == "sphere":
        return 4 * math.pi * sizes[0] ** 2
    radius, length = sizes
    caps = 4 * math.pi * radius**2 if shape == "capsule" else 2 * math.pi * radius**2
    return 2 * math.pi * radius * length + caps


def moments(shape: str, sizes: Sequence[float]) -> NDArray:
    """Return the moments of inertia of a solid body about its centre of mass.

    Args:
        shape: see :func:`volume`.  The axis of cylinders, capsules and cones is z.
        sizes: dimensions of the shape [m]; see :func:`volume`.

    Returns:
        Moments about x, y and z divided by the mass, (3,) [m^2].
    """
    if shape == "box":
        return _across(np.square(sizes)) / 12
    if shape in {"sphere", "ellipsoid"}:
        return _across(np.square(sizes if len(sizes) == 3 else [sizes[0]] * 3)) / 5
    r2, length = sizes[0] ** 2, sizes[1]
    if shape == "cone":
        return _round(0.15 * r2 + 3 / 80 * length**2, 0.3 * r2)
    bar = _round(r2 / 4 + length**2 / 12, r2 / 2)
    if shape == "cylinder":
        return bar
    # the centre of mass of a hemisphere is at 3/8 of its radius from its base
    far = length**2 / 4 + 3 / 8 * sizes[0] * length
    ends = _round(0.4 * r2 + far, 0.4 * r2)
    return np.asarray(
        np.average([bar, ends], axis=0, weights=[length, 4 / 3 * sizes[0]])
    )


def shell_moments(shape: str, sizes: Sequence[float]) -> NDArray:
    """Return the moments of inertia of a thin shell about its centre of mass.

    Args:
        shape: as for :func:`moments`, except ``cone``.  As in MuJoCo, the outer half
            axes of an ellipsoidal shell exceed the inner half axes by 1 um.
        sizes: dimensions of the shape [m]; see :func:`volume`.

    Returns:
        Moments about x, y and z divided by the mass, (3,) [m^2].
    """
    if shape == "box":
        squares, areas = np.square(sizes), math.prod(sizes) / np.array(sizes)
        # each pair of opposite faces consists of plates at half an edge from the centre
        faces = [_across(squares / 12 + squares / 6 * pair) for pair in np.eye(3)]
        return np.asarray(np.average(faces, axis=0, weights=areas))
    if shape == "sphere":
        return np.full(3, 2 / 3 * sizes[0] ** 2)
    if shape == "ellipsoid":
        a, b, c = axes = np.array(sizes)
        volume = (a * b + b * c + c * a + (a + b + c) * _SHELL + _SHELL**2) * _SHELL
        outside = np.prod(axes + _SHELL) / volume  # ratio of outer and shell volume
        thicker = outside * (2 * axes + _SHELL) * _SHELL
        return (_across(axes**2) + _across(thicker)) / 5
    r2, length = sizes[0] ** 2, sizes[1]
    side = _round(r2 / 2 + length**2 / 12, r2)
    if shape == "cylinder":
        ends = _round(r2 / 4 + length**2 / 4, r2 / 2)
        return np.asarray(np.average([side, ends], axis=0, weights=[length, sizes[0]]))
    far = length**2 / 4 + sizes[0] * length / 2
    ends = _round(2 / 3 * r2 + far, 2 / 3 * r2)
    return np.asarray(np.average([side, ends], axis=0, weights=[length, 2 * sizes[0]]))


def _across(squares: NDArray) -> NDArray:
    """Return y + z, z + x and x + y for three values x, y and z."""
    return np.asarray(np.sum(squares) - squares)


def _round(across: float, along: float) -> NDArray:
    """Return the moments of a body that is rotationally symmetric about z."""
    return np.array([across, across, along])
