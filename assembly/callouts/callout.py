"""The callouts of one feature on a drawing, and their common zone."""

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
# components of a screw that a datum of each shape constrains, in the datum's axes
HELD = {
    "axis": (0, 1, 3, 4),
    "plane": (0, 1, 5),
    "point": (3, 4, 5),
    "guide": (0, 1, 2, 3, 4),
    "body": (0, 1, 2, 3, 4, 5),
}
LOCATIONS = ("position", "coaxiality", "profile")
ORIENTATIONS = ("perpendicularity", "parallelism", "angularity")
_ALONG = 1e-3  # sine of the angle below which two directions count as parallel
_SAME_LENGTH = 1e-6  # [m] allowed difference between a stated and the nominal length


@dataclass(frozen=True)
class Datum:
    """A datum: a feature relative to which other features are measured.

    Attributes:
        frame: name of the frame.
        shape: one of :data:`HELD`. A guide is an axis that also constrains the rotation
            about itself; a body constrains all components.
        axis: (3,) unit vector of the axis or normal, in the frame's axes.
        at: (3,) [m] middle of the feature, in the frame's axes.
        hole: size of a hole that is a datum at maximum material, such as ``"12 H7"``:
            the larger the hole, the more the datum can shift.  Empty for other datums.
        hole_of: as for :attr:`Callout.hole_of`.
        extent: [m] length of a hole that is datum A at maximum material, so that the
            datum can tilt too; 0 for other datums.
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
    """The callouts of one feature of a body, at a joint or a frame.

    Attributes:
        name: name of the feature, such as ``"leg1.bore on tube"``.
        feature: name of the frame.
        after: whether the feature is on the body that the frame's joint moves; False
            for the body before the joint.
        datums: datums A, B, C in this order, at least one.
        shape: one of :data:`SHAPES`.
        axis: (3,) unit vector of the axis or the normal, in the frame's axes.
        extent: [m] length of a bore; the two sizes of a face along its x and y; or the
            diameter of a round face.
        widths: [m] width of each zone, by the words of :data:`LOCATIONS` and
            :data:`ORIENTATIONS`.
        hole: size of a hole whose position applies at maximum material, such as
            ``"12 H7"``; empty if it applies at every size.
        direction: (3,) unit vector across the axis along which the zones are measured,
            in the frame's axes; None for all directions.  For a face: the direction of
            its first size.
        length: [m] distance from datum A and its tolerance to each side, or None.
        general: general tolerance, such as ``"ISO 2768-mK"``, or empty.
        distribution: see :meth:`forcefit.assembly.callouts.zone.Zone.draw`.
        cp: capability index of a normal distribution.
        at: (3,) [m] middle of the feature, in the frame's axes.
        envelope: whether the whole face is within the limits of its length (envelope
            principle), instead of only its middle.
        hole_of: name of the fit or joint whose hole is at maximum material. All
            features with this name have the same hole size.
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
        """Names of the callouts, such as ``"position and perpendicularity"``."""
        found = [*self.widths, *(["length"] if self.length else [])]
        found += ["general tolerance"] if self.general else []
        return " and ".join(found)

    @property
    def first_width(self) -> float:
        """[m] width of the first zone, or the tolerance of the length to each side."""
        if self.widths:
            return next(iter(self.widths.values()))
        return self.length[1] if self.length else 1.0

    @property
    def axes(self) -> NDArray:
        """(3, 3) axes of the feature as columns, in the frame's axes; z is the axis."""
        if self.shape == "plane" and self.direction is not None:
            x, z = np.array(self.direction), np.array(self.axis)
            return np.column_stack([x, np.cross(z, x), z])
        return axes_along(self.axis)


def axes_along(axis: tuple[float, float, float]) -> NDArray:
    """Return (3, 3) axes as columns, z along a unit vector (identity if it is z)."""
    z = np.array(axis)
    if np.array_equal(z, [0.0, 0.0, 1.0]):
        return np.eye(3)
    x = np.eye(3)[int(np.argmin(abs(z)))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def zone_of(callout: Callout, offset: NDArray, datum_axis: NDArray | None) -> Zone:
    """Return the zone of a feature's deviation relative to its datums.

    Args:
        callout: callouts of the feature.
        offset: (3,) [m] vector from datum A to the feature, in the feature's axes.
        datum_axis: (3,) unit vector of the axis or normal of datum A, in the feature's
            axes; None if datum A is a point.

    Returns:
        The zone that is within the zones of all callouts, in the feature's axes.

    Raises:
        BadInput: a callout does not fit the nominal geometry.
    """
    _check_coaxial(callout, offset, datum_axis)
    zones = [_zone(callout, kind, width) for kind, width in callout.widths.items()]
    away = _away(callout.shape, offset, datum_axis)
    distance = float(np.linalg.norm(away))
    if callout.length:
        nominal, tolerance = callout.length
        if abs(distance - nominal) > _SAME_LENGTH:
            found = f"found a length of {nominal * 1e3:g} mm"
            raise BadInput(f"{found}, expected that at home, {distance * 1e3:g} mm")
        if distance < _SAME_LENGTH:
            fault = "found a length to a datum at the same place"
            raise BadInput(f"{fault}, expected a distance from datum A")
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
    """Reject coaxiality of axes that do not coincide at home."""
    if "coaxiality" not in callout.widths:
        return
    expected = "expected the same axis at home; position is for others"
    if datum_axis is not None and np.linalg.norm(datum_axis[:2]) > _ALONG:
        raise BadInput(f"found coaxiality to an axis in another direction, {expected}")
    apart = float(np.linalg.norm(offset[:2]))
    if apart > _SAME_LENGTH:
        raise BadInput(
            f"found coaxiality to an axis {apart * 1e3:g} mm away, {expected}"
        )


def _zone(callout: Callout, kind: str, width: float) -> Zone:
    """Return the zone of one callout with the given width [m]."""
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
    """Return the zone of a face between two planes with the given distance [m]."""
    is_round = len(callout.extent) == 1
    return (round_plane_position if is_round else plane_position)(
        width, *callout.extent
    )


def _away(shape: str, offset: NDArray, datum_axis: NDArray | None) -> NDArray:
    """Return the offset (3,) that a length limits: normal to an axis or a plane."""
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
            fault = f"found class {geometry} of a bore without its length"
            raise BadInput(f'{fault}, expected "extent" too, or no class {geometry}')
        width = perpendicularity_tolerance(callout.extent[0], geometry)
        zones.append(axis_orientation(width, callout.extent[0]))
    return zones


def check_orientation(
    callout: Callout, axis: NDArray, datum_axis: NDArray | None,
    same_shape: bool | None,
) -> None:  # fmt: skip
    """Reject perpendicularity or parallelism that contradicts the nominal geometry.

    Args:
        callout: callouts of the feature.
        axis: (3,) unit vector of the feature's axis or normal.
        datum_axis: (3,) unit vector of datum A in the same axes; None for a point.
        same_shape: whether both features are axes, or both are planes; None if datum A
            may be the face or the bore of a fixed joint.

    Raises:
        BadInput: the angle at home differs from the callout, or the datum is a point.
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
                f"found {kind} where axis or normal and that of datum A are at "
                f"{angle:.4g} deg at home, expected {_expected(kind, same_shape)} deg; "
                "angularity is for other angles"
            )


def _expected(kind: str, same_shape: bool | None) -> str:
    """Return the angle [deg] between axes or normals for a kind of orientation."""
    if same_shape is None:
        return "0 or 90"
    return "0" if (kind == "parallelism") == same_shape else "90"
