"""The diagnosis of a campaign: residual, the effects it shows, and how sure that is.

Order of things, each opened once:

1. rows of whole configurations are kept aside;
2. the measuring frame is found, where it is not known;
3. every hypothesis's signature; all small sets scored; the best refitted in the full
   model, signatures retaken there, and scored again until the best set stays;
4. outlying rows are named, left out, and 3 repeated;
5. is what is left noise?  The verdict;
6. errors before and after on the rows kept aside.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_finite_motions, with_second_order
from forcefit.inputs.display import Figures, html_table, short_repr
from validation.campaign.campaign import Campaign
from validation.diagnosis.evidence import Background
from validation.diagnosis.holdout import Split, split
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.kept_aside import Errors, Model, Rung, errors_of, ladder
from validation.diagnosis.lack_of_fit import (
    LackOfFit,
    believed_noise,
    lack_of_fit,
    outlying,
)
from validation.diagnosis.learning import Learned
from validation.diagnosis.next_measurement import NextMeasurement, next_measurement
from validation.diagnosis.plausible import implausible, impossible_rows
from validation.diagnosis.refit import Fit, refit
from validation.diagnosis.registration import register
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import FINITE, Scored, Screen, inclusion, named
from validation.diagnosis.selection import Selection, Update, select
from validation.diagnosis.signatures import conditions_of, whiten
from validation.diagnosis.small_terms import screws_of
from validation.diagnosis.structure import Trend, trends
from validation.diagnosis.teaching import taught
from validation.diagnosis.verdict import by_names, linear_or_finite, verdict

_PASSES = 8  # of leaving out rows, believing repeats, and finite geometric errors
_BLUNDERS = 20  # one row in so many may be called a blunder, in all
_LOOSE = 1.25  # [sigma] what may be left before fits are made less sure
_BENT = 0.1  # [sigma] change of what finite geometric errors add that is looked at


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a campaign says about the machine, and what it cannot say.

    Attributes:
        campaign: what was measured; its sigma as believed, see ``noise_factor``.
        verdict: ``"explained"``, ``"learned"``, ``"none_needed"``, ``"ambiguous"`` or
            ``"outside_library"``.
        model: the best set of effects, fitted in the full model, with the machine's
            geometric errors and springs.
        claimed: names of the effects that are claimed.
        probability: of every effect of the library that the design can show.
        alternatives: sets of effects by name, with their probabilities, best first.
        best_by_score: the effects of the single best set, whatever its probability.
        lack: is what is left noise?
        declared: the same for the declared model.
        before: on all rows kept aside, with the declared model.
        after: likewise, with the best set, whatever the verdict.
        noise: by sigma.
        trimmed: before and after without the rows called outliers.
        noise_factor: (6,) by which repeats scatter more than the sigma stated.
        ladder: what each step bought on the rows kept aside.
        split: which rows were kept aside.
        outliers: (R,) bool, rows left out of everything.
        conditions: the campaign's, as declared and registered.
        open: (R,) bool, rows where clearances leave the pose free, in the declared
            model or with the effects found; see
            :class:`assembly.measurement.predict.Prediction`.
        residual_before: (R, 6) [rad, m] reading minus declared model; NaN not measured.
        residual_after: (R, 6) [rad, m] reading minus the best set's model.
        screen: the scored hypotheses of the last round.
        best: the best set there.
        trends: what the residual left varies with, if more than noise is left.
        next: the measurement that would decide, if the verdict is ambiguous.
        remarks: numbers that no machine has, and readings that no sensor gives.
    """

    campaign: Campaign
    verdict: str
    model: Model
    claimed: tuple[str, ...]
    probability: dict[str, float]
    alternatives: tuple[tuple[tuple[str, ...], float], ...]
    best_by_score: tuple[str, ...]
    lack: LackOfFit
    declared: LackOfFit
    before: Errors
    after: Errors
    noise: Errors
    trimmed: tuple[Errors, Errors]
    noise_factor: NDArray
    ladder: tuple[Rung, ...]
    split: Split
    outliers: NDArray
    conditions: Conditions
    open: NDArray
    residual_before: NDArray
    residual_after: NDArray
    screen: Screen
    best: Scored
    trends: tuple[Trend, ...]
    next: NextMeasurement | None
    remarks: tuple[str, ...]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def fit(self) -> Fit:
        """The best set of effects, fitted in the full model."""
        return self.model.fit

    @property
    def behind(self) -> Background:
        """The machine's geometric errors and springs."""
        return self.model.behind

    def summary(self) -> str:
        """The text that ``forcefit validation diagnose`` prints."""
        from validation.diagnosis.text import text

        return text(self)

    def _figures(self) -> Figures:
        """The verdict, and what it rests on."""
        likely = sorted(self.probability.items(), key=lambda one: -one[1])[:3]
        return {
            "campaign": f"{self.campaign.name}, {len(self.campaign)} rows",
            "verdict": self.verdict,
            "claimed": ", ".join(self.claimed) or "none",
            "likeliest": ", ".join(f"{name} {p:.3f}" for name, p in likely) or "none",
            "kept aside": f"{self.before.normalised:.3g} sigma before, "
            f"{self.after.normalised:.3g} after (1 is noise)",
            "outliers": f"{int(self.outliers.sum())} rows",
        }


def diagnose(
    campaign: Campaign,
    *,
    finite: bool = False,
    update: Update = lambda what, done, total: None,
) -> Diagnosis:
    """Trace a campaign's residual to the effect that the declared model lacks.

    Args:
        campaign: measured deviations.
        finite: whether motions of the declared model are finite; they are too if the
            robot's file has the effect ``geometric_stiffening``.
        update: told what is done, how much of it and of how much.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the measuring frame is not known and cannot be found.
    """
    parts = split(campaign)
    declared = conditions_of(campaign)
    finite = finite or declared.exact
    complete = with_finite_motions if finite else with_second_order
    declared = conditions = complete(declared)
    if campaign.registration == "unknown":
        conditions = register(campaign.take(parts.fitted), conditions)
    impossible = impossible_rows(campaign)
    outliers = impossible.copy()
    factor, slack = np.ones(6), 1.0
    for _ in range(_PASSES):
        used = parts.fitted & ~outliers
        fitting = campaign.take(used)
        selection = select(fitting, conditions.take(used), update, finite=finite)
        left = selection.behind.left(selection.fit.residual)
        far = np.zeros_like(outliers)
        called = int((outliers & ~impossible).sum())
        most = max(0, len(campaign) // _BLUNDERS - called)
        far[used] = outlying(fitting, left, most)
        bent = _with_errors(campaign, conditions, used, selection, complete)
        if far.any():
            outliers |= far
            continue
        if bent is not conditions:
            conditions = bent
            continue
        selection, learned = taught(campaign, conditions, used, selection, update)
        left = selection.behind.left(selection.fit.residual)
        larger = believed_noise(fitting, left)
        lack = lack_of_fit(
            fitting, left, selection.unknowns + round(selection.behind.unknowns)
        )
        if np.any(larger > 1.0):
            factor = factor * larger
        elif slack == 1.0 and lack.significant and lack.rms > _LOOSE:
            # what nothing explains must not be fitted as if it were known to a sigma
            slack = lack.rms
            larger = np.full(6, slack)
        else:
            break
        campaign = replace(campaign, sigma=campaign.sigma * larger)
    return _judge(
        campaign,
        declared,
        conditions,
        parts,
        outliers,
        (factor, slack),
        selection,
        learned,
        finite,
    )


def _in_sigmas(rung: Rung, slack: float) -> Rung:
    """A rung whose error is in sigmas that were not made larger."""
    error = replace(rung.error, normalised=slack * rung.error.normalised)
    return replace(rung, error=error)


def _with_errors(
    campaign: Campaign, conditions: Conditions, used: NDArray, selection: Selection,
    complete: Callable[[Conditions], Conditions],
) -> Conditions:  # fmt: skip
    """Conditions whose finite part is that of the geometric errors found, too."""
    # the errors change with it, and are followed until it stays
    behind, fitting = selection.behind, campaign.take(used)
    raw = behind.raw(selection.fit.residual)
    own = [conditions.robot.index(frame.name) for frame in campaign.robot.frames]
    for _ in range(_PASSES):
        values = behind.values(behind.whitened(raw))
        errors = screws_of(campaign, behind.terms, values)
        if not errors.any():
            break
        there = conditions.errors.copy()
        there[:, own] += errors
        bent = complete(replace(conditions, errors=there))
        bent = replace(conditions, second_order=bent.second_order)
        change = (
            predict(bent.take(used)).deviation
            - predict(conditions.take(used)).deviation
        )
        if np.nanmax(np.abs(change / fitting.sigma), initial=0.0) < _BENT:
            break
        conditions, raw = bent, raw - np.nan_to_num(whiten(fitting, change))
    return conditions


def _judge(
    campaign: Campaign, unregistered: Conditions, conditions: Conditions, parts: Split,
    outliers: NDArray, noise: tuple[NDArray, float], selection: Selection,
    learned: tuple[Learned, ...], finite: bool,
) -> Diagnosis:  # fmt: skip
    """The verdict, then the rows kept aside."""
    factor, slack = noise  # repeats said; nothing explained
    used = parts.fitted & ~outliers
    fitting, measured = campaign.take(used), campaign.measured
    declared = lack_of_fit(fitting, slack * selection.tangents.residual, 0)
    sets = by_names(selection.screen, selection.sets)
    probability = inclusion(selection.screen, selection.sets)
    best = named(selection.screen, selection.sets[0])
    linear = conditions if finite else replace(conditions, second_order=0.0)
    declared_model = predict(linear)
    before = measured - declared_model.deviation
    if not finite and not selection.sets[0].members and not selection.behind:
        gain = np.sum(whiten(fitting, before[used]) ** 2) - selection.fit.rss
        sets, probability = linear_or_finite(sets, probability, float(gain))
        if sets[0][0] == (FINITE,):
            motions = [Hypothesis(FINITE, (), ())]
            fit = refit(fitting, conditions.take(used), motions, np.zeros(0))
            selection, best = replace(selection, fit=fit), (FINITE,)
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + round(selection.behind.unknowns)
    lack = lack_of_fit(fitting, slack * left, unknowns)
    small = bool(selection.behind)
    decision, claimed = verdict(sets, probability, lack.significant, small=small)
    if learned:  # the library's own scores speak of it without what was learned
        sets = ((best, 1.0),)
        probability = {name: float(name in best) for name in probability}
    if learned and decision != "outside_library":
        decision, claimed = "learned", best
    remarks = implausible(campaign, selection.fit, selection.behind)
    if remarks and decision in {"explained", "learned"}:
        decision, claimed = "outside_library", ()
    impossible = [campaign.ids[i] for i in np.flatnonzero(impossible_rows(campaign))]
    if impossible:
        listed = ", ".join(impossible[:10])
        remarks += (f"a temperature that no sensor has, left out: {listed}",)
    model = Model(
        conditions, responses(conditions), selection.fit, selection.behind, learned
    )
    explained = predict(apply_effects(conditions, selection.fit.effects))
    residual_after = model.residual(campaign)
    open_ = declared_model.undetermined | explained.undetermined
    varies: tuple[Trend, ...] = ()
    if decision == "outside_library":
        varies = tuple(trends(fitting, conditions.take(used), residual_after[used]))
    further = None
    if decision == "ambiguous":
        best_fit = selection.fit
        if finite:  # of all rivals alike, so that it tells nothing apart
            there = replace(best_fit.conditions, exact=False)
            best_fit = replace(best_fit, conditions=there)
        further = next_measurement(
            fitting, conditions.take(used), best_fit, selection.rivals
        )
    held = ~parts.fitted
    if not held.any():
        held = used
    far = np.zeros_like(held)
    judged = campaign.take(held)
    most = max(0, len(campaign) // _BLUNDERS - int(outliers.sum()))
    far[held] = outlying(judged, whiten(judged, residual_after[held]), most)
    outliers = outliers | far
    shown = before if decision == "none_needed" else residual_after
    rungs = ladder(
        campaign,
        unregistered,
        model,
        selection.terms,
        used,
        held,
        selection.sets[0].rank,
        residual_after,
    )
    rungs = [_in_sigmas(rung, slack) for rung in rungs]
    campaign = replace(campaign, sigma=campaign.sigma / slack)
    return Diagnosis(
        campaign, decision, model, claimed, probability, sets, best, lack,
        declared, errors_of(campaign, before, held), errors_of(campaign, shown, held),
        errors_of(campaign, campaign.sigma, held),
        (errors_of(campaign, before, held & ~outliers),
         errors_of(campaign, shown, held & ~outliers)),
        factor, tuple(rungs), parts, outliers, conditions, open_, before,
        residual_after,
        selection.screen, selection.sets[0], varies, further, remarks,
    )  # fmt: skip
