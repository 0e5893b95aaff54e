"""Volumes and centres of simple bodies, for masses from shapes."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def volume(shape: str, sizes: Sequence[float]) -> float:
    """Return the volume of a body.

    Args:
        shape: ``box`` (three edges), ``sphere`` (radius), ``ellipsoid`` (three
            half axes), ``cylinder``, ``capsule`` (without its caps) or ``cone``
            (radius, length).
        sizes: [m] sizes of the shape.

    Returns:
        [m^3].
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
    """Return the surface of a body.

    Args:
        shape: ``box``, ``sphere``, ``cylinder`` or ``capsule``, see :func:`volume`.
        sizes: [m] sizes of the shape.

    Returns:
        [m^2].
    """
    if shape == "box":
        a, b, c = sizes
        return 2 * (a * b + b * c + c * a)
    if shape == "sphere":
        return 4 * math.pi * sizes[0] ** 2
    radius, length = sizes
    caps = 4 * math.pi * radius**2 if shape == "capsule" else 2 * math.pi * radius**2
    return 2 * math.pi * radius * length + caps


def together(masses: Sequence[float], centres: Sequence[NDArray]) -> (
    tuple[float, NDArray]
):  # fmt: skip
    """Return the mass and centre of several bodies together.

    Args:
        masses: [kg] of each.
        centres: (3,) [m] of each.

    Returns:
        [kg] and (3,) [m]; the origin without a mass.
    """
    total = float(sum(masses))
    if not total:
        return 0.0, np.zeros(3)
    return total, np.asarray(np.average(centres, axis=0, weights=masses))
