"""Reading of ``[[tolerance]]`` tables, which define tolerance callouts in robot files.

A feature is a frame in a file of format 1, and a joint of a body in a file of format 2.
See ``docs/drawing_tolerances.md``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from forcefit.assembly.callouts.callout import (
    LOCATIONS,
    ORIENTATIONS,
    SHAPES,
    Callout,
    Datum,
)
from forcefit.assembly.callouts.fits import parse_hole
from forcefit.assembly.callouts.general_tolerances import parse_general
from forcefit.assembly.callouts.written_tolerances import (
    parse_length,
    parse_width,
    within_envelope,
)
from forcefit.assembly.callouts.zone import DISTRIBUTIONS
from forcefit.assembly.drawing.drawing import DrawnBody, DrawnCallout, DrawnJoint
from forcefit.assembly.files.datum_file import (
    Z_AXIS,
    Vector,
    check_frame,
    frame_datums,
    joint_datums,
    parsed_value,
    read_direction,
    read_point,
)
from forcefit.assembly.files.drawn_body import Copy
from forcefit.assembly.files.form_file import FORMS, read_form
from forcefit.assembly.model.robot import BASE
from forcefit.inputs.table import BadInput, Table, describe, nearest, quoted

_ZONES = (*LOCATIONS, *ORIENTATIONS, "length", "general")
_LARGEST_CP = 5.0
# largest accepted cosine of the angle between perpendicular directions
_ACROSS = 1e-3
_NOT_ACROSS = "found a direction that is not perpendicular to the axis, expected 90 deg"
# number of lengths in the key ``extent``, by shape of the feature
_SIZES = {"axis": 1, "plane": 2, "point": 0}
_EXTENTS = {
    "axis": 'the length of the bore, such as "20 mm"',
    "plane": 'two sizes of the face, such as ["40 mm", "30 mm"], or "diameter"',
}
# keys that are not permitted, by shape of the feature
_EXCLUDED = {
    "axis": ("profile",),
    "plane": ("coaxiality",),
    "point": ("coaxiality", "profile", *ORIENTATIONS),
}


def read_frame_callouts(root: Table, frames: list[str]) -> tuple[Callout, ...]:
    """Read the callouts in a file with frames.

    Args:
        root: root table of the file.
        frames: names of the frames.

    Returns:
        Callouts in the order of the file.  They are not checked against the geometry.

    Raises:
        BadInput: the file is invalid.
    """
    found = []
    for table in root.tables("tolerance"):
        feature = table.text("feature", expected="the name of a frame")
        table.place = f"tolerance of {quoted(feature)}"
        check_frame(table, "feature", feature, frames)
        for word in FORMS:
            if table.has(word):
                fault = "found in a file with frames, expected half its width added"
                raise table.bad(word, f"{fault} to the clearance of the frame")
        datums = frame_datums(table, frames)
        shape = table.choice("shape", SHAPES, "axis")
        name = table.text("name", feature)
        after = table.boolean("after", False)
        axis = read_direction(table, "axis") or Z_AXIS
        callout = _callout(table, name, feature, datums, shape, after, axis)
        hole_of = table.text("hole_of", feature) if callout.hole else ""
        found.append(replace(callout, at=read_point(table), hole_of=hole_of))
        table.finish()
    return tuple(found)


def read_drawn_callouts(
    copied: Copy, bodies: list[DrawnBody], joints: list[DrawnJoint]
) -> Iterator[DrawnCallout]:
    """Yield the callouts of the bodies in a copy of a leg, or outside legs.

    Args:
        copied: copy of a leg, or the bodies outside legs.
        bodies: all bodies of the robot.
        joints: all joints of the robot.

    Yields:
        Callouts whose features and datums are joints.  Directions are in base axes in
        the home pose.

    Raises:
        BadInput: the file is invalid.
    """
    owners = [(copied.prefix + t.content["name"], t)
              for t in copied.table.tables("body")]  # fmt: skip
    if not copied.prefix:
        owners.append((BASE, copied.table))
    for body, owner in owners:
        for table in owner.tables("tolerance"):
            drawn = _drawn(table, copied, body, joints)
            if drawn is not None:
                yield drawn


def _drawn(
    table: Table, copied: Copy, body: str, joints: list[DrawnJoint]
) -> DrawnCallout | None:
    """Read a callout of a body feature; return None if it has only a form tolerance."""
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
    shape = {"planar": "plane", "spherical": "point"}.get(feature.kind, "axis")
    form = read_form(table, shape)
    if form and not any(table.has(word) for word in _ZONES):
        for key in [k for k in table.content if k not in ("feature", "name", *FORMS)]:
            fault = "found this key for a feature that has only a form tolerance"
            raise table.bad(key, f"{fault}, expected none")
        return None
    datums = joint_datums(table, feature.name, find)
    name = copied.prefix + table.text("name", f"{given} on {short}")
    callout = _callout(table, name, feature.name, tuple(datums), shape, False, None)
    table.finish()
    _check_form(table, form, callout.widths)
    direction = callout.direction
    if direction is not None:
        direction = tuple((copied.T[:3, :3] @ direction).tolist())
        _check_direction(table, direction, feature, body)
    return DrawnCallout(body, callout, direction)


def _check_direction(
    table: Table, direction: Vector, feature: DrawnJoint, body: str
) -> None:
    """Check that a direction is perpendicular to the axis of a bore."""
    if feature.kind == "planar":
        fault = "found a direction for a face, whose sides are parallel to x and y"
        raise table.bad("direction", f"{fault} of the joint; expected none")
    second = feature.kind == "universal" and body == feature.second
    axis = feature.axis2 if second else feature.axis
    if abs(float(np.dot(direction, axis))) > _ACROSS:
        raise table.bad("direction", _NOT_ACROSS)


def _callout(
    table: Table, name: str, feature: str, datums: tuple[Datum, ...], shape: str,
    after: bool, axis: Vector | None,
) -> Callout:  # fmt: skip
    """Read the keys of a callout that both file formats have in common."""
    if len({replace(d, hole="", hole_of="", extent=0.0) for d in datums}) < len(datums):
        names = [datum.frame for datum in datums]
        raise table.bad("datums", f"found {names}, expected each datum once")
    widths, hole = _widths(table, shape)
    extent = _extent(table, shape, widths)
    envelope = within_envelope(table.content.get("length"))
    across = _across(table, axis)
    if across is not None and (shape == "point" or not (widths or envelope)):
        fault = "a point" if shape == "point" else "a feature without a zone"
        raise table.bad("direction", f"found a direction for {fault}, expected none")
    distribution = table.choice("distribution", DISTRIBUTIONS, "uniform")
    if table.has("cp") and distribution == "uniform":
        expected = 'expected distribution = "normal" or "truncated"'
        raise table.bad("cp", f"found cp with a uniform distribution, {expected}")
    length = general = None
    if table.has("length"):
        length = parsed_value(table, "length", parse_length)
    if envelope and shape != "plane":
        fault = "found (E) for a feature that is not a face"
        raise table.bad("length", f"{fault}, expected none")
    if envelope and not extent:
        raise table.bad("extent", f"missing; expected {_EXTENTS[shape]}")
    if table.has("general"):
        parsed_value(table, "general", parse_general)
        general = table.text("general")
    if not (widths or length or general):
        words = " | ".join(_ZONES)
        raise table.bad("", f"found no tolerance, expected one of {words}")
    return Callout(
        name, feature, datums, after, shape, axis or Z_AXIS, extent, widths, hole,
        across, length, general or "", distribution,
        table.number("cp", "", 1.0, above=0.0, largest=_LARGEST_CP), envelope=envelope,
    )  # fmt: skip


def _widths(table: Table, shape: str) -> tuple[dict[str, float], str]:
    """Return the zone widths and the size of a hole with maximum material condition."""
    widths: dict[str, float] = {}
    used = False
    hole = table.text("hole", "") if table.has("hole") else ""
    if hole:
        parsed_value(table, "hole", parse_hole)
    for word in (*LOCATIONS, *ORIENTATIONS):
        if not table.has(word):
            continue
        if word in _EXCLUDED[shape]:
            article = "an" if shape == "axis" else "a"
            fault = f"found this zone for a feature that is {article} {shape}"
            raise table.bad(word, f"{fault}, expected none")
        widths[word], at_most = parsed_value(table, word, parse_width)
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
    """Check that orientation zones are narrower than the location zone."""
    located = [widths[w] for w in LOCATIONS if w in widths]
    for word in ORIENTATIONS:
        if word in widths and located and not widths[word] < min(located):
            found = f"found {widths[word] * 1e3:g} mm"
            expected = f"less than that of the location, {min(located) * 1e3:g} mm"
            raise table.bad(word, f"{found}, expected {expected}")


def _check_form(table: Table, form: float, widths: Mapping[str, float]) -> None:
    """Check that the form zone is narrower than all other zones of the feature."""
    least = min(widths.values(), default=1.0)
    if form and not form < least:
        word = next(word for word in FORMS if table.has(word))
        name = next(word for word, width in widths.items() if width == least)
        expected = f"less than the {name}, {least * 1e3:g} mm"
        raise table.bad(word, f"found {form * 1e3:g} mm, expected {expected}")


def _extent(table: Table, shape: str, widths: dict[str, float]) -> tuple[float, ...]:
    """Return the length of a bore or the side lengths of a face [m]."""
    if table.has("diameter"):
        return _diameter(table, shape)
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


def _diameter(table: Table, shape: str) -> tuple[float, ...]:
    """Return the diameter of a round face [m]."""
    if shape != "plane":
        article = "an" if shape == "axis" else "a"
        fault = f"found for a feature that is {article} {shape}, expected none"
        raise table.bad("diameter", f"{fault}; only a face has a diameter")
    if table.has("extent"):
        fault = 'found together with "extent", the side lengths of a rectangular face'
        raise table.bad("diameter", f"{fault}; expected only one of them")
    value = table.content["diameter"]
    try:
        return (parse_width(value)[0],)
    except BadInput:
        fault = f"found {describe(value)}"
        raise table.bad(
            "diameter", f'{fault}, expected a diameter such as "40 mm"'
        ) from None


def _across(table: Table, axis: Vector | None) -> Vector | None:
    """Return the direction in which the zone widths are measured, or None."""
    direction = read_direction(table, "direction")
    if direction is not None and axis is not None:
        if abs(float(np.dot(direction, axis))) > _ACROSS:
            raise table.bad("direction", _NOT_ACROSS)
    return direction
