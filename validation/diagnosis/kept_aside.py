"""What every step of a diagnosis bought, on the rows that were kept aside.

Steps in the order in which a machine is understood: as declared, where the device
stands, its geometry, its springs, effects of the library.  Each is fitted together with
all before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.effects import apply_effects
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict
from validation.campaign.campaign import Campaign
from validation.diagnosis.evidence import Background, Evidence, background
from validation.diagnosis.refit import Fit, refit
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
        term: ``"declared"``, ``"registration"``, ``"geometry"``, ``"springs"`` or
            ``"library effects"``.
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
class Model:
    """Effects and small unknowns together.

    Attributes:
        here: conditions of all R rows, as declared and registered.
        answers: of the readings there.
        fit: of effects, on the rows fitted.
        behind: small terms beside them.
    """

    here: Conditions
    answers: Responses
    fit: Fit
    behind: Background

    def residual(self, campaign: Campaign) -> NDArray:
        """(R, 6) [rad, m] readings minus the model; NaN where not measured."""
        there = apply_effects(self.here, self.fit.effects)
        small = added(
            campaign, self.answers, self.here, self.behind.terms,
            self.behind.values(self.fit.residual),
        )  # fmt: skip
        return campaign.measured - predict(there).deviation - small


def ladder(
    campaign: Campaign, declared: Conditions, model: Model, terms: Sequence[SmallTerm],
    used: NDArray, held: NDArray, rank: int,
) -> list[Rung]:  # fmt: skip
    """The steps up to a model.

    Args:
        campaign: of R rows.
        declared: conditions of all rows, before any registration.
        model: where the steps lead.
        terms: small terms of the rows fitted, with all their unknowns.
        used: mask (R,) of the rows fitted.
        held: mask (R,) of the rows scored.
        rank: unknowns of the library's effects that the readings can tell apart.

    Returns:
        One rung a step; a step that nothing asked for repeats the one before.
    """
    fitting, some = campaign.take(used), model.here.take(used)
    unknown = campaign.registration == "unknown"
    nuisance = [device_frame(some)] if unknown else []
    begin = np.concatenate([np.zeros(0), *(h.start for h in nuisance)])
    before = campaign.measured - predict(declared).deviation
    rungs = [Rung("declared", 0, errors_of(campaign, before, held))]
    if unknown:
        before = campaign.measured - predict(model.here).deviation
        rungs.append(Rung("registration", 6, errors_of(campaign, before, held)))
    asked = {term.name for term in model.behind.terms}
    known = 0.0
    for k, name in enumerate((GEOMETRY, SPRINGS)):
        error = rungs[-1].error
        if name in asked:
            chosen = [t for t in terms if t.name in (GEOMETRY, SPRINGS)[: k + 1]]
            chosen = [t for t in chosen if t.name in asked]
            z = whiten(fitting, fitting.measured - predict(some).deviation)
            behind = background(chosen, Evidence(chosen, len(z)).best(z))
            fit = refit(fitting, some, nuisance, begin, behind=behind)
            step = Model(model.here, model.answers, fit, behind)
            error = errors_of(campaign, step.residual(campaign), held)
            rungs.append(Rung(name, behind.unknowns - known, error))
            known = behind.unknowns
        else:
            rungs.append(Rung(name, 0, error))
    if not rank:
        return [*rungs, Rung("library effects", 0, rungs[-1].error)]
    error = errors_of(campaign, model.residual(campaign), held)
    return [*rungs, Rung("library effects", rank, error)]
