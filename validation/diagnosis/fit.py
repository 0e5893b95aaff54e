r"""Fit all unknown robot parameters together in the last step of a diagnosis.

The most probable parameters x minimise

    F(x) = |W (y - f(x)) / sigma|^2 + |(x - m) / s|^2    within the bounds of x,

Here f(x) contains the predicted readings of the robot with parameters x
(:mod:`forcefit.validation.diagnosis.prediction`). The minimum is computed by
Gauss-Newton steps with the derivatives of the linear model.  Steps that increase F are
halved.

======  ==============  =========  ===================================================
symbol  code            shape      meaning
======  ==============  =========  ===================================================
y       ``measured``    (n,)       readings used in the fit
W       ``whiten``      (n, n)     transformation to independent noise
A       ``A``           (n, k)     df/dx / sigma, whitened
P       ``precision``   (k,)       1 / s^2
C       ``covariance``  (k, k)     (A'A + P)^-1
======  ==============  =========  ===================================================

Sources:
    Nocedal, Wright, Numerical Optimization, 10.3 (Gauss-Newton's method).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from forcefit.assembly.model.robot import Robot
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.prediction import residual_of
from forcefit.validation.diagnosis.separability import ROUNDING
from forcefit.validation.diagnosis.unknowns import Acting, Unknowns
from forcefit.validation.diagnosis.whitening import whitening_of

_STEPS = 20  # maximum number of Gauss-Newton steps
_SLOPES = 6  # the derivatives are recomputed after this number of steps
_SHORTEST = 1 / 64  # smallest fraction of a Gauss-Newton step
# The iteration ends if F decreases by less than this value in one step.
_SETTLED = 1e-3
# [sigma] Residual of a reading for which the model has no solution.
_NO_ANSWER = 1e3


@dataclass(frozen=True, eq=False)
class MachineFit:
    """A robot fitted to selected rows of a campaign.

    Attributes:
        unknowns: the fitted parameters.
        x: (k,) most probable values of the parameters.
        covariance: (k, k) posterior covariance of x.
        slopes: (n, k) derivatives of the whitened predicted readings with respect to x.
        residual: (n,) whitened residual of the readings used in the fit.
    """

    unknowns: Unknowns
    x: NDArray
    covariance: NDArray
    slopes: NDArray
    residual: NDArray

    @cached_property
    def robot(self) -> Robot:
        """The fitted robot."""
        return self.unknowns.robot_at(self.x)

    @property
    def std(self) -> NDArray:
        """Standard deviations (k,) of the parameters."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def determined(self) -> NDArray:
        """Relative decrease (k,) of each variance from prior to posterior."""
        prior = self.unknowns.std**2
        return 1.0 - np.clip(np.diag(self.covariance) / prior, 0.0, 1.0)

    @property
    def effects(self) -> tuple[Acting, ...]:
        """Library effects of the robot, except the pose of the measuring frame."""
        return tuple(one for one in self.unknowns.effects if not one.device)

    def own(self, part: Acting) -> tuple[NDArray, NDArray, NDArray]:
        """Return the values, covariance and derivatives of one effect's parameters."""
        own = self.unknowns.place(part)
        return self.x[own], self.covariance[own, own], self.slopes[:, own]

    def seen(self, part: Acting) -> NDArray:
        """Return a mask (k,) of the unknowns of an effect that affect the readings."""
        return self.determined[self.unknowns.place(part)] > ROUNDING


def fit_machine(
    campaign: Campaign, unknowns: Unknowns, rows: NDArray, start: NDArray | None = None
) -> MachineFit:
    """Fit the unknown parameters of a robot to selected rows of a campaign.

    Args:
        campaign: campaign of R rows.
        unknowns: unknown parameters of the campaign's robot.
        rows: (R,) mask of the rows to fit.
        start: (k,) start values.  None for the means of the prior.

    Returns:
        The fit.
    """
    # All rows are predicted, because readings can depend on earlier commands.
    cells = campaign.cells & rows[:, None]
    sigma, whiten = campaign.sigma[cells], whitening_of(campaign, cells)

    def residual(x: NDArray) -> NDArray:
        left = residual_of(campaign, unknowns.robot_at(x))[cells] / sigma
        return whiten(np.where(np.isfinite(left), left, _NO_ANSWER))

    def slopes(x: NDArray) -> NDArray:
        return whiten(unknowns.slopes(campaign, x)[cells] / sigma[:, None])

    x, A, left = _minimum(unknowns, residual, slopes, start)
    C = np.linalg.inv(_information(A * unknowns.std))
    covariance = C * np.outer(unknowns.std, unknowns.std)
    return MachineFit(unknowns, x, covariance, A, left)


def _minimum(
    unknowns: Unknowns, residual: Callable[[NDArray], NDArray],
    slopes: Callable[[NDArray], NDArray], start: NDArray | None,
) -> tuple[NDArray, NDArray, NDArray]:  # fmt: skip
    """Return the most probable x (k,) with derivatives (n, k) and residual (n,)."""
    mean, std = unknowns.mean, unknowns.std
    lower, upper = unknowns.bounds
    x = np.clip(mean if start is None else start, lower, upper)

    def total(x: NDArray, left: NDArray) -> float:
        return float(left @ left + np.sum(((x - mean) / std) ** 2))

    left = residual(x)
    A, F = slopes(x), total(x, left)
    for turn in range(_STEPS if len(x) else 0):
        step = _step(unknowns, A, left, x)
        share = 1.0
        while share >= _SHORTEST:
            trial = np.clip(x + share * step, lower, upper)
            there = residual(trial)
            if total(trial, there) < F:
                break
            share /= 2
        else:
            break
        gained = F - total(trial, there)
        x, left, F = trial, there, F - gained
        if gained < _SETTLED:
            break
        if turn < _SLOPES:
            A = slopes(x)
    return x, A, left


def _step(unknowns: Unknowns, A: NDArray, left: NDArray, x: NDArray) -> NDArray:
    """Return the Gauss-Newton step (k,) within the bounds of the parameters."""
    std = unknowns.std
    B = A * std
    L = cholesky(_information(B), lower=True, check_finite=False)
    wanted = B.T @ left - (x - unknowns.mean) / std
    y = solve_triangular(L, wanted, lower=True, check_finite=False)
    step = solve_triangular(L, y, lower=True, trans=1, check_finite=False)
    low, high = ((bound - x) / std for bound in unknowns.bounds)
    if np.any(step < low) or np.any(step > high):
        # The step minimises |L' step - y| within the bounds.
        wide = high - low > 0.0
        step = np.zeros(len(x))
        free = lsq_linear(L.T[:, wide], y, (low[wide], high[wide]), method="bvls")
        step[wide] = free.x
    return step * std


def _information(B: NDArray) -> NDArray:
    """Return B'B + 1, the inverse covariance of x / s."""
    M = B.T @ B
    M[np.diag_indices(len(M))] += 1.0
    return np.asarray(M)
