"""HTML report on tolerances, their limits, and the effect of clearances."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.assembly.statistics.clearance_positions import clearance_means
from forcefit.assembly.statistics.plot import NAMES
from forcefit.assembly.statistics.quantities import UNITS
from forcefit.page.charts import Axis, bars, grid
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table

_LISTED = 20  # largest number of rows in the table of errors
# relative difference below which two shares of the cost are treated as equal
_ALIKE = 0.01
_ASSUMED = (
    "Limits are checked only at the postures of the grid, not between them.",
    "Errors are independent and stay within their tolerances.",
    "The closure equations are linearised (small screws).",
)
_COST_LAWS = {
    "reciprocal": "sum of cost / tolerance [rad or m]",
    "logarithm": "minus the sum of cost times log tolerance [rad or m]",
}
_GOVERNED = {
    "reciprocal": "of the price",
    "logarithm": "of the saving by larger tolerances",
}


def tolerances_page(
    results: Mapping[str, Any], provenance: Provenance, pictures: Sequence[str] = ()
) -> str:
    """Format the results of ``assembly tolerances`` as an HTML page.

    Args:
        results: dictionary with ``present``, ``allocation`` or both, the number of
            ``postures`` and their ``grid``.
        provenance: command line and input files.
        pictures: HTML of 3D scenes and maps from
            :mod:`forcefit.assembly.statistics.scenes`.

    Returns:
        HTML that includes all data and scripts.
    """
    present, allocation = (results.get(key) for key in ("present", "allocation"))
    tiles, body, sentences = [], [], []
    if present is not None:
        share = 100 * present["assemblable_share"]
        sentences.append(
            f"{share:.1f} % of {present['postures']} postures assemble by "
            "clearances alone; all postures assemble if the errors are multiplied by "
            f"{present['factor_on_errors']:.4g}"
        )
        tiles += _present_tiles(present)
        body.append(_present_section(present))
        body += (
            [section("Posture of the largest margin", *pictures)]
            if any(pictures)
            else []
        )
    if allocation is not None:
        sentences.append(_allocation_sentence(allocation))
        tiles += _allocation_tiles(allocation)
        body += [_asked_section(results, allocation), _allocation_section(allocation)]
        body += _clearance_sections(allocation)
    return page(
        Page(
            title=f"{results['robot']}: tolerances",
            verdict=_sentence(sentences),
            good=_good(present, allocation),
            tiles=tiles,
            about=f"{results['postures']} postures: {results['grid']}.",
            body=body,
            assumed=_ASSUMED,
            provenance=provenance,
            results=results,
        )
    )


def _sentence(parts: Sequence[str]) -> str:
    """Join clauses to one sentence."""
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def _good(
    present: Mapping[str, Any] | None, allocation: Mapping[str, Any] | None
) -> bool | None:
    """Return whether all postures can be assembled and the yield is demonstrated.

    Return None if a posture requires an assembly force, or the yield is uncertain.
    """
    verdict = "shown"
    if allocation is not None:
        verdict = (allocation["verification"] or {}).get("verdict", "not verified")
    if verdict == "contradicted":
        return False
    loose = present is None or present["assemblable_share"] == 1.0
    return True if loose and verdict in {"shown", "no draw failed"} else None


def _present_tiles(present: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on the largest margin and on the error that affects it most."""
    at = ", ".join(f"{k} = {v:.4g}" for k, v in present["at"].items() if abs(v) > 1e-9)
    note = f"at {at or 'the origin'} [m, rad]; it assembles up to 1."
    tiles = [Tile("Largest margin", [Value(present["largest_margin"])], [note])]
    if present["slopes"]:
        first = present["slopes"][0]
        share = f"{100 * first['share_of_margin']:.0f} %"
        tiles.append(Tile("Governing error", [first["error"]], [f"{share} of it."]))
    factor = present["factor_on_errors"]
    answer, note = f"all errors times {factor:.3g}", "then all postures assemble."
    if factor >= 1.0:
        answer, note = "nothing", "all postures assemble with the present errors."
    return [*tiles, Tile("Tolerance to tighten", [answer], [note])]


def _present_section(present: Mapping[str, Any]) -> str:
    """Return the section on the contribution of each error to the largest margin."""
    rows: list[list[Cell]] = [
        [one["error"], Value(one["value"], _error_unit(one["error"])),
         one["share_of_margin"]]
        for one in present["slopes"][:_LISTED]
    ]  # fmt: skip
    shares = {one["error"]: one["share_of_margin"] for one in present["slopes"]}
    most = dict(list(shares.items())[:_LISTED])
    rest = f"{len(shares) - len(most)} others"
    if len(shares) > len(most):
        most[rest] = sum(list(shares.values())[_LISTED:])
    axis = Axis("share of the largest margin")
    return section(
        "Present errors",
        bars(most, axis, "Largest share first.", np.nan, rest),
        table(["error", "size", Column("share of the margin")], rows, "errors"),
    )


def _error_unit(name: str) -> str:
    """Return the SI unit of an error such as ``leg1.link_a.TX``."""
    return "rad" if name.rpartition(".")[2].startswith("R") else "m"


def _allocation_sentence(allocation: Mapping[str, Any]) -> str:
    """Return a clause on whether the tolerances satisfy the limits."""
    text = f"tolerances for a yield of {allocation['yield']:g}"
    proven = allocation["proven_scale"]
    if np.isfinite(proven):
        text += f", proven for all tolerances multiplied by {proven:.4f}"
    check = allocation["verification"]
    if check:
        text += f", by {check['draws']} new draws at all postures: {check['verdict']}"
    return text


def _allocation_tiles(allocation: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on the yield, clearances and the most expensive tolerances."""
    tiles = []
    check = allocation["verification"]
    if check:
        one = check["yield"]
        low, high = (100 * one[end] for end in ("lower", "upper"))
        tiles.append(Tile("Yield", [f"{100 * one['probability']:.4g} %"],
                          [f"{low:.4g} to {high:.4g} %, fresh draws."]))  # fmt: skip
    for key, one in allocation["perfect_parts"].items():
        if one["reached"] > 0.0:
            answer = f"{100 * one['reached'] / one['limit']:.0f} %"
            tiles.append(
                Tile("Used by clearances", [answer], [f"of the limit of {key}."])
            )
    return [*tiles, _tighten_tile(allocation)]


def _tighten_tile(allocation: Mapping[str, Any]) -> Tile:
    """Return a tile on the tolerances with the largest share of the cost."""
    tight = [one for one in allocation["tolerances"] if not one["at_loosest"]]
    if not tight:
        why = "every tolerance can have its largest allowed value."
        return Tile("Tolerance to tighten", ["nothing"], [why])
    most = max(one["share"] for one in tight)
    first = [one for one in tight if one["share"] >= (1.0 - _ALIKE) * most]
    share = f"{100 * most:.0f} % {_GOVERNED[allocation['cost']]}"
    if len(first) > 1:
        names = ", ".join(one["name"] for one in first)
        return Tile("Tolerance to tighten", [names], [f"{share} each."])
    (one,) = first
    size = Value(one["tolerance"], one["unit"])
    return Tile(
        "Tolerance to tighten", [one["name"]], [share, ", to plus or minus ", size, "."]
    )


def _asked_section(results: Mapping[str, Any], allocation: Mapping[str, Any]) -> str:
    """Return the section on required limits, yield, error distribution and postures."""
    rows: list[list[Cell]] = [
        [f"{NAMES[key]}, at most", Value(limit, UNITS[key].removesuffix("1"), 6)]
        for key, limit in allocation["limits"].items()
    ]
    asked = allocation["yield"]
    model = allocation["clearance"]
    errors = "uniform within plus or minus their tolerance"
    if allocation["distribution"] == "truncated":
        errors = (
            f"normal, the tolerance at {allocation['deviations']:g} standard "
            "deviations, where it is cut"
        )
    clearances = "no pose error is limited: their position does not matter"
    if model is not None:
        means = clearance_means(model, allocation["contact_length"])
        clearances = f"clearance {model}: {means}"
    check = allocation["verification"]
    fresh = f"; {check['draws']} new draws for verification" if check else ""
    rows += [
        ["yield", "1: every robot within tolerance" if asked == 1.0 else f"{asked:g}"],
        ["clearances", clearances],
        ["errors", errors],
        ["price", _COST_LAWS[allocation["cost"]]],
        ["postures", f"{results['postures']}: {results['grid']}"],
        ["draws", f"{allocation['draws']}, seed {allocation['seed']}{fresh}"],
    ]
    head = ["requirement", "value"]
    return section("Requirements", table(head, rows, "requirements"))


def _allocation_section(allocation: Mapping[str, Any]) -> str:
    """Return the section on tolerances by class, cost and worst cases."""
    classes = allocation["tolerances"]
    rows: list[list[Cell]] = [
        [one["name"], *(Value(one[k], one["unit"]) for k in
                        ("tolerance", "loosest_allowed")),
         float(one["cost"]), float(one["share"])]
        for one in classes
    ]  # fmt: skip
    worst: list[list[Cell]] = [
        [NAMES[key], *(Value(v, UNITS[key], 6) for v in
                       (allocation["limits"][key], one["found"], one["proven"]))]
        for key, one in allocation["worst"].items()
    ]  # fmt: skip
    charts = [
        # Angles and lengths have separate charts.
        bars(some, Axis("tolerance, plus or minus", unit), "", np.nan)
        for unit in ("rad", "m")
        if (some := {one["name"]: one["tolerance"] for one in classes
                     if one["unit"] == unit})
    ]  # fmt: skip
    share = Column(f"share {_GOVERNED[allocation['cost']]}")
    head: list[str | Column] = ["class", "tolerance, plus or minus", "largest allowed"]
    pieces = [
        grid(*charts),
        table([*head, Column("cost"), share], rows, "tolerances"),
        _price_paragraph(allocation),
    ]
    if worst:
        columns = ["quantity", "limit", "largest value found", "upper bound"]
        pieces.append(table(columns, worst, "limits"))
    return section("Allocated tolerances", *pieces)


def _price_paragraph(allocation: Mapping[str, Any]) -> str:
    """Return a paragraph on the cost and its lower bound."""
    price, bound = (allocation[key] for key in ("price", "price_bound"))
    if np.isfinite(bound):
        return paragraph(
            "Price ", Value(price, "", 5), "; no tolerances that meet the limits cost "
            "less than ", Value(bound, "", 5), ".",
        )  # fmt: skip
    return paragraph(
        "Price ", Value(price, "", 5), ". It is a local minimum; a global minimum is "
        "not proved, because the limits are not convex in the "
        "tolerances.",
    )  # fmt: skip


def _clearance_sections(allocation: Mapping[str, Any]) -> list[str]:
    """Return the sections on pose errors due to clearances alone."""
    taken = {k: v for k, v in allocation["perfect_parts"].items() if v["reached"] > 0.0}
    if not taken:
        return []
    rows: list[list[Cell]] = [
        [NAMES[key], *(Value(v, one["unit"], 4) for v in
                       (one["limit"], one["reached"], one["limit"] - one["reached"])),
         one["at"]]
        for key, one in taken.items()
    ]  # fmt: skip
    one = max(taken.values(), key=lambda v: v["reached"] / v["limit"])
    head = [
        "quantity",
        "limit",
        "used by clearances",
        "available for errors",
        "at [m, rad]",
    ]
    looser, price = Value(one["looser_without"], "", 3), Value(one["price_without"])
    text = paragraph(
        "Without clearances, all tolerances could be larger by a factor of about ",
        looser, ", at a cost of about ", price, ".",
    )  # fmt: skip
    return [
        section(
            "Share of the limits used by clearances",
            table(head, rows, "clearances"),
            text,
        )
    ]
