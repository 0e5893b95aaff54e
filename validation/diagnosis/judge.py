"""The verdict on what a diagnosis settled on, and errors on the rows kept aside."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from validation.campaign.campaign import Campaign
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.holdout import Split
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.kept_aside import (
    FittedModel,
    RowSets,
    Rung,
    errors_of,
    ladder,
)
from validation.diagnosis.lack_of_fit import LackOfFit, lack_of_fit, outlying
from validation.diagnosis.learning import Learned
from validation.diagnosis.next_measurement import NextMeasurement, next_measurement
from validation.diagnosis.noise_in_time import NoiseInTime, noise_in_time, widened
from validation.diagnosis.plausible import implausible, impossible_rows
from validation.diagnosis.refit import refit
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import FINITE, inclusion, named
from validation.diagnosis.selection import Selection
from validation.diagnosis.signatures import whiten
from validation.diagnosis.structure import Trend, trends
from validation.diagnosis.text import text
from validation.diagnosis.verdict import by_names, linear_or_finite, verdict

BLUNDERS = 20  # one row in so many may be called a blunder, in all


@dataclass(frozen=True, eq=False)
class Settled:
    """Where the passes of a diagnosis ended, before anything is judged.

    Attributes:
        campaign: of R rows; its sigma is the stated one times both factors below.
        unregistered: conditions of all rows, before any registration.
        conditions: the same, registered.
        split: rows fitted and rows kept aside.
        outliers: (R,) bool, rows left out of everything.
        noise_factor: (6,) by which repeats scatter more than the sigma stated.
        inflation: [-] by which sigma was made larger for what nothing explains.
        selection: sets of effects, the best one fitted.
        learned: functions behind it.
        finite: whether motions of the declared model are finite.
    """

    campaign: Campaign
    unregistered: Conditions
    conditions: Conditions
    split: Split
    outliers: NDArray
    noise_factor: NDArray
    inflation: float
    selection: Selection
    learned: tuple[Learned, ...]
    finite: bool

    @property
    def used(self) -> NDArray:
        """(R,) bool, rows that chose and fitted the effects."""
        return self.split.fitted & ~self.outliers

    @property
    def held_out(self) -> NDArray:
        """(R,) bool, rows that judge: those kept aside, or all used if none were."""
        held_out = ~self.split.fitted
        return held_out if held_out.any() else self.used

    @property
    def fitting(self) -> Campaign:
        """The rows used."""
        return self.campaign.take(self.used)


@dataclass(frozen=True, eq=False)
class _Ranking:
    """Sets of effects by name with their probabilities, best first.

    Attributes:
        sets: names of the effects and probability of each set.
        probability: of every effect.
        best: effects of the single best set.
        selection: with the fit of that set.
    """

    sets: tuple[tuple[tuple[str, ...], float], ...]
    probability: dict[str, float]
    best: tuple[str, ...]
    selection: Selection


def judge(settled: Settled) -> Diagnosis:
    """The verdict, then the rows kept aside.

    Args:
        settled: where the passes over the rows fitted ended.

    Returns:
        The diagnosis.
    """
    campaign, conditions = settled.campaign, settled.conditions
    linear = conditions if settled.finite else replace(conditions, second_order=0.0)
    declared_model = predict(linear)
    before = campaign.measured - declared_model.deviation
    ranking = _ranked(settled, before)
    selection, correlated = _with_noise_in_time(settled, ranking.selection)
    ranking = replace(ranking, selection=selection)
    inflation = settled.inflation
    lack = _lack_of_fit(settled, selection)
    ranking, decision, claimed = _decided(settled, ranking, lack)
    remarks = implausible(campaign, selection.fit, selection.behind)
    if remarks and decision in {"explained", "learned"}:
        decision, claimed = "outside_library", ()
    model = FittedModel(
        conditions, responses(conditions), selection.fit, selection.behind,
        settled.learned,
    )  # fmt: skip
    explained = predict(apply_effects(conditions, selection.fit.effects))
    after = model.residual(campaign)
    used, held_out = settled.used, settled.held_out
    varies: tuple[Trend, ...] = ()
    if decision == "outside_library":
        varies = tuple(trends(settled.fitting, conditions.take(used), after[used]))
    outliers = settled.outliers | _outlying_held_out(settled, after)
    shown = before if decision == "none_needed" else after
    rungs = ladder(
        campaign, settled.unregistered, model, selection.terms, RowSets(used, held_out),
        selection.sets[0].rank, after,
    )  # fmt: skip
    stated = replace(campaign, sigma=campaign.sigma / inflation)
    kept = held_out & ~outliers
    return Diagnosis(
        campaign=stated,
        verdict=decision,
        model=model,
        claimed=claimed,
        probability=ranking.probability,
        alternatives=ranking.sets,
        best_by_score=ranking.best,
        lack=lack,
        declared=lack_of_fit(
            settled.fitting, inflation * selection.tangents.residual, 0
        ),
        before=errors_of(stated, before, held_out),
        after=errors_of(stated, shown, held_out),
        noise=errors_of(stated, stated.sigma, held_out),
        trimmed=(errors_of(stated, before, kept), errors_of(stated, shown, kept)),
        noise_factor=settled.noise_factor,
        noise_in_time=correlated,
        ladder=tuple(_in_sigmas(rung, inflation) for rung in rungs),
        split=settled.split,
        outliers=outliers,
        conditions=conditions,
        open=declared_model.undetermined | explained.undetermined,
        residual_before=before,
        residual_after=after,
        screen=selection.screen,
        best=selection.sets[0],
        trends=varies,
        next=_next(settled, selection) if decision == "ambiguous" else None,
        remarks=remarks + _impossible(campaign),
        wording=text,
    )


def _ranked(settled: Settled, before: NDArray) -> _Ranking:
    """The sets by name; finite motions alone are the best one where these say more."""
    selection = settled.selection
    sets = by_names(selection.screen, selection.sets)
    probability = inclusion(selection.screen, selection.sets)
    best = named(selection.screen, selection.sets[0])
    if settled.finite or selection.sets[0].members or selection.behind:
        return _Ranking(sets, probability, best, selection)
    used, fitting = settled.used, settled.fitting
    gain = np.sum(whiten(fitting, before[used]) ** 2) - selection.fit.rss
    sets, probability = linear_or_finite(sets, probability, float(gain))
    if sets[0][0] == (FINITE,):
        motions = [Hypothesis(FINITE, (), ())]
        fit = refit(fitting, settled.conditions.take(used), motions, np.zeros(0))
        selection, best = replace(selection, fit=fit), (FINITE,)
    return _Ranking(sets, probability, best, selection)


def _with_noise_in_time(
    settled: Settled, selection: Selection
) -> tuple[Selection, NoiseInTime | None]:
    """The fit with the covariance that noise correlated in time leaves, if it is."""
    fit, behind = selection.fit, selection.behind
    noise = noise_in_time(settled.fitting, behind.left(fit.residual))
    if noise is None or not len(fit.values):
        return selection, noise
    weights = behind.whitened(fit.slopes)
    C = widened(fit.covariance, weights, settled.fitting, noise)
    return replace(selection, fit=replace(fit, covariance=C)), noise


def _lack_of_fit(settled: Settled, selection: Selection) -> LackOfFit:
    """Is what the best set leaves noise?"""
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + round(selection.behind.unknowns)
    return lack_of_fit(settled.fitting, settled.inflation * left, unknowns)


def _decided(
    settled: Settled, ranking: _Ranking, lack: LackOfFit
) -> tuple[_Ranking, str, tuple[str, ...]]:
    """The verdict and what is claimed; what was learned makes the ranking certain."""
    decision, claimed = verdict(
        ranking.sets, ranking.probability, lack.significant,
        small=bool(ranking.selection.behind),
    )  # fmt: skip
    if not settled.learned:
        return ranking, decision, claimed
    # the library's own scores speak of it without what was learned
    best = ranking.best
    certain = {name: float(name in best) for name in ranking.probability}
    ranking = replace(ranking, sets=((best, 1.0),), probability=certain)
    if decision != "outside_library":
        decision, claimed = "learned", best
    return ranking, decision, claimed


def _impossible(campaign: Campaign) -> tuple[str, ...]:
    """A remark on rows with readings that no sensor gives, or none."""
    ids = [campaign.ids[i] for i in np.flatnonzero(impossible_rows(campaign))]
    if not ids:
        return ()
    return (f"a temperature that no sensor has, left out: {', '.join(ids[:10])}",)


def _next(settled: Settled, selection: Selection) -> NextMeasurement | None:
    """The measurement that would tell the best set from its rivals."""
    best_fit = selection.fit
    if settled.finite:  # of all rivals alike, so that it tells nothing apart
        linear = replace(best_fit.conditions, exact=False)
        best_fit = replace(best_fit, conditions=linear)
    conditions = settled.conditions.take(settled.used)
    return next_measurement(settled.fitting, conditions, best_fit, selection.rivals)


def _outlying_held_out(settled: Settled, residual: NDArray) -> NDArray:
    """(R,) bool, outliers among the rows that judge."""
    held_out, outliers = settled.held_out, np.zeros_like(settled.outliers)
    judged = settled.campaign.take(held_out)
    most = len(settled.campaign) // BLUNDERS - int(settled.outliers.sum())
    whitened = whiten(judged, residual[held_out])
    outliers[held_out] = outlying(judged, whitened, max(0, most))
    return outliers


def _in_sigmas(rung: Rung, inflation: float) -> Rung:
    """A rung whose error is in sigmas that were not made larger."""
    error = replace(rung.error, normalised=inflation * rung.error.normalised)
    return replace(rung, error=error)
