"""A diagnosis for a terminal."""

import math
from typing import Any

from validation.diagnosis.calibration import Calibration
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.next_measurement import NextMeasurement, load_text
from validation.diagnosis.results import LISTED, effects, learned, small, steps
from validation.diagnosis.saving import not_measured
from validation.diagnosis.sentence import (
    WORDS,
    calibration_text,
    open_text,
    sentence,
)
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS


def text(diagnosis: Diagnosis, tally: Calibration | None = None) -> str:
    """The diagnosis for a terminal."""
    lines = [f"{diagnosis.campaign.name}: {diagnosis.verdict}", sentence(diagnosis), ""]
    lines += _effects_text(diagnosis)
    for name in (GEOMETRY, SPRINGS):
        lines += _small_text(small(diagnosis, name), name)
    lines += _learned_text(diagnosis)
    lines += ["", "sets of effects, by probability:"]
    for names, p in diagnosis.alternatives:
        lines.append(f"  {p:6.3f}  {' + '.join(names) or 'none'}")
    lines += ["", *_errors_text(diagnosis)]
    lines += ["", *_sequence_text(diagnosis), *diagnosis.remarks]
    if diagnosis.needed:
        lines += ["", f"what would decide: {diagnosis.needed}"]
    missing = not_measured(diagnosis.campaign)
    if missing:
        lines += ["", f"not measured: {', '.join(missing)}"]
    lines += diagnosis.findings
    if diagnosis.noise_in_time is not None:
        noise = diagnosis.noise_in_time
        lines += [
            "",
            f"noise is correlated in time: {100 * noise.share:.0f} % of its variance "
            f"over {noise.constant:.3g} s; the effects' intervals are wider for it",
        ]
    if diagnosis.outliers.any():
        ids = zip(diagnosis.campaign.ids, diagnosis.outliers, strict=True)
        left_out = ", ".join(label for label, outlier in ids if outlier)
        lines += ["", f"left out as outliers: {left_out}"]
    if diagnosis.open.any():
        lines += ["", open_text(diagnosis.open)]
    for trend in diagnosis.trends:
        lines.append(f"left varies with {trend.against}: {100 * trend.share:.0f} %")
    if diagnosis.next is not None:
        lines += ["", *_next_text(diagnosis.next)]
    if tally is not None:
        lines += ["", calibration_text(tally)]
    return "\n".join(lines)


def _effects_text(diagnosis: Diagnosis) -> list[str]:
    """Effects with their parameters, where the verdict lists them."""
    lines = []
    for effect in effects(diagnosis) if diagnosis.verdict in LISTED else []:
        there = f" in session {effect['session']}" if "session" in effect else ""
        how = f"(probability {effect['probability']:.3f})"
        lines.append(f"{effect['name']}{there}  {how}")
        for p in effect["parameters"]:
            line = f"  {p['name']:<28}{p['value']:>14.6g} +- {p['std']:.2g} {p['unit']}"
            if "found" in p:
                line += " (declared {declared:.6g}, found {difference:+.6g})".format(
                    **p["found"]
                )
            lines.append(line)
    return lines


def _learned_text(diagnosis: Diagnosis) -> list[str]:
    """Functions learned, each in two lines or three."""
    lines = []
    for one in learned(diagnosis):
        lines.append(f"learned: {one['label']}")
        formula = one["formula"]
        lines.append(f"  {formula if len(formula) < 160 else formula[:157] + '...'}")
        parts = one["parts_of_range"]
        if parts is not None:
            lines.append(
                "  foretold in parts of {variable} left out: {after:.3g} sigma, "
                "without it {without:.3g}".format(**parts)
            )
        if one["equivalent_places"]:
            lines.append(f"  {len(one['equivalent_places'])} other places do as well")
    return lines


def _errors_text(diagnosis: Diagnosis) -> list[str]:
    """A table of the errors before and after, and of the saved robot."""
    lines = [
        f"errors on {diagnosis.held.words}; saved: on all rows",
        f"{'':<20}{'before':>12}{'after':>12}{'noise':>12}{'saved':>12}",
    ]
    columns = diagnosis.before, diagnosis.after, diagnosis.noise, diagnosis.saved
    noise = diagnosis.noise.normalised
    for name, unit in (("position", "m"), ("rotation", "rad"), ("normalised", "sigma")):
        row = [getattr(errors, name) for errors in columns]
        shown = "".join(
            f"{v:>12.3g}" if math.isfinite(v) else f"{'-':>12}" for v in row
        )
        lines.append(f"{name + ' [' + unit + ']':<20}{shown}")
    if (diagnosis.outliers & diagnosis.held.rows).any():
        cut = [f"{errors.normalised:>12.3g}" for errors in diagnosis.with_outliers]
        lines.append(f"{'with outliers':<20}{cut[0]}{cut[1]}{noise:>12.3g}")
    return lines


def _next_text(following: NextMeasurement) -> list[str]:
    """The measurement that would decide."""
    where = ", ".join(f"{k}={v:.4g}" for k, v in following.configuration.items())
    covariates = "".join(f", {k} {v:g}" for k, v in following.covariates.items())
    return [
        f"measure next: {where}; load {load_text(following.load)}{covariates}",
        f"  {following.why}",
    ]


def _small_text(one: dict[str, Any] | None, name: str) -> list[str]:
    """Geometry or springs in a few lines."""
    if one is None:
        return []
    sizes = ", ".join(
        f"{size:.2g} {one['unit'][kind]}" for kind, size in one["scale"].items()
    )
    frames = sorted(one["frames"], key=lambda f: -f["identifiable"])[:6]
    where = ", ".join(f"{f['frame']} {f['identifiable']:.1f}" for f in frames)
    return [
        f"{WORDS[name]}  (size {sizes or 'as the tolerances say'})",
        f"  {one['identifiable']:.1f} of {one['unknowns']} known: {where}",
    ]


def _sequence_text(diagnosis: Diagnosis) -> list[str]:
    """The model sequence, judged on the held-out rows."""
    rows = steps(diagnosis)
    unit = rows[-1]["unit"]
    lines = [f"{'model':<20}{'unknowns':>10}{unit:>12}{'sigma':>10}{'reduction':>11}"]
    last = math.nan
    for row in rows:
        rms, sigma = row["kept_aside_rms"], row["kept_aside_sigma"]
        reduced = f"{last - rms:>11.3g}" if math.isfinite(last) else f"{'':>11}"
        lines.append(
            f"{row['term']:<20}{row['unknowns']:>10.0f}{rms:>12.3g}{sigma:>10.3g}{reduced}"
        )
        last = rms
    return lines
