"""Writing of callouts as ``[[tolerance]]`` tables in files of format 1."""

from typing import Any

from forcefit.assembly.callouts.callout import Callout, Datum
from forcefit.assembly.files.datum_file import ORIGIN, Z_AXIS


def callout_table(callout: Callout) -> dict[str, Any]:
    """Return the content of a ``[[tolerance]]`` table without default values."""
    table: dict[str, Any] = {"feature": callout.feature}
    if callout.name != callout.feature:
        table["name"] = callout.name
    table["datums"] = [_datum_table(datum) for datum in callout.datums]
    if callout.after:
        table["after"] = True
    if callout.shape != "axis":
        table["shape"] = callout.shape
    if callout.axis != Z_AXIS:
        table["axis"] = list(callout.axis)
    if callout.at != ORIGIN:
        table["at"] = list(callout.at)
    if callout.shape == "plane" and len(callout.extent) == 1:
        table["diameter"] = callout.extent[0]
    elif callout.extent:
        table["extent"] = list(callout.extent)
    for word, width in callout.widths.items():
        at_most = callout.hole and word == "position"
        table[word] = f"{width!r} m (M)" if at_most else width
    if callout.hole:
        table["hole"] = callout.hole
    if callout.hole_of not in ("", callout.feature):
        table["hole_of"] = callout.hole_of
    if callout.direction is not None:
        table["direction"] = list(callout.direction)
    if callout.length is not None:
        length, tolerance = callout.length
        table["length"] = f"{length!r} +- {tolerance!r} m"
        table["length"] += " (E)" * callout.envelope
    if callout.general:
        table["general"] = callout.general
    if callout.distribution != "uniform":
        table["distribution"] = callout.distribution
    if callout.cp != 1.0:
        table["cp"] = callout.cp
    return table


def _datum_table(datum: Datum) -> str | dict[str, Any]:
    """Return a datum in the format of robot files."""
    if datum == Datum(datum.frame):
        return datum.frame
    table: dict[str, Any] = {
        "frame": datum.frame, "shape": datum.shape, "axis": list(datum.axis)
    }  # fmt: skip
    if datum.at != ORIGIN:
        table["at"] = list(datum.at)
    if datum.hole:
        table |= {"hole": datum.hole, "hole_of": datum.hole_of}
    if datum.extent:
        table["extent"] = datum.extent
    return table
