"""Estimate the prior standard deviations of groups of unknowns.

The standard deviations maximise the evidence p(z). With posterior means mu and
variances V of the unknowns of a group, and their prior standard deviation s,

    d ln p(z) / d ln s = sum of [(mu^2 + V)/s^2 - 1],

which is zero for s^2 = sum mu^2 / sum (1 - V/s^2). MacKay's method iterates this
equation.  Here, the change in s per step is limited.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solve_triangular

from forcefit.validation.diagnosis.gaussian import FREEDOM, deviance, size_penalty

Eigen = tuple[NDArray, NDArray]
_STEPS = 25  # maximum number of iterations
# Change in ln s below which the iteration ends.
_SETTLED = 0.03
_LEAP = 4.0  # largest factor between the values of s in successive iterations
_BEGIN = 4.0  # [sigma] start value of the rms contribution of a group to the readings
# [sigma] Smallest rms contribution of a group to the readings.
_LEAST = 1e-2


@dataclass(frozen=True, eq=False)
class Sizes:
    """Optimised prior standard deviations, and the resulting posterior distribution.

    Attributes:
        std: (k,) prior standard deviation of each unknown, divided by the noise scale
            tau.
        of_group: prior standard deviation of each group.
        mean: (k,) posterior mean.
        covariance: (k, k) posterior covariance, divided by tau^2.
        squares: value of z' C^-1 z.
        log_det: value of ln det C.
        cost: penalty on the log evidence, see :func:`.gaussian.size_penalty`.
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
        """Relative decrease (k,) of each variance from prior to posterior."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - np.diag(self.covariance) / self.std**2
        return np.where(self.std > 0, share, 0.0)


@dataclass(frozen=True, eq=False)
class Grouped:
    """Linear model of k unknowns with a common prior standard deviation in each group.

    Attributes:
        gram: (k, k) inner products of the columns of the design matrix.
        along: (k,) inner products of the columns with the readings.
        squares: sum of squares of the readings.
        count: number of readings.
        group: (k,) group of each unknown.
        given: (k,) fixed prior standard deviation, NaN if it is optimised.
        most: (k,) largest plausible prior standard deviation.
    """

    gram: NDArray
    along: NDArray
    squares: float
    count: int
    group: NDArray
    given: NDArray
    most: NDArray

    def without(self, unknowns: NDArray) -> "Grouped":
        """Return the model without the unknowns of given indices."""
        kept = np.delete(np.arange(len(self.along)), unknowns)
        return replace(
            self, gram=self.gram[np.ix_(kept, kept)], along=self.along[kept],
            group=self.group[kept], given=self.given[kept], most=self.most[kept],
        )  # fmt: skip


def best_sizes(
    model: Grouped, start: Mapping[int, float] = MappingProxyType({}),
    eigen: Mapping[int, Eigen] = MappingProxyType({}),
) -> Sizes:  # fmt: skip
    """Return the prior standard deviations of all groups that maximise the evidence.

    Args:
        model: the linear model.
        start: mapping from groups to start values.
        eigen: mapping from groups to the eigenvalues and eigenvectors of their block of
            ``model.gram``.
    """
    given, group, count = model.given, model.group, model.count
    free = np.isnan(given)
    own = {int(g): np.flatnonzero((group == g) & free) for g in np.unique(group[free])}
    diagonal = np.diag(model.gram)
    limits, size = {}, {}
    for g, which in own.items():
        unit = 1 / np.sqrt(max(float(diagonal[which].mean()), 1e-300))
        limits[g] = unit * _LEAST, float(model.most[which].max())
        size[g] = min(max(start.get(g, unit * _BEGIN), limits[g][0]), limits[g][1])
    largest = max(own, key=lambda g: len(own[g]), default=None)
    which = np.zeros(0, dtype=int) if largest is None else own[largest]
    block = eigen.get(-1 if largest is None else largest)
    turned = _turned(model.gram, model.along, which, block)
    best: tuple[_Posterior, dict[int, float]] | None = None
    worth = -np.inf
    for _ in range(_STEPS):
        std = np.where(free, 0.0, given)
        for g, which in own.items():
            std[which] = size[g]
        now = turned.posterior(std, model.squares)
        value = -0.5 * (float(deviance(now.left, count)) + now.log_det)
        if value > worth:
            worth, best = value, (now, dict(size))
        precision, change = (FREEDOM + count) / (FREEDOM + now.left), 0.0
        for g, which in own.items():
            seen = max(float(now.determined[which].sum()), 1e-9)
            step = np.sqrt(precision * float((now.x[which] ** 2).sum()) / seen)
            new = size[g] * float(np.clip(step, 1 / _LEAP, _LEAP))
            new = min(max(new, limits[g][0]), limits[g][1])
            change = max(change, abs(np.log(new / size[g])))
            size[g] = new
        if change < _SETTLED:
            break
    assert best is not None
    at, size = best
    determined = [float(at.determined[which].sum()) for which in own.values()]
    return Sizes(
        std=at.std,
        of_group=size,
        mean=turned.back(at.std * at.x),
        covariance=turned.covariance(at),
        squares=at.left,
        log_det=at.log_det,
        cost=sum(map(size_penalty, determined)),
    )


@dataclass(frozen=True, eq=False)
class _Posterior:
    """Posterior of the rotated unknowns for given prior standard deviations.

    Attributes:
        std: (k,) prior standard deviations.
        x: (k,) posterior means divided by the prior standard deviations.
        determined: (k,) 1 minus the ratio of posterior to prior variance. For the
            unknowns of the largest group, only the sum of these values is valid.
        left: value of z' C^-1 z.
        log_det: value of ln det C.
        D: 1 plus s^2 times the eigenvalues.
        E: C D^-1.
        L: Cholesky factor of A - C D^-1 C'.
    """

    std: NDArray
    x: NDArray
    determined: NDArray
    left: float
    log_det: float
    D: NDArray
    E: NDArray
    L: NDArray


@dataclass(frozen=True, eq=False)
class _Turned:
    """Inner products of the design matrix after a rotation of the largest group.

    The rotation of the unknowns makes the block of the largest group diagonal. Because
    these unknowns have the same standard deviation, D is diagonal in

        M = 1 + S G S = [A  C; C' D].

    Only the Schur complement A - C D^-1 C', which is small, must be factored.

    Attributes:
        values: eigenvalues of the block of the largest group.
        V: eigenvectors of this block.
        group: indices of the unknowns in this group.
        rest: indices of all other unknowns.
        inner: inner products among the other unknowns.
        across: inner products between the other unknowns and this group.
        along: (k,) inner products of the columns with the readings.
    """

    values: NDArray
    V: NDArray
    group: NDArray
    rest: NDArray
    inner: NDArray
    across: NDArray
    along: NDArray

    def posterior(self, std: NDArray, squares: float) -> _Posterior:
        """Return the posterior for prior standard deviations (k,)."""
        o, g = self.rest, self.group
        s, S = (float(std[g[0]]) if len(g) else 0.0), std[o]
        D = 1.0 + s**2 * self.values
        C = S[:, None] * self.across * s
        E = C / D
        A = self.inner * np.outer(S, S) - E @ C.T
        A[np.diag_indices(len(A))] += 1.0
        L = np.linalg.cholesky(A)
        b, x = std * self.along, np.empty(len(std))
        x[o] = cho_solve((L, True), b[o] - E @ b[g], check_finite=False)
        x[g] = (b[g] - C.T @ x[o]) / D
        inverse = solve_triangular(
            L, np.hstack([np.eye(len(o)), E]), lower=True, check_finite=False
        )
        variance = np.empty(len(std))
        shown = (inverse**2).sum(axis=0)
        variance[o], variance[g] = shown[: len(o)], 1 / D + shown[len(o) :]
        return _Posterior(
            std, x, 1 - variance, max(squares - float(b @ x), 1e-12 * squares),
            float(np.log(D).sum()) + 2 * float(np.log(np.diag(L)).sum()), D, E, L,
        )  # fmt: skip

    def back(self, x: NDArray) -> NDArray:
        """Transform rotated unknowns (last axis) back to the original unknowns."""
        turned = x.copy()
        turned[..., self.group] = x[..., self.group] @ self.V.T
        return turned

    def covariance(self, at: _Posterior) -> NDArray:
        """Return the posterior covariance (k, k)."""
        o, g = self.rest, self.group
        inverse = solve_triangular(
            at.L, np.hstack([np.eye(len(o)), -at.E]), lower=True, check_finite=False
        )
        rows = np.empty((len(o), len(at.std)))
        rows[:, o], rows[:, g] = inverse[:, : len(o)], inverse[:, len(o) :]
        rows = self.back(rows * at.std)
        C = rows.T @ rows
        C[np.ix_(g, g)] += (self.V * (at.std[g] ** 2 / at.D)) @ self.V.T
        return C


def _turned(
    gram: NDArray, along: NDArray, group: NDArray, eigen: Eigen | None
) -> _Turned:
    """Rotate the unknowns of a group to make their inner products diagonal."""
    rest = np.setdiff1d(np.arange(len(gram)), group)
    values, V = eigen or np.linalg.eigh(gram[np.ix_(group, group)])
    turned = along.copy()
    turned[group] = V.T @ along[group]
    return _Turned(
        np.maximum(values, 0.0), V, group, rest, gram[np.ix_(rest, rest)],
        gram[np.ix_(rest, group)] @ V, turned,
    )  # fmt: skip
