"""Clearance of a joint of a robot file of ``format = 2``: bounds, or contacts."""

from assembly.drawing.contacts import Contact, bore
from assembly.drawing.drawing import FREE_ROWS
from assembly.files.joint_file import read_bounds
from assembly.files.written_units import without_units
from assembly.model.clearance import BOUNDS, CONES
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.robot import Clearance
from forcefit.inputs.table import Table

_ANGLES = ("tilt", "spin")
_Clearance = tuple[Clearance | None, tuple[Contact, ...]]


def read_drawn_clearance(table: Table, kind: str, slides: bool) -> _Clearance:
    """The ``clearance`` table of a joint or of a bearing.

    Args:
        table: of the joint.
        kind: its type; that of a universal joint's bearing is ``"revolute"``.
        slides: whether it is passive and prismatic.

    Returns:
        The bounds of its own frame, None if there are none; and its contacts.

    Raises:
        BadInput: a rule of the format is broken.
    """
    if not table.has("clearance"):
        return None, ()
    given = table.table("clearance")
    inner = Table(dict(given.content), given.file, given.place)
    for key in (*BOUNDS, "length"):
        without_units(inner, key, "angle" if key in _ANGLES else "length")
    bounds = read_bounds(inner, slides)
    found: _Clearance = bounds, ()
    if inner.has("length"):
        found = _in_bore(inner, kind, bounds)
    inner.finish()
    _refuse_free(inner, found[0], kind)
    return found


def _in_bore(table: Table, kind: str, bounds: Clearance) -> _Clearance:
    """The bounds without ``radial``, and the contacts of a bore with it."""
    if not {0, 1, 3, 4}.isdisjoint(FREE_ROWS[kind]):
        fault = f"found the length of a bore on a {kind} joint"
        raise table.bad("length", f"{fault}, which has no bore; expected none")
    length = table.number("length", "m", above=0.0, largest=LARGEST_LENGTH)
    radial = table.number("radial", "m", least=0.0, largest=LARGEST_LENGTH)
    if bounds.tilt is not None:
        fault = 'found together with "length"'
        raise table.bad("tilt", f"{fault}, which bounds the tilt; expected one of them")
    kept = Clearance(axial=bounds.axial, spin=bounds.spin)
    return (None if kept == Clearance() else kept), bore(radial, length)


def _refuse_free(table: Table, bounds: Clearance | None, kind: str) -> None:
    """Reject bounds of the free motions of a joint of several freedoms."""
    free = set(FREE_ROWS[kind])
    for key, rows in zip(BOUNDS, CONES, strict=True):
        given = bounds is not None and getattr(bounds, key) is not None
        if len(free) > 1 and given and not free.isdisjoint(rows):
            fault = f"found a bound of a free motion of a {kind} joint"
            raise table.bad(key, f"{fault}, expected none")
