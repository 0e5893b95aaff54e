"""Read ``locked_at``: the posture at which a fixed joint is bolted."""

from collections.abc import Mapping
from typing import Any

from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.kinematics.posture import POSE
from forcefit.assembly.model.frame import LEFT
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import Clearance, LockedAt
from forcefit.inputs.table import Table, describe

_EXPECTED = (
    '"home", { pose = { tx = .. } } or { joints = { NAME = .. } }, with left = '
    '"uniform" for a random position or "worst"'
)


def read_locked_at(
    table: Table, fixed: bool, clearance: Clearance | None
) -> tuple[Clearance | None, LockedAt | None]:
    """Return the operating clearance of a joint, and the pose at which it is bolted.

    Args:
        table: table of the joint.
        fixed: whether the joint is fixed.
        clearance: clearance specified in the table.

    Returns:
        The clearance and None if the table does not contain ``locked_at``.  Otherwise
        None, because a bolted joint has no clearance, and the pose together with the
        clearance before bolting.

    Raises:
        BadInput: the joint is not fixed or has no clearance, or the pose is invalid.
    """
    key = "locked_at"
    if not table.has(key):
        return clearance, None
    if not fixed or clearance is None:
        what = "a fixed joint without clearance" if fixed else "a joint that moves"
        fault = f"found {what}, expected a fixed joint with a clearance"
        raise table.bad(key, fault)
    value = table.content[key]
    if value == "home":
        return None, LockedAt(clearance)
    if not isinstance(value, dict) or {"pose", "joints"} <= set(value):
        raise table.bad(key, f"found {describe(value)}, expected {_EXPECTED}")
    inner = table.table(key)
    pose, joints = _numbers(inner, "pose", POSE), _numbers(inner, "joints", None)
    left = inner.choice("left", LEFT, "least")
    inner.finish()
    if not pose and not joints and set(value) != {"left"}:
        raise table.bad(key, f"found no coordinate, expected {_EXPECTED}")
    return None, LockedAt(clearance, pose, joints, left)


def _numbers(table: Table, key: str, names: tuple[str, ...] | None) -> dict[str, float]:
    """Return the coordinates in an inner table, or an empty dictionary."""
    if not table.has(key):
        return {}
    inner = table.table(key)
    numbers = {
        name: inner.number(name, "rad or m", largest=LARGEST_LENGTH)
        for name in (inner.content if names is None else names)
        if inner.has(name)
    }
    inner.finish()
    return numbers


def bolt_without_units(table: Table, kinds: Mapping[str, str]) -> None:
    """Convert texts such as ``"30 deg"`` in ``locked_at`` to numbers in m or rad.

    Args:
        table: table of a joint in a file of format 2, which is modified in place.
        kinds: type of each joint, by name.

    Raises:
        BadInput: a text is not a number with a unit of length or angle as required.
    """
    if not isinstance(table.content.get("locked_at"), dict):
        return
    bolt = table.table("locked_at")
    for key in ("pose", "joints"):
        if isinstance(bolt.content.get(key), dict):
            given = bolt.table(key)
            for name in given.content:
                shift = name[0] == "t" if key == "pose" else _slides(kinds, name)
                without_units(given, name, "length" if shift else "angle")


def _slides(kinds: Mapping[str, str], name: str) -> bool:
    """Return whether the coordinate of a joint is a length."""
    return kinds.get(name) == "prismatic"


def bolt_table(bolt: LockedAt) -> Any:
    """Return the value of ``locked_at`` for a robot file.

    Args:
        bolt: pose at which the joint is bolted, and its clearance before bolting.

    Returns:
        Table or text in the file format.
    """
    given = {"pose": bolt.pose, "joints": bolt.joints}
    table: dict[str, Any] = {k: dict(v) for k, v in given.items() if v}
    if bolt.left != "least":
        table["left"] = bolt.left
    return table or "home"
