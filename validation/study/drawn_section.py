"""Create report sections about drawing tolerances."""

from typing import Any

from forcefit.assembly.statistics.report import draws_sections
from forcefit.page.page import Tile, paragraph, section
from forcefit.page.tables import Value, rotation_and_translation
from forcefit.validation.study.study import StudyResults


def drawn_section(results: StudyResults) -> str:
    """Return the statistics and the worst case of parts within tolerance as HTML."""
    found = results.statistics
    if found is None:
        return ""
    about = paragraph(
        f"{found['draws']} machines with parts within the drawing tolerances, seed "
        f"{found['seed']}, at this pose. Their errors replace those of the study, and "
        "the clearance of each fit differs between machines. Pose errors: clearance "
        f"{found['clearance']}: {found['clearance_means']}. The other sections use the "
        "errors of the study and the mean clearance of fits."
    )
    left_out = found.get("worst_case_left_out")
    why = paragraph(f"The worst case was not computed: {left_out}.") if left_out else ""
    title = section("Tolerances of the drawing", about, why)
    return "".join([title, *draws_sections(found, results.draws)])


def drawn_tiles(found: dict[str, Any] | None, worst: dict[str, Any]) -> list[Tile]:
    """Return the tile of the worst case over all parts within tolerance.

    Args:
        found: statistics of the study, or None.
        worst: certified bounds, from
            :func:`forcefit.validation.study.headline.worst_clearance`.

    Returns:
        A list with the tile, or an empty list without such a bound.
    """
    if found is None or "drawn" not in worst:
        return []
    shift, over = found["worst_case"]["translation"], worst["drawn"]["map"]
    name, share = max(shift["shares"].items(), key=lambda pair: pair[1])
    total = sum(shift["shares"].values())
    note = [
        "Over all parts within the drawing tolerances and all clearances, at this pose",
        *(["; over the map ", *_bounds(over)] if over is not None else []),
        f"; {worst['drawn']['assumption']}.",
    ]  # fmt: skip
    if total > 0:
        note.append(f" Largest part of the translation: {name}, {share / total:.0%}.")
    return [Tile("Certified worst case", _bounds(worst["drawn"]["pose"]), note)]


def _bounds(found: dict[str, float]) -> list[str | Value]:
    """Format the bounds of the rotation and translation errors."""
    return rotation_and_translation(found["rotation"], found["translation"], 3)
