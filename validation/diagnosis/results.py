"""A diagnosis for machines, in the public format."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from assembly.effects import LIBRARY
from stiffness.screws import SCREW
from validation.diagnosis.calibration import Calibration
from validation.diagnosis.claims import parameters_of
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.saving import functions_of, not_measured
from validation.diagnosis.sentence import formula, sentence
from validation.diagnosis.sequence import LEARNED, Errors
from validation.diagnosis.small_terms import GEOMETRY, KINDS, SPRINGS
from validation.diagnosis.unknowns import Small

LISTED = {"explained", "ambiguous", "learned"}  # verdicts that list effects
_HARDLY = 0.05  # of an unknown known: its frame is not listed


def table(diagnosis: Diagnosis, tally: Calibration | None = None) -> dict[str, Any]:
    """The diagnosis in the public format.

    Args:
        diagnosis: a diagnosis.
        tally: how often it is right on this design, if that was simulated.

    Returns:
        Plain values.
    """
    listed = diagnosis.verdict in LISTED
    ids = np.array(diagnosis.campaign.ids)
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
            "before": _errors(diagnosis.before),
            "after": _errors(diagnosis.after),
            "saved": _errors(diagnosis.saved),
            "noise": {
                "position": diagnosis.noise.position,
                "rotation": diagnosis.noise.rotation,
            },
            "with_outliers": {
                "before": _errors(diagnosis.with_outliers[0]),
                "after": _errors(diagnosis.with_outliers[1]),
            },
        },
        "noise_scale": {
            "value": diagnosis.noise_scale[0],
            "std": diagnosis.noise_scale[1],
            "findings": list(diagnosis.findings),
            "normalised": diagnosis.noise.normalised,
            "common": dict(
                zip(KINDS, diagnosis.traced.selected.noise.common, strict=True)
            ),
        },
        "noise_in_time": None
        if diagnosis.noise_in_time is None
        else asdict(diagnosis.noise_in_time),
        "ladder": steps(diagnosis),
        "geometry": small(diagnosis, GEOMETRY),
        "springs": small(diagnosis, SPRINGS),
        "learned": learned(diagnosis),
        "held_out": {
            "rows": int(diagnosis.held.rows.sum()),
            "how": diagnosis.held.how,
            "words": diagnosis.held.words,
            "ids": ids[diagnosis.held.rows].tolist(),
            "uncertainty": diagnosis.uncertainty,
        },
        "not_measured": not_measured(diagnosis.campaign),
        "lack_of_fit": {
            "rms": diagnosis.lack.rms,
            "probability": diagnosis.lack.probability,
            "between_repeats": diagnosis.lack.repeats,
        },
        "remarks": list(diagnosis.remarks),
        "setup_blunders": [asdict(one) for one in diagnosis.setup],
        "outliers": ids[diagnosis.outliers].tolist(),
        "open": ids[diagnosis.open].tolist(),
        "structure": [
            {"against": t.against, "share": t.share, "probability": t.probability}
            for t in diagnosis.trends
        ],
        "next_measurement": _next(diagnosis),
        "calibration": None if tally is None else asdict(tally),
    }


def steps(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The model sequence in the public format, rms in m or, without positions, rad."""
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


_UNITS = {GEOMETRY: ("rad", "m"), SPRINGS: ("rad/(N m)", "m/N")}


def small(diagnosis: Diagnosis, name: str) -> dict[str, Any] | None:
    """Geometric errors, or springs, of all frames in the public format.

    Args:
        diagnosis: a diagnosis.
        name: ``"geometry"`` or ``"springs"``.

    Returns:
        The sizes of the prior, how many combinations the readings say, and of every
        unknown its value, standard deviation and the share that the readings say; None
        if the machine is as declared.
    """
    fit = diagnosis.fit
    places = zip(fit.unknowns.parts, fit.unknowns.slices, strict=True)
    found = [(p, own) for p, own in places if isinstance(p, Small) and p.name == name]
    if not found:
        return None
    ((part, own),) = found
    share, std = fit.determined[own], np.sqrt(np.diag(fit.covariance)[own])
    frames = diagnosis.campaign.robot.frames
    known = np.bincount(part.frame, share, minlength=len(frames))
    sizes = {
        kind: float(part.std[part.axis // 3 == k].max())
        for k, kind in enumerate(KINDS) if np.any(part.axis // 3 == k)
    }  # fmt: skip
    return {
        "scale": sizes,
        "unit": dict(zip(KINDS, _UNITS[name], strict=True)),
        "unknowns": len(part),
        "identifiable": float(share.sum()),
        "where": [f.name for i, f in enumerate(frames) if known[i] > _HARDLY],
        "frames": [
            {"frame": f.name, "identifiable": float(known[i])}
            for i, f in enumerate(frames) if known[i] > _HARDLY
        ],
        "parameters": [
            {
                "frame": frames[i].name, "component": SCREW[axis].lower(),
                "value": float(v), "std": float(s), "identified": float(told),
                "unit": _UNITS[name][axis // 3],
            }
            for i, axis, v, s, told
            in zip(part.frame, part.axis, fit.x[own], std, share, strict=True)
        ],
    }  # fmt: skip


def effects(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Effects of the machine found with their parameters, as in the public format.

    Args:
        diagnosis: a diagnosis.

    Returns:
        Of an effect that the robot's file declares, the value is what the saved robot
        has; what was declared and the difference found are given with it.
    """
    robot = diagnosis.campaign.robot
    bare, shown = robot.without_effects(), []

    def unit(effect: str, name: str) -> str:
        return LIBRARY[effect].unit(bare, name)

    for one in diagnosis.fit.unknowns.effects:
        if one.device:
            continue
        name, h = one.hypothesis.effect, one.hypothesis
        x, C, _ = diagnosis.fit.own(one)
        there = robot.effects
        if one.session is not None:
            there = robot.session_effects.get(one.session, {})
        declared = there.get(name, {})
        seen = diagnosis.fit.seen(one)
        parameters = parameters_of(bare, one, x, C, declared, seen)
        differences = h.public(bare, x)
        acting = {n for p, *_ in parameters for n in (p, p.rpartition(".")[0])}
        shown.append({
            "name": name,
            **({} if one.session is None else {"session": one.session}),
            # frames found rigid or tight have no parameter
            "where": [frame for frame in h.where if frame in acting],
            "probability": diagnosis.probability.get(name, 0.0),
            "parameters": [
                _parameter(p, value, std, unit(name, p))
                | _found(declared.get(p), differences[p], value)
                for p, value, std in parameters
            ],
        })
    return shown


_NAMES = {GEOMETRY: "geometric_errors", SPRINGS: "springs"}


def _unnamed(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Geometric errors and springs, where no effect of the library is named."""
    if diagnosis.effects or diagnosis.fit.unknowns.functions:
        return []
    found = [(name, small(diagnosis, name)) for name in (GEOMETRY, SPRINGS)]
    return [
        {
            "name": _NAMES[name], "where": one["where"], "probability": 1.0,
            "combinations": one["identifiable"], "parameters": [],
        }
        for name, one in found if one is not None
    ]  # fmt: skip


def _parameter(name: str, value: float, std: float, unit: str) -> dict[str, Any]:
    """A parameter of the machine."""
    interval = [value - 1.645 * std, value + 1.645 * std]
    return {
        "name": name, "value": value, "std": std, "interval_90": interval, "unit": unit,
    }  # fmt: skip


def _found(declared: float | None, difference: float, value: float) -> dict[str, Any]:
    """What was declared of a parameter, and the difference found for it, if it was."""
    if declared is None:
        return {}
    told = {"declared": declared, "difference": difference, "corrected": value}
    return {"found": told}


def learned(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """What was learned, in the public format: a function of a robot file each."""
    places = [k for k, s in enumerate(diagnosis.sequence) if s.term == LEARNED]
    shown = []
    for k, functions in enumerate(functions_of(diagnosis)):
        # in folds fewer functions may have been found
        at = places[min(k, len(places) - 1)] if places else len(diagnosis.sequence) - 1
        before, after = (diagnosis.sequence[max(i, 0)].error for i in (at - 1, at))
        parts = diagnosis.traced.selected.functions[k].range_error
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
                "equivalent_places": [
                    [{"where": p.where, "components": list(p.components),
                      "variables": list(p.variables)} for p in parts]
                    for parts in diagnosis.traced.selected.functions[k].equivalent
                ],
                "before": _errors(before),
                "after": _errors(after),
                "parts_of_range": None if parts is None else asdict(parts),
            })  # fmt: skip
    return shown


def _errors(errors: Errors) -> dict[str, float]:
    return {
        "position": errors.position,
        "rotation": errors.rotation,
        "normalised": errors.normalised,
    }


def _next(diagnosis: Diagnosis) -> dict[str, Any] | None:
    if diagnosis.next is None:
        return None
    return {
        "why": diagnosis.next.why,
        "configuration": diagnosis.next.configuration,
        "load": list(diagnosis.next.load),
        "covariates": diagnosis.next.covariates,
        "power": diagnosis.next.power,
    }
