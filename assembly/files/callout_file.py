"""Tolerances of features in robot files: ``[[tolerance]]``.

In a file of frames, a feature is a frame.  In a file of bodies, a feature is a joint of
the body.  See ``docs/drawing_tolerances.md``.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from forcefit.assembly.callouts.callout import (
    HELD,
    LOCATIONS,
    ORIENTATIONS,
    SHAPES,
    Callout,
    Datum,
)
from forcefit.assembly.callouts.fits import parse_size
from forcefit.assembly.callouts.general_tolerances import parse_general
from forcefit.assembly.callouts.written_tolerances import parse_length, parse_width
from forcefit.assembly.callouts.zone import DISTRIBUTIONS
from forcefit.assembly.drawing.drawing import DrawnBody, DrawnCallout, DrawnJoint
from forcefit.assembly.files.drawn_body import Copy
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import BASE
from forcefit.inputs.table import BadInput, Table, describe, nearest, quoted

Parsed = TypeVar("Parsed")
Vector = tuple[float, float, float]
_Z = (0.0, 0.0, 1.0)
_ORIGIN = (0.0, 0.0, 0.0)
_LARGEST_CP = 5.0
_ACROSS = 1e-3  # largest cosine of two perpendicular directions
_NOT_ACROSS = "found a direction that is not perpendicular to the axis, expected 90 deg"
_SIZES = {"axis": 1, "plane": 2, "point": 0}  # count of numbers in "extent"
_EXTENTS = {
    "axis": 'the length of the bore, such as "20 mm"',
    "plane": 'two sizes of the face, such as ["40 mm", "30 mm"]',
}
# keys that a shape cannot have
_EXCLUDED = {
    "axis": ("profile",),
    "plane": ("coaxiality",),
    "point": ("coaxiality", "profile", *ORIENTATIONS),
}


def read_frame_callouts(root: Table, frames: list[str]) -> tuple[Callout, ...]:
    """Return the callouts of a file of frames.

    Args:
        root: root table of the file.
        frames: names of the frames.

    Returns:
        Callouts in the order of the file, not checked against the geometry.

    Raises:
        BadInput: the file violates a rule of the format.
    """
    found = []
    for table in root.tables("tolerance"):
        feature = table.text("feature", expected="the name of a frame")
        table.place = f"tolerance of {quoted(feature)}"
        _check_known(table, "feature", feature, frames)
        datums = tuple(_datum(table, value, frames) for value in _datum_list(table))
        shape = table.choice("shape", SHAPES, "axis")
        name = table.text("name", feature)
        after = table.boolean("after", False)
        axis = _direction(table, "axis") or _Z
        callout = _callout(table, name, feature, datums, shape, after, axis)
        found.append(replace(callout, at=_point(table)))
        table.finish()
    return tuple(found)


def read_drawn_callouts(
    copied: Copy, bodies: list[DrawnBody], joints: list[DrawnJoint]
) -> Iterator[DrawnCallout]:
    """Yield the callouts of the bodies in a copy of a leg, and of the base.

    Args:
        copied: a copy of a leg, or the bodies that belong to no leg.
        bodies: bodies of the whole robot.
        joints: joints of the whole robot.

    Yields:
        Callouts whose features and datums are joints; directions are in base axes in
        the home pose.

    Raises:
        BadInput: the file violates a rule of the format.
    """
    owners = [(copied.prefix + t.content["name"], t)
              for t in copied.table.tables("body")]  # fmt: skip
    if not copied.prefix:
        owners.append((BASE, copied.table))
    for body, owner in owners:
        for table in owner.tables("tolerance"):
            yield _drawn(table, copied, body, joints)


def _drawn(
    table: Table, copied: Copy, body: str, joints: list[DrawnJoint]
) -> DrawnCallout:
    """Return the callouts of one joint of a body."""
    here = {j.name: j for j in joints if body in (j.first, j.second)}
    short = body.removeprefix(copied.prefix)

    def find(name: str, key: str) -> DrawnJoint:
        for full in (copied.prefix + name, name):
            if full in here:
                return here[full]
        names = [n.removeprefix(copied.prefix) for n in here]
        fault = f"found {quoted(name)}, expected a joint of {quoted(short)}"
        raise table.bad(key, fault + nearest(name, names))

    given = table.text("feature", expected="the name of a joint of the body")
    table.place = f"tolerance of {quoted(given)} on {quoted(short)}"
    feature = find(given, "feature")
    datums = []
    for value in _datum_list(table):
        if not isinstance(value, str):
            fault = f"found {describe(value)}, expected names of joints"
            raise table.bad("datums", fault)
        datums.append(Datum(find(value, "datums").name))
    shape = {"planar": "plane", "spherical": "point"}.get(feature.kind, "axis")
    name = copied.prefix + table.text("name", f"{given} on {short}")
    callout = _callout(table, name, feature.name, tuple(datums), shape, False, None)
    table.finish()
    direction = callout.direction
    if direction is not None:
        direction = tuple((copied.T[:3, :3] @ direction).tolist())
        _check_direction(table, direction, feature, body)
    return DrawnCallout(body, callout, direction)


def _check_direction(
    table: Table, direction: Vector, feature: DrawnJoint, body: str
) -> None:
    """Raise BadInput if a direction is not perpendicular to the axis of a bore."""
    if feature.kind == "planar":
        fault = "found a direction for a face; its sides are along the joint's x and y"
        raise table.bad("direction", f"{fault}; expected none")
    second = feature.kind == "universal" and body == feature.second
    axis = feature.axis2 if second else feature.axis
    if abs(float(np.dot(direction, axis))) > _ACROSS:
        raise table.bad("direction", _NOT_ACROSS)


def _datum_list(table: Table) -> list:
    """Return the datums as written: at least one, at most three."""
    value = table.require("datums", "names of features, A first")
    if not isinstance(value, list) or not 1 <= len(value) <= 3:
        fault = f"found {describe(value)}, expected a list of one to three names"
        raise table.bad("datums", fault)
    return value


def _datum(table: Table, value: Any, frames: list[str]) -> Datum:
    """Return a datum from the name of a frame, or from a table with shape and axis."""
    if isinstance(value, dict):
        inner = Table(value, table.file, f"{table.place}.datums")
        name = inner.text("frame", expected="the name of a frame")
        shape = inner.choice("shape", HELD, "axis")
        axis, at = _direction(inner, "axis") or _Z, _point(inner)
        inner.finish()
    else:
        if not isinstance(value, str):
            fault = f"found {describe(value)}, expected names of frames"
            raise table.bad("datums", fault)
        name, shape, axis, at = value, "axis", _Z, _ORIGIN
    _check_known(table, "datums", name, frames)
    return Datum(name, shape, axis, at)


def _check_known(table: Table, key: str, name: str, frames: list[str]) -> None:
    """Raise BadInput if a name is not the name of a frame."""
    if name not in frames:
        fault = f"found {quoted(name)}, expected the name of a frame"
        raise table.bad(key, fault + nearest(name, frames))


def _callout(
    table: Table, name: str, feature: str, datums: tuple[Datum, ...], shape: str,
    after: bool, axis: Vector | None,
) -> Callout:  # fmt: skip
    """Return a callout from the keys that both formats have."""
    if len(set(datums)) < len(datums):
        names = [datum.frame for datum in datums]
        raise table.bad("datums", f"found {names}, expected each datum once")
    widths, hole = _widths(table, shape)
    extent = _extent(table, shape, widths)
    across = _across(table, axis)
    if across is not None and (shape == "point" or not widths):
        fault = "a point" if shape == "point" else "a feature without a zone"
        raise table.bad("direction", f"found a direction for {fault}, expected none")
    distribution = table.choice("distribution", DISTRIBUTIONS, "uniform")
    if table.has("cp") and distribution == "uniform":
        expected = 'expected distribution = "normal" or "truncated" with it'
        raise table.bad("cp", f"found a cp for a uniform distribution, {expected}")
    length = general = None
    if table.has("length"):
        length = _parsed(table, "length", parse_length)
    if table.has("general"):
        _parsed(table, "general", parse_general)
        general = table.text("general")
    if not (widths or length or general):
        words = " | ".join((*LOCATIONS, *ORIENTATIONS, "length", "general"))
        raise table.bad("", f"found no tolerance, expected one of {words}")
    return Callout(
        name, feature, datums, after, shape, axis or _Z, extent, widths, hole,
        across, length, general or "", distribution,
        table.number("cp", "", 1.0, above=0.0, largest=_LARGEST_CP),
    )  # fmt: skip


def _widths(table: Table, shape: str) -> tuple[dict[str, float], str]:
    """Return the widths of the zones, and the hole with maximum material condition."""
    widths: dict[str, float] = {}
    used = False
    hole = table.text("hole", "") if table.has("hole") else ""
    if hole:
        _parsed(table, "hole", parse_size)
    for word in (*LOCATIONS, *ORIENTATIONS):
        if not table.has(word):
            continue
        if word in _EXCLUDED[shape]:
            article = "an" if shape == "axis" else "a"
            fault = f"found for a feature that is {article} {shape}"
            raise table.bad(word, f"{fault}, expected none")
        widths[word], at_most = _parsed(table, word, parse_width)
        if at_most and (word != "position" or shape != "axis" or not hole):
            fault = 'found (M), expected only for the position of a bore with "hole"'
            raise table.bad(word, f'{fault}, such as hole = "12 H7"')
        used = used or at_most
    if hole and not used:
        expected = 'expected a position with (M), such as position = "0.05 mm (M)"'
        raise table.bad("hole", f"found a hole without (M), {expected}")
    _check_widths(table, widths)
    return widths, hole


def _check_widths(table: Table, widths: dict[str, float]) -> None:
    """Raise BadInput if an orientation zone is not smaller than the location zone."""
    located = [widths[w] for w in LOCATIONS if w in widths]
    for word in ORIENTATIONS:
        if word in widths and located and not widths[word] < min(located):
            found = f"found {widths[word] * 1e3:g} mm"
            expected = f"less than that of the location, {min(located) * 1e3:g} mm"
            raise table.bad(word, f"{found}, expected {expected}")


def _extent(table: Table, shape: str, widths: dict[str, float]) -> tuple[float, ...]:
    """Return the length [m] of a bore, or the side lengths [m] of a face."""
    count = _SIZES[shape]
    if not table.has("extent"):
        if widths and count:
            raise table.bad("extent", f"missing; expected {_EXTENTS[shape]}")
        return ()
    value = table.content["extent"]
    values = value if isinstance(value, list) else [value]
    if len(values) != count:
        expected = _EXTENTS.get(shape, "none for a point")
        raise table.bad("extent", f"found {describe(value)}, expected {expected}")
    try:
        return tuple(parse_width(v)[0] for v in values)
    except BadInput:
        fault = f"found {describe(value)}, expected {_EXTENTS[shape]}"
        raise table.bad("extent", fault) from None


def _across(table: Table, axis: Vector | None) -> Vector | None:
    """Return the unit vector of the zones' direction, perpendicular to a known axis."""
    direction = _direction(table, "direction")
    if direction is not None and axis is not None:
        if abs(float(np.dot(direction, axis))) > _ACROSS:
            raise table.bad("direction", _NOT_ACROSS)
    return direction


def _point(table: Table) -> Vector:
    """Return the middle of a feature [m] in its frame's axes."""
    default = np.zeros(3)
    x, y, z = table.array("at", (3,), "m", default, largest=LARGEST_LENGTH).tolist()
    return x, y, z


def _direction(table: Table, key: str) -> Vector | None:
    """Return a unit vector; None if the key is absent."""
    if not table.has(key):
        return None
    vector = table.array(key, (3,), "direction", largest=LARGEST_LENGTH)
    size = float(np.linalg.norm(vector))
    if size < 1e-12:
        raise table.bad(key, "found no direction, expected 3 numbers, not all 0")
    x, y, z = (vector / size).tolist()
    return x, y, z


def _parsed(table: Table, key: str, parse: Callable[[Any], Parsed]) -> Parsed:
    """Return the value of a key, parsed by a function that raises for wrong values."""
    try:
        return parse(table.content[key])
    except BadInput as error:
        raise table.bad(key, str(error)) from None
    except TypeError:  # the parser expected a text
        fault = f"found {describe(table.content[key])}, expected a text"
        raise table.bad(key, fault) from None


def callout_table(callout: Callout) -> dict[str, Any]:
    """Return the content of ``[[tolerance]]`` of a frames file, without defaults."""
    table: dict[str, Any] = {"feature": callout.feature}
    if callout.name != callout.feature:
        table["name"] = callout.name
    table["datums"] = [_datum_value(datum) for datum in callout.datums]
    if callout.after:
        table["after"] = True
    if callout.shape != "axis":
        table["shape"] = callout.shape
    if callout.axis != _Z:
        table["axis"] = list(callout.axis)
    if callout.at != _ORIGIN:
        table["at"] = list(callout.at)
    if callout.extent:
        table["extent"] = list(callout.extent)
    for word, width in callout.widths.items():
        at_most = callout.hole and word == "position"
        table[word] = f"{width!r} m (M)" if at_most else width
    if callout.hole:
        table["hole"] = callout.hole
    if callout.direction is not None:
        table["direction"] = list(callout.direction)
    if callout.length is not None:
        length, tolerance = callout.length
        table["length"] = f"{length!r} +- {tolerance!r} m"
    if callout.general:
        table["general"] = callout.general
    if callout.distribution != "uniform":
        table["distribution"] = callout.distribution
    if callout.cp != 1.0:
        table["cp"] = callout.cp
    return table


def _datum_value(datum: Datum) -> str | dict[str, Any]:
    """Return a datum as written in a file."""
    if datum == Datum(datum.frame):
        return datum.frame
    table = {"frame": datum.frame, "shape": datum.shape, "axis": list(datum.axis)}
    return table if datum.at == _ORIGIN else table | {"at": list(datum.at)}
