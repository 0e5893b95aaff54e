"""Prior standard deviations of groups of unknowns, where the readings are likeliest.

With posterior mean mu and covariance V of the unknowns of a group and s their size,

    d ln p(z) / d ln s = sum of [(mu^2 + V)/s^2 - 1],

zero where s^2 = sum mu^2 / sum (1 - V/s^2): MacKay's step, taken with a limit.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from validation.diagnosis.gaussian import likeness, size_cost

_STEPS = 25
_SETTLED = 0.03  # change of ln s
_LEAP = 4.0  # times that a size may change in a step
_BEGIN = 4.0  # [sigma] what a group's unknowns may do at first
_LEAST, _MOST = 1e-2, 1e6  # [sigma] likewise


@dataclass(frozen=True, eq=False)
class Sizes:
    """Unknowns with the sizes of their priors at the likeliest.

    Attributes:
        std: (k,) of every unknown, in units of the noise's scale tau.
        of_group: by group.
        mean: (k,) posterior.
        covariance: (k, k) likewise, over tau^2.
        squares: z' C^-1 z.
        log_det: ln det C.
        cost: of having chosen the sizes.
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
        """(k,) 1 of what the readings say alone, 0 of what the prior says."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - np.diag(self.covariance) / self.std**2
        return np.where(self.std > 0, share, 0.0)


def best_sizes(
    gram: NDArray, along: NDArray, squares: float, count: int, freedom: float,
    group: NDArray, given: NDArray, most: NDArray, start: dict[int, float],
) -> Sizes:  # fmt: skip
    """Sizes of all groups.

    Args:
        gram: (k, k) inner products of columns.
        along: (k,) with the readings.
        squares: of the readings.
        count: n of them.
        freedom: of the noise's scale.
        group: (k,) number of the group; those of a given size are of none.
        given: (k,) size, NaN where it is asked for.
        most: (k,) largest size that is plausible.
        start: sizes to begin with, by group.

    Returns:
        The sizes, and the posterior.
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
        now = -0.5 * (float(likeness(left, count, freedom)) + log_det)
        if now > worth:
            worth = now
            cost = sum(size_cost(float(determined[w].sum())) for w in own.values())
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
