"""Interfaces between a link and its joints."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.number_arrays import comma_numbers, number_array
from forcefit.inputs.table import BadInput, describe, nearest
from forcefit.stiffness.beam.beam import unit_vector
from forcefit.stiffness.screws import UNIT_VECTORS

# [m] largest accepted coordinate or radius
_FARTHEST = 1e6
_EXPECTED = '"z=0.452", "bore=px,py,pz/ax,ay,az/r", a table {plane, radius} or {bore}'


@dataclass(frozen=True, eq=False)
class Interface:
    """Part of the surface of a link that is connected to a joint.

    Attributes:
        kind: ``"plane"`` for the part of the surface in a plane, ``"disc"`` for a
            circular part of a plane, or ``"bore"`` for a cylinder.
        point: (3,) [m] point in the plane, centre of the disc, or reference point on
            the axis of the bore.
        direction: (3,) unit normal of the plane, or axis of the bore.
        radius: [m] radius of the disc or the bore; infinite for a plane.
    """

    kind: str
    point: NDArray
    direction: NDArray
    radius: float

    def __post_init__(self) -> None:
        point = np.array(self.point, dtype=float)
        direction = unit_vector(f"{self.kind} direction", self.direction)
        if point.shape != (3,) or not np.isfinite(point).all():
            raise BadInput(f"{self.kind}: the point must be 3 finite numbers [m]")
        sizes = [*np.abs(point), 0.0 if math.isinf(self.radius) else self.radius]
        if max(sizes) > _FARTHEST:
            raise BadInput(
                f"{self.kind}: found {max(sizes):g}, expected lengths of at most "
                f"{_FARTHEST:g} m"
            )
        if not self.radius > 0:
            raise BadInput(f"{self.kind}: radius = {self.radius:g} must be > 0 [m]")
        for name, array in (("point", point), ("direction", direction)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def __str__(self) -> str:
        p, d = (",".join(f"{v:g}" for v in a) for a in (self.point, self.direction))
        radius = "" if math.isinf(self.radius) else f"/{self.radius:g}"
        return f"{self.kind}={p}/{d}{radius}"

    def distance(self, points: ArrayLike) -> NDArray:
        """Compute the distances of points from the plane or cylinder of the interface.

        Args:
            points: (..., 3) [m] points.

        Returns:
            (...) [m] distances, >= 0.
        """
        offset = np.asarray(points, dtype=float) - self.point
        along = offset @ self.direction
        if self.kind != "bore":
            return np.abs(along)
        across = offset - along[..., None] * self.direction
        return np.abs(np.linalg.norm(across, axis=-1) - self.radius)


def parse_interface(text: object, place: str = "interface") -> Interface:
    """Parse an interface as written on the command line or in a robot file.

    Args:
        text: ``"z=0.452"`` (also x, y), ``"bore=px,py,pz/ax,ay,az/r"``,
            ``"disc=px,py,pz/nx,ny,nz/r"``, ``"plane=px,py,pz/nx,ny,nz"``, or a table
            ``{plane = {point, normal}, radius}`` or ``{bore = {point, axis, radius}}``.
            All lengths are in metres, in the axes of the surface.
        place: name of the option or key, for error messages.

    Returns:
        The interface.

    Raises:
        BadInput: the value has a different form.
    """
    try:
        if isinstance(text, str):
            return _from_text(text)
        if isinstance(text, Mapping):
            return _from_table(text)
        raise BadInput(f"found {describe(text)}, expected {_EXPECTED}")
    except BadInput as error:
        raise BadInput(f"{place}: {error}") from None


def _from_text(text: str) -> Interface:
    """Parse the text of an interface."""
    kind, equals, value = (part.strip() for part in text.partition("="))
    parts = [comma_numbers(part) for part in value.split("/")]
    lengths = [len(part) for part in parts]
    if equals and kind in UNIT_VECTORS and lengths == [1]:
        direction = np.array(UNIT_VECTORS[kind])
        return Interface("plane", parts[0][0] * direction, direction, math.inf)
    if equals and kind == "plane" and lengths == [3, 3]:
        return Interface("plane", parts[0], parts[1], math.inf)
    if equals and kind in {"bore", "disc"} and lengths == [3, 3, 1]:
        return Interface(kind, parts[0], parts[1], float(parts[2][0]))
    raise BadInput(f"found {describe(text)}, expected {_EXPECTED}")


def _from_table(table: Mapping) -> Interface:
    """Parse the table of an interface in a robot file."""
    kind = "bore" if "bore" in table else "plane"
    known = {"bore"} if kind == "bore" else {"plane", "radius"}
    _refuse_unknown(table, known, "")
    inner = table.get(kind)
    if not isinstance(inner, Mapping):
        raise BadInput(f"found {describe(dict(table))}, expected {_EXPECTED}")
    if kind == "bore":
        _refuse_unknown(inner, {"point", "axis", "radius"}, "bore: ")
        radius = _length(inner, "radius", "bore.radius")
        return Interface(
            "bore", _vector(inner, "point"), _vector(inner, "axis"), radius
        )
    _refuse_unknown(inner, {"point", "normal"}, "plane: ")
    point, normal = _vector(inner, "point"), _vector(inner, "normal")
    if "radius" not in table:
        return Interface("plane", point, normal, math.inf)
    return Interface("disc", point, normal, _length(table, "radius", "radius"))


def _refuse_unknown(table: Mapping, known: set[str], place: str) -> None:
    """Reject an unknown key in a table."""
    for key in table:
        if key not in known:
            raise BadInput(f'{place}unknown key "{key}"{nearest(str(key), known)}')


def _vector(table: Mapping, key: str) -> NDArray:
    """Read three finite numbers from a table."""
    value = table.get(key)
    array = number_array(value.tolist() if isinstance(value, np.ndarray) else value)
    if array is None or array.shape != (3,) or not np.isfinite(array).all():
        given = describe(value) if key in table else "nothing"
        raise BadInput(f"{key}: found {given}, expected 3 finite numbers")
    return array


def _length(table: Mapping, key: str, name: str) -> float:
    """Read a positive length from a table."""
    value = table.get(key)
    array = number_array([value])
    if array is None or not (np.isfinite(array[0]) and array[0] > 0):
        given = describe(value) if key in table else "nothing"
        raise BadInput(f"{name}: found {given}, expected a finite number > 0 [m]")
    return float(array[0])
