"""Test whether a residual is noise, and find its outliers and trends.

The residual is compared with the declared sigma and with the scatter of repeated
measurements.  A trend is a dependence of the residual on one variable, for example on a
load or a temperature.  The coefficients of a trend differ between the six components of
the readings.

Sources:
    Draper, Smith, Applied Regression Analysis, 3rd ed., section 2.1 (lack of fit and
    pure error), section 6.1 (extra sum of squares).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, f

from forcefit.assembly.kinematics.posture import POSE, pose_components
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.validation.campaign.campaign import LOAD, Campaign, number_rows
from forcefit.validation.diagnosis.noise import repeat_scatter
from forcefit.validation.diagnosis.separability import orthonormal_basis

SIGNIFICANT = 1e-4  # p-value below which a residual is not noise
UNLIKELY = 1e-3  # p-value below which a hypothesis is rejected, if many are tested
OUTLIERS = 20  # there is at most one outlier in this number of rows
# Number of bins of a covariate. Rows in the same bin are treated as repeated
# measurements.
_LEVELS = 30
_OUTLYING = 5.5  # smallest rms of an outlier, relative to the median rms of all rows
_MOST = 6  # largest number of reported trends


@dataclass(frozen=True)
class LackOfFit:
    """Result of the test of a residual.

    Attributes:
        rms: [-] square root of the squared whitened residual per degree of freedom.
        probability: p-value of the hypothesis that the residual is noise with the
            declared sigma.
        repeats: [-] rms scatter of repeated measurements, divided by sigma. NaN without
            repeats.
        repeats_freedom: [-] degrees of freedom of ``repeats``.
        against_repeats: p-value of the hypothesis that the residual is noise with the
            scatter of the repeated measurements.
        common: whether noise common to several points was estimated.  The residual is
            then also tested against the scatter of repeats.
    """

    rms: float
    probability: float
    repeats: float
    repeats_freedom: int
    against_repeats: float
    common: bool = False

    @property
    def significant(self) -> bool:
        """Whether the residual exceeds the noise."""
        by_repeats = self.against_repeats < SIGNIFICANT
        if self.sigma_too_small:
            return by_repeats
        return self.probability < SIGNIFICANT or (self.common and by_repeats)

    @property
    def sigma_too_small(self) -> bool:
        """Whether the scatter of repeats exceeds the declared sigma significantly."""
        if not self.repeats_freedom:
            return False
        squares = self.repeats**2 * self.repeats_freedom
        return float(chi2.sf(squares, self.repeats_freedom)) < SIGNIFICANT


def lack_of_fit(campaign: Campaign, residual: NDArray, unknowns: int) -> LackOfFit:
    """Return the result of testing whether a residual is noise.

    Args:
        campaign: campaign of R rows with N readings.
        residual: (N,) whitened residual.
        unknowns: number of fitted unknowns.
    """
    rss = float(residual @ residual)
    freedom = max(1, len(residual) - unknowns)
    rows, columns = np.nonzero(campaign.cells)
    group = np.ravel_multi_index(
        (_alike(campaign)[rows], columns), campaign.cells.shape
    )
    repeats, between = repeat_scatter(residual, group)
    against = 1.0
    if between and freedom > between:
        # Ratio of lack of fit to pure error.  Rounded repeats may have zero scatter.
        excess = (rss - between * repeats**2) / (freedom - between)
        ratio = excess / repeats**2 if repeats else (np.inf if excess > 0 else 0.0)
        against = float(f.sf(ratio, freedom - between, between))
    return LackOfFit(
        float(np.sqrt(rss / freedom)), float(chi2.sf(rss, freedom)),
        repeats if between else float("nan"), between, against,
        campaign.common is not None,
    )  # fmt: skip


def _alike(campaign: Campaign) -> NDArray:
    """Return labels (R,) that are equal for rows with similar conditions."""
    # Time is ignored.  Each other covariate is divided into bins.
    parts = [campaign.repeat]
    for name, values in campaign.covariates.items():
        span = float(np.ptp(values))
        if name != "time" and span > 0:
            parts.append(np.floor(_LEVELS * (values - values.min()) / span))
    return number_rows(*parts)


def outlying(campaign: Campaign, residual: NDArray, most: int | None = None) -> NDArray:
    """Return a mask of the rows whose residuals are outliers.

    Args:
        campaign: campaign of R rows with N readings.
        residual: (N,) whitened residual.
        most: largest number of outliers, by default 5 % of the rows.

    Returns:
        Mask (R,) of the outliers.

    Sources:
        Baarda (1968), A testing procedure for use in geodetic networks.
    """
    rows = np.nonzero(campaign.cells)[0]
    squares = np.bincount(rows, residual**2, minlength=len(campaign))
    cells = np.bincount(rows, minlength=len(campaign))
    rms = np.sqrt(squares / np.maximum(cells, 1))
    # Whitened noise has an rms of 1, so an rms below 5.5 is never an outlier.
    far = rms > _OUTLYING * max(float(np.median(rms)), 1.0)
    most = len(campaign) // OUTLIERS if most is None else most
    if far.sum() > most:
        far &= np.isin(np.arange(len(campaign)), np.argsort(-rms)[:most])
    return far


@dataclass(frozen=True)
class Trend:
    """A variable on which a residual depends.

    Attributes:
        against: description of the variable.
        share: [-] fraction of the squared whitened residual that the variable explains.
        probability: p-value of the trend, corrected for the number of tested trends.
    """

    against: str
    share: float
    probability: float


def trends(
    campaign: Campaign, conditions: Conditions, residual: NDArray
) -> list[Trend]:
    """Return the variables on which a residual depends, strongest first.

    Args:
        campaign: campaign of R rows.
        conditions: conditions of the campaign.
        residual: (R, 6) [rad, m] residual, NaN for components that were not measured.

    Returns:
        At most six significant trends.
    """
    z = residual / campaign.sigma
    tried = list(_candidates(campaign, conditions))
    tested = [_test(name, X, z, len(tried)) for name, X in tried]
    seen = [t for t in tested if t is not None and t.probability < UNLIKELY]
    return sorted(seen, key=lambda t: -t.share)[:_MOST]


def _candidates(
    campaign: Campaign, conditions: Conditions
) -> Iterator[tuple[str, NDArray]]:
    """Yield the name of each tested trend and its regression columns (R, p)."""
    loads = campaign.loads
    force = loads[:, 3:]
    size = np.linalg.norm(force, axis=1)
    yield "load, linearly", loads
    yield "square of the load's size", size[:, None] ** 2
    yield "size of the load", size[:, None]
    for name, w in zip(LOAD, loads.T, strict=True):
        yield f"load.{name}", w[:, None]
    pose = pose_components(conditions.postures.platform)
    yield "pose, linearly", pose
    for name, p in zip(POSE, pose.T, strict=True):
        yield f"pose.{name} and its square", _powers(p)
    for i, frame in enumerate(conditions.robot.frames):
        if not frame.actuated:
            continue
        q = conditions.coordinates[:, i]
        yield f"q.{frame.name} and its square", _powers(q)
        if frame.turns:
            for n in (1, 2):
                wave = np.column_stack([np.sin(n * q), np.cos(n * q)])
                yield f"q.{frame.name}, {'once' if n == 1 else 'twice'} a turn", wave
    for name, values in campaign.covariates.items():
        yield f"cov.{name}", values[:, None]
        yield f"cov.{name} and its square", _powers(values)
        span = float(np.ptp(values))
        if name == "time" and span:
            w = 2 * np.pi * np.outer(values / span, [1, 2])
            yield "cov.time, slow waves", np.hstack([np.sin(w), np.cos(w)])


def _powers(x: NDArray) -> NDArray:
    """Return a centred variable and its square, (R, 2)."""
    centred = x - x.mean()
    return np.column_stack([centred, centred**2])


def _test(name: str, X: NDArray, z: NDArray, tried: int) -> Trend | None:
    """Test the significance of a trend by an F test."""
    before = after = 0.0
    extra = freedom = 0
    for column in z.T:
        known = np.isfinite(column)
        if known.sum() < X.shape[1] + 3:
            continue
        varied = X[known] - X[known].mean(axis=0)
        u = orthonormal_basis(varied, floor=1e-12 * np.abs(X).max(axis=0))
        if not u.shape[1]:
            continue
        y = column[known] - column[known].mean()
        left = y - u @ (u.T @ y)
        before += float(y @ y)
        after += float(left @ left)
        extra += u.shape[1]
        freedom += len(y) - 1 - u.shape[1]
    if not extra or not after:
        return None
    ratio = ((before - after) / extra) / (after / freedom)
    chance = min(1.0, tried * float(f.sf(ratio, extra, freedom)))
    return Trend(name, 1 - after / before, chance)
