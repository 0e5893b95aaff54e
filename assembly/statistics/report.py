"""HTML report on random errors: yields, distributions and most important errors."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.statistics.plot import NAMES
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.ranking import (
    NOT_DISTINGUISHED,
    rank_text,
    ranked,
    shares_sentence,
)
from forcefit.assembly.statistics.summary import WORDS
from forcefit.assembly.statistics.tightening import tightening_tiles
from forcefit.assembly.statistics.worst_pose_report import worst_section
from forcefit.page.charts import BLUE, GREY, RED, Axis, bars, chart, grid
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table

if TYPE_CHECKING:
    import xarray

_BINS = 60
_GOOD = 0.95  # smallest yield that is marked as good
_LISTED = 20  # largest number of rows in the table of errors
_ASSUMED = (
    "The closure equations are linearised (small screws).",
    "Yields refer to all draws; other results refer to the draws that assemble.",
    "Confidence intervals include the sampling error, but not errors of the "
    "assumed distributions.",
)


def draws_page(
    summary: Mapping[str, Any], data: "xarray.Dataset", provenance: Provenance,
    robot: str = "",
) -> str:  # fmt: skip
    """Format the results of an experiment as an HTML page.

    Args:
        summary: result of :func:`forcefit.assembly.statistics.summary.summarise`, and
            the robot's name with the key ``robot``.
        data: the draws.
        provenance: command line and input files.
        robot: 3D scene from :func:`forcefit.assembly.statistics.scenes.drawn_robot`.

    Returns:
        HTML that includes all data and scripts.
    """
    goes = summary["assembles"]["forced"]
    verdict = f"Of {summary['draws']} draws {_share_text(goes)} assemble"
    if "within_limits" in summary:
        verdict += f"; {_share_text(summary['within_limits'])} meet all limits"
    return page(
        Page(
            title=f"{summary['robot']}: random errors",
            verdict=verdict + ".",
            good=_good(_share(summary)),
            tiles=_draws_tiles(summary),
            about=f"{summary['draws']} draws, seed {summary['seed']}; pose errors: "
            f"clearance {summary['clearance']}: {summary['clearance_means']}.",
            body=draws_sections(summary, data, robot),
            assumed=_ASSUMED,
            provenance=provenance,
            results=summary,
        )
    )


def draws_sections(
    summary: Mapping[str, Any], data: "xarray.Dataset", robot: str = ""
) -> list[str]:
    """Return the sections of :func:`draws_page`."""
    return [
        section("Probabilities", _yields(summary)),
        _perfect_parts(summary),
        section("A draw with a large error", robot) if robot else "",
        section("Distributions", _quantities(summary), _histograms(summary, data)),
        _capability(summary),
        _importance(summary),
        worst_section(summary["worst_case"]) if "worst_case" in summary else "",
    ]


def _share(summary: Mapping[str, Any]) -> Mapping[str, float]:
    """Return the yield, or the probability of assembly if there are no limits."""
    limits: Mapping[str, float] | None = summary.get("within_limits")
    forced: Mapping[str, float] = summary["assembles"]["forced"]
    return limits or forced


def _good(share: Mapping[str, float]) -> bool | None:
    """Return whether the yield is at least 95 %, or None if this is uncertain."""
    if share["lower"] >= _GOOD:
        return True
    return None if share["upper"] >= _GOOD else False


def _share_text(interval: Mapping[str, float]) -> str:
    """Format a probability and its confidence interval in per cent."""
    low, high = 100 * interval["lower"], 100 * interval["upper"]
    return f"{100 * interval['probability']:.2f} % ({low:.2f} to {high:.2f})"


def _draws_tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on the yield, the pose error and the most important errors."""
    share = _share(summary)
    low, high = (100 * share[end] for end in ("lower", "upper"))
    words = "all limits satisfied" if "within_limits" in summary else WORDS["forced"]
    tiles = [Tile("Yield", [f"{100 * share['probability']:.4g} %"],
                  [f"{words}; {low:.4g} to {high:.4g} %."])]  # fmt: skip
    sizes = {k: summary["quantities"].get(k, {}) for k in ("rotation", "translation")}
    high95 = [
        Value(one["quantiles"]["0.95"]["value"], UNITS[key], 3)
        for key, one in sizes.items() if "quantiles" in one
    ]  # fmt: skip
    if high95:
        answer = [part for one in high95 for part in (" and ", one)][1:]
        note = f"of the platform error; clearance model {summary['clearance']}."
        tiles.append(Tile("95 % quantile", answer, [note]))
    return tiles + tightening_tiles(summary)


def _yields(summary: Mapping[str, Any]) -> str:
    """Format the probabilities of assembly and of exceeded limits as an HTML table."""
    named = {WORDS[key]: one for key, one in summary["assembles"].items()}
    for key, one in summary["exceeds"].items():
        limit = f"{one['limit']:g} {one['unit']}".removesuffix(" 1")
        named[f"{NAMES[key]} above {limit}"] = one
    if "within_limits" in summary:
        named["all limits satisfied"] = summary["within_limits"]
    rows: list[list[Cell]] = [
        [name, *(one[k] for k in ("probability", "lower", "upper")),
         float(one.get("undecided", 0))]
        for name, one in named.items()
    ]  # fmt: skip
    level = f"{summary['confidence']:.0%}"
    words = ("probability", f"lower bound ({level})", "upper bound", "undecided draws")
    head: list[str | Column] = ["event", *(Column(one, digits=5) for one in words)]
    return table(head, rows, "yields")


def _perfect_parts(summary: Mapping[str, Any]) -> str:
    """Format the section on results without geometric errors."""
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
    pieces = [table(["quantity", "without errors", "limit"], reached, "perfect parts")]
    if of_joints:
        head: list[str | Column] = ["clearance", "contribution", Column("share")]
        pieces.append(table(head, of_joints, "clearances"))
    return section("Results without geometric errors", *pieces)


def _quantities(summary: Mapping[str, Any]) -> str:
    """Format means and quantiles as an HTML table."""
    rows: list[list[Cell]] = []
    for key, one in summary["quantities"].items():
        if "mean" not in one:
            continue
        clearance = f" (clearance {one['clearance']})" if "clearance" in one else ""
        values = [one["mean"]["value"], one["most_probable"]["value"]]
        values += [one["quantiles"][q]["value"] for q in ("0.5", "0.95", "0.99")]
        rows.append([NAMES[key] + clearance, *(Value(v, one["unit"]) for v in values)])
    head = ["quantity", "mean", "most probable", "median", "95 % below", "99 % below"]
    text = f"Of the {summary['assembled']} of {summary['draws']} draws that assemble:"
    return paragraph(text) + table(head, rows, "sizes")


def _histograms(summary: Mapping[str, Any], data: "xarray.Dataset") -> str:
    """Plot histograms of all quantities that vary."""
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
    note = f"Constant quantities: {', '.join(still)}." if still else ""
    return grid(*charts) + paragraph(note)


def _histogram(name: str, one: Mapping[str, Any], values: NDArray) -> str:
    """Plot a histogram with median and 95 % quantile as HTML."""
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
    caption = f"clearance {one['clearance']}" if "clearance" in one else ""
    return chart(traces, Axis(name, one["unit"]), Axis("draws"), caption)


def _capability(summary: Mapping[str, Any]) -> str:
    """Format the section on process capability."""
    rows: list[list[Cell]] = [
        [NAMES[key], Value(one["limit"], one["unit"]),
         *(one[index][k] for index in ("cp", "cpk", "ppm")
           for k in ("value", "lower", "upper"))]
        for key, one in summary.get("capability", {}).items()
    ]  # fmt: skip
    words = [word for name in ("Cp", "Cpk", "ppm above")
             for word in (name, f"{name}, lower bound",
                          f"{name}, upper bound")]  # fmt: skip
    head: list[str | Column] = ["quantity", "limit", *map(Column, words)]
    return section("Capability", table(head, rows, "capability")) if rows else ""


def _importance(summary: Mapping[str, Any]) -> str:
    """Format the section on the importance of errors."""
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
        model = summary["importance"]["clearance"]
        title = NAMES[key] + (f" (clearance {model})" if key in POSE_ERRORS else "")
        axis = Axis(f"share of the variance: {NAMES[key]}")
        words = ("total index", "lower bound", "upper bound", "first-order index")
        head: list[str | Column] = ["error", *map(Column, words), "rank"]
        pieces += [
            paragraph(f"{shares_sentence(shares, key)}."),
            bars({name: v[0] for name, v in shares}, axis, title, np.nan),
            table(head, rows, "shares"),
        ]
    if pieces:
        pieces.append(
            paragraph(f"{NOT_DISTINGUISHED[0].upper()}{NOT_DISTINGUISHED[1:]}.")
        )
    return section("Governing errors", *pieces) if pieces else ""
