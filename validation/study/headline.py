"""A study in a few sentences: how it goes together, where it ends up, what was checked.

The pose error that is said first is the certified bound of the worst play; every other
one is said together with what it takes of the play.
"""

from typing import Any

import numpy as np

from validation.study.study import StudyResults

WORST = "frozen"  # reading of (27): all play moves that moves no spring
_NO_PLAY = 1e-6  # [-] of the clearances: less is rounding


def worst_play(results: StudyResults) -> dict[str, Any]:
    """Certified upper bounds of the platform's error wherever its play may rest.

    Args:
        results: of :func:`validation.study.study.run_study`.

    Returns:
        ``rotation`` [rad] and ``translation`` [m], reading ``frozen`` of (27), at the
        study's pose (``pose``) and the largest over its ``map``, with the number of
        ``points`` they are over, ``of`` all; None where there is none.  Infinite where
        nothing bounds the platform.
    """
    parts = ("rotation", "translation")
    here = results.error.get(WORST)
    table: dict[str, Any] = {"reading": WORST, "pose": None, "map": None}
    if here is not None:
        table["pose"] = {part: here[part]["upper"] for part in parts}
    if results.maps is not None:
        upper = results.maps.sel(bound="upper")
        bounds = {part: upper[f"{part}_error"].values for part in parts}
        known = ~np.isnan(bounds["rotation"]) & ~np.isnan(bounds["translation"])
        if known.any():
            largest = {part: float(v[known].max()) for part, v in bounds.items()}
            points = {"points": int(known.sum()), "of": known.size}
            table["map"] = largest | points
    return table


def verdict(results: StudyResults) -> str:
    """What the study found, in a few sentences.

    The pose error is the certified bound wherever play rests, over the map if there is
    one; beside it stands what it is with play at least energy.

    Args:
        results: of :func:`validation.study.study.run_study`.

    Returns:
        Plain text.
    """
    solution = results.solution
    if solution["status"] != "ok":
        return f"No answer at this pose: {solution['status']}, {solution['reason']}."
    return f"{_goes_together(results)}. {_ends_up(results)} {_checked(results)}"


def _goes_together(results: StudyResults) -> str:
    """By play alone, or by how much force."""
    zone, answer = results.solution["zone"], results.answer
    assert answer is not None
    if zone["margin"] is not None and zone["margin"] < _NO_PLAY:
        return "It goes together without force, and needs no play for it"
    if zone["assemblable"] or zone["assemblable_free"]:
        goes = "It goes together by its clearances alone"
        return goes + (
            "" if zone["assemblable"] else " if its compliant joints turn freely"
        )
    goes = f"It goes together only by force: {answer.energy:.4g} J"
    if zone["margin_free"] is not None:
        goes += f", its play being {zone['margin_free']:.3g} times too small"
    return goes


def _ends_up(results: StudyResults) -> str:
    """Where the platform is: the certified bound of the worst play first."""
    worst = worst_play(results)
    screw = results.solution["platform_screw"]
    turn, shift = (float(np.linalg.norm(half)) for half in (screw[:3], screw[3:]))
    at_rest = f"with play resting at least energy it is {_pose_text(turn, shift)} away."
    if worst["pose"] is None:
        return f"How far play lets its platform go could not be bounded; {at_rest}"
    bound = _bound_text(worst["pose"])
    said = [f"Wherever its play rests, its platform is {bound} from the nominal pose"]
    if worst["map"] is not None:
        over = worst["map"]
        some = f" {over['points']} of" if over["points"] < over["of"] else ""
        said.append(
            f", {_bound_text(over)} over{some} the {over['of']} poses of the map"
        )
    return "".join(said) + (
        f" (certified bounds of (27), reading {WORST}{_wider(results)}); {at_rest}"
    )


def _wider(results: StudyResults) -> str:
    """What the other readings allow, where that is more than one per cent more."""
    said = ""
    own = results.error[WORST]
    for reading, found in results.error.items():
        parts = ("rotation", "translation")
        if any(found[p]["upper"] > 1.01 * own[p]["upper"] for p in parts):
            bounds = {part: found[part]["upper"] for part in parts}
            said += f"; {reading}: {_bound_text(bounds)} at the study's pose"
    return said


def _bound_text(bounds: dict[str, float]) -> str:
    """A pose error that is not exceeded."""
    if not all(np.isfinite([bounds["rotation"], bounds["translation"]])):
        return "free to move without bound"
    return f"at most {_pose_text(bounds['rotation'], bounds['translation'])}"


def _pose_text(rotation: float, translation: float) -> str:
    """Sizes of a pose error [rad, m] in mm and mrad."""
    return f"{1e3 * translation:.3g} mm and {1e3 * rotation:.3g} mrad"


def _checked(results: StudyResults) -> str:
    """How many independent checks ran, what they said, what has not run."""
    found, missing = results.verdicts, results.unchecked
    ran = [v for v in found.values() if v in {"passed", "failed", "not decided"}]
    said = "No independent check was asked for."
    if ran:
        how = "passed" if set(ran) == {"passed"} else "did not all pass"
        said = f"Independent checks of these numbers: {len(ran)}; they {how}."
    elif found:
        said = "No independent check of these numbers could be made."
    if missing:
        names = ", ".join(missing)
        said += f" Not checked: {names}."
    return said
