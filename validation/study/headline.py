"""State the conclusions of a study about assembly, pose error and checks.

The first pose error is the certified bound over all positions within the clearances.
Every other pose error is stated with its assumption about the clearances.
"""

from typing import Any

import numpy as np

from forcefit.assembly.model.statuses import BEYOND_LIMITS, SINGULAR
from forcefit.results.text import in_unit
from forcefit.validation.study.drawn_tolerances import DRAWN_ERRORS
from forcefit.validation.study.study import StudyResults

# Assumption of problem (27): all motions within the clearances, without elastic
# deformation.
WORST = "frozen"
_CHECKED = {
    "energy": "energy", "margin": "zone margin", "margin_free": "free zone margin"
}  # fmt: skip
_OUTCOMES = ("passed", "failed", "not decided")  # possible results of a check
# [-] A required fraction of the clearances below this value is round-off.
_NO_CLEARANCE = 1e-6


def worst_clearance(results: StudyResults) -> dict[str, Any]:
    """Return certified upper bounds on the platform error within the clearances.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        Bounds ``rotation`` [rad] and ``translation`` [m] under the assumption
        ``frozen`` of problem (27), at the study's pose (``pose``) and as maxima over
        its ``map``. ``points`` of the ``of`` map points have bounds.  A bound is None
        if it was not computed, and infinite if the pose is unbounded.  For a robot with
        drawing tolerances, ``drawn`` contains the bounds over all parts within
        tolerance and the corresponding assumption.
    """
    parts = ("rotation", "translation")
    error = results.error.get(WORST)
    table: dict[str, Any] = {"assumption": WORST, "pose": None, "map": None}
    if error is not None:
        table["pose"] = {part: error[part]["upper"] for part in parts}
    if results.maps is not None:
        upper = results.maps.sel(bound="upper")
        bounds = {part: upper[f"{part}_error"].values for part in parts}
        known = ~np.isnan(bounds["rotation"]) & ~np.isnan(bounds["translation"])
        if known.any():
            largest = {part: float(v[known].max()) for part, v in bounds.items()}
            points = {"points": int(known.sum()), "of": known.size}
            table["map"] = largest | points
    drawn = _worst_drawn(results)
    return table if drawn is None else table | {"drawn": drawn}


def _worst_drawn(results: StudyResults) -> dict[str, Any] | None:
    """Return certified upper bounds over all parts within tolerance, or None."""
    found = results.statistics
    if found is None or "worst_case" not in found:
        return None
    worst, parts = found["worst_case"], ("rotation", "translation")
    means = "; ".join(dict.fromkeys(worst[part]["means"] for part in parts))
    table: dict[str, Any] = {
        "assumption": means, "pose": {part: worst[part]["bound"] for part in parts},
        "map": None,
    }  # fmt: skip
    if results.maps is not None and DRAWN_ERRORS["rotation"] in results.maps:
        values = {part: results.maps[DRAWN_ERRORS[part]].values for part in parts}
        known = ~np.isnan(values["rotation"])
        if known.any():
            largest = {part: float(v[known].max()) for part, v in values.items()}
            points = {"points": int(known.sum()), "of": known.size}
            table["map"] = largest | points
    return table


def verdict(results: StudyResults) -> str:
    """Join the conclusions of a study to one text; see :func:`conclusions`."""
    return " ".join(conclusions(results))


def conclusions(results: StudyResults) -> list[str]:
    """Return the conclusions of a study, most important first.

    Pose errors begin with the certified bound within the clearances and, if there is a
    map, its maximum over the map.  The pose error of the minimum-energy solution
    follows.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        A list of sentences, of which the first concerns the assembly.
    """
    solution = results.solution
    if solution["status"] == BEYOND_LIMITS:
        return [f"Beyond the limits of its joints: {solution['reason']}."]
    if solution["status"] == SINGULAR:
        reason = solution["reason"]
        return [f"{reason[0].upper()}{reason[1:]}.", _checks_text(results)]
    if solution["status"] != "ok":
        why = f"{solution['status']}, {solution['reason']}"
        return [f"No solution at this pose: {why}."]
    parts = (
        _assembly_text(results) + ".", _pose_error_text(results), _drawn_text(results),
        _checks_text(results),
    )  # fmt: skip
    return list(filter(None, parts))


def by_force(results: StudyResults) -> bool:
    """Return whether assembly requires elastic deformation.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        True or False; False also if the robot cannot be assembled at all.
    """
    if results.solution["status"] != "ok":
        return False
    zone = results.solution["zone"]
    needless = zone["margin"] is not None and zone["margin"] < _NO_CLEARANCE
    return not (needless or zone["assemblable"] or zone["assemblable_free"])


def _assembly_text(results: StudyResults) -> str:
    """State whether the robot assembles by its clearances or only by force."""
    zone, assembly = results.solution["zone"], results.assembly
    assert assembly is not None
    if not by_force(results):
        if zone["margin"] is not None and zone["margin"] < _NO_CLEARANCE:
            return "It assembles without force or clearance"
        text = "It assembles by its clearances alone"
        return text + (
            "" if zone["assemblable"] else " if its compliant joints rotate freely"
        )
    text = f"It assembles only by force: {assembly.energy:.4g} J"
    if zone["margin_free"] is not None:
        text += f", its clearances being {zone['margin_free']:.3g} times too small"
    return text


def _pose_error_text(results: StudyResults) -> str:
    """State the platform's pose error, beginning with the certified bound."""
    worst = worst_clearance(results)
    screw = results.solution["platform_screw"]
    turn, shift = (float(np.linalg.norm(half)) for half in (screw[:3], screw[3:]))
    at_rest = f"in the minimum-energy solution it is {_pose_text(turn, shift)} away."
    if worst["pose"] is None:
        return f"No bound on its pose error within the clearances was found; {at_rest}"
    where, drawn = "For all positions within the clearances", ""
    if "drawn" in worst:
        one = worst["drawn"]
        drawn = "For all parts within the drawing tolerances and all positions "
        drawn += f"within the clearances its platform is {_bounds_text(one)} "
        drawn += f"(certified bounds; {one['assumption']}). "
        at_mean = ", with fits at their mean clearance," if results.robot.fits else ""
        where = f"Without these tolerances{at_mean} and for all positions within the "
        where += "clearances"
    others = _other_assumptions(results)
    return (
        f"{drawn}{where} its platform is {_bounds_text(worst)} (certified bounds of "
        f"(27), assumption {WORST}{others}); {at_rest}"
    )


def _bounds_text(worst: dict[str, Any]) -> str:
    """Format the bounds at the pose and their maxima over the map."""
    text = f"{_bound_text(worst['pose'])} from the nominal pose"
    if worst["map"] is not None:
        over = worst["map"]
        some = f" {over['points']} of" if over["points"] < over["of"] else ""
        text += f", {_bound_text(over)} over{some} the {over['of']} poses of the map"
    return text


def _drawn_text(results: StudyResults) -> str:
    """State the statistics of parts within the drawing tolerances."""
    if not (results.robot.callouts or results.robot.fits):
        return ""
    found, text = results.statistics, ""
    if found is None or "worst_case" not in found:
        text = "The certified bounds exclude the drawing tolerances"
        text += ", with fits at their mean. " if results.robot.fits else ". "
    if found is None:
        return text.strip()
    text += f"Of {found['draws']} drawn machines {found['assembled']} assemble"
    sizes = {key: found["quantities"][key] for key in ("rotation", "translation")}
    if all("quantiles" in one for one in sizes.values()):
        high = {key: one["quantiles"]["0.95"]["value"] for key, one in sizes.items()}
        text += f"; the pose error of 95 % of these is {_bound_text(high)}"
    return f"{text}."


def _other_assumptions(results: StudyResults) -> str:
    """Format bounds under other assumptions that are more than one per cent larger."""
    text = ""
    own = results.error[WORST]
    for assumption, error in results.error.items():
        parts = ("rotation", "translation")
        if any(error[p]["upper"] > 1.01 * own[p]["upper"] for p in parts):
            bounds = {part: error[part]["upper"] for part in parts}
            text += f"; {assumption}: {_bound_text(bounds)} at the study's pose"
    return text


def _bound_text(bounds: dict[str, float]) -> str:
    """Format an upper bound on the pose error."""
    if not all(np.isfinite([bounds["rotation"], bounds["translation"]])):
        return "free to move without bound"
    return f"at most {_pose_text(bounds['rotation'], bounds['translation'])}"


def _pose_text(rotation: float, translation: float) -> str:
    """Format a pose error [rad, m] in mrad and mm."""
    return f"{in_unit(rotation, 'mrad', 3)} and {in_unit(translation, 'mm', 3)}"


def covered(results: StudyResults) -> list[str]:
    """Return the subject and outcome of each independent check that was run.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        One phrase per check; checks without a significant comparison are omitted.
    """
    phrases = []
    verdicts = results.verdicts
    if verdicts.get("reference") in _OUTCOMES and results.reference is not None:
        names = [
            _CHECKED[name] for name, outcome in results.reference["checks"].items()
            if outcome != "no signal"
        ]  # fmt: skip
        phrases.append(
            f"{', '.join(names)} by the printed problems in cvxpy: "
            f"{verdicts['reference']}"
        )
    if verdicts.get("crosscheck") in _OUTCOMES:
        phrases.append(
            "pose without clearances by a multibody simulation: "
            f"{verdicts['crosscheck']}"
        )
    return phrases


def _checks_text(results: StudyResults) -> str:
    """State the outcomes of independent checks and which checks are missing."""
    phrases, missing = covered(results), results.unchecked
    text = "No independent check was requested."
    if phrases:
        text = f"Checked independently: {'; '.join(phrases)}."
        if worst_clearance(results)["pose"] is not None:
            text += " No independent check covers the certified bounds."
    elif results.verdicts:
        text = "No independent check of these results was possible."
    if missing:
        names = ", ".join(missing)
        text += f" Not checked: {names}."
    return text
