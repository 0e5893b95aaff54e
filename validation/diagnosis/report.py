"""A diagnosis as one self-contained page."""

import html
from pathlib import Path

from forcefit.inputs.writing import write_text
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.figures import (
    confounding_figure,
    covariate_figure,
    error_figure,
    ladder_figure,
    probability_figure,
    vector_figure,
)
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.results import LISTED, effects, learned, steps
from validation.diagnosis.sentence import calibration_text, open_text, sentence
from validation.diagnosis.verdict import Calibration
from validation.html import html_figure, html_page, html_table


def write_report(
    diagnosis: Diagnosis, path: Path | str, tally: Calibration | None = None
) -> None:
    """Write the page, whole or not at all.

    Args:
        diagnosis: the diagnosis.
        path: of the page.
        tally: how often it is right on this design, if that was simulated.

    Raises:
        BadInput: it cannot be written.
    """
    write_text(report_page(diagnosis, tally), path)


def report_page(diagnosis: Diagnosis, tally: Calibration | None = None) -> str:
    """The page as HTML with its pictures inside.

    Args:
        diagnosis: the diagnosis.
        tally: how often it is right on this design, if that was simulated.

    Returns:
        The whole page.
    """
    campaign = diagnosis.campaign
    settled = diagnosis.verdict in {"explained", "learned", "none_needed"}
    parts = [
        f"<h1>Diagnosis of {html.escape(campaign.name)}</h1>",
        f"<p class='verdict {'good' if settled else 'bad'}'>"
        f"{html.escape(sentence(diagnosis))}</p>",
        f"<p>{len(campaign)} rows, robot {html.escape(campaign.robot.name)}; "
        f"{html.escape(diagnosis.split.how)}.</p>",
        "<h2>Before and after</h2>",
        html_figure(error_figure(diagnosis), "Rows that chose and fitted nothing."),
        "<h2>What every step bought</h2>",
        html_figure(ladder_figure(diagnosis), "Line at 1: noise as stated."),
        html_table(
            ["step", "unknowns", "rms kept aside", "unit", "sigma"],
            [
                [
                    row["term"],
                    f"{row['unknowns']:.0f}",
                    f"{row['kept_aside_rms']:.3g}",
                    row["unit"],
                    f"{row['kept_aside_sigma']:.3g}",
                ]
                for row in steps(diagnosis)
            ],
        ),
        *_learned(diagnosis),
        *_parameters(diagnosis),
        "<h2>Where the residual is</h2>",
        html_figure(vector_figure(diagnosis), "All rows but outliers."),
        "<h2>What it varies with</h2>",
        html_figure(covariate_figure(diagnosis), "Line at 1: noise as stated."),
        *_structure(diagnosis),
        "<h2>Which effect</h2>",
        html_figure(
            probability_figure(diagnosis), "Posterior weight of all sets with it."
        ),
        html_table(
            ["set of effects", "probability"],
            [[" + ".join(n) or "none", f"{p:.3f}"] for n, p in diagnosis.alternatives],
        ),
        "<h2>What this design can tell apart</h2>",
        html_figure(
            confounding_figure(diagnosis),
            "1: whatever the row's effect does, the column's can do as well.",
        ),
        *_next(diagnosis),
        *_noise(diagnosis),
    ]
    if tally is not None:
        parts += [
            "<h2>How often this is right</h2>",
            f"<p>{html.escape(calibration_text(tally))}</p>",
        ]
    return html_page(f"Diagnosis of {campaign.name}", "\n".join(parts))


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
    return ["<h2>Learned</h2>", html_table(head, rows)]


def _parameters(diagnosis: Diagnosis) -> list[str]:
    """Table of the best set's numbers."""
    if diagnosis.verdict not in LISTED:
        return []
    rows = []
    for effect in effects(diagnosis):
        for p in effect["parameters"]:
            low, high = p["interval_90"]
            rows.append([
                f"{effect['name']}: {p['name']}",
                f"{p['value']:.6g}",
                f"{p['std']:.2g}",
                f"{low:.6g} .. {high:.6g}",
                p["unit"],
            ])
    title = "Parameters, if so" if diagnosis.verdict == "ambiguous" else "Parameters"
    head = ["parameter", "value", "std", "90 % interval", "unit"]
    return [f"<h2>{title}</h2>", html_table(head, rows)]


def _structure(diagnosis: Diagnosis) -> list[str]:
    """Table of what is left varies with."""
    if not diagnosis.trends:
        return []
    rows = [
        [t.against, f"{100 * t.share:.0f} %", f"{t.probability:.1g}"]
        for t in diagnosis.trends
    ]
    return [
        "<p>What is left after the best set of effects varies with:</p>",
        html_table(["against", "share of its square", "by chance"], rows),
    ]


def _next(diagnosis: Diagnosis) -> list[str]:
    """What to measure next."""
    if diagnosis.next is None:
        return []
    rows = [[k, f"{v:.6g}"] for k, v in diagnosis.next.configuration.items()]
    rows.append(["load [N m, N]", load_text(diagnosis.next.load)])
    rows += [[k, f"{v:g}"] for k, v in diagnosis.next.covariates.items()]
    return [
        "<h2>Measure next</h2>",
        f"<p>{html.escape(diagnosis.next.why)}.</p>",
        html_table(["command", "value"], rows),
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
    return [
        "<h2>Noise and outliers</h2>",
        f"<p>What is left is {lack.rms:.2f} of the stated sigma (probability "
        f"{lack.probability:.2g} by chance); {repeats}.</p>",
        f"<p>Left out as outliers: {html.escape(', '.join(far)) or 'none'}.</p>",
        *(
            [f"<p>{html.escape(open_text(diagnosis.open))}.</p>"]
            if diagnosis.open.any()
            else []
        ),
    ]
