"""Monte Carlo statistics of a posture in one call.

The arguments of :func:`statistics` correspond to the options of the command ``forcefit
assembly statistics``.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.effects.robot_effects import (
    errors_of_effects,
    with_effects_applied,
)
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.given_load import Load
from forcefit.assembly.statistics.callout_sources import Sources, sources_of
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment, precision_for
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.plot import histogram_figure
from forcefit.assembly.statistics.summary import summarise, summary_text
from forcefit.assembly.sweeps.point_table import point_table
from forcefit.inputs.errors import BadInput, describe, nearest

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

_WORDS: dict[str, tuple[str | None, ...]] = {
    "clearance": tuple(CLEARANCE_MODELS), "by": ("source", "frame", "kind"),
    "state": (None, "contact", "exact"),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Statistics:
    """Results for random errors at a posture.

    Attributes:
        data: data set with the dimension ``draw``.
        summary: yields, quantiles and most probable values, as in the output of
            ``forcefit assembly statistics --json``; see
            :func:`forcefit.assembly.statistics.summary.summarise`.
    """

    data: "xarray.Dataset"
    summary: dict[str, Any]

    def __repr__(self) -> str:
        return summary_text(self.summary)

    def to_xarray(self) -> "xarray.Dataset":
        """Return the draws as a data set."""
        return self.data

    def to_pandas(self) -> "pandas.DataFrame":
        """Return the draws as a table with one row per draw."""
        return point_table(self.data)

    def plot(self) -> "Figure":
        """Plot histograms of the quantities."""
        return histogram_figure(self.data)


def statistics(
    posture: Posture,
    errors: Sources | Path | str | None = None,
    *,
    draws: int = 10_000,
    seed: int = 1,
    clearance: str = "worst",
    contact_length: float | None = None,
    load: Load | None = None,
    gravity: ArrayLike | None = None,
    limits: Mapping[str, float] | None = None,
    yield_strength: float | None = None,
    capability: bool = False,
    importance: int | None = None,
    by: str = "kind",
    margins: bool = True,
    state: str | None = None,
    confidence: float = 0.95,
    workers: int = 1,
    output: Path | str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Statistics:
    """Estimate the yield and the pose errors of a robot from random errors.

    Args:
        posture: posture of the robot; random errors replace those in the robot file.
        errors: path of a TOML file with error distributions (see docs/statistics.md),
            or error sources, such as those from
            :func:`forcefit.assembly.statistics.callout_sources.sources_of`. They are
            added to the errors from tolerances and fits in the robot file. None to use
            only the robot file.
        draws: number of draws, at least 2.
        seed: seed of the random numbers.
        clearance: model of the positions within the clearances: ``"worst"``,
            ``"uniform"``, ``"contact"`` or ``"least"``, see
            :data:`forcefit.assembly.statistics.clearance_positions.CLEARANCE_MODELS`.
        contact_length: [m] ratio of random moments to random forces in the model
            ``"contact"``; None for the length of the longest body.
        load: load on the platform at its origin in base axes, (6,) [N m, N] or a
            dictionary such as ``{"fz": -50}``.
        gravity: (3,) [m/s^2] gravity in base axes; None for no gravity.
        limits: limits on results in SI units, such as ``{"translation": 2e-4}``.
        yield_strength: [Pa] yield strength of the links, used as a limit on their
            stress.
        capability: whether Cp, Cpk and the parts per million above each limit are
            computed.
        importance: number of base draws for Sobol indices; None to omit the indices.
        by: grouping of errors for the Sobol indices: ``"source"``, ``"frame"`` or
            ``"kind"``.
        margins: whether the assembly margins, problem (21), are computed.
        state: state in which the platform stiffness of each draw is computed,
            ``"contact"`` or ``"exact"``; None to omit the stiffness.
        confidence: confidence level of all intervals.
        workers: number of threads.
        output: NetCDF file to write. An interrupted computation resumes from the draws
            in ``<output>.journal``.
        progress: function called with the number of finished draws and the number of
            all draws.

    Returns:
        The draws and their summary.

    Raises:
        BadInput: an argument is out of range; a file is invalid; there are neither
            tolerances in the robot file nor ``errors``; a limited quantity is not
            computed; the load acts along a motion without stiffness; or the journal
            belongs to other draws.
        ModuleNotFoundError: xarray is missing.

    Example:
        >>> import forcefit as ff
        >>> posture = ff.place_robot(ff.load_robot("examples/drawn/four_bar.toml"))
        >>> found = statistics(posture, draws=100, limits={"translation": 1.5e-4})
        >>> found.summary["assembled"]
        100
    """
    limits = dict(limits or {})
    _check_words(clearance=clearance, by=by, state=state)
    _check_numbers(draws, workers, confidence, yield_strength)
    if capability and not limits:
        raise BadInput("capability: found no limits, expected one or more")
    if contact_length is not None and clearance != "contact":
        raise BadInput(
            f'contact_length: found together with clearance "{clearance}"; '
            'expected clearance "contact"'
        )
    g = None if gravity is None else tuple(np.array(gravity, dtype=float).tolist())
    declared, posture = posture, with_effects_applied(posture)
    sources = sources_of(posture.robot, errors, errors_of_effects(declared, posture))
    experiment = Experiment(
        posture, sources, seed, clearance, margins, load=load,
        gravity=g, stiffness=state or "", precision=precision_for(limits),
        contact_length=contact_length,
    )  # fmt: skip
    experiment.check_limits([*limits, *(["stress"] if yield_strength else [])])
    options = None
    if importance is not None:
        options = ImportanceOptions(importance, by, confidence)
    data = run_draws(experiment, draws, output, workers, progress, options)
    summary = {
        "robot": posture.robot.name, "pose": posture.pose(), "seed": seed,
        "load": experiment.wrench, "gravity": experiment.gravity,
        **summarise(data, limits, yield_strength, confidence, capability),
    }  # fmt: skip
    return Statistics(data, summary)


def _check_words(**words: str | None) -> None:
    """Raise an error if a text argument has no valid value."""
    for name, word in words.items():
        if word not in _WORDS[name]:
            valid = [one for one in _WORDS[name] if one is not None]
            raise BadInput(f"{name}: found {describe(word)}{nearest(str(word), valid)}")


def _check_numbers(
    draws: int, workers: int, confidence: float, yield_strength: float | None
) -> None:
    """Raise an error if a number is out of range."""
    for name, count, least in (("draws", draws, 2), ("workers", workers, 1)):
        if count < least:
            raise BadInput(f"{name}: found {count}, expected at least {least}")
    if not 0 < confidence < 1:
        raise BadInput(
            f"confidence: found {confidence}, expected a number between 0 and 1"
        )
    if yield_strength is not None and not 0 < yield_strength < np.inf:
        raise BadInput(f"yield_strength: found {yield_strength}, expected > 0 Pa")
