"""Reading of joint clearances in robot files with ``format = 2``."""

from forcefit.assembly.callouts.fits import Fit
from forcefit.assembly.drawing.contacts import (
    Contact,
    bearings,
    fitted,
    fitted_guide,
    guide,
    pad,
)
from forcefit.assembly.drawing.drawing import FREE_ROWS
from forcefit.assembly.files.joint_file import fit_of, read_bounds
from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.model.clearance import BOUNDS, CONES
from forcefit.assembly.model.joint_names import BORE
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import Clearance
from forcefit.inputs.table import Table, describe, quoted

# [m] smallest length of a contact; the tilt increases with decreasing length
_LEAST_LENGTH = 1e-9
_ANGLES = ("tilt", "spin")
_Clearance = tuple[Clearance | None, tuple[Contact, ...]]


def read_drawn_clearance(table: Table, kind: str) -> _Clearance:
    """Read the ``clearance`` table of a joint or bearing.

    Args:
        table: table of the joint.
        kind: type of the joint; ``"revolute"`` for a bearing of a universal joint.

    Returns:
        Clearance bounds of the joint frame, or None, and the contacts of the joint.

    Raises:
        BadInput: the table is invalid.
    """
    if not table.has("clearance"):
        return None, ()
    given = table.table("clearance")
    inner = Table(dict(given.content), given.file, given.place)
    for key in (*BOUNDS, "length"):
        without_units(inner, key, "angle" if key in _ANGLES else "length")
    bounds = read_bounds(inner, kind)
    contacts = [key for key in _CONTACTS if inner.has(key)]
    if len(contacts) > 1:
        fault = f"found together with {quoted(contacts[0])}"
        raise inner.bad(contacts[1], f"{fault}, expected only one of them")
    if contacts not in ([], ["length"]) and inner.has("fit"):
        where = "each bearing" if contacts == ["bearings"] else f"the {contacts[0]}"
        fault = f"found together with {quoted(contacts[0])}, expected it in {where}"
        raise inner.bad("fit", fault)
    found: _Clearance = bounds, ()
    for key in contacts:
        found = _CONTACTS[key](inner, kind, bounds)
    inner.finish()
    _refuse_free(inner, found[0], kind)
    return found


def _in_bore(table: Table, kind: str, bounds: Clearance) -> _Clearance:
    """Return the axial and spin bounds of a joint, and the contacts in its bore."""
    _refuse_with(table, "length", ("tilt", "ball"))
    _refuse_without_shaft(table, "length", kind)
    half = _length(table, "length") / 2
    gap, fit = _gap(table)
    contacts = bearings((-half, gap), (half, gap), BORE)
    return _of_shaft(bounds), fitted(contacts, (fit, fit), ("", ""), 2 * half)


def _in_bearings(table: Table, kind: str, bounds: Clearance) -> _Clearance:
    """Return the axial and spin bounds of a joint, and the contacts in two bearings."""
    _refuse_with(table, "bearings", ("radial", "tilt", "ball"))
    _refuse_without_shaft(table, "bearings", kind)
    value = table.get("bearings")
    pair = isinstance(value, list) and len(value) == 2
    if not pair or not all(isinstance(one, dict) for one in value):
        fault = f"found {describe(value)}, expected two tables"
        raise table.bad("bearings", f"{fault} {{ z, radial }}")
    first, second = sorted(_bearing(table, k, one) for k, one in enumerate(value, 1))
    (z1, gap1, fit1, part1), (z2, gap2, fit2, part2) = first, second
    if z2 - z1 <= _LEAST_LENGTH:
        fault = f"found both bearings at z = {z1:g} m"
        raise table.bad("bearings", f"{fault}, expected different positions")
    contacts = bearings((z1, gap1), (z2, gap2))
    return _of_shaft(bounds), fitted(contacts, (fit1, fit2), (part1, part2), z2 - z1)


def _bearing(table: Table, number: int, content: dict) -> tuple[float, float, str, str]:
    """Return the position [m], radial clearance [m], fit and name of a bearing."""
    inner = Table(dict(content), table.file, f"{table.place}.bearings[{number}]")
    for key in ("z", "radial"):
        without_units(inner, key, "length")
    z = inner.number("z", "m", largest=LARGEST_LENGTH)
    gap, fit = _gap(inner)
    inner.finish()
    return z, gap, fit, f"bearing_{number}"


def _gap(table: Table, key: str = "radial") -> tuple[float, str]:
    """Return a gap [m], and the fit from which it is computed, or an empty text."""
    fit = fit_of(table)
    if fit is not None:
        if table.has(key):
            raise table.bad(key, 'found together with "fit", expected only one of them')
        return fit.mean_radial, fit.text
    return table.number(key, "m", least=0.0, largest=LARGEST_LENGTH), ""


def _of_shaft(bounds: Clearance) -> Clearance | None:
    """Return the bounds ``axial`` and ``spin``, or None if both are absent."""
    kept = Clearance(axial=bounds.axial, spin=bounds.spin)
    return None if kept == Clearance() else kept


def _refuse_without_shaft(table: Table, key: str, kind: str) -> None:
    """Check that a joint with a bore or bearings has a shaft."""
    if not {0, 1, 3, 4}.isdisjoint(FREE_ROWS[kind]):
        fault = f"found the clearance of a shaft on a {kind} joint"
        raise table.bad(key, f"{fault}, which has no shaft; expected none")


def _in_guide(table: Table, kind: str, bounds: Clearance) -> _Clearance:
    """Return the axial bound and the contacts of a linear guide."""
    _refuse_type(table, "guide", kind, "prismatic")
    _refuse_with(table, "guide", ("radial", "tilt", "spin", "ball"))
    inner = _sizes(table, "guide", ("gap", "length", "width", "height"))
    fits = _guide_fits(inner)
    x, y = _guide_gaps(inner) if fits is None else (fit.mean_radial for fit in fits)
    length, width, height = (_length(inner, k) for k in ("length", "width", "height"))
    inner.finish()
    if fits is None:
        return _of_shaft(bounds), guide((x, y), length, width, height)
    largest = fits[0].radial[1], fits[1].radial[1]
    contacts = guide((x, y), length, width, height, largest)
    names = fits[0].text, fits[1].text
    return _of_shaft(bounds), fitted_guide(contacts, names, length)


def _guide_gaps(inner: Table) -> tuple[float, float]:
    """Return the gaps of a guide along x and y [m]."""
    if not isinstance(inner.content.get("gap"), list):
        gap = inner.number("gap", "m", least=0.0, largest=LARGEST_LENGTH)
        return gap, gap
    x, y = inner.array("gap", (2,), "m", largest=LARGEST_LENGTH).tolist()
    if min(x, y) < 0:
        raise inner.bad("gap", f"found {min(x, y):g}, expected 2 numbers >= 0 [m]")
    return x, y


def _guide_fits(inner: Table) -> tuple[Fit, Fit] | None:
    """Return the fits of a guide along x and y, or None if gaps are specified."""
    value = inner.content.get("fit")
    if value is not None and inner.has("gap"):
        raise inner.bad("gap", 'found together with "fit", expected only one of them')
    if not isinstance(value, list):
        fit = fit_of(inner)
        return None if fit is None else (fit, fit)
    inner.has("fit")
    if len(value) != 2:
        expected = 'expected one fit, or two, such as ["40 H7/g6", "30 H7/g6"]'
        raise inner.bad("fit", f"found a list of length {len(value)}, {expected}")
    one, other = (fit_of(Table({"fit": v}, inner.file, inner.place)) for v in value)
    assert one is not None
    assert other is not None
    return one, other


def _on_pad(table: Table, kind: str, bounds: Clearance) -> _Clearance:
    """Return the remaining bounds of a joint and the contacts of its pad."""
    _refuse_type(table, "pad", kind, "planar")
    _refuse_with(table, "pad", ("axial", "tilt", "ball"))
    inner = _sizes(table, "pad", ("gap", "length", "width"))
    gap, fit = _gap(inner, "gap")
    length, width = (_length(inner, key) for key in ("length", "width"))
    inner.finish()
    return (None if bounds == Clearance() else bounds), pad(gap, length, width, fit)


_CONTACTS = {
    "length": _in_bore, "bearings": _in_bearings, "guide": _in_guide, "pad": _on_pad,
}  # fmt: skip


def _refuse_type(table: Table, key: str, kind: str, of_kind: str) -> None:
    """Check that the contacts are possible for the joint type."""
    if kind != of_kind:
        fault = f"found on a {kind} joint, expected none"
        raise table.bad(key, f"{fault}; only a {of_kind} joint has a {key}")


def _refuse_with(table: Table, key: str, others: tuple[str, ...]) -> None:
    """Check that contacts and bounds do not limit the same motion."""
    for other in others:
        if table.has(other):
            fault = f"found together with {quoted(key)}, which bounds the same motion"
            raise table.bad(other, f"{fault}; expected only one of them")


def _sizes(table: Table, key: str, keys: tuple[str, ...]) -> Table:
    """Return a table with texts such as ``"2 mm"`` converted to numbers in m."""
    given = table.table(key)
    inner = Table(dict(given.content), given.file, given.place)
    for name in keys:
        without_units(inner, name, "length")
    return inner


def _length(table: Table, key: str) -> float:
    """Return a dimension of a contact [m]."""
    return table.number(key, "m", above=_LEAST_LENGTH, largest=LARGEST_LENGTH)


def _refuse_free(table: Table, bounds: Clearance | None, kind: str) -> None:
    """Check that a compound joint has no bounds on its free motions."""
    free = set(FREE_ROWS[kind])
    for key, rows in zip(BOUNDS, CONES, strict=True):
        given = bounds is not None and getattr(bounds, key) is not None
        if len(free) > 1 and given and not free.isdisjoint(rows):
            fault = f"found a bound of a free motion of a {kind} joint"
            raise table.bad(key, f"{fault}, expected none")
