"""Pages of draws and of tolerances: yields, what governs them, what to tighten."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.statistics.plot import NAMES
from assembly.statistics.quantities import POSE_ERRORS, UNITS
from assembly.statistics.ranking import NOT_DISTINGUISHED, rank_text
from assembly.statistics.summary import WORDS
from assembly.statistics.tightening import ranked, tightening_tiles
from forcefit.page.charts import BLUE, GREY, RED, Axis, bars, chart
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table

if TYPE_CHECKING:
    import xarray

_BINS = 60
_GOOD = 0.95  # a yield below it is no good news
_LISTED = 20  # errors in a table of shares
_ASSUMED = (
    "Small screws: the closures are linear in the errors of each draw.",
    "Yields count all draws; energies, forces, pose errors only those that assemble.",
    "Intervals are of the sampling alone: they do not cover a wrong distribution.",
)
_TOLERANCES_ASSUMED = (
    "Limits hold at the postures of the grid; between them nothing is said.",
    "Errors are independent and keep within their tolerances.",
    "Small screws: the closures are linear in the errors.",
)


def draws_page(
    summary: Mapping[str, Any], data: "xarray.Dataset", provenance: Provenance,
    robot: str = "",
) -> str:  # fmt: skip
    """The page of an experiment.

    Args:
        summary: of :func:`assembly.statistics.summary.summarise`, with ``robot``.
        data: the draws.
        provenance: command and files.
        robot: HTML of :func:`assembly.statistics.scenes.drawn_robot`.

    Returns:
        HTML, which needs no other file.
    """
    goes = summary["assembles"]["forced"]
    verdict = f"Of {summary['draws']} draws {_share_text(goes)} go together"
    if "within_limits" in summary:
        verdict += f"; {_share_text(summary['within_limits'])} keep all limits"
    return page(
        Page(
            title=f"{summary['robot']}: random errors",
            verdict=verdict + ".",
            good=_share(summary)["probability"] >= _GOOD,
            tiles=_draws_tiles(summary),
            about=f"{summary['draws']} draws, seed {summary['seed']}; pose errors: "
            f"play {summary['play']}: {summary['play_means']}.",
            body=[
                section("How often", _yields(summary)),
                _perfect_parts(summary),
                section("One of the worst", robot) if robot else "",
                section("How large", _quantities(summary), _histograms(summary, data)),
                _importance(summary),
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=summary,
        )
    )


def _share(summary: Mapping[str, Any]) -> Mapping[str, float]:
    """The yield: all limits kept, or going together where there are none."""
    limits: Mapping[str, float] | None = summary.get("within_limits")
    forced: Mapping[str, float] = summary["assembles"]["forced"]
    return limits or forced


def _share_text(interval: Mapping[str, float]) -> str:
    """A probability in per cent, with its interval."""
    low, high = 100 * interval["lower"], 100 * interval["upper"]
    return f"{100 * interval['probability']:.2f} % ({low:.2f} to {high:.2f})"


def _draws_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Yield, pose error, and the errors that matter."""
    share = _share(summary)
    low, high = (100 * share[end] for end in ("lower", "upper"))
    words = "all limits kept" if "within_limits" in summary else WORDS["forced"]
    tiles = [Tile("Yield", [f"{100 * share['probability']:.4g} %"],
                  [f"{words}; {low:.4g} to {high:.4g} %."])]  # fmt: skip
    sizes = {k: summary["quantities"].get(k, {}) for k in ("translation", "rotation")}
    high95 = [
        Value(one["quantiles"]["0.95"]["value"], UNITS[key], 3)
        for key, one in sizes.items() if "quantiles" in one
    ]  # fmt: skip
    if high95:
        answer = [part for one in high95 for part in (" and ", one)][1:]
        note = f"of the platform's error; play {summary['play']}."
        tiles.append(Tile("95 % stay below", answer, [note]))
    return tiles + tightening_tiles(summary)


def _yields(summary: Mapping[str, Any]) -> str:
    """Table of all probabilities."""
    named = {WORDS[key]: one for key, one in summary["assembles"].items()}
    for key, one in summary["exceeds"].items():
        limit = f"{one['limit']:g} {one['unit']}".removesuffix(" 1")
        named[f"{NAMES[key]} above {limit}"] = one
    if "within_limits" in summary:
        named["all limits kept"] = summary["within_limits"]
    rows: list[list[Cell]] = [
        [name, *(one[k] for k in ("probability", "lower", "upper")),
         float(one.get("undecided", 0))]
        for name, one in named.items()
    ]  # fmt: skip
    level = f"{summary['confidence']:.0%}"
    words = ("probability", f"at least ({level})", "at most", "draws undecided")
    head: list[str | Column] = ["", *(Column(one, digits=5) for one in words)]
    return table(head, rows, "yields")


def _perfect_parts(summary: Mapping[str, Any]) -> str:
    """What perfect parts reach, and the part of each kind of clearance in it."""
    parts = {k: v for k, v in summary["perfect_parts"].items() if v["reached"]}
    if not parts:
        return ""
    limits = {k: one["limit"] for k, one in summary["exceeds"].items()}
    reached: list[list[Cell]] = [
        [NAMES[key], Value(one["reached"], one["unit"]),
         Value(limits[key], one["unit"]) if key in limits else ""]
        for key, one in parts.items()
    ]  # fmt: skip
    of_joints: list[list[Cell]] = [
        [f"{NAMES[key]}: {name}", Value(size, one["unit"]), size / one["reached"]]
        for key, one in parts.items()
        for name, size in one.get("clearances", {}).items()
    ]
    pieces = [table(["all errors zero", "reached", "limit"], reached, "perfect parts")]
    if of_joints:
        head: list[str | Column] = ["clearance", "its part", Column("share")]
        pieces.append(table(head, of_joints, "clearances"))
    return section("What perfect parts reach", *pieces)


def _quantities(summary: Mapping[str, Any]) -> str:
    """Table of means and quantiles."""
    rows: list[list[Cell]] = []
    for key, one in summary["quantities"].items():
        if "mean" not in one:
            continue
        play = f" (play {one['play']})" if "play" in one else ""
        values = [one["mean"]["value"], one["most_probable"]["value"]]
        values += [one["quantiles"][q]["value"] for q in ("0.5", "0.95", "0.99")]
        rows.append([NAMES[key] + play, *(Value(v, one["unit"]) for v in values)])
    head = ["", "mean", "most probable", "median", "95 % below", "99 % below"]
    text = f"Of the {summary['assembled']} of {summary['draws']} draws that assemble:"
    return paragraph(text) + table(head, rows, "sizes")


def _histograms(summary: Mapping[str, Any], data: "xarray.Dataset") -> str:
    """A histogram of each quantity that varies, with median and 95 % quantile."""
    charts, still = [], []
    solved = data["status"].values == 0
    for key, one in summary["quantities"].items():
        values = np.asarray(data[key].values, dtype=float)[solved]
        values = values.max(axis=1) if values.ndim == 2 else values
        values = values[np.isfinite(values)]
        if len(values) < 2 or np.ptp(values) <= 1e-12 * np.abs(values).max():
            still.append(NAMES[key])
            continue
        charts.append(_histogram(NAMES[key], one, values))
    note = f"Without variation: {', '.join(still)}." if still else ""
    return f"<div class=grid>{''.join(charts)}</div>{paragraph(note)}"


def _histogram(name: str, one: Mapping[str, Any], values: NDArray) -> str:
    """Counts of a quantity in bins of one width."""
    counts, edges = np.histogram(values, _BINS)
    traces: list[dict[str, Any]] = [{
        "type": "bar", "x": (edges[1:] + edges[:-1]) / 2, "y": counts,
        "marker": {"color": BLUE}, "name": "draws", "showlegend": False,
    }]  # fmt: skip
    for words, q, colour in (("median", "0.5", GREY), ("95 % below", "0.95", RED)):
        at = one["quantiles"][q]["value"]
        traces.append({
            "type": "scatter", "mode": "lines", "x": [at, at], "name": words,
            "y": [0, int(counts.max())], "line": {"color": colour},
        })  # fmt: skip
    caption = f"play {one['play']}" if "play" in one else ""
    return chart(traces, Axis(name, one["unit"]), Axis("draws"), caption)


def _importance(summary: Mapping[str, Any]) -> str:
    """Which errors the variance is owed to."""
    pieces = []
    for key, one in summary.get("importance", {}).get("quantities", {}).items():
        shares = ranked(summary, key)[:_LISTED]
        if not shares:
            pieces.append(paragraph(f"{NAMES[key]}: {one.get('reason', 'no shares')}."))
            continue
        rows: list[list[Cell]] = [
            [name, *values, float(one["first_index"][name][0]),
             rank_text(one["rank"].get(name))]
            for name, values in shares
        ]  # fmt: skip
        play = f" (play {summary['importance']['play']})" if key in POSE_ERRORS else ""
        axis = Axis(f"share of the variance: {NAMES[key]}")
        words = ("share, with others", "at least", "at most", "share alone")
        head: list[str | Column] = ["error", *map(Column, words), "rank"]
        pieces += [
            bars({name: v[0] for name, v in shares}, axis, NAMES[key] + play, np.nan),
            table(head, rows, "shares"),
        ]
    if pieces:
        pieces.append(
            paragraph(f"{NOT_DISTINGUISHED[0].upper()}{NOT_DISTINGUISHED[1:]}.")
        )
    return section("What governs it", *pieces) if pieces else ""


def tolerances_page(
    results: Mapping[str, Any], provenance: Provenance, pictures: Sequence[str] = ()
) -> str:
    """The page of ``assembly tolerances``.

    Args:
        results: with ``present``, ``allocation`` or both.
        provenance: command and files.
        pictures: HTML of :mod:`assembly.statistics.scenes`, of the errors present.

    Returns:
        HTML, which needs no other file.
    """
    present, allocation = (results.get(key) for key in ("present", "allocation"))
    tiles, body, sentences = [], [], []
    good = True
    if present is not None:
        share = 100 * present["assemblable_share"]
        sentences.append(
            f"{share:.1f} % of {present['postures']} postures go together by "
            "clearances alone; all of them with the errors times "
            f"{present['factor_on_errors']:.4g}."
        )
        tiles += _present_tiles(present)
        body.append(_present_section(present))
        body += [section("Where it is tight", *pictures)] if any(pictures) else []
    if allocation is not None:
        check = allocation["verification"]
        good = (check or {}).get("verdict") != "contradicted"
        sentences.append(_allocation_sentence(allocation))
        tiles += _allocation_tiles(allocation)
        body.append(_allocation_section(allocation))
    return page(
        Page(
            title=f"{results['robot']}: tolerances",
            verdict=" ".join(sentences),
            good=good and (present is None or present["assemblable_share"] == 1.0),
            tiles=tiles,
            about=f"{results['postures']} postures.",
            body=body,
            assumed=_TOLERANCES_ASSUMED,
            provenance=provenance,
            results=results,
        )
    )


def _present_tiles(present: Mapping[str, Any]) -> list[Tile]:
    """The largest margin, and the error it is owed to."""
    at = ", ".join(f"{k} = {v:.4g}" for k, v in present["at"].items() if abs(v) > 1e-9)
    note = f"at {at or 'the origin'} [m, rad]; 1 and less goes together."
    tiles = [Tile("Largest margin", [Value(present["largest_margin"])], [note])]
    if present["slopes"]:
        first = present["slopes"][0]
        share = f"{100 * first['share_of_margin']:.0f} %"
        tiles.append(Tile("What governs it", [first["error"]], [f"{share} of it."]))
    factor = present["factor_on_errors"]
    if factor < 1.0:
        answer = f"all errors times {factor:.3g}"
        tiles.append(Tile("What to tighten", [answer], ["then all postures fit."]))
    return tiles


def _present_section(present: Mapping[str, Any]) -> str:
    """Shares of the errors there are in the largest margin."""
    rows: list[list[Cell]] = [
        [one["error"], Value(one["value"], _error_unit(one["error"])),
         one["share_of_margin"]]
        for one in present["slopes"][:_LISTED]
    ]  # fmt: skip
    shares = {one["error"]: one["share_of_margin"] for one in present["slopes"]}
    most = dict(list(shares.items())[:_LISTED])
    return section(
        "The errors there are",
        bars(most, Axis("share of the largest margin"), "The steepest first.", np.nan),
        table(["error", "size", Column("share of the margin")], rows, "errors"),
    )


def _error_unit(name: str) -> str:
    """SI unit of an error such as ``leg1.link_a.TX``."""
    return "rad" if name.rpartition(".")[2].startswith("R") else "m"


def _allocation_sentence(allocation: Mapping[str, Any]) -> str:
    """Whether the tolerances hold, by proof and by fresh draws."""
    text = f"Tolerances for a yield of {allocation['yield']:g}"
    proven = allocation["proven_scale"]
    if np.isfinite(proven):
        text += f", proven when scaled by {proven:.4f}"
    check = allocation["verification"]
    if check:
        text += f"; {check['draws']} fresh draws at all postures: {check['verdict']}"
    return text + "."


def _allocation_tiles(allocation: Mapping[str, Any]) -> list[Tile]:
    """Yield, the tolerance that costs most, and those that could be loosest."""
    tiles = []
    check = allocation["verification"]
    if check:
        one = check["yield"]
        low, high = (100 * one[end] for end in ("lower", "upper"))
        tiles.append(Tile("Yield", [f"{100 * one['probability']:.4g} %"],
                          [f"{low:.4g} to {high:.4g} %, fresh draws."]))  # fmt: skip
    classes = allocation["tolerances"]
    if allocation["cost"] == "reciprocal" and classes:
        prices = [one["cost"] / one["tolerance"] for one in classes]
        first = int(np.argmax(prices))
        share = 100 * prices[first] / sum(prices)
        tiles.append(Tile("What governs the price", [classes[first]["name"]],
                          [f"{share:.0f} % of it."]))  # fmt: skip
    tight = min(classes, key=lambda one: one["tolerance"] / one["loosest_allowed"])
    tiles.append(Tile("What to tighten", [tight["name"]], [
        "to plus or minus ", Value(tight["tolerance"], tight["unit"]), "."
    ]))  # fmt: skip
    return tiles


def _allocation_section(allocation: Mapping[str, Any]) -> str:
    """Tolerances by class, worst cases and price."""
    rows: list[list[Cell]] = [
        [one["name"], *(Value(one[k], one["unit"]) for k in
                        ("tolerance", "loosest_allowed")), float(one["cost"])]
        for one in allocation["tolerances"]
    ]  # fmt: skip
    worst: list[list[Cell]] = [
        [NAMES[key], *(Value(v, UNITS[key], 6) for v in
                       (allocation["limits"][key], one["found"], one["proven"]))]
        for key, one in allocation["worst"].items()
    ]  # fmt: skip
    charts = "".join(
        bars(some, Axis("tolerance, plus or minus", unit, {"type": "log"}), "", np.nan)
        for unit in ("rad", "m")
        if (some := {one["name"]: one["tolerance"] for one in allocation["tolerances"]
                     if one["unit"] == unit})
    )  # fmt: skip
    head: list[str | Column] = ["class", "tolerance, plus or minus", "loosest allowed"]
    return section(
        "The tolerances there may be",
        f"<div class=grid>{charts}</div>",
        table([*head, Column("cost")], rows, "tolerances"),
        paragraph("Price ", Value(allocation["price"], "", 5), "; at least ",
                  Value(allocation["price_bound"], "", 5), "."),
        table(["quantity", "limit", "worst found", "proven at most"], worst, "limits"),
    )  # fmt: skip
