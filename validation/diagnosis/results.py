"""A diagnosis for machines, and the honest sentence for people."""

import math
from dataclasses import asdict, replace
from typing import Any

from numpy.typing import NDArray

from assembly.effects import LIBRARY
from assembly.model.robot import Robot
from validation.diagnosis.diagnose import Diagnosis, Errors
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.verdict import Calibration


def table(found: Diagnosis, tally: Calibration | None = None) -> dict[str, Any]:
    """The diagnosis in the public format.

    Args:
        found: a diagnosis.
        tally: how often it is right on this design, if that was simulated.

    Returns:
        Plain values.
    """
    listed = found.verdict in {"explained", "ambiguous"}
    held = ~found.split.fitted & ~found.outliers
    return {
        "campaign": found.campaign.name,
        "robot": found.campaign.robot.name,
        "verdict": found.verdict,
        "sentence": sentence(found),
        "effects": effects(found) if listed else [],
        "alternatives": [
            {"names": list(names), "probability": p} for names, p in found.alternatives
        ],
        "probabilities": found.probability,
        "best_by_score": list(found.best_by_score),
        "error": {
            "unit": {"position": "m", "rotation": "rad"},
            "before": _errors(found.before),
            "after": _errors(found.after),
            "noise": {
                "position": found.noise.position,
                "rotation": found.noise.rotation,
            },
        },
        "held_out": {"rows": int(held.sum()), "how": found.split.how},
        "lack_of_fit": {
            "rms": found.lack.rms,
            "probability": found.lack.probability,
            "between_repeats": found.lack.repeats,
        },
        "outliers": [
            i for i, far in zip(found.campaign.ids, found.outliers, strict=True) if far
        ],
        "open": [
            i for i, free in zip(found.campaign.ids, found.open, strict=True) if free
        ],
        "structure": [
            {"against": t.against, "share": t.share, "probability": t.probability}
            for t in found.trends
        ],
        "next_measurement": _next(found),
        "calibration": None if tally is None else asdict(tally),
    }


def effects(found: Diagnosis) -> list[dict[str, Any]]:
    """The best set's effects with their parameters, as in the public format."""
    robot = found.campaign.robot
    shown = []
    for k, h in enumerate(found.fit.hypotheses):
        if h.effect not in found.best_by_score:
            continue  # a device's frame fitted anyway, or finite motions beside others
        parameters = found.fit.parameters(k)
        acting = {n for name, *_ in parameters for n in (name, name.rpartition(".")[0])}
        shown.append({
            "name": h.effect,
            # frames found rigid or tight have no parameter left
            "where": [frame for frame in h.where if frame in acting],
            "probability": found.probability.get(h.effect, 0.0),
            "parameters": [
                {
                    "name": name,
                    "value": value,
                    "std": std,
                    "interval_90": [value - 1.645 * std, value + 1.645 * std],
                    "unit": LIBRARY[h.effect].unit(robot, name),
                }
                for name, value, std in parameters
            ],
        })
    return shown


def corrected(found: Diagnosis) -> Robot:
    """The declared robot with the effects found beside any it had."""
    robot = found.campaign.robot
    merged = {name: dict(values) for name, values in robot.effects.items()}
    for name, values in found.fit.effects.items():
        if name in found.claimed:
            merged[name] = {**merged.get(name, {}), **values}
    return replace(robot, effects=merged)


def _errors(errors: Errors) -> dict[str, float]:
    return {
        "position": errors.position,
        "rotation": errors.rotation,
        "normalised": errors.normalised,
    }


def _next(found: Diagnosis) -> dict[str, Any] | None:
    if found.next is None:
        return None
    return {
        "why": found.next.why,
        "configuration": found.next.configuration,
        "load": list(found.next.load),
        "covariates": found.next.covariates,
        "power": found.next.power,
    }


def sentence(found: Diagnosis) -> str:
    """What may be said, and no more."""
    where = _judged_on(found)
    kept = f"on {where} the residual is {found.before.normalised:.2f} sigma before"
    if found.verdict == "none_needed":
        return (
            "The declared model is enough: the residual is noise as far as this design "
            f"can tell ({found.before.normalised:.2f} sigma on {where})."
        )
    if found.verdict == "explained":
        names = " and ".join(found.claimed)
        return (
            f"The declared model lacks {names}; {kept}, {found.after.normalised:.2f} "
            "after (1 is noise)."
        )
    if found.verdict == "ambiguous":
        sets = " or ".join(
            " + ".join(names) or "nothing" for names, _ in found.alternatives[:4]
        )
        return f"This design cannot tell which effect it is: {sets}; {kept}."
    seen = ", ".join(t.against for t in found.trends[:3]) or "nothing that was recorded"
    return (
        "No effect of the library explains the residual: at best "
        f"{found.lack.rms:.2f} sigma are left, which vary with {seen}."
    )


def _judged_on(found: Diagnosis) -> str:
    """Which rows the errors before and after are of."""
    aside = ~found.split.fitted
    return "rows kept aside" if aside.any() else "the rows fitted, too few to spare any"


def calibration_text(tally: Calibration) -> str:
    """How often the method is right on this design, in words."""

    def counts(said: dict[str, int]) -> str:
        return ", ".join(f"{name} {n}" for name, n in sorted(said.items()))

    named = "" if math.isnan(tally.right) else f"; {100 * tally.right:.0f} % named it"
    return (
        f"simulated on this design, {tally.campaigns} campaigns each: with noise alone "
        f"{counts(tally.without)}; with what was found {counts(tally.with_found)}"
        f"{named}; false claims {100 * tally.false_claims:.1f} %"
    )


def text(found: Diagnosis, tally: Calibration | None = None) -> str:
    """The diagnosis for a terminal."""
    lines = [f"{found.campaign.name}: {found.verdict}", sentence(found), ""]
    for effect in effects(found) if found.verdict in {"explained", "ambiguous"} else []:
        lines.append(f"{effect['name']}  (probability {effect['probability']:.3f})")
        for p in effect["parameters"]:
            lines.append(
                f"  {p['name']:<28}{p['value']:>14.6g} +- {p['std']:.2g} {p['unit']}"
            )
    lines += ["", "sets of effects, by probability:"]
    for names, p in found.alternatives:
        lines.append(f"  {p:6.3f}  {' + '.join(names) or 'none'}")
    aside = "rows kept aside" if (~found.split.fitted).any() else "rows fitted"
    lines += ["", f"{aside:<20}{'before':>12}{'after':>12}{'noise':>12}"]
    for name, unit in (("position", "m"), ("rotation", "rad"), ("normalised", "sigma")):
        row = [getattr(e, name) for e in (found.before, found.after, found.noise)]
        if name == "normalised":
            row[2] = 1.0
        shown = "".join(
            f"{v:>12.3g}" if math.isfinite(v) else f"{'-':>12}" for v in row
        )
        lines.append(f"{name + ' [' + unit + ']':<20}{shown}")
    far = [i for i, o in zip(found.campaign.ids, found.outliers, strict=True) if o]
    if far:
        lines += ["", f"left out as outliers: {', '.join(far)}"]
    if found.open.any():
        lines += ["", open_text(found.open)]
    for trend in found.trends:
        lines.append(f"left varies with {trend.against}: {100 * trend.share:.0f} %")
    if found.next is not None:
        where = ", ".join(f"{k}={v:.4g}" for k, v in found.next.configuration.items())
        covariates = "".join(f", {k} {v:g}" for k, v in found.next.covariates.items())
        lines += [
            "",
            f"measure next: {where}; load {load_text(found.next.load)}{covariates}",
            f"  {found.next.why}",
        ]
    if tally is not None:
        lines += ["", calibration_text(tally)]
    return "\n".join(lines)


def _number(value: float) -> str:
    """Three digits, or a dash where nothing was measured."""
    return f"{value:.3g}" if math.isfinite(value) else "-"


def open_text(open_: NDArray) -> str:
    """In which rows play leaves the pose free, and what is then predicted.

    Args:
        open_: (R,) bool, by row.

    Returns:
        One line.
    """
    return (
        f"play leaves the pose free in {int(open_.sum())} of {len(open_)} rows "
        "(marked open): of the poses of least energy one is predicted there, in a "
        "closed chain the nearest to nominal, in an open one that of play in the middle"
    )
