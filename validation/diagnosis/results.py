"""A diagnosis for machines, and the honest sentence for people."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.functions import columns_of, parameters_of
from assembly.effects.registration import BASE
from assembly.model.function import Function
from assembly.model.robot import Robot
from stiffness.screws import SCREW
from validation.diagnosis.candidates import Answers
from validation.diagnosis.diagnose import Diagnosis, Errors
from validation.diagnosis.learning import term_name
from validation.diagnosis.next_measurement import load_text
from validation.diagnosis.small_terms import GEOMETRY, KINDS, SPRINGS, with_small
from validation.diagnosis.verdict import Calibration

LISTED = {"explained", "ambiguous", "learned"}  # verdicts that list effects
_WORDS = {GEOMETRY: "geometric errors", SPRINGS: "springs"}
_HARDLY = 0.05  # of an unknown known: its frame is not listed


def table(found: Diagnosis, tally: Calibration | None = None) -> dict[str, Any]:
    """The diagnosis in the public format.

    Args:
        found: a diagnosis.
        tally: how often it is right on this design, if that was simulated.

    Returns:
        Plain values.
    """
    listed = found.verdict in LISTED
    held = ~found.split.fitted
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
            "without_outliers": {
                "before": _errors(found.trimmed[0]),
                "after": _errors(found.trimmed[1]),
            },
        },
        "noise_factor": dict(zip(KINDS, found.noise_factor[::3].tolist(), strict=True)),
        "ladder": steps(found),
        "geometry": small(found, GEOMETRY),
        "springs": small(found, SPRINGS),
        "learned": learned(found),
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


def steps(found: Diagnosis) -> list[dict[str, Any]]:
    """The ladder in the public format, rms in m or, without positions, in rad."""
    rows = []
    for rung in found.ladder:
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


def small(found: Diagnosis, name: str) -> dict[str, Any] | None:
    """Geometric errors, or springs, of all frames in the public format.

    Args:
        found: a diagnosis.
        name: ``"geometry"`` or ``"springs"``.

    Returns:
        The sizes of the prior, how many combinations the readings say, and of every
        unknown its value, standard deviation and the share that the readings say; None
        if the machine is as declared.
    """
    behind = found.behind
    values, stds = behind.values(found.fit.residual), behind.deviations()
    everyone = zip(behind.terms, values, stds, behind.identified(), strict=True)
    for term, value, std, share in everyone:
        if term.name != name:
            continue
        frames = found.campaign.robot.frames
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
    """The declared robot with what was found built in, beside any effects it had."""
    behind = found.behind
    values = behind.values(found.fit.residual)
    robot = with_small(found.campaign.robot, behind.terms, values)
    merged = {name: dict(values) for name, values in robot.effects.items()}
    for name, values in found.fit.effects.items():
        if name in found.claimed:
            merged[name] = {**merged.get(name, {}), **values}
    functions = (*robot.functions, *_functions(found))
    robot = replace(robot, effects=merged, functions=functions)
    unknown = found.campaign.registration == "unknown"
    return _registered(found, robot) if unknown else robot


def _registered(found: Diagnosis, robot: Robot) -> Robot:
    """The robot with the measuring frame as it was found, in each session its own."""
    fitted = {"registration": found.fit.effects.get("registration", {})}
    base = apply_effects(found.model.here, fitted).base
    base = np.broadcast_to(base, (len(found.campaign), 6))
    tool = {
        k: v for k, v in robot.effects.get("registration", {}).items() if k not in BASE
    }

    def placed(row: int) -> dict[str, float]:
        return dict(zip(BASE, base[row].tolist(), strict=True))

    if found.campaign.session is None:
        effects = {**robot.effects, "registration": {**tool, **placed(0)}}
        return replace(robot, effects=effects)
    effects = {k: v for k, v in robot.effects.items() if k != "registration"}
    if tool:
        effects["registration"] = tool
    sessions = dict(robot.session_effects)
    for session in found.campaign.sessions:
        row = int(np.flatnonzero(found.campaign.session == session)[0])
        own = {**sessions.get(session, {}), "registration": placed(row)}
        sessions[session] = own
    return replace(robot, effects=effects, session_effects=sessions)


def _fitted(found: Diagnosis) -> list[list[Function]]:
    """The functions of every learned effect, with their numbers."""
    behind, model = found.behind, found.model
    places = Answers(model.here, found.campaign.robot, model.answers)
    everyone = zip(
        behind.terms,
        behind.values(found.fit.residual),
        behind.deviations(),
        strict=True,
    )
    known = {term.name: (x, std) for term, x, std in everyone}
    return [
        places.fitted(one.candidate, *known[term_name(k + 1)])
        for k, one in enumerate(model.learned)
    ]


def _functions(found: Diagnosis) -> list[Function]:
    return [function for one in _fitted(found) for function in one]


def learned(found: Diagnosis) -> list[dict[str, Any]]:
    """What was learned, in the public format: a function of a robot file each."""
    rungs = [r.error for r in found.ladder if r.term == "learned effects"]
    first = next(r.error for r in found.ladder if r.term == "library effects")
    shown = []
    for k, functions in enumerate(_fitted(found)):
        same = found.model.learned[k].equivalent
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


def formula(function: Function) -> str:
    """A function in words, by component: numbers times what they multiply."""
    name = function.variables[0].rpartition(".")[2]
    told = []
    for component in function.components:
        numbers = parameters_of(function, component)
        terms = [
            f"{numbers[key]:.4g} {_column_text(function.form, key, name)}".rstrip()
            for key in columns_of(function, component)
        ]
        told.append(f"{component} = {' + '.join(terms)}")
    times = " (times the wrench there)" if function.kind == "compliance" else ""
    return "; ".join(told) + times


def _column_text(form: str, key: str, name: str) -> str:
    """What a column of a form is, in words."""
    head, _, word = key.rpartition(".")
    if form == "powers":
        return {"0": "", "1": name}.get(key, f"{name}^{key}")
    if form == "waves":
        return f"{'sin' if word == 'sine' else 'cos'}({head} {name})"
    return f"{form}.{key}({name})"


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
        small_ones = [_WORDS[term.name] for term in found.behind.terms]
        names = " and ".join([*found.claimed, *small_ones])
        return (
            f"The declared model lacks {names}; {kept}, {found.after.normalised:.2f} "
            "after (1 is noise)."
        )
    if found.verdict == "learned":
        names = " and ".join(
            [*found.claimed, *(f.title for f in _functions(found))][:6]
        )
        return (
            f"The library lacks what was learned: {names}; {kept}, "
            f"{found.after.normalised:.2f} after (1 is noise)."
        )
    if found.verdict == "ambiguous":
        sets = " or ".join(
            " + ".join(names) or "nothing" for names, _ in found.alternatives[:4]
        )
        return f"This design cannot tell which effect it is: {sets}; {kept}."
    seen = ", ".join(t.against for t in found.trends[:3]) or "nothing that was recorded"
    return (
        "No effect of the library explains the residual: at best "
        f"{found.lack.rms:.2f} sigma are left, which vary with {seen}; {kept}, "
        f"{found.after.normalised:.2f} with what was found."
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
    for effect in effects(found) if found.verdict in LISTED else []:
        lines.append(f"{effect['name']}  (probability {effect['probability']:.3f})")
        for p in effect["parameters"]:
            lines.append(
                f"  {p['name']:<28}{p['value']:>14.6g} +- {p['std']:.2g} {p['unit']}"
            )
    for name in (GEOMETRY, SPRINGS):
        lines += _small_text(small(found, name), name)
    for one in learned(found):
        where = f"{one['where']} {', '.join(one['components'])}"
        lines.append(f"learned: {where} of {', '.join(one['variables'])}")
        told = one["formula"]
        lines.append(f"  {told if len(told) < 160 else told[:157] + '...'}")
        if one["equivalent_places"]:
            lines.append(f"  {len(one['equivalent_places'])} other places do as well")
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
    if (found.outliers & ~found.split.fitted).any():
        cut = [f"{e.normalised:>12.3g}" for e in found.trimmed]
        lines.append(f"{'without outliers':<20}{cut[0]}{cut[1]}{1.0:>12.3g}")
    lines += ["", *_ladder_text(found)]
    if np.any(found.noise_factor > 1):
        lines += ["", noise_text(found.noise_factor)]
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
        f"{_WORDS[name]}  (size {sizes or 'as the tolerances say'})",
        f"  {one['identifiable']:.1f} of {one['unknowns']} known: {where}",
    ]


def _ladder_text(found: Diagnosis) -> list[str]:
    """What every step bought, on the rows kept aside."""
    rows = steps(found)
    unit = rows[-1]["unit"]
    head = f"{'step':<20}{'unknowns':>10}{unit:>12}{'sigma':>10}{'bought':>10}"
    lines = [head]
    last = math.nan
    for row in rows:
        rms, sigma = row["kept_aside_rms"], row["kept_aside_sigma"]
        bought = f"{last - rms:>10.3g}" if math.isfinite(last) else f"{'':>10}"
        lines.append(
            f"{row['term']:<20}{row['unknowns']:>10.0f}{rms:>12.3g}{sigma:>10.3g}{bought}"
        )
        last = rms
    return lines


def noise_text(factor: NDArray) -> str:
    """That repeats were believed rather than the sigma stated."""
    parts = {"rotations": factor[0], "positions": factor[3]}
    said = " and ".join(f"{v:.2g} times ({k})" for k, v in parts.items() if v > 1)
    return f"repeats scatter more than the sigma stated, which was taken {said}"


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
