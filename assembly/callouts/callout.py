"""Tolerance callouts on an engineering drawing, and their tolerance zones."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.fits import parse_hole
from forcefit.assembly.callouts.general_tolerances import (
    linear_tolerance,
    parse_general,
    perpendicularity_tolerance,
)
from forcefit.assembly.callouts.zone import Zone, intersection
from forcefit.assembly.callouts.zones_of_features import (
    axis_orientation,
    axis_position,
    axis_position_along,
    plane_orientation,
    plane_position,
    point_position,
    round_plane_orientation,
    round_plane_position,
    shift_along,
)
from forcefit.inputs.table import BadInput

SHAPES = ("axis", "plane", "point")
# for each shape of a datum, screw components that the datum constrains, in datum axes
HELD = {
    "axis": (0, 1, 3, 4),
    "plane": (0, 1, 5),
    "point": (3, 4, 5),
    "guide": (0, 1, 2, 3, 4),
    "body": (0, 1, 2, 3, 4, 5),
}
LOCATIONS = ("position", "coaxiality", "profile")
ORIENTATIONS = ("perpendicularity", "parallelism", "angularity")
_ALONG = 1e-3  # largest accepted sine of the angle between parallel directions
_SAME_LENGTH = 1e-6  # [m] largest accepted difference from a nominal length


@dataclass(frozen=True)
class Datum:
    """Datum, which is a feature relative to which other features are measured.

    Attributes:
        frame: name of the frame.
        shape: one of :data:`HELD`. A guide is an axis that also constrains the rotation
            about itself.  A body constrains all components.
        axis: unit vector along the axis or normal in frame axes, (3,).
        at: centre of the feature in frame axes, (3,) [m].
        hole: size of a hole with maximum material condition, for example ``"12 H7"``;
            empty for other datums.
        hole_of: name of the fit or joint to which the hole belongs; see
            :attr:`Callout.hole_of`.
        extent: length of the hole [m] if the datum is datum A with maximum material
            condition and can therefore tilt; 0 for other datums.
    """

    frame: str
    shape: str = "axis"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    hole: str = ""
    hole_of: str = ""
    extent: float = 0.0


@dataclass(frozen=True, eq=False)
class Callout:
    """Tolerance callouts of a feature.

    Attributes:
        name: name of the feature, for example ``"leg1.bore on tube"``.
        feature: name of the frame.
        after: whether the feature is on the child body of the joint.
        datums: one to three datums in the order A, B, C.
        shape: one of :data:`SHAPES`.
        axis: unit vector along the axis or normal in frame axes, (3,).
        extent: length of a bore, side lengths of a face along its x and y axes, or
            diameter of a round face [m].
        widths: width of each zone [m], by the words in :data:`LOCATIONS` and
            :data:`ORIENTATIONS`.
        hole: size of a hole with maximum material condition, for example ``"12 H7"``;
            empty without this condition.
        direction: unit vector in frame axes, (3,); the direction of the zone width of
            an axis or of the first side of a face; None for all directions.
        length: distance from datum A and its symmetric tolerance [m], or None.
        general: general tolerance, for example ``"ISO 2768-mK"``, or empty.
        distribution: see :meth:`forcefit.assembly.callouts.zone.Zone.draw`.
        cp: process capability index of a normal distribution.
        at: centre of the feature in frame axes, (3,) [m].
        envelope: whether the length tolerance applies to the entire face according to
            the envelope principle, not only to its centre.
        hole_of: name of the fit or joint to which the hole belongs. Features with the
            same name have the same hole size.
    """

    name: str
    feature: str
    datums: tuple[Datum, ...]
    after: bool = False
    shape: str = "axis"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    extent: tuple[float, ...] = ()
    widths: Mapping[str, float] = field(default_factory=dict)
    hole: str = ""
    direction: tuple[float, float, float] | None = None
    length: tuple[float, float] | None = None
    general: str = ""
    distribution: str = "uniform"
    cp: float = 1.0
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    envelope: bool = False
    hole_of: str = ""

    @property
    def words(self) -> str:
        """Types of the callouts, for example ``"position and perpendicularity"``."""
        found = [*self.widths, *(["length"] if self.length else [])]
        found += ["general tolerance"] if self.general else []
        return " and ".join(found)

    @property
    def first_width(self) -> float:
        """Width of the first zone, or symmetric tolerance of the length [m]."""
        if self.widths:
            return next(iter(self.widths.values()))
        return self.length[1] if self.length else 1.0

    @property
    def axes(self) -> NDArray:
        """Axes of the feature as columns in frame axes, (3, 3); z is ``axis``."""
        if self.shape == "plane" and self.direction is not None:
            x, z = np.array(self.direction), np.array(self.axis)
            return np.column_stack([x, np.cross(z, x), z])
        return axes_along(self.axis)


def axes_along(axis: tuple[float, float, float]) -> NDArray:
    """Return axes as columns, (3, 3), with z along a unit vector."""
    z = np.array(axis)
    if np.array_equal(z, [0.0, 0.0, 1.0]):
        return np.eye(3)
    x = np.eye(3)[int(np.argmin(abs(z)))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def zone_of(callout: Callout, offset: NDArray, datum_axis: NDArray | None) -> Zone:
    """Return the tolerance zone of a feature relative to its datums.

    Args:
        callout: callouts of the feature.
        offset: vector from datum A to the feature in feature axes, (3,) [m].
        datum_axis: unit vector along the axis or normal of datum A in feature axes,
            (3,); None if datum A is a point.

    Returns:
        Intersection of the zones of all callouts, in feature axes.

    Raises:
        BadInput: a callout contradicts the nominal geometry.
    """
    _check_coaxial(callout, offset, datum_axis)
    zones = [_zone(callout, kind, width) for kind, width in callout.widths.items()]
    away = _away(callout.shape, offset, datum_axis)
    distance = float(np.linalg.norm(away))
    if callout.length:
        nominal, tolerance = callout.length
        if abs(distance - nominal) > _SAME_LENGTH:
            found = f"found a length of {nominal * 1e3:g} mm"
            raise BadInput(
                f"{found}, expected the length at home, {distance * 1e3:g} mm"
            )
        if distance < _SAME_LENGTH:
            fault = "found a length to a coincident datum"
            raise BadInput(f"{fault}, expected a nonzero distance from datum A")
        if callout.envelope:
            zones.append(_face_within(callout, 2 * tolerance))
        else:
            zones.append(shift_along(tolerance, away / distance))
    if callout.general:
        zones += _general(callout, away, datum_axis)
    return intersection(zones)


def _check_coaxial(
    callout: Callout, offset: NDArray, datum_axis: NDArray | None
) -> None:
    """Check that axes with a coaxiality tolerance coincide in the home pose."""
    if "coaxiality" not in callout.widths:
        return
    expected = "expected coincident axes at home; use position for other axes"
    if datum_axis is not None and np.linalg.norm(datum_axis[:2]) > _ALONG:
        raise BadInput(
            f"found coaxiality to an axis in a different direction, {expected}"
        )
    apart = float(np.linalg.norm(offset[:2]))
    if apart > _SAME_LENGTH:
        raise BadInput(
            f"found coaxiality to an axis {apart * 1e3:g} mm away, {expected}"
        )


def _zone(callout: Callout, kind: str, width: float) -> Zone:
    """Return the zone of a callout with a given width [m]."""
    across = callout.direction
    direction = None if across is None else (np.array(across) @ callout.axes)[:2]
    location = kind in LOCATIONS
    if callout.shape == "point":
        return point_position(width)
    if callout.shape == "plane" and location:
        return _face_within(callout, width)
    if callout.shape == "plane":
        is_round = len(callout.extent) == 1
        leaning = round_plane_orientation if is_round else plane_orientation
        return leaning(width, *callout.extent)
    (length,) = callout.extent
    if not location:
        return axis_orientation(width, length, direction)
    bonus = 0.0
    if callout.hole and kind == "position":
        bonus = float(np.ptp(parse_hole(callout.hole)[1]))
    if direction is not None:
        return axis_position_along(width, length, direction, bonus)
    return axis_position(width, length, bonus)


def _face_within(callout: Callout, width: float) -> Zone:
    """Return the zone of a face between two planes at a given distance [m]."""
    is_round = len(callout.extent) == 1
    return (round_plane_position if is_round else plane_position)(
        width, *callout.extent
    )


def _away(shape: str, offset: NDArray, datum_axis: NDArray | None) -> NDArray:
    """Return the component of the offset to which a length tolerance applies, (3,).

    This component is normal to a plane or to parallel axes.
    """
    if shape == "plane":
        return np.array([0.0, 0.0, offset[2]])
    if datum_axis is not None and np.linalg.norm(datum_axis[:2]) < _ALONG:
        return np.array([offset[0], offset[1], 0.0])
    return offset


def _general(callout: Callout, away: NDArray, datum_axis: NDArray | None) -> list[Zone]:
    """Return the length and perpendicularity zones of a general tolerance."""
    linear, geometry = parse_general(callout.general)
    distance = float(np.linalg.norm(away))
    zones = [shift_along(linear_tolerance(distance, linear), away / distance)]
    square = datum_axis is not None and abs(datum_axis[2]) < _ALONG
    if geometry and square and callout.shape == "axis":
        if not callout.extent:
            fault = f"found class {geometry} for a bore without its length"
            raise BadInput(f'{fault}, expected also "extent", or no class {geometry}')
        width = perpendicularity_tolerance(callout.extent[0], geometry)
        zones.append(axis_orientation(width, callout.extent[0]))
    return zones


def check_orientation(
    callout: Callout, axis: NDArray, datum_axis: NDArray | None,
    same_shape: bool | None,
) -> None:  # fmt: skip
    """Check that orientation callouts agree with the nominal geometry.

    Args:
        callout: callouts of the feature.
        axis: unit vector along the axis or normal of the feature, (3,).
        datum_axis: unit vector along the axis or normal of datum A, (3,); None for a
            point.
        same_shape: whether the feature and datum A are both axes or both planes; None
            if datum A may be the face or the bore of a fixed joint.

    Raises:
        BadInput: the nominal angle contradicts the callout, or the datum is a point.
    """
    for kind in set(callout.widths) & set(ORIENTATIONS):
        if datum_axis is None:
            raise BadInput(
                f"found {kind} to a point, expected an axis or a plane as datum A"
            )
        cosine = abs(float(axis @ datum_axis))
        parallel = cosine > np.sqrt(1 - _ALONG**2)
        square = cosine < _ALONG
        known = [same_shape] if same_shape is not None else [True, False]
        fits = {
            "parallelism": [parallel if same else square for same in known],
            "perpendicularity": [square if same else parallel for same in known],
            "angularity": [True],
        }[kind]
        if not any(fits):
            angle = np.degrees(np.arccos(min(1.0, cosine)))
            raise BadInput(
                f"found {kind} although the angle between the axis or normal and that "
                f"of datum A is {angle:.4g} deg at home, expected "
                f"{_expected(kind, same_shape)} deg; use angularity for other angles"
            )


def _expected(kind: str, same_shape: bool | None) -> str:
    """Return the angle between axes or normals that a callout requires [deg]."""
    if same_shape is None:
        return "0 or 90"
    return "0" if (kind == "parallelism") == same_shape else "90"
