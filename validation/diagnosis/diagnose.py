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

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_finite_motions, with_second_order
from forcefit.inputs.display import Figures, html_table, short_repr
from validation.campaign.campaign import Campaign
from validation.diagnosis.holdout import Split, split
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.lack_of_fit import LackOfFit, lack_of_fit, outlying
from validation.diagnosis.next_measurement import NextMeasurement, next_measurement
from validation.diagnosis.refit import Fit, refit
from validation.diagnosis.registration import register
from validation.diagnosis.scoring import FINITE, Scored, Screen, inclusion, named
from validation.diagnosis.selection import Selection, Update, select
from validation.diagnosis.signatures import conditions_of, whiten
from validation.diagnosis.structure import Trend, trends
from validation.diagnosis.verdict import by_names, linear_or_finite, verdict


@dataclass(frozen=True)
class Errors:
    """Root mean squares over the rows kept aside.

    Attributes:
        position: [m] of the components measured.
        rotation: [rad] likewise.
        normalised: [-] of residual over sigma.
    """

    position: float
    rotation: float
    normalised: float


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a campaign says about the machine, and what it cannot say.

    Attributes:
        campaign: what was measured.
        verdict: ``"explained"``, ``"none_needed"``, ``"ambiguous"`` or
            ``"outside_library"``.
        fit: the best set of effects, fitted in the full model.
        claimed: names of the effects that are claimed.
        probability: of every effect of the library that the design can show.
        alternatives: sets of effects by name, with their probabilities, best first.
        best_by_score: the effects of the single best set, whatever its probability.
        lack: is what is left noise?
        declared: the same for the declared model.
        before: on the rows kept aside, with the declared model.
        after: with the effects claimed, or the best set where the verdict is ambiguous.
        noise: by the stated sigma.
        split: which rows were kept aside.
        outliers: (R,) bool, rows left out of everything.
        conditions: the campaign's, as declared and registered.
        open: (R,) bool, rows where play leaves the pose free, in the declared model or
            with the effects found; see
            :class:`assembly.measurement.predict.Prediction`.
        residual_before: (R, 6) [rad, m] reading minus declared model; NaN not measured.
        residual_after: (R, 6) [rad, m] reading minus the best set's model.
        screen: the scored hypotheses of the last round.
        best: the best set there.
        trends: what the residual left varies with, if more than noise is left.
        next: the measurement that would decide, if the verdict is ambiguous.
    """

    campaign: Campaign
    verdict: str
    fit: Fit
    claimed: tuple[str, ...]
    probability: dict[str, float]
    alternatives: tuple[tuple[tuple[str, ...], float], ...]
    best_by_score: tuple[str, ...]
    lack: LackOfFit
    declared: LackOfFit
    before: Errors
    after: Errors
    noise: Errors
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

    __repr__, _repr_html_ = short_repr, html_table

    def summary(self) -> str:
        """The text that ``forcefit validation diagnose`` prints."""
        from validation.diagnosis.results import text

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
    here = conditions_of(campaign)
    finite = finite or here.exact
    here = with_finite_motions(here) if finite else with_second_order(here)
    if campaign.registration == "unknown":
        here = register(campaign.take(parts.fitted), here)
    outliers = np.zeros(len(campaign), dtype=bool)
    while True:
        used = parts.fitted & ~outliers
        found = select(campaign.take(used), here.take(used), update, finite=finite)
        far = np.zeros_like(outliers)
        far[used] = outlying(campaign.take(used), found.fit.residual)
        if not far.any():
            break
        outliers |= far
    return _judge(campaign, here, parts, outliers, found, finite)


def _judge(
    campaign: Campaign, here: Conditions, parts: Split, outliers: NDArray,
    found: Selection, finite: bool,
) -> Diagnosis:  # fmt: skip
    """The verdict, then the rows kept aside."""
    used = parts.fitted & ~outliers
    fitting, measured = campaign.take(used), campaign.measured
    lack = lack_of_fit(fitting, found.fit.residual, found.unknowns)
    declared = lack_of_fit(fitting, found.tangents.residual, 0)
    sets = by_names(found.screen, found.sets)
    probability = inclusion(found.screen, found.sets)
    best = named(found.screen, found.sets[0])
    linear = here if finite else replace(here, second_order=0.0)
    declared_model = predict(linear)
    before = measured - declared_model.deviation
    if not finite and not found.sets[0].members:
        gain = np.sum(whiten(fitting, before[used]) ** 2) - found.fit.rss
        sets, probability = linear_or_finite(sets, probability, float(gain))
        if sets[0][0] == (FINITE,):
            motions = [Hypothesis(FINITE, (), ())]
            fit = refit(fitting, here.take(used), motions, np.zeros(0))
            found, best = replace(found, fit=fit), (FINITE,)
    said, claimed = verdict(sets, probability, lack.significant)
    after = apply_effects(here, found.fit.effects)
    explained = predict(after)
    residual_after = measured - explained.deviation
    open_ = declared_model.undetermined | explained.undetermined
    left: tuple[Trend, ...] = ()
    if said == "outside_library":
        left = tuple(trends(fitting, here.take(used), residual_after[used]))
    further = None
    if said == "ambiguous":
        best_fit = found.fit
        if finite:  # of all rivals alike, so that it tells nothing apart
            there = replace(best_fit.conditions, exact=False)
            best_fit = replace(best_fit, conditions=there)
        further = next_measurement(fitting, here.take(used), best_fit, found.rivals)
    held = ~parts.fitted & ~outliers
    if not held.any():
        held = used
    far = np.zeros_like(held)
    shown = residual_after if said in {"explained", "ambiguous"} else before
    judged = campaign.take(held)
    far[held] = outlying(judged, whiten(judged, residual_after[held]))
    outliers = outliers | far
    held &= ~far
    return Diagnosis(
        campaign, said, found.fit, claimed, probability, sets, best, lack,
        declared, _errors(campaign, before, held),
        _errors(campaign, shown, held), _errors(campaign, campaign.sigma, held),
        parts, outliers, here, open_, before, residual_after, found.screen,
        found.sets[0], left, further,
    )  # fmt: skip


def _errors(campaign: Campaign, residual: NDArray, rows: NDArray) -> Errors:
    """Root mean squares over the measured cells of some rows."""
    z = np.where(campaign.cells, residual, np.nan)[rows]

    def rms(values: NDArray) -> float:
        known = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")

    return Errors(rms(z[:, 3:]), rms(z[:, :3]), rms(z / campaign.sigma[rows]))
