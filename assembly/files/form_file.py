"""Flatness and cylindricity tolerances, which increase joint clearances.

A form deviation neither rotates nor displaces a feature.  If the flatness of a face or
the cylindricity of a bore is t, the gap to the mating part can increase by up to t/2.
"""

from collections.abc import Iterator, Sequence
from typing import Any

from forcefit.assembly.callouts.fits import clearance_fit
from forcefit.assembly.callouts.written_tolerances import parse_width
from forcefit.assembly.files.datum_file import parsed_value
from forcefit.assembly.files.drawn_body import Copy
from forcefit.assembly.files.written_units import without_units
from forcefit.inputs.table import BadInput, Table, quoted

FORMS = {"flatness": "plane", "cylindricity": "axis"}
_WITH_GAP = {
    "flatness": 'a pad, such as clearance = { pad = { gap = "10 um", .. } }',
    "cylindricity": "a radial clearance, a fit or bearings",
}


def read_form(table: Table, shape: str) -> float:
    """Return the width of the form tolerance zone of a feature.

    Args:
        table: table with the tolerances of the feature.
        shape: shape of the feature: ``"axis"``, ``"plane"`` or ``"point"``.

    Returns:
        Width of the zone [m], or 0 without a form tolerance.

    Raises:
        BadInput: the value is not a width, or the form tolerance does not apply to a
            feature of this shape.
    """
    width = 0.0
    for word, of_shape in FORMS.items():
        if not table.has(word):
            continue
        if shape != of_shape:
            article = "an" if shape == "axis" else "a"
            fault = f"found this tolerance for a feature that is {article} {shape}"
            raise table.bad(word, f"{fault}, expected none")
        width, at_most = parsed_value(table, word, parse_width)
        if at_most:
            raise table.bad(
                word, "found a width with (M), expected a width without (M)"
            )
    return width


def forms_of_joints(copies: Sequence[Copy]) -> dict[str, tuple[str, float]]:
    """Return the increases of joint clearances due to form tolerances.

    Args:
        copies: copies of the legs, and the bodies outside legs.

    Returns:
        ``"flatness"`` or ``"cylindricity"`` and the increase of the clearance [m], by
        joint name.  The increase is half the sum of the zone widths of both features.

    Raises:
        BadInput: the text of a width is invalid.
    """
    tables = [(c, t) for c in copies for t in c.table.tables("joint")]
    names = {c.prefix + str(t.content.get("name")) for c, t in tables}
    found: dict[str, tuple[str, float]] = {}
    for copied, table, word in _with_form(copies):
        feature = str(table.content.get("feature"))
        table.place = f"tolerance of {quoted(feature)}"
        width, _ = parsed_value(table, word, parse_width)
        inner = copied.prefix + feature
        joint = inner if inner in names else feature
        found[joint] = word, found.get(joint, (word, 0.0))[1] + width / 2
    return found


def _with_form(copies: Sequence[Copy]) -> Iterator[tuple[Copy, Table, str]]:
    """Yield the tolerance tables that contain a form tolerance, and its key."""
    for copied in copies:
        owners = copied.table.tables("body")
        if not copied.prefix:
            owners = [*owners, copied.table]
        for owner in owners:
            for table in owner.tables("tolerance"):
                yield from ((copied, table, w) for w in FORMS if table.has(w))


def widen_clearance(joint: Table, word: str, added: float) -> None:
    """Increase the gap in a joint due to form tolerances.

    Args:
        joint: table of the joint, which is modified in place.
        word: ``"flatness"`` or ``"cylindricity"``.
        added: increase of the gap [m].

    Raises:
        BadInput: the joint has no gap to which this form tolerance applies.
    """
    given = joint.content.get("clearance")
    wider = _widened(joint, given, word, added) if isinstance(given, dict) else None
    if wider is None:
        fault = f"found no gap that is affected by the {word} of its features"
        raise joint.bad("clearance", f"{fault}, expected {_WITH_GAP[word]}")
    joint.content = joint.content | {"clearance": wider}


def _widened(
    joint: Table, given: dict[str, Any], word: str, added: float
) -> dict[str, Any] | None:
    """Return the clearance with an increased gap, or None without a gap."""
    if word == "flatness":
        pad = given.get("pad")
        if not isinstance(pad, dict):
            return None
        if "fit" in pad:
            return given | {"pad": pad | {"fit": _looser(pad["fit"], added)}}
        return given | {"pad": _added(joint, pad, "gap", added)}
    if "fit" in given:
        return given | {"fit": _looser(given["fit"], added)}
    if "radial" in given:
        return _added(joint, given, "radial", added)
    bearings = given.get("bearings")
    if not isinstance(bearings, list):
        return None
    return given | {
        "bearings": [
            _widened(joint, one, word, added) or one if isinstance(one, dict) else one
            for one in bearings
        ]
    }


def _added(
    joint: Table, given: dict[str, Any], key: str, added: float
) -> dict[str, Any]:
    """Increase a length in a table [m]; invalid values are not changed."""
    inner = Table(dict(given), joint.file, f"{joint.place}.clearance")
    without_units(inner, key, "length")
    value = inner.content.get(key)
    if isinstance(value, int | float) and not isinstance(value, bool):
        inner.content[key] = value + added
    return inner.content


def _looser(fit: Any, added: float) -> Any:
    """Increase the clearance of a fit; invalid values are not changed."""
    try:
        clearance_fit(fit)
    except (BadInput, TypeError):
        return fit
    return f"{fit.strip()} + {added * 1e6:.6g} um"
