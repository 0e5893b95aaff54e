"""A diagnosis as one self-contained page."""

from pathlib import Path

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
from validation.diagnosis import results
from validation.diagnosis.calibration import Calibration
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.figures import (
    confounding_chart,
    covariate_charts,
    error_chart,
    probability_chart,
    sequence_chart,
    vector_charts,
)
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.results import LISTED, effects, learned, steps
from validation.diagnosis.scene import worst_robot
from validation.diagnosis.sentence import calibration_text, open_text, sentence

_ASSUMED = (
    "Held-out rows chose and fitted nothing; errors before and after are theirs.",
    "Readings scatter as their sigma states, unless the noise below says otherwise.",
    "An effect that is none of the library shows as a function learned, or as outside "
    "the library; effects that the design cannot tell apart are named together.",
)
NOWHERE = Provenance()


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
    """The page as HTML with its charts inside.

    Args:
        diagnosis: the diagnosis.
        tally: how often it is right on this design, if that was simulated.
        provenance: command and files.

    Returns:
        The whole page.
    """
    campaign = diagnosis.campaign
    body = [
        section("Before and after", error_chart(diagnosis)),
        section(
            "Models, and what each reduces",
            sequence_chart(diagnosis),
            _steps(diagnosis),
        ),
        *_robot(diagnosis),
        *_learned(diagnosis),
        *_parameters(diagnosis),
        section("Where the residual is", vector_charts(diagnosis)),
        section(
            "What it varies with", covariate_charts(diagnosis), *_structure(diagnosis)
        ),
        section("Which effect", probability_chart(diagnosis), _sets(diagnosis)),
        section("What this design can tell apart", confounding_chart(diagnosis)),
        *_next(diagnosis),
        *_noise(diagnosis),
    ]
    if tally is not None:
        body.append(
            section("How often this is right", paragraph(calibration_text(tally)))
        )
    return page(
        Page(
            title=f"Diagnosis of {campaign.name}",
            verdict=sentence(diagnosis),
            good=diagnosis.verdict in {"explained", "learned", "none_needed"},
            tiles=_tiles(diagnosis),
            about=f"{len(campaign)} rows, robot {campaign.robot.name}; "
            f"{diagnosis.held.words}.",
            body=body,
            assumed=_ASSUMED,
            provenance=provenance,
            results=results.table(diagnosis, tally),
        )
    )


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


def _robot(diagnosis: Diagnosis) -> list[str]:
    """The robot where the declared model errs most."""
    drawn = worst_robot(diagnosis)
    return [section("The robot where the error is largest", drawn)] if drawn else []


def _steps(diagnosis: Diagnosis) -> str:
    """Table of the model sequence."""
    rows: list[list[Cell]] = [
        [row["term"], f"{row['unknowns']:.0f}",
         Value(row["kept_aside_rms"], row["unit"], 3),
         Value(row["kept_aside_sigma"], "", 3)]
        for row in steps(diagnosis)
    ]  # fmt: skip
    return table(["model", "unknowns", "rms held out", "sigma"], rows, "steps")


def _sets(diagnosis: Diagnosis) -> str:
    """Table of the sets of effects."""
    rows: list[list[Cell]] = [
        [" + ".join(n) or "none", p] for n, p in diagnosis.alternatives
    ]
    return table(["set of effects", Column("probability", digits=3)], rows)


def _learned(diagnosis: Diagnosis) -> list[str]:
    """Table of the functions learned."""
    rows = [
        [f"{one['where']} {', '.join(one['components'])}", ", ".join(one["variables"]),
         one["form"], one["formula"]]
        for one in learned(diagnosis)
    ]  # fmt: skip
    if not rows:
        return []
    head = ["where", "of", "form", "value [rad, m, per N m or N]"]
    return [section("Learned", table(head, rows))]


def _parameters(diagnosis: Diagnosis) -> list[str]:
    """Table of the best set's numbers."""
    if diagnosis.verdict not in LISTED:
        return []
    rows: list[list[Cell]] = []
    for effect in effects(diagnosis):
        for p in effect["parameters"]:
            low, high = p["interval_90"]
            rows.append([
                f"{effect['name']}: {p['name']}",
                Value(p["value"], p["unit"], 6), Value(p["std"], p["unit"], 2),
                Value(low, p["unit"], 6), Value(high, p["unit"], 6),
            ])  # fmt: skip
    title = "Parameters, if so" if diagnosis.verdict == "ambiguous" else "Parameters"
    head = ["parameter", "value", "standard deviation", "at least (90 %)", "at most"]
    return [section(title, table(head, rows, "parameters"))]


def _structure(diagnosis: Diagnosis) -> list[str]:
    """Table of what is left varies with."""
    if not diagnosis.trends:
        return []
    rows: list[list[Cell]] = [
        [t.against, f"{100 * t.share:.0f} %", f"{t.probability:.1g}"]
        for t in diagnosis.trends
    ]
    return [
        paragraph("What is left after the best set of effects varies with:"),
        table(["against", "share of its square", "by chance"], rows),
    ]


def _next(diagnosis: Diagnosis) -> list[str]:
    """What to measure next."""
    if diagnosis.next is None:
        return []
    rows = [[k, f"{v:.6g}"] for k, v in diagnosis.next.configuration.items()]
    rows.append(["load [N m, N]", load_text(diagnosis.next.load)])
    rows += [[k, f"{v:g}"] for k, v in diagnosis.next.covariates.items()]
    return [
        section(
            "Measure next",
            paragraph(f"{diagnosis.next.why}."),
            table(["command", "value"], rows),
        )
    ]


def _noise(diagnosis: Diagnosis) -> list[str]:
    """How the noise was judged, and which rows were left out."""
    far = [
        i for i, o in zip(diagnosis.campaign.ids, diagnosis.outliers, strict=True) if o
    ]
    lack = diagnosis.lack
    repeats = (
        f"{lack.repeats:.2f} between repeats"
        if lack.repeats_freedom
        else "no repeats to judge it by"
    )
    texts = [
        f"What is left is {lack.rms:.2f} of the stated sigma (probability "
        f"{lack.probability:.2g} by chance); {repeats}.",
        f"Left out as outliers: {', '.join(far) or 'none'}.",
    ]
    if diagnosis.open.any():
        texts.append(f"{open_text(diagnosis.open)}.")
    return [section("Noise and outliers", *map(paragraph, texts))]
