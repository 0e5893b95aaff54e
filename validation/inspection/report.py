"""Create the report page of an inspection."""

from forcefit.page.page import Page, Provenance, Tile, listed, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table
from forcefit.validation.campaign.campaign import READING
from forcefit.validation.diagnosis.figures import imitation_chart
from forcefit.validation.diagnosis.sentence import open_text
from forcefit.validation.inspection.counts import (
    covariate_counts,
    load_counts,
    reading_counts,
)
from forcefit.validation.inspection.inspection import Inspection
from forcefit.validation.inspection.remark import CAREFUL, LOST

_ASSUMED = (
    "Effects have the plausible sizes that the library assumes. Real effects may be "
    "larger or smaller.",
    "The noise of the readings is the stated sigma, unless repeats indicate otherwise.",
    "No effect is fitted. Readings are used only to estimate the noise from repeats.",
)
_HEADS = {LOST: "What this campaign cannot determine", CAREFUL: "Warnings"}
Cells = list[list[Cell]]


def inspection_page(inspection: Inspection, provenance: Provenance) -> str:
    """Return the report page of an inspection as self-contained HTML.

    Args:
        inspection: result of
            :func:`forcefit.validation.inspection.inspection.inspect_campaign`.
        provenance: command and input files.
    """
    c = inspection.campaign
    return page(
        Page(
            title=f"Inspection of {c.name}",
            verdict=_verdict(inspection),
            good=_good(inspection),
            tiles=_tiles(inspection),
            about=f"{len(c)} rows of {c.robot.name}, commanded by {c.commanded}, "
            f"registration {c.registration}.",
            body=[
                *_remarks(inspection),
                _effects(inspection),
                _distinguished(inspection),
                _readings(inspection),
                _suspects(inspection),
                _conditions(inspection),
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=inspection.table(),
        )
    )


def _texts(inspection: Inspection, weight: str) -> list[str]:
    """Return the texts of all remarks of one level."""
    return [one.text for one in inspection.remarks if one.weight == weight]


def _verdict(inspection: Inspection) -> str:
    """Summarise the inspection in one sentence."""
    seen, count = int(inspection.separability.visible.sum()), _library(inspection)
    text = f"The design can reveal {seen} of {count} library effects"
    counts = {
        "cannot be determined": len(_texts(inspection, LOST)),
        "warnings": len(_texts(inspection, CAREFUL)),
    }
    words = [
        f"{n} {'aspect ' if n == 1 else 'aspects '}{what}" if what[0] == "c"
        else f"{n} {what[:-1] if n == 1 else what}"
        for what, n in counts.items() if n
    ]  # fmt: skip
    return f"{text}; {', '.join(words) or 'no warnings'}."


def _library(inspection: Inspection) -> int:
    """Return the number of library effects."""
    return len(inspection.separability.names) + len(inspection.signatures.untestable)


def _good(inspection: Inspection) -> bool | None:
    """Return True for a good design, None for warnings, False for a useless design."""
    unregistered = bool(inspection.signatures.unregistered)
    if unregistered or not inspection.separability.visible.any():
        return False
    return None if any(_texts(inspection, weight) for weight in _HEADS) else True


def _tiles(inspection: Inspection) -> list[Tile]:
    """Return tiles about the rows, the noise and the effects."""
    s, noise = inspection.separability, inspection.noise
    tiles = [
        Tile("Rows", [str(len(inspection.campaign))],
             [f"{inspection.visits.sets} configurations repeated, "
              f"{inspection.visits.order}."]),
    ]  # fmt: skip
    if noise is not None:
        low, high = noise.interval
        tiles.append(Tile("Noise from repeats", [f"{noise.ratio:.2f} times sigma"],
                          [f"{low:.2f} to {high:.2f} at 90 %."]))  # fmt: skip
    seen = f"{int(s.visible.sum())} of {_library(inspection)}"
    tiles.append(Tile("Detectable effects", [seen], ["at plausible sizes."]))
    groups = s.classes()
    alike = "; ".join(", ".join(group) for group in groups) or "none"
    tiles.append(Tile("Groups that cannot be distinguished", [str(len(groups))],
                      [f"{alike}."]))  # fmt: skip
    return tiles


def _remarks(inspection: Inspection) -> list[str]:
    """Return one section for each level of remarks."""
    found = {head: _texts(inspection, weight) for weight, head in _HEADS.items()}
    if inspection.open.any():
        found[_HEADS[CAREFUL]].append(f"{open_text(inspection.open)}.")
    return [section(head, listed(texts)) for head, texts in found.items() if texts]


def _effects(inspection: Inspection) -> str:
    """Tabulate the smallest detectable size of each effect."""
    s = inspection.separability
    rows: Cells = [
        [name, "yes" if s.visible[i] else "if larger" if s.traced[i] else "no",
         float(s.shows_at[i]), float(s.strength[i]), float(s.left[i]),
         f"{s.rank[i]} of {s.unknowns[i]}"]
        for i, name in enumerate(s.names)
    ]  # fmt: skip
    head: list[str | Column] = [
        "effect", "detectable", Column("if larger than this multiple"),
        Column("signature [sigma]"), Column("fraction without registration"),
        "unknowns determined",
    ]  # fmt: skip
    untestable = [f"{k}: {why}" for k, why in inspection.signatures.untestable.items()]
    pieces = [table(head, rows, "effects")]
    if untestable:
        pieces += [paragraph("Not testable:"), listed(untestable)]
    return section("Effects", *pieces)


def _distinguished(inspection: Inspection) -> str:
    """Show in a chart and a list which effects can imitate each other."""
    s = inspection.separability
    texts = [f"{', '.join(group)} cannot be distinguished." for group in s.classes()]
    texts += [f"{b} can reproduce every effect of {a}." for a, b in s.imitated()]
    pieces = [listed(texts)] if texts else []
    if len(s.names):
        pieces.append(imitation_chart(s.shared, s.names))
    return section("Effects that this design distinguishes", *pieces)


def _readings(inspection: Inspection) -> str:
    """Tabulate the rms, declared sigma and noise of each measured component."""
    rows: Cells = []
    for k, one in enumerate(reading_counts(inspection.campaign).values()):
        if not one["measured"]:
            continue
        unit = "rad" if k < 3 else "m"
        noise = [float("nan")] * 3
        if inspection.noise is not None:
            interval = inspection.noise.component_interval[k]
            noise = [float(inspection.noise.component[k]), *map(float, interval)]
        sizes = [one["rms"], *one["sigma"], *noise]
        rows.append([READING[k], str(one["measured"]), str(one["missing"]),
                     *(Value(float(v), unit, 3) for v in sizes)])  # fmt: skip
    head = ["reading", "measured", "missing", "rms", "least sigma", "largest sigma",
            "noise from repeats", "at least (90 %)", "at most"]  # fmt: skip
    return section("Readings and noise", table(head, rows, "readings"))


def _suspects(inspection: Inspection) -> str:
    """Tabulate the readings that deviate too much from their repeats."""
    if inspection.noise is None or not inspection.noise.suspects:
        return ""
    ids = inspection.campaign.ids
    rows: Cells = [
        [" or ".join(ids[i] for i in one.rows), one.component, abs(one.size)]
        for one in inspection.noise.suspects
    ]
    head: list[str | Column] = ["row", "reading", Column("standard deviations", "", 3)]
    return section("Suspect readings", table(head, rows, "suspects"))


def _conditions(inspection: Inspection) -> str:
    """Tabulate the number of values and the range of loads and covariates."""
    loads = load_counts(inspection.campaign)
    rows: Cells = [
        [kind, str(loads["levels"]), *(Value(float(v), unit) for v in loads[kind])]
        for kind, unit in (("moment", "N m"), ("force", "N"))
    ]
    rows += [
        [name, str(one["levels"]), *map(float, one["range"])]
        for name, one in covariate_counts(inspection.campaign).items()
    ]
    text = paragraph(f"{loads['unloaded_rows']} rows are without load.")
    head = ["quantity", "levels", "least", "largest"]
    return section("Loads and covariates", text, table(head, rows, "conditions"))
