"""Create report pages of the errors that modelling assumptions cause."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forcefit.page.charts import Axis, bars
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table
from forcefit.validation.assumptions.over_poses import CostsOverPoses
from forcefit.validation.assumptions.platform_cost import PlatformCosts
from forcefit.validation.assumptions.report import COMPARED, pose_text, spread
from forcefit.validation.assumptions.validity import ENERGY_LIMIT, POSITION_LIMIT, Cost

_LIMITS = f"{1e6 * POSITION_LIMIT:g} µm or {100 * ENERGY_LIMIT:g} %"
_ASSUMED = (
    "Each assumption is tested separately against a model without this assumption.",
    "Poses are compared at the minimum-energy solution.",
    f"An error is significant above {_LIMITS} of the energy.  The position limit is "
    "the required accuracy of the IRSBot-2.",
)
_HALVES = (("rotation", "rad"), ("position", "m"))
_LISTED = 20  # largest number of links in a chart
Cells = list[list[Cell]]


def costs_page(
    costs: CostsOverPoses, results: Mapping[str, Any], provenance: Provenance
) -> str:
    """Return the report page of the errors of all assumptions.

    Args:
        costs: errors at one pose or at many poses.
        results: the errors as plain values, which ``forcefit report compare`` reads.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    reached = len(costs.reached)
    return page(
        Page(
            title=f"{costs.robot.name}: errors due to the model's assumptions",
            verdict=_verdict(costs),
            good=_good(costs),
            tiles=_tiles(costs),
            about=f"{reached} of {len(costs.asked)} poses reached.",
            body=[
                section("Assumptions of the model", *_assumptions(costs)),
                section("Stiffness of the platform", *_platform(costs)),
                _poses(costs),
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=results,
        )
    )


def _known(costs: CostsOverPoses) -> dict[str, list[tuple[Mapping[str, float], Cost]]]:
    """Return the known errors of each assumption, with their poses."""
    pairs = {
        name: [
            (pose, cost)
            for pose, at in zip(costs.reached, costs.costs, strict=True)
            if isinstance(cost := at[name], Cost)
        ]
        for name in costs.assumptions
    }
    return {name: found for name, found in pairs.items() if found}


def _significant(costs: CostsOverPoses) -> list[str]:
    """Return the assumptions that have a significant error at a pose."""
    return [
        name for name, found in _known(costs).items()
        if any(cost.matters for _, cost in found)
    ]  # fmt: skip


def _verdict(costs: CostsOverPoses) -> str:
    """Return a sentence on the assumptions that cause significant errors."""
    known, found = len(_known(costs)), _significant(costs)
    if not known:
        return "No error is known: there is nothing to compare."
    unknown = len(costs.assumptions) - known
    last = f" ({unknown} more errors are unknown)." if unknown else "."
    if not found:
        return f"All {known} known errors are at most {_LIMITS} of the energy{last}"
    return (
        f"{len(found)} of {known} known errors exceed {_LIMITS} of the energy: "
        f"{'; '.join(found)}{last}"
    )


def _good(costs: CostsOverPoses) -> bool | None:
    """Return False if no error is known, None if an error is significant, else True."""
    if not costs.known:
        return False
    return None if _significant(costs) else True


def _tiles(costs: CostsOverPoses) -> list[Tile]:
    """Return tiles with the largest pose errors and the error in platform stiffness."""
    tiles = []
    for half, unit in _HALVES:
        largest = {
            name: max((v for _, cost in found if np.isfinite(v := getattr(cost, half))),
                      default=0.0)
            for name, found in _known(costs).items()
        }  # fmt: skip
        if largest:
            name = max(largest, key=lambda one: largest[one])
            tiles.append(Tile(f"Largest error of {half}", [Value(largest[name], unit)],
                              [f"{name}."]))  # fmt: skip
    if isinstance(costs.platform, PlatformCosts):
        worst = float(np.nanmax(costs.platform.beams))
        tiles.append(Tile("Compliance of the platform", [f"{100 * worst:.2g} %"],
                          ["largest difference of beams from solids."]))  # fmt: skip
    return tiles


def _assumptions(costs: CostsOverPoses) -> list[str]:
    """Return a table of the largest errors and a table of unknown errors."""
    known = _known(costs)
    rows: Cells = []
    for name, found in known.items():
        poses = [pose for pose, _ in found]
        row: list[Cell] = [name]
        for key, unit in (*_HALVES, ("energy", "")):
            largest = spread(np.array([getattr(c, key) for _, c in found]), poses)
            row.append(Value(largest["largest"], unit, 3))
        matters = sum(cost.matters for _, cost in found)
        rows.append([*row, f"{matters} of {len(found)} poses"])
    head = ["assumption", "largest rotation", "largest position", "largest energy, "
            "relative", f"above {_LIMITS}"]  # fmt: skip
    pieces = []
    if known:
        errors = {
            name: spread(
                np.array([c.position for _, c in found]), [p for p, _ in found]
            )
            for name, found in known.items()
        }
        shown = {
            k: v["largest"] for k, v in errors.items() if np.isfinite(v["largest"])
        }
        if shown:
            caption = f"Line: {1e6 * POSITION_LIMIT:g} µm."
            axis = Axis("largest error of position", "m")
            pieces.append(bars(shown, axis, caption, POSITION_LIMIT))
        pieces.append(table(head, rows, "assumptions"))
    reasons = dict.fromkeys(
        (name, cost)
        for at in costs.costs for name, cost in at.items() if isinstance(cost, str)
    )  # fmt: skip
    if reasons:
        unknown = [[name, reason] for name, reason in reasons]
        pieces.append(paragraph("Not known:"))
        pieces.append(table(["assumption", "reason"], unknown, "unknown errors"))
    return pieces


def _platform(costs: CostsOverPoses) -> list[str]:
    """Return a table of the relative differences in platform compliance."""
    platform = costs.platform
    if isinstance(platform, str):
        return [paragraph(f"Not known: {platform}.")]
    values = {text: getattr(platform, name) for name, text in COMPARED.items()}
    rows: Cells = []
    for text, one in values.items():
        row = spread(one, costs.reached)
        rows.append([text, row["median"], row["largest"], pose_text(row["at"])])
    links = {k: float(np.nanmax(v)) for k, v in platform.by_link.items()}
    head: list[str | Column] = [
        "compared models", Column("median", digits=3), Column("largest", digits=3),
        "at [m, rad]",
    ]  # fmt: skip
    pieces = [
        paragraph("Largest relative difference in compliance over all wrenches; "
                  f"mesh error {100 * platform.mesh_error:.2g} %."),
        table(head, rows, "platform"),
    ]  # fmt: skip
    if links:
        first = dict(list(links.items())[:_LISTED])
        caption = "One link as a beam, all others as solids."
        pieces.append(bars(first, Axis("relative difference"), caption, np.nan))
    return pieces


def _poses(costs: CostsOverPoses) -> str:
    """Return a table of the errors at every pose, or an empty string for one pose."""
    if len(costs.asked) < 2:
        return ""
    head = ["pose [m, rad]", *(f"{name}, position" for name in costs.assumptions)]
    rows: Cells = [
        [pose_text(pose), *(_position(at[name]) for name in costs.assumptions)]
        for pose, at in zip(costs.reached, costs.costs, strict=True)
    ]
    return section("Poses", table(head, rows, "poses"), *_unreached(costs))


def _position(cost: Cost | str) -> Cell:
    """Return the position error, or a dash if it is unknown."""
    return "-" if isinstance(cost, str) else Value(cost.position, "m", 3)


def _unreached(costs: CostsOverPoses) -> Sequence[str]:
    """Return a table of the unreachable poses with the reasons."""
    rows = [
        [pose_text(pose), why]
        for pose, why in zip(costs.asked, costs.unreached, strict=True) if why
    ]  # fmt: skip
    if not rows:
        return []
    return [table(["unreachable pose", "reason"], rows, "unreached poses")]
