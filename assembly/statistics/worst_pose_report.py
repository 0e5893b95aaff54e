"""Worst pose errors as a dictionary, as text and as a section of a report."""

from collections.abc import Mapping
from typing import Any

from forcefit.assembly.statistics.callout_sources import Sources
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS
from forcefit.assembly.statistics.worst_pose import MEANINGS, worst_pose
from forcefit.page.page import paragraph, section
from forcefit.page.tables import Cell, Column, Value, table

_LISTED = 8  # largest number of contributions in the text
_LEAST = 1e-6  # smallest reported contribution, relative to the sum


def worst_results(
    prepared: LinearResponse, sources: Sources, seed: int = 1
) -> dict[str, Any]:
    """Compute the worst rotation and the worst translation.

    Args:
        prepared: a posture without loads.
        sources: see :func:`forcefit.assembly.statistics.worst_pose.worst_pose`.
        seed: seed of the random starting corners of the search.

    Returns:
        For each quantity, the definition of the worst case and its meaning, the largest
        value found, upper bound, unit, direction, and contributions by name.
    """
    results = {}
    for key in POSE_ERRORS:
        worst = worst_pose(prepared, sources, key, seed)
        rigid = {} if worst.reading != "equilibrium" else {"rigid": worst.rigid}
        results[key] = {
            "reading": worst.reading, "means": MEANINGS[worst.reading],
            "attained": worst.attained, "bound": worst.bound, "unit": UNITS[key],
            "direction": worst.direction, "shares": dict(worst.shares), **rigid,
        }  # fmt: skip
    return results


def worst_text(results: Mapping[str, Any]) -> str:
    """Format results of :func:`worst_results` as text."""
    lines = []
    for key, worst in results.items():
        unit = worst["unit"]
        lines.append(
            f"worst case of the {key} over errors and clearances: "
            f"{worst['attained']:.4g} {unit} found, at most {worst['bound']:.4g} "
            f"{unit}; {worst['means']}"
        )
        if "rigid" in worst:
            lines[-1] += f" (without any force: {worst['rigid']:.4g} {unit})"
        total = sum(worst["shares"].values()) or 1.0
        lines += [
            f"  {name}: {share:.3g} {unit} ({share / total:.0%})"
            for name, share in list(worst["shares"].items())[:_LISTED]
            if share > _LEAST * total
        ]
    return "\n".join(lines)


def worst_section(results: Mapping[str, Any]) -> str:
    """Format results of :func:`worst_results` as a section of an HTML page."""
    rows: list[list[Cell]] = [
        [key, Value(one["attained"], one["unit"]), Value(one["bound"], one["unit"]),
         one["means"]]
        for key, one in results.items()
    ]  # fmt: skip
    head: list[str | Column] = ["error", "attained", "certified bound", "reading"]
    shares: list[list[Cell]] = [
        [f"{key}: {name}", Value(share, one["unit"]),
         share / sum(one["shares"].values())]
        for key, one in results.items() for name, share in one["shares"].items()
        if share > _LEAST * sum(one["shares"].values())
    ]  # fmt: skip
    text = paragraph("Over all errors within tolerance and all clearances:")
    of: list[str | Column] = ["error or clearance", "contribution", Column("share")]
    return section(
        "Worst case", text, table(head, rows, "worst case"),
        table(of, shares, "parts of the worst case"),
    )  # fmt: skip
