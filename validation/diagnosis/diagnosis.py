"""Result of a diagnosis: the verdict and the evidence for it.

Other modules format the result as text, figures and files.  ``wording`` is the function
that makes the text, so that this module does not import them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot
from forcefit.results.display import Figures, html_table, short_repr
from forcefit.results.quantities import flag
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.campaign.tables import row_dataset, screw
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.holdout import HeldOut
from forcefit.validation.diagnosis.lack_of_fit import LackOfFit, Trend
from forcefit.validation.diagnosis.next_measurement import NextMeasurement
from forcefit.validation.diagnosis.noise_in_time import NoiseInTime
from forcefit.validation.diagnosis.sequence import Errors, Step
from forcefit.validation.diagnosis.setup_blunders import SetupBlunder
from forcefit.validation.diagnosis.trace import Traced

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of the diagnosis of a campaign.

    Attributes:
        campaign: the measurements, with the stated sigma.
        verdict: ``"explained"``, ``"learned"``, ``"none_needed"``, ``"ambiguous"``,
            ``"outside_library"`` or ``"not_enough_rows"``.
        fit: the machine found, with all parameters fitted together; its robot is saved.
        traced: result of the search.
        claimed: names of the claimed effects.
        effects: names of all effects of the machine found, claimed or not.
        probability: probability of every effect of the library that the design can
            detect.
        alternatives: sets of effects by name, with their probabilities, most probable
            first.
        lack: result of the test whether the residual of the fitted rows is noise.
        before: errors of the declared model on the held-out rows, without outliers.
        after: errors on the same rows of machines fitted without these rows.
        saved: errors of the saved robot on all rows without outliers; it was fitted to
            these rows.
        noise: errors due to sigma, and due to the noise that points of a measurement
            share.
        with_outliers: errors before and after with the held-out outliers included.
        uncertainty: [-] standard error of ``after.normalised``, from the scatter of
            blocks.
        noise_scale: ratio of true to stated sigma, and the standard deviation of the
            ratio.
        noise_in_time: correlation of the noise in time, which widens the intervals of
            the effects; None if there is none.
        sequence: models from the declared one to the machine found, with their errors.
        held: the held-out rows, and the method of holding out.
        outliers: (R,) bool, rows that no computation uses.
        conditions: declared conditions of the campaign, registered.
        open: (R,) bool, rows in which clearances leave the pose undetermined, in the
            declared model or with the effects found; see
            :class:`forcefit.assembly.measurement.predict.Prediction`.
        residual_before: (R, 6) [rad, m] reading minus declared model; NaN if not
            measured.
        residual_after: (R, 6) [rad, m] reading minus reading of the saved robot.
        trends: variables with which the residual varies, if it is more than noise.
        next: the measurement that would decide an ambiguous verdict.
        needed: description of the rows that would decide, if there are too few.
        remarks: implausible parameters of the machine, and impossible readings.
        setup: errors of the campaign's set-up; if there are any, no effects were
            searched.
        wording: function that returns a diagnosis as text.
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
        """The fitted machine."""
        return self.fit.robot

    @property
    def fitted(self) -> NDArray:
        """(R,) bool, True for rows to which the saved machine was fitted."""
        return np.asarray(self.traced.used | (self.held.rows & ~self.outliers))

    @property
    def better(self) -> bool:
        """Whether the machine found has smaller held-out errors than the declared."""
        found = bool(len(self.fit.unknowns)) or bool(self.effects)
        return found and self.after.normalised < self.before.normalised

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences on the noise: its scale, its repeatability, its memory."""
        return self.traced.selected.noise.findings

    def to_xarray(self) -> "xarray.Dataset":
        """Return a data set over ``row``: residuals, held-out rows, outliers."""
        return row_dataset(
            self.campaign,
            {
                "residual_before": (screw("residual before"), self.residual_before),
                "residual_after": (screw("residual after"), self.residual_after),
                "held_out": (flag("held out"), self.held.rows),
                "outlier": (flag("outlier"), self.outliers),
                "open": (flag("pose undetermined within clearances"), self.open),
            },
        )

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a row for each measurement, columns (variable, component)."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "row")

    def save(self, path: Path | str) -> None:
        """Write the machine found as a robot file, and its covariance.

        Args:
            path: path of the robot file; the covariance is written to the same name
                with the suffix ``.npz``.

        Raises:
            BadInput: a file cannot be written.
        """
        from forcefit.validation.diagnosis.saving import save

        save(self, path)

    def summary(self) -> str:
        """Return the text that ``forcefit validation diagnose`` prints."""
        return self.wording(self)

    def _figures(self) -> Figures:
        """Return lines with the verdict and its main numbers."""
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
