"""Reading of datums, points and directions in ``[[tolerance]]`` tables."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from forcefit.assembly.callouts.callout import HELD, Datum
from forcefit.assembly.callouts.fits import parse_hole
from forcefit.assembly.callouts.written_tolerances import parse_width
from forcefit.assembly.drawing.drawing import DrawnJoint
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.inputs.table import BadInput, Table, describe, nearest, quoted

Parsed = TypeVar("Parsed")
Vector = tuple[float, float, float]
Z_AXIS = (0.0, 0.0, 1.0)
ORIGIN = (0.0, 0.0, 0.0)
# joint types whose feature on a body is one hole
_HOLES = ("revolute", "cylindrical")


def frame_datums(table: Table, frames: list[str]) -> tuple[Datum, ...]:
    """Return the datums of a feature in a file with frames.

    Raises:
        BadInput: a datum is invalid.
    """
    datums = tuple(_datum(table, value, frames) for value in _datum_list(table))
    for number, datum in enumerate(datums):
        if bool(datum.extent) != bool(datum.hole and number == 0):
            given = 'with "extent"' if datum.extent else 'without "extent"'
            expected = '"extent" exactly for a hole at maximum material as datum A'
            fault = f"found {quoted(datum.frame)} {given}; expected {expected}"
            raise table.bad("datums", fault)
    return datums


def joint_datums(
    table: Table, feature: str, find: Callable[[str, str], DrawnJoint]
) -> list[Datum]:
    """Return the datums of a feature in a file with bodies and joints.

    Args:
        table: table with the tolerances of the feature.
        feature: full name of the joint that is the feature.
        find: function that returns the joint for a name in the file.  Its second
            argument is the key that contains the name, for error messages.

    Returns:
        Datums, which are joints.  The text ``"B (M)"`` denotes datum B with maximum
        material condition.

    Raises:
        BadInput: a datum is invalid.
    """
    datums = []
    hole, extent = table.text("datum_hole", ""), 0.0
    if hole:
        parsed_value(table, "datum_hole", parse_hole)
    if table.has("datum_extent"):
        extent = _extent(table, "datum_extent")
    for number, value in enumerate(_datum_list(table)):
        if not isinstance(value, str):
            fault = f"found {describe(value)}, expected names of joints"
            raise table.bad("datums", fault)
        name, at_most = value, value.endswith(" (M)")
        if at_most:
            name = value.removesuffix("(M)").strip()
        joint = find(name, "datums")
        if joint.name == feature:
            fault = f"found {quoted(value)}, which is the feature itself"
            raise table.bad("datums", f"{fault}, expected a different joint")
        if at_most:
            _check_shifting(table, value, joint.kind, hole)
            if number == 0 and not extent:
                fault = f"found {quoted(value)} as datum A, which can tilt in the hole"
                expected = 'expected also "datum_extent", the length of this hole'
                raise table.bad("datums", f"{fault}; {expected}")
        datums.append(
            Datum(
                joint.name,
                hole=hole if at_most else "",
                extent=extent if at_most and number == 0 else 0.0,
            )  # fmt: skip
        )
    shifting = [datum.frame for datum in datums if datum.hole]
    if hole and len(shifting) != 1:
        fault = f"found a hole size, and {len(shifting)} datums with (M)"
        raise table.bad("datum_hole", f'{fault}; expected one, such as "B (M)"')
    if extent and not datums[0].hole:
        fault = "found without (M) at datum A"
        raise table.bad("datum_extent", f"{fault}; expected none")
    return datums


def _check_shifting(table: Table, value: str, kind: str, hole: str) -> None:
    """Check that a datum with maximum material condition is a hole with a size."""
    if kind not in _HOLES:
        fault = f"found {quoted(value)}, a {kind} joint"
        expected = f"expected (M) at a {' or '.join(_HOLES)} joint"
        raise table.bad("datums", f"{fault}; {expected}")
    if not hole:
        expected = 'expected also "datum_hole", such as datum_hole = "12 H7"'
        raise table.bad(
            "datums", f"found {quoted(value)} without a hole size, {expected}"
        )


def _datum_list(table: Table) -> list:
    """Return the list of one to three datums in a table."""
    value = table.require("datums", "names of features, A first")
    if not isinstance(value, list) or not 1 <= len(value) <= 3:
        fault = f"found {describe(value)}, expected a list of one to three names"
        raise table.bad("datums", fault)
    return value


def _datum(table: Table, value: Any, frames: list[str]) -> Datum:
    """Read a datum, which is specified by a frame name or a table."""
    if isinstance(value, dict):
        inner = Table(value, table.file, f"{table.place}.datums")
        name = inner.text("frame", expected="the name of a frame")
        shape = inner.choice("shape", HELD, "axis")
        axis, at = read_direction(inner, "axis") or Z_AXIS, read_point(inner)
        hole, hole_of = _hole_of_datum(inner, name, shape)
        extent = _extent(inner, "extent") if inner.has("extent") else 0.0
        inner.finish()
    else:
        if not isinstance(value, str):
            fault = f"found {describe(value)}, expected names of frames"
            raise table.bad("datums", fault)
        name, shape, axis, at, hole, hole_of = value, "axis", Z_AXIS, ORIGIN, "", ""
        extent = 0.0
    check_frame(table, "datums", name, frames)
    return Datum(name, shape, axis, at, hole, hole_of, extent)


def _extent(table: Table, key: str) -> float:
    """Return the length of a datum hole [m]."""
    length, at_most = parsed_value(table, key, parse_width)
    if at_most:
        raise table.bad(key, "found (M), expected a length without (M)")
    return length


def _hole_of_datum(table: Table, name: str, shape: str) -> tuple[str, str]:
    """Return the size and name of a datum hole with maximum material condition."""
    if not table.has("hole"):
        return "", ""
    if shape != "axis":
        fault = f"found a hole size for a datum of shape {shape}"
        raise table.bad("hole", f"{fault}, expected none")
    parsed_value(table, "hole", parse_hole)
    return table.text("hole"), table.text("hole_of", name)


def check_frame(table: Table, key: str, name: str, frames: list[str]) -> None:
    """Check that a frame with a given name exists."""
    if name not in frames:
        fault = f"found {quoted(name)}, expected the name of a frame"
        raise table.bad(key, fault + nearest(name, frames))


def read_point(table: Table) -> Vector:
    """Return the centre of a feature in the axes of its frame, (3,) [m]."""
    default = np.zeros(3)
    x, y, z = table.array("at", (3,), "m", default, largest=LARGEST_LENGTH).tolist()
    return x, y, z


def read_direction(table: Table, key: str) -> Vector | None:
    """Return a unit vector, or None if the key is absent."""
    if not table.has(key):
        return None
    vector = table.array(key, (3,), "direction", largest=LARGEST_LENGTH)
    size = float(np.linalg.norm(vector))
    if size < 1e-12:
        raise table.bad(key, "found a zero vector, expected a nonzero direction vector")
    x, y, z = (vector / size).tolist()
    return x, y, z


def parsed_value(table: Table, key: str, parse: Callable[[Any], Parsed]) -> Parsed:
    """Parse the value of a key by a function that raises an error if it is invalid."""
    try:
        return parse(table.content[key])
    except BadInput as error:
        raise table.bad(key, str(error)) from None
    except TypeError:  # the value is not a text
        fault = f"found {describe(table.content[key])}, expected a text"
        raise table.bad(key, fault) from None
