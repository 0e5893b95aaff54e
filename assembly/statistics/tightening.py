"""Tiles of a report on the errors and clearances with the largest effect."""

from collections.abc import Mapping
from typing import Any

from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.statistics.ranking import leaders, named_together, ranked
from forcefit.page.page import Tile
from forcefit.page.tables import Value

_NAMED = 3  # largest number of names in a tile


def tightening_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on clearances, most important errors and tolerances to tighten.

    Args:
        summary: result of :func:`forcefit.assembly.statistics.summary.summarise`.

    Returns:
        The tiles. Without the importance of errors, there are no tiles on errors.
    """
    tiles = _clearance_tiles(summary)
    broken, key = summary["perfect_parts_break"], _deciding(summary)
    shares = ranked(summary, key)
    names: list[str] = []
    if shares:
        ranks = summary["importance"]["quantities"][key]["rank"]
        names = named_together(
            sorted(leaders(ranks), key=[name for name, _ in shares].index), ranks
        )
        largest, (value, *_) = shares[0]
        each = "" if names[0] == largest else " each"
        note = f"fraction of the {key}'s variance, including interactions."
        if len(names) > 1:
            note = (
                f"{note[:-1]}; the order of these errors is unknown: {_listed(names)}."
            )
        answer = f"{names[0]}: {100 * value:.0f} %{each}"
        tiles.append(Tile("Governing errors", [answer], [note]))
    if broken:
        tiles.append(_broken_tile(broken))
    elif summary.get("within_limits", {}).get("probability") == 1.0:
        note = f"all {summary['draws']} draws meet all limits."
        tiles.append(Tile("Tolerance to tighten", ["nothing"], [note]))
    elif names:
        note = "the order of these errors is unknown." if len(names) > 1 else ""
        tiles.append(Tile("Tolerance to tighten", [_listed(names)], [note]))
    return tiles


def _deciding(summary: Mapping[str, Any]) -> str:
    """Return the quantity whose limit is exceeded most often."""
    exceeds = sorted(
        summary["exceeds"], key=lambda k: -summary["exceeds"][k]["probability"]
    )
    order = [k for k in exceeds if summary["exceeds"][k]["probability"] > 0.0]
    known = (k for k in (*order, "translation", "energy") if ranked(summary, k))
    return next(known, "translation")


def _clearance_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return a tile on the pose error due to clearances alone."""
    parts = summary["perfect_parts"]
    answer: list[str | Value] = []
    for key in ("rotation", "translation"):
        one = parts.get(key, {})
        if one.get("reached"):
            answer += [" and ", Value(one["reached"], one["unit"], 3)]
    if not answer:
        return []
    largest = next(iter(parts.get("translation", {}).get("clearances", {})), "")
    note = f"without geometric errors; main contribution: {largest}." if largest else ""
    loads = " and loads" if summary.get("load") else ""
    return [
        Tile(
            f"Clearances{loads} alone",
            answer[1:],
            [note or "without geometric errors."],
        )
    ]


def _broken_tile(broken: Mapping[str, Any]) -> Tile:
    """Return a tile for a limit that is exceeded without geometric errors."""
    key, one = next(iter(broken.items()))
    largest = next(iter(one.get("clearances", {})), "")
    note: list[str | Value] = [
        f"Without geometric errors, the {key} is ",
        Value(one["reached"], one["unit"], 4),
        ", limit ",
        Value(one["limit"], one["unit"], 4),
        ", so no tolerances of errors satisfy the limit.",
    ]  # fmt: skip
    if largest:
        note.append(f" First: {largest}.")
    what = "the clearances" if key in POSE_ERRORS else "the design or its loads"
    return Tile("Tolerance to tighten", [what], note)


def _listed(names: list[str]) -> str:
    """Return the first names, and the number of remaining names, as text."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
