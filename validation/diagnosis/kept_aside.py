"""What every step of a diagnosis bought, on the rows that were kept aside.

Steps in the order in which a machine is understood: as declared, where the device
stands, its geometry, its springs, effects of the library, functions learned.  Each is
fitted together with all before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import NOTHING, Background, background
from validation.diagnosis.candidates import Sensitivities
from validation.diagnosis.evidence import Evidence, Prior
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.learning import Learned, term_name
from validation.diagnosis.refit import Fit, refit, with_clearance_held
from validation.diagnosis.registration import device_frame
from validation.diagnosis.responses import Responses
from validation.diagnosis.signatures import whiten
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm, added


@dataclass(frozen=True)
class Errors:
    """Root mean squares over some rows.

    Attributes:
        position: [m] of the components measured.
        rotation: [rad] likewise.
        normalised: [-] of residual over sigma.
    """

    position: float
    rotation: float
    normalised: float


@dataclass(frozen=True)
class Rung:
    """A step and what is left after it.

    Attributes:
        term: ``"declared"``, ``"registration"``, ``"geometry"``, ``"springs"``,
            ``"library effects"`` or, for each function, ``"learned effects"``.
        unknowns: [-] numbers fitted; of many small ones, how many combinations the
            readings and not their prior say.
        error: on the rows kept aside.
    """

    term: str
    unknowns: float
    error: Errors


def errors_of(campaign: Campaign, residual: NDArray, rows: NDArray) -> Errors:
    """Root mean squares of what is left.

    Args:
        campaign: of R rows.
        residual: (R, 6) [rad, m].
        rows: mask (R,).

    Returns:
        Over the measured cells of those rows; NaN where nothing was measured.
    """
    z = np.where(campaign.cells, residual, np.nan)[rows]

    def rms(values: NDArray) -> float:
        known = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")

    return Errors(rms(z[:, 3:]), rms(z[:, :3]), rms(z / campaign.sigma[rows]))


@dataclass(frozen=True, eq=False)
class RowSets:
    """Which rows were fitted, and which are scored.

    Attributes:
        fitted: mask (R,).
        scored: mask (R,).
    """

    fitted: NDArray
    scored: NDArray


@dataclass(frozen=True, eq=False)
class FittedModel:
    """Effects and small unknowns together.

    Attributes:
        conditions: conditions of all R rows, as declared and registered.
        response: of the readings there.
        fit: of effects, on the rows fitted.
        behind: small terms beside them.
        learned: functions among these.
    """

    conditions: Conditions
    response: Responses
    fit: Fit
    behind: Background
    learned: tuple[Learned, ...] = ()

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """To functions at any place."""
        return Sensitivities(self.conditions, self.conditions.robot, self.response)

    def residual(self, campaign: Campaign) -> NDArray:
        """(R, 6) [rad, m] readings minus the model; NaN where not measured."""
        fitted = apply_effects(self.conditions, self.fit.effects)
        values = self.behind.values(self.fit.residual)
        small = added(
            campaign, self.response, self.conditions, self.behind.terms, values
        )
        known = {t.name: x for t, x in zip(self.behind.terms, values, strict=True)}
        for k, one in enumerate(self.learned):
            if term_name(k + 1) in known:
                x = known[term_name(k + 1)]
                small += self.sensitivities.moved(one.candidate, x)
        return campaign.measured - predict(fitted).deviation - small


def ladder(
    campaign: Campaign, declared: Conditions, model: FittedModel,
    terms: Sequence[SmallTerm], rows: RowSets, rank: int, residual: NDArray,
) -> list[Rung]:  # fmt: skip
    """The steps up to a model.

    Args:
        campaign: of R rows.
        declared: conditions of all rows, before any registration.
        model: where the steps lead.
        terms: small terms of the rows fitted, with all their unknowns.
        rows: those fitted, and those scored.
        rank: unknowns of the library's effects that the readings can tell apart.
        residual: (R, 6) [rad, m] what the model leaves.

    Returns:
        One rung a step; a step that nothing asked for repeats the one before.
    """
    fitting = campaign.take(rows.fitted)
    conditions = with_clearance_held(model.conditions, model.fit)
    some = conditions.take(rows.fitted)
    names = [term.name for term in model.behind.terms]
    first = [name for name in (GEOMETRY, SPRINGS) if name in names]

    def rung(
        name: str, behind: Background, members: Sequence[Hypothesis],
        conditions: Conditions = conditions,
    ) -> None:  # fmt: skip
        same = len(members) == len(model.fit.hypotheses)
        begin = np.concatenate([np.zeros(0), *(h.start for h in members)])
        start = model.fit.values if same else begin
        some = conditions.take(rows.fitted)
        fit = refit(fitting, some, members, start, behind=behind)
        step = FittedModel(conditions, model.response, fit, behind, model.learned)
        error = errors_of(campaign, step.residual(campaign), rows.scored)
        rungs.append(Rung(name, behind.unknowns - known, error))

    before = campaign.measured - predict(declared).deviation
    rungs = [Rung("declared", 0, errors_of(campaign, before, rows.scored))]
    known = 0.0
    nuisance: list[Hypothesis] = []
    if campaign.registration == "unknown":
        nuisance = [device_frame(some)]
        # not yet with what finite geometric errors add
        straight = replace(conditions, second_order=declared.second_order)
        rung("registration", NOTHING, nuisance, straight)
        rungs[-1] = replace(rungs[-1], unknowns=6)
    z = whiten(fitting, fitting.measured - predict(some).deviation)
    for name in (GEOMETRY, SPRINGS):
        if name not in first:
            rungs.append(replace(rungs[-1], term=name, unknowns=0))
            continue
        own = [t for t in terms if t.name in first[: first.index(name) + 1]]
        behind = background(own, Evidence(own, len(z)).best(z))
        rung(name, behind, nuisance)
        known = behind.unknowns
    end = errors_of(campaign, residual, rows.scored)
    later = names[len(first) :]
    behind = _with_terms(model.behind, first)
    if len(model.fit.hypotheses) == len(nuisance):
        rungs.append(replace(rungs[-1], term="library effects", unknowns=0))
    elif later:
        rung("library effects", behind, model.fit.hypotheses)
        rungs[-1] = replace(rungs[-1], unknowns=rank)
    else:
        rungs.append(Rung("library effects", rank, end))
    known = behind.unknowns
    for k in range(len(later)):
        behind = _with_terms(model.behind, names[: len(first) + k + 1])
        if k < len(later) - 1:
            rung("learned effects", behind, model.fit.hypotheses)
        else:
            rungs.append(Rung("learned effects", behind.unknowns - known, end))
        known = behind.unknowns
    return rungs


def _with_terms(behind: Background, names: Sequence[str]) -> Background:
    """A background with some of its terms alone, their sizes kept."""
    kept = [term for term in behind.terms if term.name in names]
    if len(kept) == len(behind.terms):
        return behind
    everything = tuple(np.ones(len(term), dtype=bool) for term in kept)
    return background(kept, Prior(everything, behind.scales, 0.0, 0.0))
