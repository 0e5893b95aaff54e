"""What a diagnosis holds: the verdict and all that it rests on.

Words, figures and files are made of it by the modules above; the function that makes
the text comes along as ``wording``, so that this module needs none of them.
"""

from collections.abc import Callable
from dataclasses import dataclass

from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from forcefit.inputs.display import Figures, html_table, short_repr
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import Background
from validation.diagnosis.holdout import Split
from validation.diagnosis.kept_aside import Errors, FittedModel, Rung
from validation.diagnosis.lack_of_fit import LackOfFit
from validation.diagnosis.next_measurement import NextMeasurement
from validation.diagnosis.noise_in_time import NoiseInTime
from validation.diagnosis.refit import Fit
from validation.diagnosis.scoring import Scored, Screen
from validation.diagnosis.structure import Trend


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
        noise_in_time: how noise is correlated in time, None if it is not; intervals of
            the effects are the wider for it.
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
        wording: the function that puts a diagnosis into words.
    """

    campaign: Campaign
    verdict: str
    model: FittedModel
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
    noise_in_time: NoiseInTime | None
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
    wording: Callable[["Diagnosis"], str]

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def fit(self) -> Fit:
        """The best set of effects, fitted in the full model."""
        return self.model.fit

    @property
    def behind(self) -> Background:
        """The machine's geometric errors and springs."""
        return self.model.behind

    @property
    def foretells(self) -> bool:
        """Whether the model foretells rows kept aside better, with sound numbers.

        So it does where more than noise is left, too, if functions were learned.
        """
        claimed = self.verdict in {"explained", "learned"}
        return claimed or bool(self.model.learned and not self.remarks)

    def summary(self) -> str:
        """The text that ``forcefit validation diagnose`` prints."""
        return self.wording(self)

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
