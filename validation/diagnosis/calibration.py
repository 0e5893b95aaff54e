"""Estimate the error rates of a diagnosis by simulating campaigns."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from forcefit.assembly.model.statuses import EXPLAINED
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.lack_of_fit import SIGNIFICANT
from forcefit.validation.diagnosis.select import select
from forcefit.validation.diagnosis.selected import Selected
from forcefit.validation.diagnosis.verdict import verdict


@dataclass(frozen=True)
class Calibration:
    """Success and error rates of a diagnosis, estimated by simulation.

    Attributes:
        campaigns: number of simulated campaigns with effects, which equals the number
            of campaigns without effects.
        without: mapping from each verdict to its number of occurrences in the campaigns
            without effects.
        with_found: mapping from each verdict to its number of occurrences in the
            campaigns that contain the identified effects.
        right: fraction of the campaigns with effects in which the diagnosis identified
            exactly these effects.
        false_claims: fraction of all verdicts that claim absent effects.
    """

    campaigns: int
    without: dict[str, int]
    with_found: dict[str, int]
    right: float
    false_claims: float


def calibrate(
    diagnosis: Diagnosis, count: int, update: Callable[[int, int], None]
) -> Calibration:
    """Simulate and diagnose campaigns with the design of a measured campaign.

    The simulated readings are linear in the effects of the identified machine. To save
    time, the simulated diagnoses omit the final fit.

    Args:
        diagnosis: diagnosis whose design and identified machine are simulated.
        count: number of campaigns with effects, and number of campaigns without
            effects.
        update: function called with the number of finished campaigns.

    Returns:
        The success and error rates.
    """
    traced = diagnosis.traced
    cells = traced.used[traced.columns.row]
    best = traced.selected.states[0]
    fit = best.readings
    truth = tuple(sorted(e.name for e in best.elements if e.name))
    rng = np.random.default_rng(0)
    tally: dict[bool, Counter[str]] = {False: Counter(), True: Counter()}
    right = wrong = 0
    for k in range(2 * count):
        present = k % 2 == 1
        z = fit.root * rng.standard_normal(len(fit.root))
        z = fit.whiten.inverse(z + (best.fitted if present else 0.0))
        decision, claimed = _decided(select(traced.columns, z, cells), len(z))
        tally[present][decision] += 1
        right += present and decision == EXPLAINED and claimed == truth
        wrong += decision == EXPLAINED and claimed != (truth if present else ())
        update(k + 1, 2 * count)
    return Calibration(
        count, dict(tally[False]), dict(tally[True]),
        right / count if truth else float("nan"), wrong / (2 * count),
    )  # fmt: skip


def _decided(selected: Selected, count: int) -> tuple[str, tuple[str, ...]]:
    """Diagnose a simulated campaign and return the verdict."""
    best = selected.states[0]
    names = tuple(sorted(e.name for e in best.elements if e.name))
    freedom = max(1.0, count - selected.unknowns)
    more = float(chi2.sf(best.sizes.squares, freedom)) < SIGNIFICANT
    decision, claimed = verdict(
        selected, names, functions=bool(selected.functions),
        small=bool(selected.small), more_than_noise=more,
    )  # fmt: skip
    return decision, tuple(sorted(claimed))
