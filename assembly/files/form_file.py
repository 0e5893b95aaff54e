"""Flatness and cylindricity of the features of joints, which widen their clearance.

The form of a feature turns and shifts nothing, so it has no screw.  A face that is flat
within t, or a bore that is round within t, leaves up to t/2 more to the part in it.
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
    """Return the width of the form zone of a feature, 0 if it has none.

    Args:
        table: of the tolerances of the feature.
        shape: ``"axis"``, ``"plane"`` or ``"point"``.

    Returns:
        [m].

    Raises:
        BadInput: it is no width, or that of a feature of another shape.
    """
    width = 0.0
    for word, of_shape in FORMS.items():
        if not table.has(word):
            continue
        if shape != of_shape:
            article = "an" if shape == "axis" else "a"
            fault = f"found one of a feature that is {article} {shape}"
            raise table.bad(word, f"{fault}, expected none")
        width, at_most = parsed_value(table, word, parse_width)
        if at_most:
            raise table.bad(word, "found (M), expected a width alone")
    return width


def forms_of_joints(copies: Sequence[Copy]) -> dict[str, tuple[str, float]]:
    """Return the forms of the features of joints, by the names of the joints.

    Args:
        copies: of the legs, and the robot's own bodies.

    Returns:
        The word, and half the widths of both features together [m]: by how much they
        widen the clearance of the joint.

    Raises:
        BadInput: a width is none.
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
    """The tables of tolerances that state a form, and its word."""
    for copied in copies:
        owners = copied.table.tables("body")
        if not copied.prefix:
            owners = [*owners, copied.table]
        for owner in owners:
            for table in owner.tables("tolerance"):
                yield from ((copied, table, w) for w in FORMS if table.has(w))


def widen_clearance(joint: Table, word: str, added: float) -> None:
    """Add half the widths of form zones to the gap of a joint.

    Args:
        joint: its table, whose content is replaced.
        word: flatness or cylindricity.
        added: [m].

    Raises:
        BadInput: the joint has no gap between such features.
    """
    given = joint.content.get("clearance")
    wider = _widened(joint, given, word, added) if isinstance(given, dict) else None
    if wider is None:
        fault = f"found no gap that the {word} of its features could widen"
        raise joint.bad("clearance", f"{fault}, expected {_WITH_GAP[word]}")
    joint.content = joint.content | {"clearance": wider}


def _widened(
    joint: Table, given: dict[str, Any], word: str, added: float
) -> dict[str, Any] | None:
    """The clearance with a wider gap, None if it has none."""
    if word == "flatness":
        pad = given.get("pad")
        return (
            None
            if not isinstance(pad, dict)
            else (given | {"pad": _added(joint, pad, "gap", added)})
        )
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
    """A table with a larger length [m]; what is no length is left to its reader."""
    inner = Table(dict(given), joint.file, f"{joint.place}.clearance")
    without_units(inner, key, "length")
    value = inner.content.get(key)
    if isinstance(value, int | float) and not isinstance(value, bool):
        inner.content[key] = value + added
    return inner.content


def _looser(fit: Any, added: float) -> Any:
    """The fit with more clearance; what is no fit is left to its reader."""
    try:
        clearance_fit(fit)
    except (BadInput, TypeError):
        return fit
    return f"{fit.strip()} + {added * 1e6:.6g} um"
