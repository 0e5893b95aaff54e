"""Summarise the results of a study: assembly, pose error and independent checks.

The first pose error is the certified bound over all positions within the clearances.
The summary names the assumption of each pose error.
"""

from typing import Any

import numpy as np

from forcefit.assembly.model.statuses import BEYOND_LIMITS, SINGULAR
from forcefit.results.text import in_unit
from forcefit.validation.study.drawn_tolerances import DRAWN_ERRORS
from forcefit.validation.study.study import StudyResults

# Assumption of problem (27) under which the worst case is computed: deformations do
# not change, and unloaded joints are anywhere within their clearances.
WORST = "frozen"
_CHECKED = {
    "energy": "energy", "margin": "zone margin", "margin_free": "free zone margin"
}  # fmt: skip
_LARGER = {
    "free": "compliant joints also rotate about their axis",
    "budget": "the deformation energy may be 5 % above its minimum",
}
_OUTCOMES = ("passed", "failed", "not decided")  # possible results of a check
# [-] A required fraction of the clearances below this value is treated as zero.
_NO_CLEARANCE = 1e-6


def worst_clearance(results: StudyResults) -> dict[str, Any]:
    """Return certified upper bounds on the platform error within the clearances.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        Bounds ``rotation`` [rad] and ``translation`` [m] under the assumption
        ``frozen`` of problem (27), at the study's pose (``pose``) and their maxima over
        the map (``map``).  ``points`` is the number of map points with bounds, and
        ``of`` the number of all map points.  A bound is None if it was not computed,
        and infinite if the pose is unbounded.  For a robot with drawing tolerances,
        ``drawn`` contains the bounds over all parts within tolerance and their
        assumption.
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
    """Return the conclusions of a study as text, with one conclusion per line."""
    return "\n".join(conclusions(results))


def conclusions(results: StudyResults) -> list[str]:
    """Return the conclusions of a study, most important first.

    Certified bounds on the pose error precede the pose error of the minimum-energy
    solution.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        A list of texts.  The first is a sentence about the assembly.
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
        *_assembly_texts(results), *_pose_error_texts(results), _drawn_text(results),
        _checks_text(results),
    )  # fmt: skip
    return list(filter(None, parts))


def by_force(results: StudyResults) -> bool:
    """Return whether assembly requires elastic deformation.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        Whether force is required.  False if the robot cannot be assembled at all.
    """
    if results.solution["status"] != "ok":
        return False
    zone = results.solution["zone"]
    needless = zone["margin"] is not None and zone["margin"] < _NO_CLEARANCE
    return not (needless or zone["assemblable"] or zone["assemblable_free"])


def _assembly_texts(results: StudyResults) -> list[str]:
    """Return sentences on whether the robot assembles only by force."""
    zone, assembly = results.solution["zone"], results.assembly
    assert assembly is not None
    if not by_force(results):
        if zone["margin"] is not None and zone["margin"] < _NO_CLEARANCE:
            return ["It assembles without force or clearance."]
        text = "It assembles by its clearances alone"
        return [
            f"{text}."
            if zone["assemblable"]
            else f"{text} if its compliant joints rotate freely."
        ]
    energy = f"the minimum deformation energy is {assembly.energy:.4g} J"
    texts = [f"It assembles only by force: {energy}."]
    if zone["margin_free"] is not None:
        factor = f"{zone['margin_free']:.3g} times as large"
        texts.append(f"Its clearances must be {factor} to assemble it without force.")
    return texts


def _pose_error_texts(results: StudyResults) -> list[str]:
    """Return the platform's pose errors, beginning with the certified bound."""
    worst = worst_clearance(results)
    screw = results.solution["platform_screw"]
    turn, shift = (float(np.linalg.norm(half)) for half in (screw[:3], screw[3:]))
    at_rest = (
        f"In the minimum-energy solution, the platform is {_pose_text(turn, shift)} "
        "from the nominal pose."
    )
    if worst["pose"] is None:
        return ["No bound on the pose error within the clearances was found.", at_rest]
    texts, where = [], "For all positions within the clearances"
    if "drawn" in worst:
        one = worst["drawn"]
        every = "For all parts within the drawing tolerances and all positions within "
        texts.append(
            f"{every}the clearances, {_bounds_text(one)} These bounds are certified "
            f"({one['assumption']})."
        )
        at_mean = ", with fits at their mean clearance," if results.robot.fits else ""
        where = f"Without these tolerances{at_mean} and for all positions within the "
        where += "clearances"
    texts.append(
        f"{where}, {_bounds_text(worst)} These certified bounds assume that the "
        f"deformations do not change within the clearances (assumption {WORST})."
    )
    return [*texts, *_other_assumptions(results), at_rest]


def _bounds_text(worst: dict[str, Any]) -> str:
    """Format the bounds at the pose and their maxima over the map as sentences."""
    text = f"the platform is {_bound_text(worst['pose'])}."
    over = worst["map"]
    if over is None:
        return text
    points, of = over["points"], over["of"]
    some = "all" if points == of else f"{points} of the"
    if _finite(over):
        text += f" At {some} {of} poses of the map, it is {_bound_text(over)}."
    else:
        text += f" At some of the {of} poses of the map, it is {_bound_text(over)}."
    return text


def _drawn_text(results: StudyResults) -> str:
    """Return sentences on the statistics of parts within the drawing tolerances."""
    if not (results.robot.callouts or results.robot.fits):
        return ""
    found, text = results.statistics, ""
    if found is None or "worst_case" not in found:
        text = "The certified bounds do not include the drawing tolerances"
        text += ", and use the mean of each fit. " if results.robot.fits else ". "
    if found is None:
        return text.strip()
    text += f"Of {found['draws']} randomly drawn machines, {found['assembled']} "
    text += "assemble."
    sizes = {key: found["quantities"][key] for key in ("rotation", "translation")}
    if all("quantiles" in one for one in sizes.values()):
        high = {key: one["quantiles"]["0.95"]["value"] for key, one in sizes.items()}
        text += " The 95 % quantiles of their pose error are "
        text += f"{_pose_text(high['rotation'], high['translation'])}."
    return text


def _other_assumptions(results: StudyResults) -> list[str]:
    """Return the bounds under other assumptions if they are over 1 % larger."""
    texts = []
    own = results.error[WORST]
    for assumption, error in results.error.items():
        parts = ("rotation", "translation")
        if any(error[p]["upper"] > 1.01 * own[p]["upper"] for p in parts):
            bounds = {part: error[part]["upper"] for part in parts}
            texts.append(
                f"If {_LARGER[assumption]} (assumption {assumption}), the platform is "
                f"{_bound_text(bounds)} at the study's pose."
            )
    return texts


def _bound_text(bounds: dict[str, float]) -> str:
    """Format an upper bound on the pose error."""
    if not _finite(bounds):
        return "free to move without bound"
    size = _pose_text(bounds["rotation"], bounds["translation"])
    return f"at most {size} from the nominal pose"


def _finite(bounds: dict[str, float]) -> bool:
    """Return whether the bounds of rotation and translation are both finite."""
    return bool(np.isfinite([bounds["rotation"], bounds["translation"]]).all())


def _pose_text(rotation: float, translation: float) -> str:
    """Format a pose error [rad, m] in mrad and mm."""
    return f"{in_unit(rotation, 'mrad', 3)} and {in_unit(translation, 'mm', 3)}"


def covered(results: StudyResults) -> list[str]:
    """Return the subject and outcome of each independent check that was run.

    Args:
        results: results of :func:`forcefit.validation.study.study.run_study`.

    Returns:
        One phrase per check.  Checks without an outcome are omitted.
    """
    phrases = []
    verdicts = results.verdicts
    if verdicts.get("reference") in _OUTCOMES and results.reference is not None:
        names = [
            _CHECKED[name] for name, outcome in results.reference["checks"].items()
            if outcome != "no signal"
        ]  # fmt: skip
        phrases.append(
            f"{', '.join(names)}, by solving the paper's problems in cvxpy "
            f"({verdicts['reference']})"
        )
    if verdicts.get("crosscheck") in _OUTCOMES:
        phrases.append(
            "pose without clearances, by a multibody simulation "
            f"({verdicts['crosscheck']})"
        )
    return phrases


def _checks_text(results: StudyResults) -> str:
    """Return sentences on the independent checks and on those that did not run."""
    phrases, missing = covered(results), results.unchecked
    text = "No independent check was requested."
    if phrases:
        text = f"Checked independently: {'; '.join(phrases)}."
        if worst_clearance(results)["pose"] is not None:
            text += " No independent check covers the certified bounds."
    elif results.verdicts:
        text = "No independent check of these results was possible."
    if missing:
        text += f" Checks that were not possible: {', '.join(missing)}."
    return text
