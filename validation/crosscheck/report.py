"""Create report pages of cross-checks at one pose and at many poses."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.assembly.model.statuses import (
    FAILED,
    NO_SIGNAL,
    NOT_DECIDED,
    OK,
    PASSED,
)
from forcefit.page.charts import GREY, Axis, chart
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table
from forcefit.results.quantities import in_words, unit_of
from forcefit.stiffness.screws import SCREW, SCREW_UNITS
from forcefit.validation.crosscheck.crosscheck import Crosscheck
from forcefit.validation.crosscheck.pose_metric import PoseMetric
from forcefit.validation.crosscheck.poses import outcome_text, poses_table
from forcefit.validation.crosscheck.verdict import NOT_CHECKED, verdict, verdict_text

# Colour of the verdict for each outcome.
GOOD = {PASSED: True, NOT_DECIDED: None, NO_SIGNAL: None, FAILED: False}
_LISTED = 30  # number of parameters in the table of detectable changes
ASSUMED = (
    "The simulation (Exudyn) has geometrically exact motions; the virtual-joint model "
    "is linear in errors and loads.",
    "Both models read the same robot file, so errors in that file are not detected.",
    "Neither model has friction or contact stiffness.",
)
Cells = list[list[Cell]]


def crosscheck_page(check: Crosscheck, provenance: Provenance) -> str:
    """Return the report page of a cross-check at one pose.

    Args:
        check: result of :func:`forcefit.validation.crosscheck.crosscheck.crosscheck`.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    return page(
        Page(
            title=f"{check.posture.robot.name}: comparison with a multibody simulation",
            verdict=_verdict(check),
            good=GOOD[verdict(check)],
            tiles=_tiles(check),
            about=f"{check.metric.notes()[0]}; links in the simulation: {check.links}.",
            body=[
                section("Both models at every scale", *compared(check)),
                _checks(check),
                _platform(check),
                _resolutions(check),
            ],
            assumed=ASSUMED,
            provenance=provenance,
            results=check.table(),
        )
    )


def _verdict(check: Crosscheck) -> str:
    """Return the outcome of the checks in one sentence."""
    outcomes = [one.verdict for one in check.checks.values()]
    count = f"{outcomes.count(OK)} of {len(outcomes)} checks passed"
    if verdict(check) == PASSED:
        return f"The simulation agrees with the virtual-joint model: {count}."
    words = verdict_text(check)
    return f"{words[0].upper()}{words[1:].lower()}; {count}."


def _tiles(check: Crosscheck) -> list[Tile]:
    """Return tiles for the slope, the check closest to its bound, and the scales."""
    tiles = []
    if not np.isnan(check.slope):
        tiles.append(Tile("Slope of the difference", [Value(check.slope)],
                          ["2 is required, within 0.1."]))  # fmt: skip
    used = {k: one.value / one.bound for k, one in check.checks.items() if one.signal}
    if used:
        name = max(used, key=lambda one: used[one])
        tiles.append(Tile("Check nearest to its bound", [f"{100 * used[name]:.2g} %"],
                          [f"of the bound: {name}."]))  # fmt: skip
    return [*tiles, Tile("Scales", [f"{len(check.pairs)}"],
                         [f"{check.asked} requested, the others added."])]  # fmt: skip


def compared(check: Crosscheck) -> list[str]:
    """Return the HTML text, table and chart that compare both models at every scale.

    Args:
        check: a cross-check.

    Returns:
        HTML fragments, with a chart if poses are compared.
    """
    pieces = [table(check.metric.header(), check.metric.rows(), "cross-check")]
    if not isinstance(check.metric, PoseMetric):
        return pieces
    text = paragraph(
        "The difference between a linearised model and the simulation must grow with "
        f"the square of the errors: slope 2. {_slope_text(check.slope)}"
    )
    # Without differences above the noise, there is no slope and no chart.
    chart = [] if np.isnan(check.slope) else [_slope_chart(check, check.metric)]
    return [text, *pieces, *chart]


def _slope_text(slope: float) -> str:
    """Return a sentence on the slope."""
    if np.isnan(slope):
        return "The two models do not differ measurably, so there is no slope."
    return f"Measured: {slope:.3f}."


def _slope_chart(check: Crosscheck, metric: PoseMetric) -> str:
    """Return a chart of the differences over the scale, with a line of slope 2."""
    scales = np.asarray(check.scales)
    traces: list[dict[str, Any]] = []
    for name, values in metric.differences.items():
        shown = np.where(values > 0, values, np.nan)
        traces.append({"type": "scatter", "mode": "markers", "x": scales, "y": shown,
                       "name": f"{in_words(name)} [{unit_of(name)}]"})  # fmt: skip
        traces.append({
            "type": "scatter", "mode": "lines", "x": scales, "name": "slope 2",
            "y": shown[-1] * (scales / scales[-1]) ** 2, "line": {"color": GREY},
            "showlegend": len(traces) == 1,
        })  # fmt: skip
    log = {"type": "log"}
    return chart(
        traces, Axis("scale of the errors", options=log),
        Axis("simulation minus linear model [rad, m]", options=log),
        "Difference of the platform's pose, without clearances.",
    )  # fmt: skip


def _checks(check: Crosscheck) -> str:
    """Return a table of all checks."""
    rows: Cells = [
        [name, one.value, one.uncertainty, one.bound,
         NOT_CHECKED if one.verdict == NO_SIGNAL else one.verdict]
        for name, one in check.checks.items()
    ]  # fmt: skip
    head: list[str | Column] = [
        "check", Column("value", digits=2), Column("uncertainty", digits=2),
        Column("bound"), "outcome",
    ]  # fmt: skip
    return section("Checks", table(head, rows, "checks"))


def _platform(check: Crosscheck) -> str:
    """Return a table of the platform's displacement at the largest scale."""
    first = check.pairs[0]
    rows = screw_table(first.linear.platform_screw, first.simulated.platform_screw)
    text = paragraph(
        "Displacement of the platform's origin from the nominal pose, base axes, at "
        f"scale {first.scale:g}."
    )
    return section("The platform at full size", text, rows)


def screw_table(ours: Any, theirs: Any) -> str:
    """Return a table of a screw (6,) [rad, m] in both models."""
    rows: Cells = [
        [
            name,
            *(Value(float(v), unit, 6) for v in (a, b)),
            Value(float(b - a), unit, 3),
        ]
        for name, unit, a, b in zip(SCREW, SCREW_UNITS, ours, theirs, strict=True)
    ]
    head = ["component", "virtual joints", "simulation", "difference"]
    return table(head, rows, "platform")


def _resolutions(check: Crosscheck) -> str:
    """Return a table of the parameters with changes that are hardest to detect."""
    found = sorted(check.resolutions, key=lambda one: -one.smallest)
    unproved = sum(one.unproved for one in found)
    rows: Cells = [
        [one.name, one.kind, "not detected" if one.unproved
         else f"{100 * one.smallest:.2g} %", one.by or "none"]
        for one in found[:_LISTED]
    ]  # fmt: skip
    text = paragraph(
        f"Smallest relative parameter change that a check detects, for the {len(rows)} "
        f"of {len(found)} parameters that are hardest to detect; for {unproved} even a "
        "change by the full value goes undetected."
    )
    head = ["parameter", "kind", "smallest change detected", "check"]
    return section("What the checks detect", text, table(head, rows, "parameters"))


def failure_page(failure: Mapping[str, Any], provenance: Provenance) -> str:
    """Return the report page of a cross-check that failed to run.

    Args:
        failure: second result of
            :func:`forcefit.validation.crosscheck.crosscheck.attempt`.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    return page(
        Page(
            title=f"{failure['robot']}: comparison with a multibody simulation",
            verdict=f"There is no result: {failure['reason']}.".replace("..", "."),
            good=False,
            tiles=[],
            about=f"Status: {failure['status']}.",
            body=[],
            assumed=ASSUMED,
            provenance=provenance,
            results=failure,
        )
    )


def poses_page(
    robot: str, rows: Sequence[Mapping[str, Any]], provenance: Provenance
) -> str:
    """Return the report page of cross-checks at many poses.

    Args:
        robot: name of the robot.
        rows: results of :func:`forcefit.validation.crosscheck.poses.check_poses`.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    answer = poses_table([dict(row) for row in rows])
    passed = sum(row["passed"] is True for row in rows)
    verdicts = {row.get("verdict", FAILED) for row in rows if row["passed"] is False}
    good = answer["passed"] or (False if FAILED in verdicts or not passed else None)
    names = list(rows[0]["asked"]) if rows else []
    cells: Cells = [
        [*(float(row["asked"][name]) for name in names), _slope(row),
         outcome_text(row), row.get("reason", "")]
        for row in rows
    ]  # fmt: skip
    head: list[str | Column] = [
        *(Column(name, "rad" if name[0] == "r" else "m") for name in names),
        Column("slope"), "outcome", "reason",
    ]  # fmt: skip
    return page(
        Page(
            title=f"{robot}: comparison with a multibody simulation",
            verdict=f"{passed} of {answer['reached']} reachable poses passed.",
            good=good,
            tiles=[Tile("Poses passed", [f"{passed} of {answer['reached']}"],
                        [f"{len(rows)} poses requested."])],
            about="At every pose both models are compared at several scales.",
            body=[section("Poses", table(head, cells, "poses"))],
            assumed=ASSUMED,
            provenance=provenance,
            results=answer,
        )
    )  # fmt: skip


def _slope(row: Mapping[str, Any]) -> float:
    """Return the slope at a pose, or NaN if there is none."""
    slope = row.get("slope")
    return np.nan if slope is None else float(slope)
