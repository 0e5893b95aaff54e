"""A diagnosis for a terminal, from its table in the public format."""

import math
from typing import Any

from validation.diagnosis.calibration import Calibration
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from validation.diagnosis.results import table
from validation.diagnosis.sentence import WORDS, calibration_text, open_text

Table = dict[str, Any]


def text(diagnosis: Diagnosis, tally: Calibration | None = None) -> str:
    """The diagnosis for a terminal."""
    told = table(diagnosis, tally)
    lines = [f"{told['campaign']}: {told['verdict']}", told["sentence"], ""]
    for effect in told["effects"]:
        lines += _effect_lines(effect)
    for name in (GEOMETRY, SPRINGS):
        lines += _small_lines(told[name], name)
    for function in told["learned"]:
        lines += _function_lines(function)
    lines += ["", "sets of effects, by probability:"]
    for one in told["alternatives"]:
        lines.append(
            f"  {one['probability']:6.3f}  {' + '.join(one['names']) or 'none'}"
        )
    lines += ["", *_error_lines(told), "", *_sequence_lines(told), *told["remarks"]]
    said = {
        "what would decide": told["needed"],
        "not measured": ", ".join(told["not_measured"]),
    }
    for what, words in said.items():
        lines += ["", f"{what}: {words}"] if words else []
    lines += told["noise_scale"]["findings"]
    if told["noise_in_time"] is not None:
        share, constant = (told["noise_in_time"][k] for k in ("share", "constant"))
        lines += [
            "",
            f"noise is correlated in time: {100 * share:.0f} % of its variance "
            f"over {constant:.3g} s; the effects' intervals are wider for it",
        ]
    if told["outliers"]:
        lines += ["", f"left out as outliers: {', '.join(told['outliers'])}"]
    if told["open"]:
        lines += ["", open_text(diagnosis.open)]
    for trend in told["structure"]:
        lines.append(
            f"left varies with {trend['against']}: {100 * trend['share']:.0f} %"
        )
    if told["next_measurement"] is not None:
        lines += ["", *_next_lines(told["next_measurement"])]
    if tally is not None:
        lines += ["", calibration_text(tally)]
    return "\n".join(lines)


def _effect_lines(effect: Table) -> list[str]:
    """An effect with its parameters; geometry and springs have lines of their own."""
    if "combinations" in effect:
        return []
    there = f" in session {effect['session']}" if "session" in effect else ""
    lines = [f"{effect['name']}{there}  (probability {effect['probability']:.3f})"]
    for p in effect["parameters"]:
        line = f"  {p['name']:<28}{p['value']:>14.6g} +- {p['std']:.2g} {p['unit']}"
        if "found" in p:
            line += " (declared {declared:.6g}, found {difference:+.6g})".format(
                **p["found"]
            )
        lines.append(line)
    return lines


def _small_lines(one: Table | None, name: str) -> list[str]:
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


def _function_lines(one: Table) -> list[str]:
    """A function learned, in two to four lines."""
    formula, parts = one["formula"], one["parts_of_range"]
    short = formula if len(formula) < 160 else f"{formula[:157]}..."
    lines = [f"learned: {one['label']}", f"  {short}"]
    if parts is not None:
        lines.append(
            "  predicted in parts of {variable} left out: {after:.3g} sigma, "
            "without it {without:.3g}".format(**parts)
        )
    if one["equivalent_places"]:
        lines.append(f"  {len(one['equivalent_places'])} other places do as well")
    return lines


def _error_lines(told: Table) -> list[str]:
    """A table of the errors before and after, and of the saved robot."""
    error, held = told["error"], told["held_out"]
    noise = {**error["noise"], "normalised": told["noise_scale"]["normalised"]}
    columns = error["before"], error["after"], noise, error["saved"]
    lines = [
        f"errors on {held['words']}; saved: on all rows",
        f"{'':<20}{'before':>12}{'after':>12}{'noise':>12}{'saved':>12}",
    ]
    for name, unit in (("position", "m"), ("rotation", "rad"), ("normalised", "sigma")):
        row = [errors[name] for errors in columns]
        cells = [f"{v:>12.3g}" if math.isfinite(v) else f"{'-':>12}" for v in row]
        lines.append(f"{f'{name} [{unit}]':<20}{''.join(cells)}")
    if set(told["outliers"]) & set(held["ids"]):
        cut = [error["with_outliers"][k]["normalised"] for k in ("before", "after")]
        cells = [f"{v:>12.3g}" for v in (*cut, noise["normalised"])]
        lines.append(f"{'with outliers':<20}{''.join(cells)}")
    return lines


def _sequence_lines(told: Table) -> list[str]:
    """The model sequence, judged on the held-out rows."""
    rows, last = told["ladder"], math.nan
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
    """The measurement that would decide."""
    where = ", ".join(f"{k}={v:.4g}" for k, v in one["configuration"].items())
    covariates = "".join(f", {k} {v:g}" for k, v in one["covariates"].items())
    return [
        f"measure next: {where}; load {load_text(one['load'])}{covariates}",
        f"  {one['why']}",
    ]
