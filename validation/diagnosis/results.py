"""A diagnosis for machines, in the public format."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.registration import BASE
from assembly.model.robot import Robot
from stiffness.screws import SCREW
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.kept_aside import Errors
from validation.diagnosis.learned_range import learned_range
from validation.diagnosis.sentence import formula, sentence
from validation.diagnosis.small_terms import GEOMETRY, KINDS, SPRINGS, with_small
from validation.diagnosis.teaching import functions_of
from validation.diagnosis.verdict import Calibration

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
    held = ~diagnosis.split.fitted
    return {
        "campaign": diagnosis.campaign.name,
        "robot": diagnosis.campaign.robot.name,
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis),
        "effects": effects(diagnosis) if listed else [],
        "alternatives": [
            {"names": list(names), "probability": p}
            for names, p in diagnosis.alternatives
        ],
        "probabilities": diagnosis.probability,
        "best_by_score": list(diagnosis.best_by_score),
        "error": {
            "unit": {"position": "m", "rotation": "rad"},
            "before": _errors(diagnosis.before),
            "after": _errors(diagnosis.after),
            "noise": {
                "position": diagnosis.noise.position,
                "rotation": diagnosis.noise.rotation,
            },
            "without_outliers": {
                "before": _errors(diagnosis.trimmed[0]),
                "after": _errors(diagnosis.trimmed[1]),
            },
        },
        "noise_factor": dict(
            zip(KINDS, diagnosis.noise_factor[::3].tolist(), strict=True)
        ),
        "noise_in_time": None
        if diagnosis.noise_in_time is None
        else asdict(diagnosis.noise_in_time),
        "ladder": steps(diagnosis),
        "geometry": small(diagnosis, GEOMETRY),
        "springs": small(diagnosis, SPRINGS),
        "learned": learned(diagnosis),
        "held_out": {"rows": int(held.sum()), "how": diagnosis.split.how},
        "lack_of_fit": {
            "rms": diagnosis.lack.rms,
            "probability": diagnosis.lack.probability,
            "between_repeats": diagnosis.lack.repeats,
        },
        "remarks": list(diagnosis.remarks),
        "outliers": [
            i
            for i, far in zip(diagnosis.campaign.ids, diagnosis.outliers, strict=True)
            if far
        ],
        "open": [
            i
            for i, free in zip(diagnosis.campaign.ids, diagnosis.open, strict=True)
            if free
        ],
        "structure": [
            {"against": t.against, "share": t.share, "probability": t.probability}
            for t in diagnosis.trends
        ],
        "next_measurement": _next(diagnosis),
        "calibration": None if tally is None else asdict(tally),
    }


def steps(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The ladder in the public format, rms in m or, without positions, in rad."""
    rows = []
    for rung in diagnosis.ladder:
        error = rung.error
        placed = math.isfinite(error.position)
        rows.append({
            "term": rung.term,
            "unknowns": rung.unknowns,
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
    behind = diagnosis.behind
    values, stds = behind.values(diagnosis.fit.residual), behind.deviations()
    unknowns = zip(behind.terms, values, stds, behind.identified(), strict=True)
    for term, value, std, share in unknowns:
        if term.name != name:
            continue
        frames = diagnosis.campaign.robot.frames
        known = np.bincount(term.frame, share, minlength=len(frames))
        scale = dict(zip(KINDS, behind.scales[name], strict=True))
        return {
            "scale": {kind: size for kind, size in scale.items() if size},
            "unit": dict(zip(KINDS, _UNITS[name], strict=True)),
            "unknowns": len(term),
            "identifiable": float(share.sum()),
            "frames": [
                {"frame": f.name, "identifiable": float(known[i])}
                for i, f in enumerate(frames) if known[i] > _HARDLY
            ],
            "parameters": [
                {
                    "frame": frames[i].name, "component": SCREW[axis].lower(),
                    "value": float(v), "std": float(s), "identified": float(part),
                    "unit": _UNITS[name][axis // 3],
                }
                for i, axis, v, s, part
                in zip(term.frame, term.axis, value, std, share, strict=True)
            ],
        }  # fmt: skip
    return None


def effects(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The best set's effects with their parameters, as in the public format."""
    robot = diagnosis.campaign.robot
    shown = []
    for k, h in enumerate(diagnosis.fit.hypotheses):
        if h.effect not in diagnosis.best_by_score:
            continue  # a device's frame fitted anyway, or finite motions beside others
        parameters = diagnosis.fit.parameters(k)
        acting = {n for name, *_ in parameters for n in (name, name.rpartition(".")[0])}
        shown.append({
            "name": h.effect,
            # frames found rigid or tight have no parameter left
            "where": [frame for frame in h.where if frame in acting],
            "probability": diagnosis.probability.get(h.effect, 0.0),
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


def corrected(diagnosis: Diagnosis) -> Robot:
    """The declared robot with what was found built in, beside any effects it had."""
    behind = diagnosis.behind
    unknowns = behind.values(diagnosis.fit.residual)
    robot = with_small(diagnosis.campaign.robot, behind.terms, unknowns)
    merged = {name: dict(values) for name, values in robot.effects.items()}
    for name, values in diagnosis.fit.effects.items():
        if name in diagnosis.best_by_score:
            merged[name] = {**merged.get(name, {}), **values}
    new = functions_of(diagnosis.campaign, diagnosis.model)
    functions = (*robot.functions, *(f for some in new for f in some))
    ranges = learned_range(diagnosis.campaign, ~diagnosis.outliers)
    robot = replace(
        robot, effects=merged, functions=functions,
        learned_range={**robot.learned_range, **ranges},
    )  # fmt: skip
    unknown = diagnosis.campaign.registration == "unknown"
    return _registered(diagnosis, robot) if unknown else robot


def _registered(diagnosis: Diagnosis, robot: Robot) -> Robot:
    """The robot with the measuring frame as it was found, in each session its own."""
    fitted = {"registration": diagnosis.fit.effects.get("registration", {})}
    base = apply_effects(diagnosis.model.conditions, fitted).base
    base = np.broadcast_to(base, (len(diagnosis.campaign), 6))
    tool = {
        k: v for k, v in robot.effects.get("registration", {}).items() if k not in BASE
    }

    def placed(row: int) -> dict[str, float]:
        return dict(zip(BASE, base[row].tolist(), strict=True))

    if diagnosis.campaign.session is None:
        effects = {**robot.effects, "registration": {**tool, **placed(0)}}
        return replace(robot, effects=effects)
    effects = {k: v for k, v in robot.effects.items() if k != "registration"}
    if tool:
        effects["registration"] = tool
    sessions = dict(robot.session_effects)
    for session in diagnosis.campaign.sessions:
        row = int(np.flatnonzero(diagnosis.campaign.session == session)[0])
        own = {**sessions.get(session, {}), "registration": placed(row)}
        sessions[session] = own
    return replace(robot, effects=effects, session_effects=sessions)


def learned(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """What was learned, in the public format: a function of a robot file each."""
    rungs = [r.error for r in diagnosis.ladder if r.term == "learned effects"]
    first = next(r.error for r in diagnosis.ladder if r.term == "library effects")
    shown = []
    for k, functions in enumerate(functions_of(diagnosis.campaign, diagnosis.model)):
        same = diagnosis.model.learned[k].equivalent
        for function in functions:
            shown.append({
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
                      "variables": [p.variable]} for p in parts]
                    for parts in same
                ],
                "before": _errors([first, *rungs][k]),
                "after": _errors(rungs[k]),
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
