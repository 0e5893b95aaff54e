"""Report tiles that name the most influential error or clearance."""

from collections.abc import Mapping
from typing import Any

from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.statistics.ranking import leaders, named_together, ranked
from forcefit.page.page import Tile
from forcefit.page.tables import Value

_NAMED = 3  # largest number of contributors named in a tile


def tightening_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return tiles with results without errors, main contributor and advice to tighten.

    Args:
        summary: result of :func:`forcefit.assembly.statistics.summary.summarise`.

    Returns:
        The tiles, including tiles on errors if their importance is known.
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
        note = f"share of the {key}'s variance that involves it."
        if len(names) > 1:
            note = f"{note[:-1]}; these draws do not distinguish: {_listed(names)}."
        answer = f"{names[0]}: {100 * value:.0f} %{each}"
        tiles.append(Tile("Governing errors", [answer], [note]))
    if broken:
        tiles.append(_broken_tile(broken))
    elif summary.get("within_limits", {}).get("probability") == 1.0:
        note = f"all {summary['draws']} draws meet all limits."
        tiles.append(Tile("Tolerance to tighten", ["nothing"], [note]))
    elif names:
        note = "not distinguished by these draws." if len(names) > 1 else ""
        tiles.append(Tile("Tolerance to tighten", [_listed(names)], [note]))
    return tiles


def _deciding(summary: Mapping[str, Any]) -> str:
    """Return the quantity whose limit is exceeded most often (default translation)."""
    exceeds = sorted(
        summary["exceeds"], key=lambda k: -summary["exceeds"][k]["probability"]
    )
    order = [k for k in exceeds if summary["exceeds"][k]["probability"] > 0.0]
    known = (k for k in (*order, "translation", "energy") if ranked(summary, k))
    return next(known, "translation")


def _clearance_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on the pose error that clearances cause without errors."""
    parts = summary["perfect_parts"]
    answer: list[str | Value] = []
    for key in ("rotation", "translation"):
        one = parts.get(key, {})
        if one.get("reached"):
            answer += [" and ", Value(one["reached"], one["unit"], 3)]
    if not answer:
        return []
    largest = next(iter(parts.get("translation", {}).get("clearances", {})), "")
    note = f"of perfect parts; most of the translation: {largest}." if largest else ""
    loads = " and loads" if summary.get("load") else ""
    return [Tile(f"Clearances{loads} alone", answer[1:], [note or "of perfect parts."])]


def _broken_tile(broken: Mapping[str, Any]) -> Tile:
    """Return the tile with the advice to tighten clearances instead of errors."""
    key, one = next(iter(broken.items()))
    largest = next(iter(one.get("clearances", {})), "")
    note: list[str | Value] = [
        f"Perfect parts reach a {key} of ", Value(one["reached"], one["unit"], 4),
        ", limit ", Value(one["limit"], one["unit"], 4),
        ": no tolerance of the errors meets it.",
    ]  # fmt: skip
    if largest:
        note.append(f" First: {largest}.")
    what = "the clearances" if key in POSE_ERRORS else "the design or its loads"
    return Tile("Tolerance to tighten", [what], note)


def _listed(names: list[str]) -> str:
    """List the first names, followed by the number of remaining names."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
