"""Noise: its scale beside the stated sigma, and blunders.

A reading is good, with N(0, tau^2), or with a probability of one in five thousand a
blunder, thirty times as wide.  tau^2 follows a scaled inverse chi-square about 1.

Sources:
    Box, Tiao (1968), A Bayesian approach to some outlier problems, Biometrika 55, 119.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

FREEDOM = 20.0  # of the prior of tau: a stated sigma is worth as many readings
_BLUNDERS = 2e-4  # of the readings, before they are looked at
_WIDTH = 30.0  # times tau
_CLEAR = 10.0  # times tau: what no effect does to a few readings alone
_MANY = 0.03  # more far off than this share are no blunders but an effect
_UNLIKE = 4.0  # standard deviations from the stated sigma
_CLOSE = 0.2  # of ln tau: a sigma is hardly known better
_CHANCE = 1e-4  # of repeats that scatter as much by chance
_MEDIAN = 0.4549  # of the chi-square of one degree of freedom


@dataclass(frozen=True)
class Noise:
    """What is left, beside what was stated.

    Attributes:
        tau: true over stated sigma.
        tau_std: its standard deviation.
        findings: what else is to be said of it, in words.
    """

    tau: float
    tau_std: float
    findings: tuple[str, ...] = ()


def good_readings(squares: NDArray, *, clearly: bool = False) -> NDArray:
    """Probability of every reading that it is no blunder.

    Args:
        squares: (n,) expected squared residuals, with what the fit does not know.

        clearly: whether blunders must be far off, as where effects may be left.

    Returns:
        (n,) 1 of those that are likelier good; ones where so many are far off that it
        is no matter of blunders.
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


def weights_of(good: NDArray) -> NDArray:
    """(n,) precision of readings, of one that is good."""
    return good + (1 - good) / _WIDTH**2


def scatter_of_repeats(z: NDArray, group: NDArray) -> tuple[float, int]:
    """How much readings of the same thing differ, whatever the model.

    Args:
        z: (n,) whitened readings.
        group: (n,) number of what each is a reading of.

    Returns:
        [sigma] root mean square within groups, and its degrees of freedom.
    """
    _, number, count = np.unique(group, return_inverse=True, return_counts=True)
    mean = np.bincount(number, weights=z) / count
    freedom = len(z) - len(count)
    squares = float(((z - mean[number]) ** 2).sum())
    return float(np.sqrt(squares / max(freedom, 1))), freedom


def findings(
    tau: float, tau_std: float, repeats: tuple[float, int], *, memory: bool
) -> tuple[str, ...]:
    """What noise has to say for itself.

    Args:
        tau: true over stated sigma, by what a model leaves.
        tau_std: its standard deviation.
        repeats: :func:`scatter_of_repeats`, of what is left.
        memory: whether the model depends on the rows before.

    Returns:
        Sentences; none where all is as stated.
    """
    told = []
    if abs(np.log(tau)) > max(_UNLIKE * tau_std / tau, _CLOSE):
        told.append(f"what is left is {tau:.2g} times the stated sigma")
    rms, freedom = repeats
    if freedom and float(chi2.sf(rms**2 * freedom, freedom)) < _CHANCE:
        told.append(
            f"not repeatable: rows of one configuration and load differ by {rms:.2g} "
            "times the stated sigma, by memory, time or something not recorded"
        )
    if memory:
        told.append("memory: what is read depends on the rows before")
    return tuple(told)


def scale(squares: float, count: int) -> tuple[float, float]:
    """Posterior mean of tau, and its standard deviation."""
    freedom = FREEDOM + count
    tau = np.sqrt((FREEDOM + squares) / max(freedom - 2.0, 1.0))
    return float(tau), float(tau / np.sqrt(2 * freedom))
