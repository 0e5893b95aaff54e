"""Describe the result of a diagnosis in sentences."""

import math
from collections.abc import Sequence

from numpy.typing import NDArray

from forcefit.assembly.effects.functions import columns_of, parameters_of
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.statuses import (
    AMBIGUOUS,
    EXPLAINED,
    LEARNED,
    NONE_NEEDED,
    NOT_ENOUGH_ROWS,
)
from forcefit.validation.diagnosis.calibration import Calibration
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.saving import functions_of

WORDS = {GEOMETRY: "geometric errors", SPRINGS: "springs"}


def sentence(diagnosis: Diagnosis) -> str:
    """Describe the verdict and the errors of a diagnosis in sentences."""
    if diagnosis.setup:
        faults = "; ".join(one.sentence for one in diagnosis.setup)
        return f"The campaign contains set-up blunders: {faults}"
    where = {  # description of the held-out rows for each hold-out method
        "split": "held-out rows",
        "folds": f"rows held out in {len(diagnosis.held.folds)} folds",
        "none": "the fitted rows (there are too few rows to hold out)",
    }[diagnosis.held.how]
    before = f"{diagnosis.before.normalised:.2f} sigma"
    kept = f"The residual on {where} is {before} before"
    known = math.isfinite(diagnosis.uncertainty)
    unsure = f" +- {diagnosis.uncertainty:.2f}" if known else ""
    after, noise = diagnosis.after.normalised, diagnosis.noise.normalised
    both = (
        f"{kept} and {after:.2f}{unsure} sigma after the diagnosis "
        f"(noise: {noise:.3g} sigma)"
    )
    if diagnosis.verdict == NONE_NEEDED:
        return (
            "The declared model suffices. This design cannot distinguish the residual "
            f"from noise ({before} on {where})."
        )
    if diagnosis.verdict == EXPLAINED:
        small = [WORDS[part.name] for part in diagnosis.fit.unknowns.small]
        names = " and ".join([*diagnosis.claimed, *small])
        return f"The declared model lacks {names}. {both}."
    if diagnosis.verdict == LEARNED:
        names = " and ".join([*diagnosis.claimed, *titles(diagnosis)][:6])
        return f"The declared model lacks {names} (with learned functions). {both}."
    if diagnosis.verdict == AMBIGUOUS:
        sets = " or ".join(
            " + ".join(names) or "nothing" for names, _ in diagnosis.alternatives[:4]
        )
        return (
            f"This design cannot distinguish these effects: {sets}. {kept} the "
            "diagnosis."
        )
    if diagnosis.verdict == NOT_ENOUGH_ROWS:
        return f"There are too few rows to distinguish an effect from noise. {both}."
    if not diagnosis.lack.significant:
        return (
            "The fitted rows contain only noise after the fit "
            f"({diagnosis.lack.rms:.2f} sigma), but the model is not confirmed. {both}."
        )
    seen = ", ".join(t.against for t in diagnosis.trends[:3])
    varies = f", which varies with {seen}" if seen else ""
    return (
        "No effect of the library explains the residual of the fitted rows "
        f"({diagnosis.lack.rms:.2f} sigma{varies}). {both}."
    )


def titles(diagnosis: Diagnosis) -> list[str]:
    """Return a title with location and variables for each learned function."""
    every = functions_of(diagnosis)
    return [function.title for functions in every for function in functions]


def calibration_text(tally: Calibration) -> str:
    """Describe the error rates of simulated diagnoses."""

    def counts(words: dict[str, int]) -> str:
        return ", ".join(f"{name} {n}" for name, n in sorted(words.items()))

    named = (
        ""
        if math.isnan(tally.right)
        else f"; {100 * tally.right:.0f} % with the correct effects"
    )
    return (
        f"verdicts on {tally.campaigns} simulated campaigns of each kind: with noise "
        f"alone {counts(tally.without)}; with the identified effects "
        f"{counts(tally.with_found)}{named}; false claims "
        f"{100 * tally.false_claims:.1f} %"
    )


def open_text(open_: NDArray) -> str:
    """Describe the rows in which the pose is undetermined."""
    return (
        f"clearances leave the pose undetermined in {int(open_.sum())} of "
        f"{len(open_)} rows (marked open). One pose of minimum energy is predicted "
        "for each of these rows: in a closed chain the pose nearest to nominal, in an "
        "open chain the pose with centred joints"
    )


def formula(function: Function) -> str:
    """Format a function as a sum of basis functions, for each screw component."""
    names = [name.rpartition(".")[2] for name in function.variables]
    words = []
    for component in function.components:
        numbers = parameters_of(function, component)
        terms = [
            f"{numbers[key]:.4g} {_column_text(function, key, names)}".rstrip()
            for key in columns_of(function, component)
        ]
        words.append(f"{component} = {' + '.join(terms)}")
    times = " (times the wrench there)" if function.kind == "compliance" else ""
    return "; ".join(words) + times


def _column_text(function: Function, key: str, names: Sequence[str]) -> str:
    """Format one basis function of a function."""
    form, given = function.form, function.parameters
    head, _, word = key.rpartition(".")
    if form == "knee":
        until = {"below": " up to ", "above": " beyond ", "size": "'s sign from "}
        return f"{names[0]}{until[word]}{given['at']:.4g}"
    if form == "powers":
        orders = zip(names, key.split("."), strict=False)
        return " ".join(n if o == "1" else f"{n}^{o}" for n, o in orders if o != "0")
    if form == "waves" and head == "0":
        return ""
    if form == "waves" and len(names) == 1 and "period" in given:
        turns = f"2 pi {head} {names[0]}/{given['period']:.4g}"
        return f"{'sin' if word == 'sine' else 'cos'}({turns})"
    if form == "waves" and len(names) == 1:
        return f"{'sin' if word == 'sine' else 'cos'}({head} {names[0]})"
    return f"{form}.{key}({', '.join(names)})"
