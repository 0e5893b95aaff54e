"""Reading of joints in robot files with ``format = 2``."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import (
    FREE_ROWS,
    DrawnJoint,
    JointNumbers,
    perpendicular,
)
from forcefit.assembly.files.bolt_file import read_locked_at
from forcefit.assembly.files.drawn_clearance import read_drawn_clearance
from forcefit.assembly.files.joint_file import (
    read_fit,
    read_joint_stiffness,
    read_pitch,
)
from forcefit.assembly.files.written_units import SCREW, without_units
from forcefit.assembly.model.largest import LARGEST, LARGEST_LENGTH
from forcefit.inputs.table import Table

ONE_FREEDOM = ("revolute", "prismatic", "helical")
_PARALLEL = 1e-3  # smallest accepted sine of the angle between the two axes
_KEYS = ("clearance", "joint_stiffness", "geometric_error", "tolerance")
_ROWS = ("RX", "RY", "RZ", "TX", "TY", "TZ")


def read_drawn_joint(table: Table, name: str, first: str, second: str) -> DrawnJoint:
    """Read a joint from its table.

    Args:
        table: table of the joint.
        name: full name of the joint.
        first: name of the first body.
        second: name of the second body.

    Returns:
        Joint of the leg in the file; its copies are transformed later.

    Raises:
        BadInput: the table is invalid.
    """
    kind = table.choice("type", FREE_ROWS)
    without_units(table, "pitch", "length")
    axis, across, axis2 = _axes(table, kind)
    without_units(table, "at", "length")
    actuated = table.boolean("actuated", False)
    one = kind in ONE_FREEDOM
    dimension, unit = ("length", "m") if kind == "prismatic" else ("angle", "rad")
    for key in ("position", "limits"):
        without_units(table, key, dimension)
    given = [k for k in ("position", "limits", "drive_stiffness") if table.has(k)]
    if not one and (actuated or given):
        key = "actuated" if actuated else given[0]
        names = " | ".join(f'"{name}"' for name in ONE_FREEDOM)
        fault = f"found on a {kind} joint, expected {names}"
        raise table.bad(key, fault)
    if "drive_stiffness" in given and not actuated:
        raise table.bad("drive_stiffness", "found a stiffness without actuated = true")
    joint = DrawnJoint(
        name, kind, first, second,
        at=table.array("at", (3,), "m", largest=LARGEST_LENGTH),
        axis=axis, across=across, axis2=axis2, actuated=actuated,
        position=table.number("position", unit, 0.0, largest=LARGEST_LENGTH),
        limits=_limits(table, unit), pitch=read_pitch(table, kind),
        numbers=_numbers(table, kind, actuated),
    )  # fmt: skip
    table.finish()
    return joint


def _axes(table: Table, kind: str) -> tuple[NDArray, NDArray, NDArray]:
    """Return unit vectors along ``axis``, the x axis of the joint, and ``axis2``."""
    needs = kind not in {"fixed", "spherical"}
    axis = _direction(table, "axis", needs)
    axis = np.array([0.0, 0.0, 1.0]) if axis is None else axis
    axis2 = _direction(table, "axis2", kind == "universal")
    if axis2 is None:
        across = perpendicular(axis)
        return axis, across, across
    if np.linalg.norm(np.cross(axis, axis2)) < _PARALLEL:
        raise table.bad(
            "axis2", 'found a direction parallel to "axis", expected a different one'
        )
    return axis, perpendicular(axis, axis2), axis2


def _direction(table: Table, key: str, needed: bool) -> NDArray | None:
    """Return a unit vector, (3,), or None if it is absent and optional."""
    if not needed and not table.has(key):
        return None
    without_units(table, key, "length")
    vector = table.array(key, (3,), "direction", largest=LARGEST_LENGTH)
    size = float(np.linalg.norm(vector))
    if size < 1e-12:
        raise table.bad(key, "found a zero vector, expected a nonzero direction vector")
    return np.asarray(vector / size)


def _limits(table: Table, unit: str) -> tuple[float, float] | None:
    """Return the minimum and maximum commanded coordinate, or None."""
    if not table.has("limits"):
        return None
    least, most = table.array("limits", (2,), unit, largest=LARGEST_LENGTH)
    if not least < most:
        fault = f"found [{least:g}, {most:g}], expected the smaller number first"
        raise table.bad("limits", fault)
    return float(least), float(most)


def _numbers(table: Table, kind: str, actuated: bool) -> tuple[JointNumbers, ...]:
    """Read the error, clearance and stiffness of a joint or of both bearings."""
    if kind != "universal":
        return (_one(table, kind, actuated),)
    for key in ("clearance", "geometric_error", "tolerance"):
        _refuse_count(table, key)
    bearings = []
    for which in (0, 1):
        content = {k: _bearing(table, k, which) for k in _KEYS if table.has(k)}
        place = f"{table.place}, {('first', 'second')[which]} bearing"
        bearings.append(_one(Table(content, table.file, place), "revolute", False))
    return tuple(bearings)


def _refuse_count(table: Table, key: str) -> None:
    """Check that a list has one value for each of the two bearings."""
    value = table.content.get(key)
    parts = dict if key == "clearance" else list
    if not isinstance(value, list) or not all(isinstance(v, parts) for v in value):
        return
    if len(value) != 2:
        fault = f"found a list of {len(value)}, expected one value for both bearings"
        raise table.bad(key, f"{fault}, or two values, [first, second]")


def _bearing(table: Table, key: str, which: int) -> Any:
    """Return the value for a bearing from ``[first, second]`` or a common value."""
    value = table.content[key]
    pair = isinstance(value, list) and len(value) == 2
    return value[which] if pair else value


def _one(table: Table, kind: str, actuated: bool) -> JointNumbers:
    """Read the error, clearance and stiffness of a joint or bearing."""
    for key in ("geometric_error", "tolerance"):
        without_units(table, key, SCREW)
    zero = np.zeros(6)
    error = table.array("geometric_error", (6,), "rad, m", zero, largest=LARGEST_LENGTH)
    clearance, contacts = read_drawn_clearance(table, kind)
    clearance, bolt = read_locked_at(table, kind == "fixed", clearance)
    return JointNumbers(
        clearance=clearance,
        contacts=contacts,
        stiffness=_stiffness(table, kind, actuated),
        error=error,
        tolerance=_tolerance(table),
        locked_at=bolt,
        fit="" if contacts else read_fit(table),
    )


def _tolerance(table: Table) -> NDArray | None:
    """Return the standard deviations of the geometric error, (6,), or None."""
    if not table.has("tolerance"):
        return None
    sigma = table.array("tolerance", (6,), "rad, m", largest=LARGEST_LENGTH)
    if sigma.min() < 0:
        fault = f"found the number {sigma.min():g}, expected 6 numbers >= 0 [rad, m]"
        raise table.bad("tolerance", fault)
    return sigma


def _stiffness(table: Table, kind: str, actuated: bool) -> NDArray | None:
    """Return the stiffness of a joint including its drive, (6, 6), or None."""
    free = FREE_ROWS[kind]
    if len(free) > 1:
        return _several_free(table, kind)
    own = free[0] if free else None
    K = read_joint_stiffness(table, None if actuated else own)
    if not table.has("drive_stiffness") or own is None:
        return K
    drive = table.number(
        "drive_stiffness", "N/m or N m/rad", above=0.0, largest=LARGEST
    )
    K = np.diag(np.full(6, np.inf)) if K is None else K
    if np.isfinite(K[own, own]):
        fault = f"found also {K[own, own]:g} as number {own + 1} of joint_stiffness"
        raise table.bad("drive_stiffness", f"{fault}, expected inf in that entry")
    K[own, own] = drive
    return K


def _several_free(table: Table, kind: str) -> NDArray | None:
    """Return the stiffness of a joint with several degrees of freedom, (6, 6)."""
    if not table.has("joint_stiffness"):
        return None
    free = list(FREE_ROWS[kind])
    value = copy_rows(table.content["joint_stiffness"])
    if isinstance(value, list) and len(value) == 6:
        for row in free:
            entries = value[row] if isinstance(value[row], list) else [value[row]]
            if any(entry != 0 for entry in entries):
                name = f"number {row + 1} ({_ROWS[row]})"
                fault = f"found a stiffness as {name}, along a free motion"
                raise table.bad("joint_stiffness", f"{fault}; expected 0")
            if isinstance(value[row], list):
                value[row][row] = np.inf
            else:
                value[row] = np.inf
    content = {"joint_stiffness": value}
    K = read_joint_stiffness(Table(content, table.file, table.place))
    if K is not None:
        K[free, free] = 0.0
    return K


def copy_rows(value: Any) -> Any:
    """Copy a list and its inner lists, or return another value unchanged."""
    if not isinstance(value, list):
        return value
    return [list(row) if isinstance(row, list) else row for row in value]
