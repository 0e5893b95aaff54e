"""The report's sections on parts within the tolerances of the drawing."""

from typing import Any

from forcefit.assembly.statistics.report import draws_sections
from forcefit.page.page import Tile, paragraph, section
from forcefit.page.tables import rotation_and_translation
from forcefit.validation.study.study import StudyResults


def drawn_section(results: StudyResults) -> str:
    """Return statistics, importance and worst case of drawn parts as HTML."""
    found = results.statistics
    if found is None:
        return ""
    about = paragraph(
        f"{found['draws']} machines of parts within the tolerances of the drawing, "
        f"seed {found['seed']}, at this pose. Their errors take the place of those of "
        "the study, and fits have a clearance of each machine. Pose errors: clearance "
        f"{found['clearance']}: {found['clearance_means']}. The other sections use the "
        "errors of the study and the mean clearance of fits."
    )
    left_out = found.get("worst_case_left_out")
    why = paragraph(f"The worst case was left out: {left_out}.") if left_out else ""
    title = section("Tolerances of the drawing", about, why)
    return "".join([title, *draws_sections(found, results.draws)])


def drawn_tiles(found: dict[str, Any] | None) -> list[Tile]:
    """Return the tile of the worst case over all parts within the tolerances."""
    if found is None or "worst_case" not in found:
        return []
    worst = found["worst_case"]
    turn, shift = (worst[key] for key in ("rotation", "translation"))
    bound = rotation_and_translation(turn["bound"], shift["bound"], 3)
    name, share = max(shift["shares"].items(), key=lambda pair: pair[1])
    total = sum(shift["shares"].values())
    note = [f"Over all parts and clearances; {shift['means']}."]
    if total > 0:
        note.append(f" Largest part of the translation: {name}, {share / total:.0%}.")
    return [Tile("Worst case of the drawing", bound, note)]
