"""Convert a diagnosis to plain values for JSON."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.model import statuses
from forcefit.validation.campaign.campaign import READING
from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.claims import Parameter, parameters_of
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.nuisance import GEOMETRY, KINDS, SPRINGS
from forcefit.validation.diagnosis.saving import functions_of
from forcefit.validation.diagnosis.sentence import WORDS, formula, sentence
from forcefit.validation.diagnosis.sequence import LEARNED

# Verdicts for which effects are listed.
LISTED = {statuses.EXPLAINED, statuses.AMBIGUOUS, statuses.LEARNED}
# Smallest number of parameters of a listed frame that the readings determine.
_HARDLY = 0.05
# Half width of the 90 % interval of a normal distribution, in standard deviations.
_INTERVAL = 1.645
_UNITS = {GEOMETRY: ("rad", "m"), SPRINGS: ("rad/(N m)", "m/N")}


def table(diagnosis: Diagnosis, tally: Calibration | None = None) -> dict[str, Any]:
    """Return a diagnosis as plain values for JSON.

    Args:
        diagnosis: the diagnosis.
        tally: error rates from simulated campaigns, None to omit them.
    """
    listed = diagnosis.verdict in LISTED
    ids = np.array(diagnosis.campaign.ids)
    noise, held = diagnosis.traced.selected.noise, diagnosis.held
    before, after = map(asdict, diagnosis.with_outliers)
    return {
        "campaign": diagnosis.campaign.name,
        "robot": diagnosis.campaign.robot.name,
        "verdict": diagnosis.verdict,
        "needed": diagnosis.needed,
        "sentence": sentence(diagnosis),
        "effects": [*effects(diagnosis), *_unnamed(diagnosis)] if listed else [],
        "alternatives": [
            {"names": list(names), "probability": p}
            for names, p in diagnosis.alternatives
        ],
        "probabilities": diagnosis.probability,
        "best_by_score": list(diagnosis.effects),
        "error": {
            "unit": {"position": "m", "rotation": "rad"},
            "before": asdict(diagnosis.before),
            "after": asdict(diagnosis.after),
            "saved": asdict(diagnosis.saved),
            "noise": {
                "position": diagnosis.noise.position,
                "rotation": diagnosis.noise.rotation,
            },
            "with_outliers": {"before": before, "after": after},
        },
        "noise_scale": {
            "value": diagnosis.noise_scale[0],
            "std": diagnosis.noise_scale[1],
            "findings": list(diagnosis.findings),
            "normalised": diagnosis.noise.normalised,
            "common": dict(zip(KINDS, noise.common, strict=True)),
        },
        "noise_in_time": _plain(diagnosis.noise_in_time),
        "ladder": steps(diagnosis),
        "geometry": small(diagnosis, GEOMETRY),
        "springs": small(diagnosis, SPRINGS),
        "learned": learned(diagnosis),
        "held_out": {
            "rows": int(held.rows.sum()),
            "how": held.how,
            "words": held.words,
            "ids": ids[held.rows].tolist(),
            "uncertainty": diagnosis.uncertainty,
        },
        "not_measured": diagnosis.campaign.not_measured,
        "lack_of_fit": {
            "rms": diagnosis.lack.rms,
            "probability": diagnosis.lack.probability,
            "between_repeats": diagnosis.lack.repeats,
        },
        "remarks": list(diagnosis.remarks),
        "setup_blunders": [asdict(one) for one in diagnosis.setup],
        "outliers": ids[diagnosis.outliers].tolist(),
        "open": ids[diagnosis.open].tolist(),
        "structure": [asdict(trend) for trend in diagnosis.trends],
        "next_measurement": _plain(diagnosis.next),
        "calibration": _plain(tally),
    }


def _plain(one: Any) -> dict[str, Any] | None:
    """Convert a dataclass to plain values.  None remains None."""
    return None if one is None else asdict(one)


def steps(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the models of the sequence with their errors.

    Errors are in m.  If no position was measured, they are in rad.
    """
    rows = []
    for step in diagnosis.sequence:
        error = step.error
        placed = math.isfinite(error.position)
        rows.append({
            "term": step.term,
            "unknowns": step.unknowns,
            "kept_aside_rms": error.position if placed else error.rotation,
            "unit": "m" if placed else "rad",
            "kept_aside_rotation": error.rotation,
            "kept_aside_sigma": error.normalised,
        })
    return rows


def small(diagnosis: Diagnosis, name: str) -> dict[str, Any] | None:
    """Return the geometric errors or springs of all frames as plain values.

    Args:
        diagnosis: a diagnosis.
        name: ``"geometry"`` or ``"springs"``.

    Returns:
        Values, posterior and prior standard deviations of all unknowns, and the
        fractions of the prior variances that the readings remove.  None if the fit
        contains none of these unknowns.
    """
    fit = diagnosis.fit
    part = next((part for part in fit.unknowns.small if part.name == name), None)
    if part is None:
        return None
    own, kind = fit.unknowns.place(part), part.axis // 3
    share = fit.determined[own]
    frames = diagnosis.campaign.robot.frames
    known = np.bincount(part.frame, share, minlength=len(frames)).tolist()
    listed = [
        {"frame": f.name, "identifiable": k}
        for f, k in zip(frames, known, strict=True) if k > _HARDLY
    ]  # fmt: skip
    return {
        "scale": {
            KINDS[k]: float(part.std[kind == k].max()) for k in np.unique(kind).tolist()
        },
        "unit": dict(zip(KINDS, _UNITS[name], strict=True)),
        "unknowns": len(part),
        "identifiable": float(share.sum()),
        "where": [one["frame"] for one in listed],
        "frames": listed,
        "parameters": [
            {
                "frame": frames[i].name, "component": READING[axis],
                "value": float(v), "std": float(s), "identified": float(identified),
                "unit": _UNITS[name][axis // 3],
            }
            for i, axis, v, s, identified
            in zip(part.frame, part.axis, fit.x[own], fit.std[own], share, strict=True)
        ],
    }  # fmt: skip


def effects(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the identified effects and their parameters as plain values.

    A parameter that the robot file contains is listed with its declared value and the
    difference from this value.
    """
    bare, shown = diagnosis.campaign.robot.without_effects(), []
    for one in diagnosis.fit.effects:
        name = one.hypothesis.effect
        parameters = parameters_of(diagnosis.fit, one)
        acting = {n for p in parameters for n in (p.name, p.name.rpartition(".")[0])}
        shown.append({
            "name": name,
            **({} if one.session is None else {"session": one.session}),
            # Only frames with an identified parameter are listed.
            "where": [frame for frame in one.hypothesis.where if frame in acting],
            "probability": diagnosis.probability.get(name, 0.0),
            "parameters": [
                _parameter(p, LIBRARY[name].unit(bare, p.name)) for p in parameters
            ],
        })
    return shown


def _parameter(p: Parameter, unit: str) -> dict[str, Any]:
    """Convert a parameter to plain values."""
    found = {"declared": p.declared, "difference": p.difference, "corrected": p.value}
    return {
        "name": p.name, "value": p.value, "std": p.std,
        "interval_90": [p.value - _INTERVAL * p.std, p.value + _INTERVAL * p.std],
        "unit": unit,
        **({} if p.declared is None else {"found": found}),
    }  # fmt: skip


def _unnamed(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return geometric errors and springs if no effect or function was identified."""
    if diagnosis.effects or diagnosis.fit.unknowns.functions:
        return []
    found = [(words, small(diagnosis, name)) for name, words in WORDS.items()]
    return [
        {
            "name": words.replace(" ", "_"), "where": one["where"], "probability": 1.0,
            "combinations": one["identifiable"], "parameters": [],
        }
        for words, one in found if one is not None
    ]  # fmt: skip


def learned(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the learned functions as plain values.

    Functions are listed only if they reduce the error of the held-out rows.
    """
    if not diagnosis.better:
        return []
    sequence = diagnosis.sequence
    places = [k for k, s in enumerate(sequence) if s.term == LEARNED]
    places = places or [len(sequence) - 1]
    shown = []
    for k, functions in enumerate(functions_of(diagnosis)):
        # The model sequence of a fold may contain fewer functions.
        at = places[min(k, len(places) - 1)]
        found = diagnosis.traced.selected.functions[k]
        same = [
            [
                {"where": place.where, "components": list(place.components),
                 "variables": list(place.variables)}
                for place in places
            ]
            for places in found.equivalent
        ]  # fmt: skip
        for function in functions:
            shown.append({
                "label": function.title,
                "where": function.where,
                "components": list(function.components),
                "variables": list(function.variables),
                "kind": function.kind,
                "form": function.form,
                "formula": formula(function),
                "parameters": dict(function.parameters),
                "std": dict(function.std),
                "equivalent_places": same,
                "before": asdict(sequence[max(at - 1, 0)].error),
                "after": asdict(sequence[at].error),
                "parts_of_range": _plain(found.range_error),
            })
    return shown
