"""Evaluate the results of ``diagnosis_confusion.py``.

A result is correct if its verdict is definite and contains the hidden effects, or other
effects that explain the data equally well.  A definite verdict with other effects is a
false claim.
"""

import json
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from forcefit.validation.synthetic.outside import OUTSIDE_COVARIATES

WITHIN_90 = 1.645  # [-] half width of a 90 % interval in standard deviations
VERDICTS = (
    "explained", "learned", "none_needed", "ambiguous", "outside_library",
    "not_enough_rows",
)  # fmt: skip
UNNAMED = ("geometric_errors", "springs")  # parameters of a model that are not effects


def score(folder: Path) -> dict[str, Any]:
    """Return the scores of the results in a folder.

    Args:
        folder: folder with hidden effects and results.

    Returns:
        Numbers of correct and false results, and other statistics, by name.
    """
    confusion: dict[str, Counter] = defaultdict(Counter)
    outcome: dict[str, Counter] = defaultdict(Counter)
    inside: list[bool] = []
    ratios: list[float] = []
    outside: list[float] = []
    places: list[bool] = []
    variables: list[bool] = []
    brier: list[float] = []
    seconds: list[float] = []
    saved: list[float] = []
    worse: list[bool] = []
    wrong: list[str] = []
    for path in sorted((folder / "answers").glob("*.json")):
        diagnosis = json.loads(path.read_text())
        truth = json.loads((folder / "truths" / path.name).read_text())[path.stem]
        names = sorted(effect["name"] for effect in truth["effects"])
        result = _judge(truth, diagnosis)
        strength = min(truth["contribution_rms"].values(), default=0.0)
        for group in (truth["kind"], f"{truth['kind']} {_band(strength)}", "all"):
            outcome[group][result] += 1
        confusion["+".join(names) or "none"][_told(diagnosis)] += 1
        seconds.append(diagnosis.get("seconds", 0.0))
        if "read_back" in diagnosis:
            saved.append(abs(diagnosis["read_back"] - 1.0))
            worse.append(diagnosis["saved_worse"])
        if result in ("false claim", "false outside", "crashed", "missed"):
            claimed = "+".join(_claimed(diagnosis))
            sizes = {k: round(v, 1) for k, v in truth["contribution_rms"].items()}
            wrong.append(
                f"{path.stem} {truth['robot']}: {sizes or 'none'} -> "
                f"{diagnosis['verdict']} {claimed}: {result}"
            )
        if truth["kind"] == "outside":
            outside.append(diagnosis["error"]["after"]["normalised"])
            if diagnosis.get("learned"):
                place, variable = _place_and_variable(truth, diagnosis)
                places.append(place)
                variables.append(variable)
        if result == "right" and diagnosis["verdict"] == "explained":
            ratios.append(diagnosis["error"]["after"]["normalised"])
            inside += _inside(truth, diagnosis)
        probabilities = diagnosis.get("probabilities") or {}
        if probabilities and truth["kind"] in ("single", "pair", "none"):
            squares = [(p - (n in names)) ** 2 for n, p in probabilities.items()]
            brier.append(float(np.mean(squares)))
    return {
        "outcome": {k: dict(v) for k, v in sorted(outcome.items())},
        "confusion": {k: dict(v) for k, v in sorted(confusion.items())},
        "coverage_90": _share(inside),
        "after_over_noise": _spread(ratios),
        "outside_after_over_noise": _spread(outside),
        "outside_within_1.2": _share([ratio <= 1.2 for ratio in outside]),
        "place_right": _share(places),
        "variable_right": _share(variables),
        "brier": _spread(brier),
        "read_back_off_by": _spread(saved),
        "saved_worse_than_declared": _share(worse),
        "seconds": _spread(seconds),
        "wrong": wrong,
    }


def _judge(truth: dict, diagnosis: dict) -> str:
    """Return the class of a result, such as ``"right"`` or ``"abstained"``."""
    verdict = diagnosis["verdict"]
    if verdict == "crashed":
        return "crashed"
    claimed = _claimed(diagnosis)
    accepted = [sorted(names) for names in truth["accept_effects"]]
    loose = len(truth["accept_verdicts"]) == len(VERDICTS)
    if verdict == "not_enough_rows":
        return "abstained"
    if verdict == "ambiguous":
        return "right" if verdict in truth["accept_verdicts"] else "abstained"
    if verdict in {"outside_library", "learned"}:
        outside = truth["kind"] == "outside"
        return "right" if outside else "false outside"
    if verdict == "none_needed":
        fine = truth["kind"] == "none" or loose or [] in accepted
        return "right" if fine and truth["kind"] != "outside" or loose else "missed"
    if truth["kind"] == "outside":
        return "right" if loose and claimed in accepted else "false claim"
    return "right" if claimed in accepted and claimed else "false claim"


def _claimed(diagnosis: dict) -> list[str]:
    """Return the effects of the library in a result."""
    names = (effect["name"] for effect in diagnosis.get("effects", []))
    return sorted(name for name in names if name not in UNNAMED)


def _place_and_variable(truth: dict, diagnosis: dict) -> tuple[bool, bool]:
    """Return whether a function has the frame and the variable of the hidden effect."""
    (effect,) = truth["effects"]
    name, frames = effect["name"], set(effect["where"])
    at_reading = name in ("_stand", "_sag")
    elsewhere = {"_stand": "reading", "_sag": "reading", "_tilting": "base",
                 "_cable": "load"}  # fmt: skip
    wanted = {elsewhere[name]} if name in elsewhere else frames
    known = OUTSIDE_COVARIATES.get(name, ())
    of = {v if v in ("time", "approach") else f"cov.{v}" for v in known}
    if name in ("_two_steps", "_torque_backlash"):
        kinds = ("mz", "fz")
        of = {f"wrench.{frame}.{kind}" for frame in frames for kind in kinds}
    of = of or {f"q.{frame}" for frame in frames}
    places = {one["where"] for one in diagnosis["learned"]}
    for one in diagnosis["learned"]:
        for same in one["equivalent_places"]:
            places |= {part["where"] for part in same}
    variables = {v for one in diagnosis["learned"] for v in one["variables"]}
    loaded = at_reading and any(v.startswith("load.") for v in variables)
    return bool(places & wanted), loaded or bool(variables & of)


def _told(diagnosis: dict) -> str:
    """Return a short description of a result."""
    if diagnosis["verdict"] == "explained":
        return "+".join(_claimed(diagnosis)) or "geometry or springs"
    return str(diagnosis["verdict"])


def _band(strength: float) -> str:
    """Return the size class of the smallest hidden effect, relative to the noise."""
    return (
        "none"
        if not strength
        else min(
            ("2x", "5x", "9x"),
            key=lambda band: abs(np.log(strength / float(band[:-1]))),
        )
    )


def _inside(truth: dict, diagnosis: dict) -> list[bool]:
    """Return for each parameter whether its 90 % interval contains the true value."""
    known = {
        (effect["name"], parameter["name"]): parameter["value"]
        for effect in truth["effects"]
        for parameter in effect["parameters"]
    }
    inside = []
    for effect in diagnosis["effects"]:
        for parameter in effect["parameters"]:
            key = effect["name"], parameter["name"]
            if key in known and parameter["std"]:
                away = abs(parameter["value"] - known[key])
                inside.append(away <= WITHIN_90 * parameter["std"])
    return inside


def _share(right: list[bool]) -> list[float | int | None]:
    """Return the fraction of correct results, and the number of results."""
    return [float(np.mean(right)) if right else None, len(right)]


def _spread(values: list[float]) -> dict[str, float | int]:
    """Return the median, the 90 % quantile and the number of values."""
    if not values:
        return {"count": 0}
    return {
        "median": float(np.median(values)),
        "p90": float(np.quantile(values, 0.9)),
        "mean": float(np.mean(values)),
        "count": len(values),
    }
