"""Estimate the noise relative to the declared sigma, and detect blunders.

The whitened noise of a good reading is distributed as N(0, tau^2). One reading in 5000
is expected to be a blunder, with a standard deviation of 30 tau.

Sources:
    Box, Tiao (1968), A Bayesian approach to some outlier problems, Biometrika 55, 119.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from forcefit.results.text import readings_text

_BLUNDERS = 2e-4  # prior probability of a blunder
_WIDTH = 30.0  # standard deviation of a blunder, relative to tau
_LEFT_OUT = 1e-12  # weight of a blunder, relative to the weight of a good reading
# Smallest residual of a blunder before a model is fitted, relative to tau.
_CLEAR = 10.0
# Largest accepted fraction of blunders among the readings.
_MANY = 0.05
_UNLIKE = 4.0  # smallest reported abs(tau - 1), in standard deviations
_CLOSE = 0.2  # smallest abs(ln tau) that is reported
_CHANCE = 1e-4  # p-value below which the readings are reported as not repeatable
_MEDIAN = 0.4549  # median of chi-square with one degree of freedom


@dataclass(frozen=True)
class Noise:
    """Estimated noise of a campaign.

    Attributes:
        tau: ratio of true to declared sigma.
        tau_std: standard deviation of tau.
        findings: sentences about the noise for the user.
        common: [rad, m] standard deviations of the rotation and translation that are
            common to all points of a measurement.
    """

    tau: float
    tau_std: float
    findings: tuple[str, ...] = ()
    common: tuple[float, float] = (0.0, 0.0)


def probability_good(squares: NDArray, *, clearly: bool = False) -> NDArray:
    """Return the probabilities (n,) that readings are not blunders.

    Args:
        squares: (n,) expected squares of the whitened residuals.
        clearly: whether only residuals above 10 tau are treated as blunders.

    Returns:
        The probabilities.  Values above 0.5 are set to 1. If there are too many
        blunders, all values are set to 1.
    """
    v = max(float(np.median(squares)) / _MEDIAN, 1e-12)
    with np.errstate(over="ignore", under="ignore"):
        good = (1 - _BLUNDERS) * np.exp(-squares / (2 * v))
        bad = _BLUNDERS / _WIDTH * np.exp(-squares / (2 * v * _WIDTH**2))
        share = np.where(bad + good > 0, good / np.maximum(bad + good, 1e-300), 0.0)
    share = np.where((share > 0.5) | (clearly & (squares < _CLEAR**2 * v)), 1.0, share)
    if np.mean(share < 0.5) > _MANY:
        return np.ones(len(squares))
    return share


def cell_weights(good: NDArray) -> NDArray:
    """Return weights (n,), 1 for good readings and about 0 for blunders."""
    return np.maximum(good, _LEFT_OUT)


def repeat_scatter(z: NDArray, group: NDArray) -> tuple[float, int]:
    """Return the rms scatter of repeated readings about their means.

    The second returned value is the number of degrees of freedom.
    """
    _, number, count = np.unique(group, return_inverse=True, return_counts=True)
    mean = np.bincount(number, weights=z) / count
    freedom = len(z) - len(count)
    squares = float(((z - mean[number]) ** 2).sum())
    return float(np.sqrt(squares / max(freedom, 1))), freedom


def findings(
    tau: float, tau_std: float, repeats: tuple[float, int], *, memory: bool,
    common: tuple[float, float] = (0.0, 0.0),
) -> tuple[str, ...]:  # fmt: skip
    """Return sentences about noise that differs from the declared sigma.

    Args:
        tau: ratio of true to declared sigma.
        tau_std: standard deviation of tau.
        repeats: result of :func:`repeat_scatter` for the residual.
        memory: whether the model predicts a row from earlier rows, for example because
            of hysteresis.
        common: [rad, m] noise that is common to the points of a measurement.
    """
    told = []
    if any(common):
        named = {"position": common[1] or None, "rotation": common[0] or None}
        sizes = readings_text(named, digits=3)
        told.append(f"noise common to the points of a row: {sizes}")
        if not repeats[1]:
            unsure = "an unrecorded cause has the same effect"
            told[0] += f"; without repeats {unsure}"
    if abs(np.log(tau)) > max(_UNLIKE * tau_std / tau, _CLOSE):
        told.append(f"the residual is {tau:.2g} times the stated sigma")
    rms, freedom = repeats
    if freedom and float(chi2.sf(rms**2 * freedom, freedom)) < _CHANCE:
        told.append(
            "not repeatable: the scatter of rows with equal configuration and load is "
            f"{rms:.2g} times the stated sigma; possible causes are memory, time or an "
            "unrecorded variable"
        )
    if memory:
        told.append("memory: the readings depend on the order of the rows")
    return tuple(told)
