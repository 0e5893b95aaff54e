"""Estimate noise that is common to the points of one measurement.

A device may measure several points of the platform together. The repeatability error of
the machine is then the same in these readings. This common noise is modelled as a small
random platform motion in each measurement, with one standard deviation for rotations
and one for translations. The two standard deviations maximise the evidence, which is
the probability density of the readings with all other unknowns integrated out.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from forcefit.validation.diagnosis.gaussian import size_penalty
from forcefit.validation.diagnosis.states import IN_USE, Models, State
from forcefit.validation.diagnosis.weighted_readings import NONE

# First step of the logarithm of a standard deviation in the optimisation.
_STEP = 1.0
_CLOSE = 0.05  # tolerance on the logarithms of the standard deviations
# [sigma] Lower bound on the common noise in the readings.
_LEAST = 0.02
# [sigma] Common noise above which models without common noise are not tested.
_CLEAR = 1.0
_EVALUATIONS = 40  # maximum number of evaluations of the evidence
_STABLE = 0.1  # largest difference of the logarithms of two estimates that agree


def common_sizes(state: State) -> tuple[float, float]:
    """Estimate the noise that is common to points measured together.

    Returns:
        [rad, m] standard deviations of rotation and translation, divided by the noise
        scale. A standard deviation is zero if it hardly increases the evidence.
    """
    some = state.readings.sample(NONE)
    loadings = some.columns.loadings(some.cells)
    if loadings is None:
        return NONE
    squares = [float((loadings[:, k : k + 3] ** 2).sum()) for k in (0, 3)]
    units = [math.sqrt(len(loadings) / s) if s > 0 else 0.0 for s in squares]
    visits = len(np.unique(some.columns.visit[some.cells]))
    cost = size_penalty(3.0 * visits) + IN_USE
    best, worth, both = NONE, _evidence(state, NONE), (1.0, 1.0)
    for kinds in ((0, 1), (1,), (0,)):
        if not all(units[k] for k in kinds):
            continue
        if len(kinds) == 1 and both[1 - kinds[0]] > _CLEAR:
            continue
        sizes, value = _largest(state, kinds, units)
        if len(kinds) == 2:
            both = sizes[0] / units[0], sizes[1] / units[1]
        if value - cost * len(kinds) > worth:
            best, worth = sizes, value - cost * len(kinds)
    return best


def _largest(
    state: State, kinds: tuple[int, ...], units: list[float]
) -> tuple[tuple[float, float], float]:
    """Return the standard deviations that maximise the evidence, and its maximum."""

    def sizes(logs: NDArray) -> tuple[float, float]:
        own = dict(zip(kinds, np.exp(logs).tolist(), strict=True))
        return own.get(0, 0.0) * units[0], own.get(1, 0.0) * units[1]

    start = np.zeros(len(kinds))
    simplex = np.vstack([start, start + _STEP * np.eye(len(kinds))])
    found = minimize(
        lambda logs: -_evidence(state, sizes(logs)), start, method="Nelder-Mead",
        bounds=[(math.log(_LEAST), math.log(1e4))] * len(kinds),
        options={
            "initial_simplex": simplex, "xatol": _CLOSE, "fatol": 0.1,
            "maxfev": _EVALUATIONS,
        },
    )  # fmt: skip
    return sizes(found.x), -float(found.fun)


def _evidence(state: State, sizes: tuple[float, float]) -> float:
    """Return the log posterior of a model for given common noise."""
    some = state.readings.sample(sizes)
    return (
        Models(some).state(state.elements, state.mode, state).score - some.log_det / 2
    )


def stable(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Return whether two estimates of the standard deviations are nearly equal."""
    pairs = list(zip(one, other, strict=True))
    if any((a > 0) != (b > 0) for a, b in pairs):
        return False
    return all(a == b or abs(math.log(a / b)) < _STABLE for a, b in pairs)
