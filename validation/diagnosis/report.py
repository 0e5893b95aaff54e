"""Create the report page of a diagnosis."""

from pathlib import Path
from typing import Any

import numpy as np

from forcefit.assembly.model.statuses import AMBIGUOUS, NOT_ENOUGH_ROWS, OUTSIDE_LIBRARY
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
from forcefit.validation.diagnosis import figures, results
from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.next_measurement import load_text
from forcefit.validation.diagnosis.sentence import calibration_text, open_text

_ASSUMED = (
    "Errors are computed on held-out rows, which no model selection or fit used.",
    "The noise of the readings is the stated sigma, unless noted otherwise below.",
    "Effects that are missing in the library appear as learned functions or as outside "
    "the library. Effects that the design cannot distinguish are listed together.",
)
# Verdicts without a confirmed result. The value is None if additional rows could lead
# to a result, and False otherwise.
_GOOD = {AMBIGUOUS: None, NOT_ENOUGH_ROWS: None, OUTSIDE_LIBRARY: False}
NOWHERE = Provenance()
Table = dict[str, Any]


def write_report(
    diagnosis: Diagnosis,
    path: Path | str,
    tally: Calibration | None = None,
    provenance: Provenance = NOWHERE,
) -> None:
    """Write the report page of a diagnosis.

    Args:
        diagnosis: the diagnosis.
        path: path of the page.
        tally: error rates from simulated campaigns, None to omit them.
        provenance: the command and its input files.

    Raises:
        BadInput: the page cannot be written.
    """
    write_text(report_page(diagnosis, tally, provenance), path)


def report_page(
    diagnosis: Diagnosis,
    tally: Calibration | None = None,
    provenance: Provenance = NOWHERE,
) -> str:
    """Return the report page as self-contained HTML.

    The arguments are the same as for :func:`write_report`.
    """
    campaign, answer = diagnosis.campaign, results.table(diagnosis, tally)
    body = [
        section("Errors before and after", figures.error_chart(diagnosis)),
        section(
            "Models and error reduction",
            figures.sequence_chart(diagnosis),
            _steps(answer),
        ),
        *_section("The robot at the largest error", figures.worst_robot(diagnosis)),
        *_section("Learned functions", _learned(answer)),
        *_section(*_parameters(answer)),
        section("Residual of the rows", figures.vector_charts(diagnosis)),
        section(
            "Variation of the residual",
            figures.covariate_charts(diagnosis),
            *_structure(answer),
        ),
        section(
            "Probability of the effects",
            figures.probability_chart(diagnosis),
            _sets(answer),
        ),
        section(
            "Effects that this design distinguishes",
            figures.confounding_chart(diagnosis),
        ),
        *_next(answer),
        section("Noise and outliers", *map(paragraph, _noise(diagnosis))),
    ]
    if tally is not None:
        tally_text = paragraph(calibration_text(tally))
        body.append(section("Simulated success rate", tally_text))
    return page(
        Page(
            title=f"Diagnosis of {campaign.name}",
            verdict=answer["sentence"],
            good=_GOOD.get(diagnosis.verdict, True),
            tiles=_tiles(diagnosis),
            about=f"{len(campaign)} rows, robot {campaign.robot.name}; "
            f"{diagnosis.held.words}.",
            body=body,
            assumed=_ASSUMED,
            provenance=provenance,
            results=answer,
        )
    )


def _section(title: str, content: str) -> list[str]:
    """Return a section of the page in a list, or an empty list without content."""
    return [section(title, content)] if content else []


def _tiles(diagnosis: Diagnosis) -> list[Tile]:
    """Return tiles for verdict, errors, most probable effect and next measurement."""
    before, after = diagnosis.before, diagnosis.after
    tiles = [Tile("Verdict", [diagnosis.verdict.replace("_", " ")])]
    for kind, unit in (("rotation", "rad"), ("position", "m")):
        values = [getattr(errors, kind) for errors in (before, after)]
        if all(v == v for v in values):  # NaN if not measured
            tiles.append(Tile(f"Error of {kind}, rms", [
                Value(values[0], unit, 3), " to ", Value(values[1], unit, 3),
            ], ["Errors before and after, on held-out rows."]))  # fmt: skip
    names = " + ".join(diagnosis.effects) or "nothing"
    likely = max(diagnosis.probability.values(), default=0.0)
    tiles.append(Tile("Most probable cause", [names.replace("_", " ")],
                      [f"Largest probability of an effect {likely:.3f}."]))  # fmt: skip
    if diagnosis.next is not None:
        tiles.append(Tile("Next measurement", [diagnosis.next.why]))
    return tiles


def _steps(answer: Table) -> str:
    """Tabulate the model sequence."""
    rows: list[list[Cell]] = [
        [row["term"], f"{row['unknowns']:.0f}",
         Value(row["kept_aside_rms"], row["unit"], 3),
         Value(row["kept_aside_sigma"], "", 3)]
        for row in answer["ladder"]
    ]  # fmt: skip
    return table(["model", "unknowns", "held-out rms", "sigma"], rows, "steps")


def _sets(answer: Table) -> str:
    """Tabulate the alternative sets of effects with their probabilities."""
    rows: list[list[Cell]] = [
        [" + ".join(one["names"]) or "none", one["probability"]]
        for one in answer["alternatives"]
    ]
    return table(["set of effects", Column("probability", digits=3)], rows)


def _learned(answer: Table) -> str:
    """Tabulate the learned functions."""
    rows = [
        [f"{one['where']} {', '.join(one['components'])}", ", ".join(one["variables"]),
         one["form"], one["formula"]]
        for one in answer["learned"]
    ]  # fmt: skip
    head = ["where", "of", "form", "value [rad, m, per N m or N]"]
    return table(head, rows) if rows else ""


def _parameters(answer: Table) -> tuple[str, str]:
    """Return the title and the table of the effect parameters."""
    rows: list[list[Cell]] = [
        [f"{effect['name']}: {p['name']}", Value(p["value"], p["unit"], 6),
         Value(p["std"], p["unit"], 2),
         *(Value(end, p["unit"], 6) for end in p["interval_90"])]
        for effect in answer["effects"] for p in effect["parameters"]
    ]  # fmt: skip
    title = (
        "Parameters of the best set" if answer["verdict"] == AMBIGUOUS else "Parameters"
    )
    head = ["parameter", "value", "standard deviation", "at least (90 %)", "at most"]
    listed = answer["verdict"] in results.LISTED
    return title, table(head, rows, "parameters") if listed else ""


def _structure(answer: Table) -> list[str]:
    """Tabulate the variables on which the residual depends."""
    rows: list[list[Cell]] = [
        [t["against"], f"{100 * t['share']:.0f} %", f"{t['probability']:.1g}"]
        for t in answer["structure"]
    ]
    if not rows:
        return []
    return [
        paragraph("The residual after the best set of effects varies with:"),
        table(["variable", "fraction of the squared residual", "p-value"], rows),
    ]


def _next(answer: Table) -> list[str]:
    """Return the section about the next measurement."""
    following = answer["next_measurement"]
    if following is None:
        return []
    rows = [[k, f"{v:.6g}"] for k, v in following["configuration"].items()]
    rows.append(["load [N m, N]", load_text(following["load"])])
    rows += [[k, f"{v:g}"] for k, v in following["covariates"].items()]
    commands = table(["command", "value"], rows)
    return [section("Next measurement", paragraph(f"{following['why']}."), commands)]


def _noise(diagnosis: Diagnosis) -> list[str]:
    """Describe the noise and the outliers in sentences."""
    lack = diagnosis.lack
    far = np.array(diagnosis.campaign.ids)[diagnosis.outliers]
    repeats = "the campaign contains no repeats"
    if lack.repeats_freedom:
        repeats = f"the scatter of repeats is {lack.repeats:.2f} times the stated sigma"
    texts = [
        f"The residual is {lack.rms:.2f} times the stated sigma (p-value "
        f"{lack.probability:.2g}); {repeats}.",
        f"Rows excluded as outliers: {', '.join(far) or 'none'}.",
    ]
    if diagnosis.open.any():
        texts.append(f"{open_text(diagnosis.open)}.")
    return texts
