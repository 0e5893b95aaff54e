"""The verdict on what a diagnosis found, and the errors on the rows held out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from assembly.measurement.predict import predict
from validation.campaign.campaign import Campaign
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.fit import MachineFit, fit_machine
from validation.diagnosis.holdout import HeldOut, blocks_of
from validation.diagnosis.lack_of_fit import (
    SIGNIFICANT,
    LackOfFit,
    lack_of_fit,
    outlying,
)
from validation.diagnosis.next_measurement import NextMeasurement, next_measurement
from validation.diagnosis.noise_in_time import NoiseInTime, noise_in_time, widened
from validation.diagnosis.plausible import implausible, impossible_rows
from validation.diagnosis.prediction import predicted, residual_of
from validation.diagnosis.sequence import errors_of, pooled, stages
from validation.diagnosis.signatures import whiten
from validation.diagnosis.structure import Trend, trends
from validation.diagnosis.text import text
from validation.diagnosis.trace import FINITE, Traced
from validation.diagnosis.verdict import NOT_ENOUGH, Kept, by_names, verdict
from validation.diagnosis.whitening import independent, size_of_noise, whitening_of

BLUNDERS = 20  # one row in so many may be called a blunder, in all
_LOOSE = 1.25  # rms of held-out rows, in sigma, that is noise whatever its chance
_SHARE = 0.5  # of the readings that may be determined unknowns
_DECISIVE = 8  # blocks of rows; with fewer, held-out rows that fail say "too few"


@dataclass(frozen=True, eq=False)
class Judged:
    """A machine fitted without some rows, and these.

    Attributes:
        fit: the machine.
        used: (R,) bool, rows that were fitted.
        held: (R,) bool, rows that judge it.
    """

    fit: MachineFit
    used: NDArray
    held: NDArray


def judge(
    campaign: Campaign, traced: Traced, fit: MachineFit, held: HeldOut,
    folds: Sequence[Judged],
) -> Diagnosis:  # fmt: skip
    """The errors on the held-out rows, and the verdict.

    Args:
        campaign: of R rows, as it was measured.
        traced: what the search found.
        fit: the machine that is saved.
        held: the rows that judge.
        folds: machines fitted without them.

    Returns:
        The diagnosis.
    """
    used = traced.used
    every = [stages(_believed(campaign, traced), f.fit, f.used, f.held) for f in folds]
    first = 1 if campaign.registration == "unknown" else 0
    before, after = (_joined(campaign, every, place) for place in (first, -1))
    outliers = traced.outliers | _outlying_held(campaign, traced, held, after)
    rows = held.rows & ~outliers
    steps = pooled(campaign, every, rows)
    fit, correlated = _with_noise_in_time(traced.fitting, fit)
    left = residual_of(campaign, fit.robot)
    noisy = _noisy(campaign, traced)
    lack = _lack_of_fit(noisy, traced, fit, left)
    names = _names(fit)
    kept = Kept(names, bool(fit.unknowns.functions), bool(fit.unknowns.small))
    decision, claimed = verdict(traced.selected, kept, lack.significant)
    errors = {
        kind: errors_of(campaign, residual, rows)
        for kind, residual in (("before", before), ("after", after))
    }
    if decision in {"explained", "learned", "ambiguous"}:
        fails = _fails(noisy, folds, after, rows, lack)
        if fails or errors["after"].normalised > errors["before"].normalised:
            decision, claimed = "outside_library", ()
        if _too_few(campaign, traced, fit, fails):
            decision, claimed = NOT_ENOUGH, ()
    remarks = implausible(campaign, fit)
    if remarks and decision in {"explained", "learned"}:
        decision, claimed = "outside_library", ()
    declared = _declared_residual(campaign, traced, FINITE in names)
    if held.how == "split":  # what is saved is fitted to all rows, now that they judged
        fit, correlated = _of_all_rows(campaign, traced, fit, used | rows)
        left = residual_of(campaign, fit.robot)
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
        declared=lack_of_fit(
            noisy.take(used), independent(noisy.take(used), declared[used]), 0
        ),
        before=errors["before"],
        after=errors["before"] if decision == "none_needed" else errors["after"],
        saved=errors_of(campaign, left, ~outliers),
        noise=errors_of(campaign, size_of_noise(noisy), rows),
        with_outliers=(
            errors_of(campaign, before, held.rows),
            errors_of(campaign, after, held.rows),
        ),
        uncertainty=_uncertainty(campaign, after, rows),
        noise_scale=(traced.selected.noise.tau, traced.selected.noise.tau_std),
        noise_in_time=correlated,
        sequence=tuple(steps),
        held=held,
        outliers=outliers,
        conditions=traced.conditions,
        open=_open(campaign, fit),
        residual_before=declared,
        residual_after=left,
        trends=_trends(campaign, traced, left) if decision == "outside_library" else (),
        next=_next(campaign, traced, fit) if decision == "ambiguous" else None,
        needed=_needed(campaign, traced, fit) if decision == NOT_ENOUGH else "",
        remarks=remarks + _impossible(campaign),
        wording=text,
    )  # fmt: skip


def _open(campaign: Campaign, fit: MachineFit) -> NDArray:
    """(R,) bool, rows where clearances leave the pose free, declared or as found."""
    found = predicted(campaign, fit.robot).undetermined
    return np.asarray(predicted(campaign).undetermined | found)


def _trends(campaign: Campaign, traced: Traced, left: NDArray) -> tuple[Trend, ...]:
    """What the residual of the fitted rows varies with."""
    used = traced.used
    conditions = traced.conditions.take(used)
    return tuple(trends(campaign.take(used), conditions, left[used]))


def _believed(campaign: Campaign, traced: Traced) -> Campaign:
    """The campaign with its readings and the sigma that the search believed."""
    return replace(traced.campaign, measured=campaign.measured)


def _noisy(campaign: Campaign, traced: Traced) -> Campaign:
    """The campaign with the noise by which residuals are judged."""
    # sigma as it is stated, unless it counts in what the points have in common
    common = traced.campaign.common
    if common is None:
        return campaign
    scale = min(traced.selected.noise.tau, 1.0)
    return replace(campaign, sigma=scale * campaign.sigma, common=common)


def _declared_residual(campaign: Campaign, traced: Traced, linear: bool) -> NDArray:
    """(R, 6) [rad, m] readings minus the declared model, registered."""
    conditions = traced.conditions
    if linear:
        conditions = replace(conditions, second_order=0.0)
    return np.asarray(campaign.measured - predict(conditions).deviation)


def _names(fit: MachineFit) -> tuple[str, ...]:
    """Effects of the library that a machine has, the measuring frame's place aside."""
    own = [e.hypothesis.effect for e in fit.unknowns.effects if not e.device]
    return tuple(dict.fromkeys(own))


def _joined(campaign: Campaign, folds: list, place: int) -> NDArray:
    """(R, 6) residual of one stage of every fold, each on the rows that it held out."""
    residual = np.full(campaign.measured.shape, np.nan)
    for fold in folds:
        there = fold[place].residual
        residual = np.where(np.isnan(there), residual, there)
    return residual


def _outlying_held(
    campaign: Campaign, traced: Traced, held: HeldOut, residual: NDArray
) -> NDArray:
    """(R,) bool, outliers among the rows that judge."""
    outliers = np.zeros(len(campaign), dtype=bool)
    judged = campaign.take(held.rows)
    whitened = np.nan_to_num(whiten(judged, residual[held.rows]))
    most = len(campaign) // BLUNDERS - int(traced.outliers.sum())
    outliers[held.rows] = outlying(judged, whitened, max(0, most))
    return outliers


def _of_all_rows(
    campaign: Campaign, traced: Traced, fit: MachineFit, rows: NDArray
) -> tuple[MachineFit, NoiseInTime | None]:
    """The same unknowns fitted to some more rows, of the noise found in the others."""
    believed = _believed(campaign, traced)
    more = campaign.cells & ~traced.campaign.cells
    sigma = np.where(more, believed.sigma * traced.selected.noise.tau, believed.sigma)
    believed = replace(believed, sigma=sigma)
    fit = fit_machine(believed, fit.unknowns, rows, fit.x)
    return _with_noise_in_time(believed.take(rows), fit)


def _with_noise_in_time(
    fitting: Campaign, fit: MachineFit
) -> tuple[MachineFit, NoiseInTime | None]:
    """The fit with the covariance that noise correlated in time leaves, if it is."""
    noise = noise_in_time(fitting, fit.residual)
    if noise is None or not len(fit.x):
        return fit, noise
    C = widened(fit.covariance, fit.slopes, fitting, noise)
    return replace(fit, covariance=C), noise


def _lack_of_fit(
    campaign: Campaign, traced: Traced, fit: MachineFit, left: NDArray
) -> LackOfFit:
    """Is the residual of the fitted rows noise, by the stated sigma and repeats?"""
    fitting = campaign.take(traced.used)
    residual = independent(fitting, left[traced.used])
    return lack_of_fit(fitting, residual, round(float(fit.determined.sum())))


def _fails(
    campaign: Campaign, folds: Sequence[Judged], residual: NDArray, rows: NDArray,
    lack: LackOfFit,
) -> bool:  # fmt: skip
    """Whether held-out rows show more than noise and the uncertainty of the fit."""
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


def _too_few(campaign: Campaign, traced: Traced, fit: MachineFit, fails: bool) -> bool:
    """Whether so few rows decide nothing."""
    cells = int(campaign.cells[traced.used].sum())
    blocks = len(np.unique(blocks_of(campaign)[0][traced.used]))
    many = float(fit.determined.sum()) > _SHARE * cells
    return many or (fails and blocks <= _DECISIVE)


def _needed(campaign: Campaign, traced: Traced, fit: MachineFit) -> str:
    """Rows that would decide, in words."""
    components = max(1, int(campaign.cells.any(axis=0).sum()))
    wanted = float(fit.determined.sum()) / _SHARE / components
    blocks = len(np.unique(campaign.configuration))
    count = int(np.ceil(max(wanted, 2.0 * blocks, 2.0 * _DECISIVE)))
    return (
        f"about {count} configurations spread over the range of every drive, some of "
        "them loaded and some repeated; there are "
        f"{blocks}, read in {components} components"
    )


def _uncertainty(campaign: Campaign, residual: NDArray, rows: NDArray) -> float:
    """Standard error of the rms of held-out rows in sigma, by scatter of blocks."""
    z = np.where(campaign.cells, residual / campaign.sigma, np.nan)
    squares = np.nansum(z**2, axis=1)
    blocks = blocks_of(campaign)[0]
    names = np.unique(blocks[rows])
    sums = np.array([squares[rows & (blocks == b)].sum() for b in names])
    count = np.isfinite(z[rows]).sum()
    if len(names) < 2 or not count or not sums.any():
        return float("nan")
    error = sums.std(ddof=1) * np.sqrt(len(sums)) / count
    return float(error / (2 * np.sqrt(sums.sum() / count)))


def _impossible(campaign: Campaign) -> tuple[str, ...]:
    """A remark on rows with readings that no sensor gives, or none."""
    ids = [campaign.ids[i] for i in np.flatnonzero(impossible_rows(campaign))]
    if not ids:
        return ()
    return (f"a temperature that no sensor has, left out: {', '.join(ids[:10])}",)


def _next(
    campaign: Campaign, traced: Traced, fit: MachineFit
) -> NextMeasurement | None:
    """The measurement that would tell the best model from its rivals."""
    rivals = [
        fit_machine(traced.campaign, unknowns, traced.used)
        for unknowns in traced.rivals()
    ]
    return next_measurement(campaign, traced.conditions, fit, rivals)
