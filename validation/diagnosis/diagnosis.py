"""Define the result of a diagnosis."""

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
        campaign: the measurements with the declared standard deviations.
        verdict: ``"explained"``, ``"learned"``, ``"none_needed"``, ``"ambiguous"``,
            ``"outside_library"`` or ``"not_enough_rows"``.
        fit: the identified machine, with all parameters fitted together.
        traced: result of the search for effects.
        claimed: names of the claimed effects.
        effects: names of all effects of the identified machine, claimed or not.
        probability: probability of each detectable library effect.
        alternatives: sets of effect names with their probabilities, most probable
            first.
        lack: lack-of-fit test of the fitted rows.
        before: errors of the declared model on the held-out rows, without outliers.
        after: errors of the fitted machines on the held-out rows.
        saved: errors of the saved robot on all rows to which it was fitted.
        noise: errors expected due to noise alone.
        with_outliers: ``before`` and ``after`` including the held-out outliers.
        uncertainty: [-] standard error of ``after.normalised``.
        noise_scale: ratio of true to declared sigma, and its standard deviation.
        noise_in_time: correlation of the noise in time.  None if there is no
            correlation.
        sequence: sequence of models from the declared to the identified machine, with
            their errors.
        held: the held-out rows and how they were chosen.
        outliers: (R,) bool, True for rows excluded from all computations.
        conditions: declared conditions, including the pose of the measuring device.
        open: (R,) bool, True for rows in which the predicted pose is undetermined
            because of clearances.
        residual_before: (R, 6) [rad, m] reading minus prediction of the declared model,
            NaN if not measured.
        residual_after: (R, 6) [rad, m] reading minus prediction of the saved robot.
        trends: variables on which the residual depends.
        next: the best additional measurement if the verdict is ambiguous.
        needed: description of the additional rows that a verdict requires.
        remarks: sentences about implausible parameters and impossible sensor readings.
        setup: blunders in the set-up of the campaign.
        wording: function that converts a diagnosis to text.
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
        """The robot with all fitted parameters."""
        return self.fit.robot

    @property
    def fitted(self) -> NDArray:
        """Mask (R,), True for rows to which the saved machine was fitted."""
        return np.asarray(self.traced.used | (self.held.rows & ~self.outliers))

    @property
    def better(self) -> bool:
        """Whether held-out errors are smaller than errors of the declared machine."""
        found = bool(len(self.fit.unknowns)) or bool(self.effects)
        return found and self.after.normalised < self.before.normalised

    @property
    def findings(self) -> tuple[str, ...]:
        """Sentences about the noise."""
        return self.traced.selected.noise.findings

    def to_xarray(self) -> "xarray.Dataset":
        """Convert residuals and row masks to a data set with dimension ``row``."""
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
        """Convert to a pandas table with one row per measurement."""
        from forcefit.assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "row")

    def save(self, path: Path | str) -> None:
        """Write the identified machine to a robot file, and its covariance next to it.

        Args:
            path: path of the robot file.  The file of the covariance has the same name
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
        """Return the verdict and the main results for display."""
        likely = sorted(self.probability.items(), key=lambda one: -one[1])[:3]
        return {
            "campaign": f"{self.campaign.name}, {len(self.campaign)} rows",
            "verdict": self.verdict,
            "claimed": ", ".join(self.claimed) or "none",
            "likeliest": ", ".join(f"{name} {p:.3f}" for name, p in likely) or "none",
            "held-out rows": f"{self.before.normalised:.3g} sigma before, "
            f"{self.after.normalised:.3g} sigma after the diagnosis "
            f"(noise: {self.noise.normalised:.3g} sigma)",
            "outliers": f"{int(self.outliers.sum())} rows",
        }
