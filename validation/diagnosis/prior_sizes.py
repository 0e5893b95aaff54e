"""Prior standard deviations of groups of unknowns by maximum evidence.

With posterior mean mu and covariance V of the unknowns of a group and s their size,

    d ln p(z) / d ln s = sum of [(mu^2 + V)/s^2 - 1],

zero where s^2 = sum mu^2 / sum (1 - V/s^2): MacKay's step, marginal with a limit.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from validation.diagnosis.gaussian import deviance, size_penalty

_STEPS = 25
_SETTLED = 0.03  # change of ln s that ends the iteration
_LEAP = 4.0  # largest factor of change in a step
_BEGIN = 4.0  # [sigma] contribution of a group's unknowns at the start
_LEAST, _MOST = 1e-2, 1e6  # [sigma] limits of that contribution


@dataclass(frozen=True, eq=False)
class Sizes:
    """Optimised prior standard deviations and the posterior.

    Attributes:
        std: (k,) of every unknown, in units of the noise's scale tau.
        of_group: standard deviations by group.
        mean: (k,) posterior.
        covariance: (k, k) likewise, over tau^2.
        squares: z' C^-1 z.
        log_det: ln det C.
        cost: penalty of the optimisation, see :func:`.gaussian.size_penalty`.
    """

    std: NDArray
    of_group: dict[int, float]
    mean: NDArray
    covariance: NDArray
    squares: float
    log_det: float
    cost: float

    @property
    def determined(self) -> NDArray:
        """(k,) 1 for an unknown that the readings determine, 0 for the prior."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - np.diag(self.covariance) / self.std**2
        return np.where(self.std > 0, share, 0.0)


def best_sizes(
    gram: NDArray, along: NDArray, squares: float, count: int, freedom: float,
    group: NDArray, given: NDArray, most: NDArray, start: dict[int, float],
) -> Sizes:  # fmt: skip
    """Optimise the prior standard deviations of all groups.

    Args:
        gram: (k, k) inner products of columns.
        along: (k,) inner products with the readings.
        squares: sum of squares of the readings.
        count: n, number of readings.
        freedom: degrees of freedom of the noise scale's prior.
        group: (k,) group of each unknown.
        given: (k,) fixed standard deviation, or NaN.
        most: (k,) largest plausible standard deviation.
        start: start values by group.

    Returns:
        Standard deviations and posterior.
    """
    free = np.isnan(given)
    own = {int(g): np.flatnonzero((group == g) & free) for g in np.unique(group[free])}
    diagonal = np.diag(gram)
    limits, size = {}, {}
    for g, which in own.items():
        unit = 1 / np.sqrt(max(float(diagonal[which].mean()), 1e-300))
        limits[g] = unit * _LEAST, min(unit * _MOST, float(most[which].max()))
        size[g] = min(max(start.get(g, unit * _BEGIN), limits[g][0]), limits[g][1])
    best: Sizes | None = None
    worth = -np.inf
    for _ in range(_STEPS):
        std = np.where(free, 0.0, given)
        for g, which in own.items():
            std[which] = size[g]
        M = gram * np.outer(std, std)
        M[np.diag_indices(len(M))] += 1.0
        factor = cho_factor(M, lower=True, check_finite=False)
        x = cho_solve(factor, std * along, check_finite=False)
        inverse = solve_triangular(
            factor[0], np.eye(len(M)), lower=True, check_finite=False
        )
        left = max(squares - float(std * along @ x), 1e-12 * squares)
        log_det = 2 * float(np.log(np.diag(factor[0])).sum())
        determined = 1 - (inverse**2).sum(axis=0)
        now = -0.5 * (float(deviance(left, count, freedom)) + log_det)
        if now > worth:
            worth = now
            cost = sum(size_penalty(float(determined[w].sum())) for w in own.values())
            inverse *= std
            best = Sizes(
                std, dict(size), std * x, inverse.T @ inverse, left, log_det, cost
            )
        precision, change = (freedom + count) / (freedom + left), 0.0
        for g, which in own.items():
            seen = max(float(determined[which].sum()), 1e-9)
            step = np.sqrt(precision * float((x[which] ** 2).sum()) / seen)
            new = size[g] * float(np.clip(step, 1 / _LEAP, _LEAP))
            new = min(max(new, limits[g][0]), limits[g][1])
            change = max(change, abs(np.log(new / size[g])))
            size[g] = new
        if change < _SETTLED:
            break
    assert best is not None
    return best
