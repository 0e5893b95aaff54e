"""Determine the verdict of a diagnosis and the errors on held-out rows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.statuses import (
    AMBIGUOUS,
    EXPLAINED,
    LEARNED,
    NONE_NEEDED,
    NOT_ENOUGH_ROWS,
    OUTSIDE_LIBRARY,
)
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.fit import MachineFit, fit_machine
from forcefit.validation.diagnosis.holdout import FEWEST, HeldOut, blocks_of
from forcefit.validation.diagnosis.lack_of_fit import (
    OUTLIERS,
    SIGNIFICANT,
    LackOfFit,
    lack_of_fit,
    outlying,
    trends,
)
from forcefit.validation.diagnosis.next_measurement import next_measurement
from forcefit.validation.diagnosis.noise_in_time import (
    NoiseInTime,
    noise_in_time,
    widened,
)
from forcefit.validation.diagnosis.plausible import implausible, impossible_rows
from forcefit.validation.diagnosis.prediction import predicted, residual_of
from forcefit.validation.diagnosis.sequence import errors_of, joined, pooled, stages
from forcefit.validation.diagnosis.signatures import whiten
from forcefit.validation.diagnosis.text import text
from forcefit.validation.diagnosis.trace import FINITE, Traced
from forcefit.validation.diagnosis.verdict import by_names, verdict
from forcefit.validation.diagnosis.whitening import (
    independent,
    size_of_noise,
    whitening_of,
)

# [sigma] Largest rms of the held-out residuals that is treated as noise.
_LOOSE = 1.25
# Largest accepted number of unknowns per reading. Only unknowns that the readings
# determine are counted.
_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Judged:
    """Fitted machine with masks of the fitted rows and of the held-out rows.

    Attributes:
        fit: the fitted machine.
        used: (R,) mask of the fitted rows.
        held: (R,) mask of the held-out rows.
    """

    fit: MachineFit
    used: NDArray
    held: NDArray


def judge(
    campaign: Campaign, traced: Traced, fit: MachineFit, held: HeldOut,
    folds: Sequence[Judged],
) -> Diagnosis:  # fmt: skip
    """Return the diagnosis with its verdict and the errors on held-out rows.

    Args:
        campaign: campaign of R rows, as measured.
        traced: result of the search.
        fit: the fitted machine.
        held: the held-out rows.
        folds: machines fitted without the held-out rows.
    """
    used, noise = traced.used, traced.selected.noise
    believed = replace(traced.campaign, measured=campaign.measured)
    every = [stages(believed, f.fit, f.used, f.held) for f in folds]
    first = 1 if campaign.registration == "unknown" else 0
    before, after = (
        joined([[*fold.values()][place][1] for fold in every]) for place in (first, -1)
    )
    outliers = traced.outliers | _outlying_held(campaign, traced, held, after)
    rows = held.rows & ~outliers
    steps = pooled(campaign, every, rows)
    errors = steps[first].error, steps[-1].error
    fit, correlated = _with_noise_in_time(traced.fitting, fit)
    left = residual_of(campaign, fit.robot)
    noisy = _noisy(campaign, traced)
    fitting, determined = noisy.take(used), float(fit.determined.sum())
    lack = lack_of_fit(fitting, independent(fitting, left[used]), round(determined))
    names = tuple(dict.fromkeys(one.hypothesis.effect for one in fit.effects))
    decision, claimed = verdict(
        traced.selected, names, functions=bool(fit.unknowns.functions),
        small=bool(fit.unknowns.small), more_than_noise=lack.significant,
    )  # fmt: skip
    if decision in {EXPLAINED, LEARNED, AMBIGUOUS}:
        fails = _fails(noisy, folds, after, rows, lack)
        if fails or errors[1].normalised > errors[0].normalised:
            decision, claimed = OUTSIDE_LIBRARY, ()
        if _too_few(campaign, used, determined, fails):
            decision, claimed = NOT_ENOUGH_ROWS, ()
    remarks = implausible(campaign, fit)
    if remarks and decision in {EXPLAINED, LEARNED}:
        decision, claimed = OUTSIDE_LIBRARY, ()
    conditions = traced.conditions
    if FINITE in names:
        conditions = replace(conditions, second_order=0.0)
    declared = np.asarray(campaign.measured - predict(conditions).deviation)
    if held.how == "split":  # after the test, all rows are fitted
        fit, correlated = _of_all_rows(believed, traced, fit, used | rows)
        left = residual_of(campaign, fit.robot)
    varies, following = [], None
    if decision == OUTSIDE_LIBRARY:
        varies = trends(campaign.take(used), traced.conditions.take(used), left[used])
    if decision == AMBIGUOUS:
        rivals = [fit_machine(traced.campaign, u, used) for u in traced.rivals()]
        following = next_measurement(campaign, traced.conditions, fit, rivals)
    free = [predicted(campaign, robot).undetermined for robot in (None, fit.robot)]
    return Diagnosis(
        campaign=campaign,
        verdict=decision,
        fit=fit,
        traced=traced,
        claimed=claimed,
        effects=names,
        probability=traced.selected.probability,
        alternatives=by_names(traced.selected),
        lack=lack,
        before=errors[0],
        after=errors[0] if decision == NONE_NEEDED else errors[1],
        saved=errors_of(campaign, left, ~outliers),
        noise=errors_of(campaign, size_of_noise(noisy), rows),
        with_outliers=(
            errors_of(campaign, before, held.rows),
            errors_of(campaign, after, held.rows),
        ),
        uncertainty=_uncertainty(campaign, after, rows),
        noise_scale=(noise.tau, noise.tau_std),
        noise_in_time=correlated,
        sequence=tuple(steps),
        held=held,
        outliers=outliers,
        conditions=traced.conditions,
        open=np.any(free, axis=0),
        residual_before=declared,
        residual_after=left,
        trends=tuple(varies),
        next=following,
        needed=_needed(campaign, fit) if decision == NOT_ENOUGH_ROWS else "",
        remarks=remarks + _impossible(campaign),
        wording=text,
    )


def _noisy(campaign: Campaign, traced: Traced) -> Campaign:
    """Return the campaign with the standard deviations used to test residuals."""
    # Without common noise, the declared sigma is used.
    common = traced.campaign.common
    if common is None:
        return campaign
    scale = min(traced.selected.noise.tau, 1.0)
    return replace(campaign, sigma=scale * campaign.sigma, common=common)


def _outlying_held(
    campaign: Campaign, traced: Traced, held: HeldOut, residual: NDArray
) -> NDArray:
    """Return a mask (R,) of the outliers among the held-out rows."""
    outliers = np.zeros(len(campaign), dtype=bool)
    judged = campaign.take(held.rows)
    whitened = np.nan_to_num(whiten(judged, residual[held.rows]))
    most = len(campaign) // OUTLIERS - int(traced.outliers.sum())
    outliers[held.rows] = outlying(judged, whitened, max(0, most))
    return outliers


def _of_all_rows(
    believed: Campaign, traced: Traced, fit: MachineFit, rows: NDArray
) -> tuple[MachineFit, NoiseInTime | None]:
    """Refit the parameters of a machine to all rows."""
    more = believed.cells & ~traced.campaign.cells
    sigma = np.where(more, traced.selected.noise.tau, 1.0) * believed.sigma
    believed = replace(believed, sigma=sigma)
    fit = fit_machine(believed, fit.unknowns, rows, fit.x)
    return _with_noise_in_time(believed.take(rows), fit)


def _with_noise_in_time(
    fitting: Campaign, fit: MachineFit
) -> tuple[MachineFit, NoiseInTime | None]:
    """Enlarge the covariance of a fit if the noise is correlated in time."""
    noise = noise_in_time(fitting, fit.residual)
    if noise is None or not len(fit.x):
        return fit, noise
    C = widened(fit.covariance, fit.slopes, fitting, noise)
    return replace(fit, covariance=C), noise


def _fails(
    campaign: Campaign, folds: Sequence[Judged], residual: NDArray, rows: NDArray,
    lack: LackOfFit,
) -> bool:  # fmt: skip
    """Return whether held-out residuals exceed the noise and errors of the fit."""
    squares, count = 0.0, 0
    for one in folds:
        own = campaign.cells & (one.held & rows)[:, None] & np.isfinite(residual)
        variance, whiten = np.ones(int(own.sum())), whitening_of(campaign, own)
        if len(one.fit.x):
            J = one.fit.unknowns.slopes(campaign, one.fit.x)[own]
            J = whiten(J / campaign.sigma[own][:, None])
            variance += np.einsum("nk,kl,nl->n", J, one.fit.covariance, J)
        z = whiten(residual[own] / campaign.sigma[own])
        squares += float(np.sum(z**2 / variance))
        count += len(z)
    if not count:
        return True
    scatter = lack.repeats if lack.sigma_too_small else 1.0
    squares /= scatter**2
    loose = squares / count > _LOOSE**2
    return bool(loose and chi2.sf(squares, count) < SIGNIFICANT)


def _too_few(campaign: Campaign, used: NDArray, determined: float, fails: bool) -> bool:
    """Return whether there are too few rows for a verdict."""
    blocks = len(np.unique(blocks_of(campaign)[0][used]))
    many = determined > _SHARE * int(campaign.cells[used].sum())
    return many or (fails and blocks <= FEWEST)


def _needed(campaign: Campaign, fit: MachineFit) -> str:
    """Describe the additional rows that a verdict requires."""
    components = max(1, int(campaign.cells.any(axis=0).sum()))
    wanted = float(fit.determined.sum()) / _SHARE / components
    blocks = len(np.unique(campaign.configuration))
    count = int(np.ceil(max(wanted, 2.0 * blocks, 2.0 * FEWEST)))
    return (
        f"about {count} configurations spread over the range of every drive, some of "
        "them loaded and some repeated; the campaign contains "
        f"{blocks} configurations with {components} measured components"
    )


def _uncertainty(campaign: Campaign, residual: NDArray, rows: NDArray) -> float:
    """Return the standard error of the held-out rms [sigma]."""
    z = np.where(campaign.cells, residual / campaign.sigma, np.nan)[rows]
    _, block = np.unique(blocks_of(campaign)[0][rows], return_inverse=True)
    sums = np.bincount(block, np.nansum(z**2, axis=1))
    count = np.isfinite(z).sum()
    if len(sums) < 2 or not count or not sums.any():
        return float("nan")
    error = sums.std(ddof=1) * np.sqrt(len(sums)) / count
    return float(error / (2 * np.sqrt(sums.sum() / count)))


def _impossible(campaign: Campaign) -> tuple[str, ...]:
    """Return a remark on impossible readings, or an empty tuple."""
    ids = [campaign.ids[i] for i in np.flatnonzero(impossible_rows(campaign))]
    if not ids:
        return ()
    return (
        f"rows excluded because of an impossible temperature: {', '.join(ids[:10])}",
    )
