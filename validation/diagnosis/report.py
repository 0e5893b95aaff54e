"""A diagnosis as one self-contained page."""

from pathlib import Path
from typing import Any

import numpy as np

from assembly.model.statuses import AMBIGUOUS, EXPLAINED, LEARNED, NONE_NEEDED
from forcefit.inputs.writing import write_text
from forcefit.page.page import (
    Page,
    Provenance,
    Tile,
    page,
    paragraph,
    section,
)
from forcefit.page.tables import Cell, Column, Value, table
from validation.diagnosis import figures, results
from validation.diagnosis.calibration import Calibration
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.sentence import calibration_text, open_text

_ASSUMED = (
    "Held-out rows chose and fitted nothing; errors before and after are theirs.",
    "Readings scatter as their sigma states, unless the noise below says otherwise.",
    "An effect that is none of the library shows as a function learned, or as outside "
    "the library; effects that the design cannot tell apart are named together.",
)
NOWHERE = Provenance()
Table = dict[str, Any]


def write_report(
    diagnosis: Diagnosis,
    path: Path | str,
    tally: Calibration | None = None,
    provenance: Provenance = NOWHERE,
) -> None:
    """Write the page, whole or not at all.

    Args:
        diagnosis: the diagnosis.
        path: of the page.
        tally: how often it is right on this design, if that was simulated.
        provenance: command and files.

    Raises:
        BadInput: it cannot be written.
    """
    write_text(report_page(diagnosis, tally, provenance), path)


def report_page(
    diagnosis: Diagnosis,
    tally: Calibration | None = None,
    provenance: Provenance = NOWHERE,
) -> str:
    """The page as HTML with its charts inside; see :func:`write_report`."""
    campaign, told = diagnosis.campaign, results.table(diagnosis, tally)
    body = [
        section("Before and after", figures.error_chart(diagnosis)),
        section(
            "Models, and what each reduces",
            figures.sequence_chart(diagnosis),
            _steps(told),
        ),
        *_section(
            "The robot where the error is largest", figures.worst_robot(diagnosis)
        ),
        *_section("Learned", _learned(told)),
        *_section(*_parameters(told)),
        section("Where the residual is", figures.vector_charts(diagnosis)),
        section(
            "What it varies with",
            figures.covariate_charts(diagnosis),
            *_structure(told),
        ),
        section("Which effect", figures.probability_chart(diagnosis), _sets(told)),
        section(
            "What this design can tell apart", figures.confounding_chart(diagnosis)
        ),
        *_next(told),
        section("Noise and outliers", *map(paragraph, _noise(diagnosis))),
    ]
    if tally is not None:
        told_tally = paragraph(calibration_text(tally))
        body.append(section("How often this is right", told_tally))
    return page(
        Page(
            title=f"Diagnosis of {campaign.name}",
            verdict=told["sentence"],
            good=diagnosis.verdict in {EXPLAINED, LEARNED, NONE_NEEDED},
            tiles=_tiles(diagnosis),
            about=f"{len(campaign)} rows, robot {campaign.robot.name}; "
            f"{diagnosis.held.words}.",
            body=body,
            assumed=_ASSUMED,
            provenance=provenance,
            results=told,
        )
    )


def _section(title: str, content: str) -> list[str]:
    """A section, unless it is empty."""
    return [section(title, content)] if content else []


def _tiles(diagnosis: Diagnosis) -> list[Tile]:
    """Verdict, error before and after, the likeliest effect, what to measure."""
    before, after = diagnosis.before, diagnosis.after
    tiles = [Tile("Verdict", [diagnosis.verdict.replace("_", " ")])]
    for kind, unit in (("position", "m"), ("rotation", "rad")):
        values = [getattr(errors, kind) for errors in (before, after)]
        if all(v == v for v in values):  # NaN: not measured
            tiles.append(Tile(f"Error of {kind}, rms", [
                Value(values[0], unit, 3), " to ", Value(values[1], unit, 3),
            ], ["before and after, on held-out rows."]))  # fmt: skip
    names = " + ".join(diagnosis.effects) or "nothing"
    likely = max(diagnosis.probability.values(), default=0.0)
    tiles.append(Tile("Likeliest cause", [names.replace("_", " ")],
                      [f"probability of an effect up to {likely:.3f}."]))  # fmt: skip
    if diagnosis.next is not None:
        tiles.append(Tile("Measure next", [diagnosis.next.why]))
    return tiles


def _steps(told: Table) -> str:
    """Table of the model sequence."""
    rows: list[list[Cell]] = [
        [row["term"], f"{row['unknowns']:.0f}",
         Value(row["kept_aside_rms"], row["unit"], 3),
         Value(row["kept_aside_sigma"], "", 3)]
        for row in told["ladder"]
    ]  # fmt: skip
    return table(["model", "unknowns", "rms held out", "sigma"], rows, "steps")


def _sets(told: Table) -> str:
    """Table of the sets of effects."""
    rows: list[list[Cell]] = [
        [" + ".join(one["names"]) or "none", one["probability"]]
        for one in told["alternatives"]
    ]
    return table(["set of effects", Column("probability", digits=3)], rows)


def _learned(told: Table) -> str:
    """Table of the functions learned."""
    rows = [
        [f"{one['where']} {', '.join(one['components'])}", ", ".join(one["variables"]),
         one["form"], one["formula"]]
        for one in told["learned"]
    ]  # fmt: skip
    head = ["where", "of", "form", "value [rad, m, per N m or N]"]
    return table(head, rows) if rows else ""


def _parameters(told: Table) -> tuple[str, str]:
    """Title and table of the best set's numbers."""
    rows: list[list[Cell]] = [
        [f"{effect['name']}: {p['name']}", Value(p["value"], p["unit"], 6),
         Value(p["std"], p["unit"], 2),
         *(Value(end, p["unit"], 6) for end in p["interval_90"])]
        for effect in told["effects"] for p in effect["parameters"]
    ]  # fmt: skip
    title = "Parameters, if so" if told["verdict"] == AMBIGUOUS else "Parameters"
    head = ["parameter", "value", "standard deviation", "at least (90 %)", "at most"]
    listed = told["verdict"] in results.LISTED
    return title, table(head, rows, "parameters") if listed else ""


def _structure(told: Table) -> list[str]:
    """Table of what the residual varies with."""
    rows: list[list[Cell]] = [
        [t["against"], f"{100 * t['share']:.0f} %", f"{t['probability']:.1g}"]
        for t in told["structure"]
    ]
    if not rows:
        return []
    return [
        paragraph("What is left after the best set of effects varies with:"),
        table(["against", "share of its square", "by chance"], rows),
    ]


def _next(told: Table) -> list[str]:
    """What to measure next."""
    following = told["next_measurement"]
    if following is None:
        return []
    rows = [[k, f"{v:.6g}"] for k, v in following["configuration"].items()]
    rows.append(["load [N m, N]", load_text(following["load"])])
    rows += [[k, f"{v:g}"] for k, v in following["covariates"].items()]
    commands = table(["command", "value"], rows)
    return [section("Measure next", paragraph(f"{following['why']}."), commands)]


def _noise(diagnosis: Diagnosis) -> list[str]:
    """How the noise was judged, and which rows were left out."""
    lack = diagnosis.lack
    far = np.array(diagnosis.campaign.ids)[diagnosis.outliers]
    repeats = "no repeats to judge it by"
    if lack.repeats_freedom:
        repeats = f"{lack.repeats:.2f} between repeats"
    texts = [
        f"What is left is {lack.rms:.2f} of the stated sigma (probability "
        f"{lack.probability:.2g} by chance); {repeats}.",
        f"Left out as outliers: {', '.join(far) or 'none'}.",
    ]
    if diagnosis.open.any():
        texts.append(f"{open_text(diagnosis.open)}.")
    return texts
