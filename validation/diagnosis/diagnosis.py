"""What a diagnosis holds: the verdict and all that it rests on.

Words, figures and files are made of it by the modules above; the function that makes
the text comes along as ``wording``, so that this module needs none of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.model.robot import Robot
from forcefit.inputs.display import Figures, html_table, short_repr
from validation.campaign.campaign import Campaign
from validation.diagnosis.fit import MachineFit
from validation.diagnosis.holdout import HeldOut
from validation.diagnosis.lack_of_fit import LackOfFit, Trend
from validation.diagnosis.next_measurement import NextMeasurement
from validation.diagnosis.noise_in_time import NoiseInTime
from validation.diagnosis.sequence import Errors, Step
from validation.diagnosis.setup_blunders import SetupBlunder
from validation.diagnosis.trace import Traced


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a campaign says about the machine, and what it cannot say.

    Attributes:
        campaign: what was measured, with the sigma stated.
        verdict: ``"explained"``, ``"learned"``, ``"none_needed"``, ``"ambiguous"``,
            ``"outside_library"`` or ``"not_enough_rows"``.
        fit: the machine found, every number fitted together; its robot is saved.
        traced: what the search found.
        claimed: names of the effects that are claimed.
        effects: names of the effects of the machine found, claimed or not.
        probability: of every effect of the library that the design can show.
        alternatives: sets of effects by name, with their probabilities, best first.
        lack: is the residual of the fitted rows noise?
        before: on the held-out rows without outliers, with the declared model.
        after: likewise, with machines fitted without these rows; whatever the verdict.
        saved: errors of the saved robot on all rows without outliers, to which it was
            fitted.
        noise: by sigma, and by what the points of a measurement have in common.
        with_outliers: before and after with the held-out rows called outliers.
        uncertainty: [-] standard error of ``after.normalised``, by scatter of blocks.
        noise_scale: true over stated sigma, and the standard deviation of that.
        noise_in_time: how noise is correlated in time, None if it is not; intervals of
            the effects are the wider for it.
        sequence: models up to the machine found, with errors on the held-out rows.
        held: the rows that judge, and how.
        outliers: (R,) bool, rows left out of everything.
        conditions: the campaign's, as declared and registered.
        open: (R,) bool, rows where clearances leave the pose free, in the declared
            model or with the effects found; see
            :class:`assembly.measurement.predict.Prediction`.
        residual_before: (R, 6) [rad, m] reading minus declared model; NaN not measured.
        residual_after: (R, 6) [rad, m] reading minus what the saved robot reads.
        trends: what the residual varies with, if more than noise is left.
        next: the measurement that would decide, if the verdict is ambiguous.
        needed: rows that would decide, if there are not enough.
        remarks: numbers that no machine has, and readings that no sensor gives.
        setup: what of the campaign is set up wrongly; nothing else was looked for then.
        wording: the function that puts a diagnosis into words.
    """

    campaign: Campaign
    verdict: str
    fit: MachineFit
    traced: Traced
    claimed: tuple[str, ...]
    effects: tuple[str, ...]
    probability: dict[str, float]
    alternatives: tuple[tuple[tuple[str, ...], float], ...]
    lack: LackOfFit
    before: Errors
    after: Errors
    saved: Errors
    noise: Errors
    with_outliers: tuple[Errors, Errors]
    uncertainty: float
    noise_scale: tuple[float, float]
    noise_in_time: NoiseInTime | None
    sequence: tuple[Step, ...]
    held: HeldOut
    outliers: NDArray
    conditions: Conditions
    open: NDArray
    residual_before: NDArray
    residual_after: NDArray
    trends: tuple[Trend, ...]
    next: NextMeasurement | None
    needed: str
    remarks: tuple[str, ...]
    wording: Callable[["Diagnosis"], str]
    setup: tuple[SetupBlunder, ...] = ()

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def robot(self) -> Robot:
        """The machine found, as fitted."""
        return self.fit.robot

    @property
    def fitted(self) -> NDArray:
        """(R,) bool, rows to which the machine that is saved was fitted."""
        return np.asarray(self.traced.used | (self.held.rows & ~self.outliers))

    @property
    def better(self) -> bool:
        """Whether the machine found predicts the held-out rows better than declared."""
        found = bool(len(self.fit.unknowns)) or bool(self.effects)
        return found and self.after.normalised < self.before.normalised

    @property
    def findings(self) -> tuple[str, ...]:
        """What is said of the noise: its scale, repeats, memory."""
        return self.traced.selected.noise.findings

    def summary(self) -> str:
        """Return the text that ``forcefit validation diagnose`` prints."""
        return self.wording(self)

    def _figures(self) -> Figures:
        """Return the verdict, and what it rests on."""
        likely = sorted(self.probability.items(), key=lambda one: -one[1])[:3]
        return {
            "campaign": f"{self.campaign.name}, {len(self.campaign)} rows",
            "verdict": self.verdict,
            "claimed": ", ".join(self.claimed) or "none",
            "likeliest": ", ".join(f"{name} {p:.3f}" for name, p in likely) or "none",
            "held-out rows": f"{self.before.normalised:.3g} sigma before, "
            f"{self.after.normalised:.3g} after "
            f"({self.noise.normalised:.3g} is noise)",
            "outliers": f"{int(self.outliers.sum())} rows",
        }
