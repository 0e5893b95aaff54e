r"""Estimate noise that is correlated in time, and the resulting uncertainties.

Within a session, the noise of each component of a reading is partly white and partly an
Ornstein-Uhlenbeck process.  The correlation of the noise at times t_i and t_j is

    R_ij = (1 - a) delta_ij + a exp(-|t_i - t_j| / tau).

======  ==============  =========  ===================================================
symbol  code            shape      meaning
======  ==============  =========  ===================================================
a       ``share``                  fraction of the variance that is correlated
tau     ``constant``               [s] correlation time
G       ``slopes``      (N, k)     change of the whitened readings per unknown
H       ``covariance``  (k, k)     (G'G)^-1, covariance of the unknowns for white noise
======  ==============  =========  ===================================================

Fits assume white noise.  If the correlation matrix of the noise is R, the covariance of
the fitted unknowns is H G'R G H. The likelihood is computed by a Kalman filter for a
grid of values of a and tau.

Sources:
    Uhlenbeck, Ornstein (1930), On the theory of the Brownian motion, Phys. Rev. 36.
    Harvey (1989), Forecasting, Structural Time Series Models and the Kalman Filter.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.lack_of_fit import SIGNIFICANT

_SHARES = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95])
# Number of tested correlation times.
_CONSTANTS = 12
_FEWEST = 30  # smallest number of rows for an estimate


@dataclass(frozen=True)
class NoiseInTime:
    """Noise that is partly an Ornstein-Uhlenbeck process.

    Attributes:
        share: [-] fraction of the variance that is correlated.
        constant: [s] correlation time.
        probability: probability that white noise has an estimated correlation at least
            this large.
    """

    share: float
    constant: float
    probability: float


def noise_in_time(campaign: Campaign, residual: NDArray) -> NoiseInTime | None:
    """Estimate the correlation of a residual in time.

    Args:
        campaign: campaign of R rows with N readings.
        residual: (N,) whitened residual.

    Returns:
        The maximum-likelihood estimate.  None if there are too few rows, if no time was
        recorded, or if the correlation is not significant.
    """
    if "time" not in campaign.covariates or len(campaign) < _FEWEST:
        return None
    series = [(times, residual[cells]) for times, cells in _series(campaign)]
    steps = np.concatenate([np.diff(times) for times, _ in series])
    longest = max(np.ptp(times) for times, _ in series)
    if not steps.any():
        return None
    constants = np.geomspace(float(np.median(steps[steps > 0])), longest, _CONSTANTS)
    squares, logs = np.zeros((2, len(_SHARES), len(constants)))
    for times, z in series:
        more = _innovations(times, z, constants)
        squares, logs = squares + more[0], logs + more[1]
    # The variance of the noise is estimated together with its correlation.
    count = len(residual)
    gain = count * np.log(residual @ residual / squares) - logs
    best = np.unravel_index(np.argmax(gain), gain.shape)
    chance = float(chi2.sf(gain[best], 2))
    if chance > SIGNIFICANT:
        return None
    return NoiseInTime(float(_SHARES[best[0]]), float(constants[best[1]]), chance)


def widened(
    covariance: NDArray, slopes: NDArray, campaign: Campaign, noise: NoiseInTime
) -> NDArray:
    """Return the covariance (k, k) of fitted unknowns under correlated noise.

    Args:
        covariance: (k, k) covariance H for white noise.
        slopes: (N, k) derivatives G of the whitened readings.
        campaign: campaign of R rows with N readings.
        noise: the correlated noise.
    """
    along = np.zeros_like(slopes)  # product (R - 1) G
    for times, cells in _series(campaign):
        fading = np.exp(-np.diff(times) / noise.constant)
        for own, fades in ((cells, fading), (cells[::-1], fading[::-1])):
            before = np.zeros(slopes.shape[1])
            for last, now, fade in zip(own[:-1], own[1:], fades, strict=True):
                before = fade * (before + slopes[last])
                along[now] += noise.share * before
    return covariance + covariance @ (slopes.T @ along) @ covariance


def _series(campaign: Campaign) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield the times and indices of the readings, by component, point and session."""
    rows, columns = np.nonzero(campaign.cells)
    time = campaign.covariates["time"][rows]
    own = [
        label[rows] for label in (campaign.session, campaign.point) if label is not None
    ]
    numbers = [np.unique(names, return_inverse=True)[1] for names in (*own, columns)]
    group = np.column_stack(numbers)
    for one in np.unique(group, axis=0):
        cells = np.flatnonzero((group == one).all(axis=1))
        cells = cells[np.argsort(time[cells], kind="stable")]
        yield time[cells], cells


def _innovations(
    times: NDArray, z: NDArray, constants: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the sums of v^2 / S and of ln S over a time series.

    Here v is the innovation of the Kalman filter, and S is its variance. The sums are
    arrays (shares, constants), one value for each pair of noise parameters.
    """
    share = _SHARES[:, None]
    fading = np.exp(-np.diff(times)[:, None] / constants)
    mean = np.zeros((len(_SHARES), len(constants)))
    variance = np.broadcast_to(share, mean.shape).copy()
    squares, logs = np.zeros_like(mean), np.zeros_like(mean)
    for i, value in enumerate(z):
        if i:
            mean = fading[i - 1] * mean
            variance = fading[i - 1] ** 2 * (variance - share) + share
        S = variance + 1 - share
        wrong = value - mean
        squares += wrong**2 / S
        logs += np.log(S)
        gain = variance / S
        mean = mean + gain * wrong
        variance = variance * (1 - gain)
    return squares, logs
