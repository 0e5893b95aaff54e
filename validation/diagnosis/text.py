"""Format the results of a diagnosis as text for a terminal."""

import math
from typing import Any

from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.next_measurement import load_text
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.sentence import WORDS, calibration_text, open_text

Table = dict[str, Any]


def text(diagnosis: Diagnosis, tally: Calibration | None = None) -> str:
    """Format a diagnosis as text for a terminal."""
    answer = table(diagnosis, tally)
    lines = [f"{answer['campaign']}: {answer['verdict']}", answer["sentence"], ""]
    for effect in answer["effects"]:
        lines += _effect_lines(effect)
    for name in (GEOMETRY, SPRINGS):
        lines += _small_lines(answer[name], name)
    for function in answer["learned"]:
        lines += _function_lines(function)
    lines += ["", "sets of effects, by probability:"]
    for one in answer["alternatives"]:
        lines.append(
            f"  {one['probability']:6.3f}  {' + '.join(one['names']) or 'none'}"
        )
    lines += [
        "",
        *_error_lines(answer),
        "",
        *_sequence_lines(answer),
        *answer["remarks"],
    ]
    notes = {
        "required for a verdict": answer["needed"],
        "not measured": ", ".join(answer["not_measured"]),
    }
    for what, words in notes.items():
        lines += ["", f"{what}: {words}"] if words else []
    lines += answer["noise_scale"]["findings"]
    if answer["noise_in_time"] is not None:
        share, constant = (answer["noise_in_time"][k] for k in ("share", "constant"))
        lines += [
            "",
            f"noise is correlated in time: {100 * share:.0f} % of its variance has a "
            f"correlation time of {constant:.3g} s, which the intervals include",
        ]
    if answer["outliers"]:
        lines += ["", f"excluded as outliers: {', '.join(answer['outliers'])}"]
    if answer["open"]:
        lines += ["", open_text(diagnosis.open)]
    for trend in answer["structure"]:
        lines.append(
            f"residual varies with {trend['against']}: {100 * trend['share']:.0f} %"
        )
    if answer["next_measurement"] is not None:
        lines += ["", *_next_lines(answer["next_measurement"])]
    if tally is not None:
        lines += ["", calibration_text(tally)]
    return "\n".join(lines)


def _effect_lines(effect: Table) -> list[str]:
    """Return lines about a library effect."""
    if "combinations" in effect:
        return []
    there = f" in session {effect['session']}" if "session" in effect else ""
    lines = [f"{effect['name']}{there}  (probability {effect['probability']:.3f})"]
    for p in effect["parameters"]:
        line = f"  {p['name']:<28}{p['value']:>14.6g} +- {p['std']:.2g} {p['unit']}"
        if "found" in p:
            line += " (declared {declared:.6g}, difference {difference:+.6g})".format(
                **p["found"]
            )
        lines.append(line)
    return lines


def _small_lines(one: Table | None, name: str) -> list[str]:
    """Return lines about the geometric errors or the springs."""
    if one is None:
        return []
    sizes = ", ".join(
        f"{size:.2g} {one['unit'][kind]}" for kind, size in one["scale"].items()
    )
    frames = sorted(one["frames"], key=lambda f: -f["identifiable"])[:6]
    where = ", ".join(f"{f['frame']} {f['identifiable']:.1f}" for f in frames)
    return [
        f"{WORDS[name]}  (prior std {sizes or 'from the tolerances'})",
        f"  {one['identifiable']:.1f} of {one['unknowns']} determined: {where}",
    ]


def _function_lines(one: Table) -> list[str]:
    """Return lines about a learned function."""
    formula, parts = one["formula"], one["parts_of_range"]
    short = formula if len(formula) < 160 else f"{formula[:157]}..."
    lines = [f"learned: {one['label']}", f"  {short}"]
    if parts is not None:
        lines.append(
            "  extrapolation error over the range of {variable}: {after:.3g} sigma, "
            "without the function {without:.3g} sigma".format(**parts)
        )
    if one["equivalent_places"]:
        lines.append(f"  {len(one['equivalent_places'])} equivalent other locations")
    return lines


def _error_lines(answer: Table) -> list[str]:
    """Tabulate the errors of the declared, identified and saved robots."""
    error, held = answer["error"], answer["held_out"]
    noise = {**error["noise"], "normalised": answer["noise_scale"]["normalised"]}
    columns = error["before"], error["after"], noise, error["saved"]
    lines = [
        f"errors on {held['words']}; errors of the saved robot on all rows",
        f"{'':<20}{'before':>12}{'after':>12}{'noise':>12}{'saved':>12}",
    ]
    for name, unit in (("position", "m"), ("rotation", "rad"), ("normalised", "sigma")):
        row = [errors[name] for errors in columns]
        cells = [f"{v:>12.3g}" if math.isfinite(v) else f"{'-':>12}" for v in row]
        lines.append(f"{f'{name} [{unit}]':<20}{''.join(cells)}")
    if set(answer["outliers"]) & set(held["ids"]):
        cut = [error["with_outliers"][k]["normalised"] for k in ("before", "after")]
        cells = [f"{v:>12.3g}" for v in (*cut, noise["normalised"])]
        lines.append(f"{'with outliers':<20}{''.join(cells)}")
    return lines


def _sequence_lines(answer: Table) -> list[str]:
    """Return lines about the models of the sequence."""
    rows, last = answer["ladder"], math.nan
    unit = rows[-1]["unit"]
    lines = [f"{'model':<20}{'unknowns':>10}{unit:>12}{'sigma':>10}{'reduction':>11}"]
    for row in rows:
        rms, sigma = row["kept_aside_rms"], row["kept_aside_sigma"]
        reduced = f"{last - rms:>11.3g}" if math.isfinite(last) else f"{'':>11}"
        lines.append(
            f"{row['term']:<20}{row['unknowns']:>10.0f}{rms:>12.3g}{sigma:>10.3g}{reduced}"
        )
        last = rms
    return lines


def _next_lines(one: Table) -> list[str]:
    """Return a line about the next measurement."""
    where = ", ".join(f"{k}={v:.4g}" for k, v in one["configuration"].items())
    covariates = "".join(f", {k} {v:g}" for k, v in one["covariates"].items())
    return [
        f"measure next: {where}; load {load_text(one['load'])}{covariates}",
        f"  {one['why']}",
    ]
