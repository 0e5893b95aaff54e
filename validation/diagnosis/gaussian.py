r"""Gaussian linear models as inner products of columns: one operation, eliminate.

Readings are z = X u + noise with u ~ N(0, s^2) and noise ~ N(0, 1), both in units of a
scale tau.  With S = diag(s) and C = 1 + X S^2 X':

======  ==============  =======  =====================================================
symbol  code            shape    meaning
======  ==============  =======  =====================================================
G       ``matrix``      (k, k)   inner products of columns, z last
M                       (p, p)   1 + S G S of what is eliminated
U       ``factor_columns``      (n, p)   X S L^-T with L L' = M, so that C^-1 = 1 - U U'
Q       ``squares``              z' C^-1 z
======  ==============  =======  =====================================================

tau^2 follows a scaled inverse chi-square of nu degrees of freedom about 1, which makes
z multivariate t; nu = inf is a scale that is known.

Sources:
    Goodnight (1979), A tutorial on the sweep operator, The American Statistician 33.
    Gelman et al., Bayesian Data Analysis, sections 3.3, 14.8 (scale, prior as rows).
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import gammaln, log_ndtr

SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)  # [sigma] prior contributions to readings
SPAN = math.log(SIZES[-1] / SIZES[0])
_SEEN = 1e-8  # least eigenvalue of a scaled candidate that is not rounding


@dataclass(frozen=True, eq=False)
class Products:
    """Inner products of columns, some of which are eliminated.

    Attributes:
        matrix: (k, k), the readings last.
        log_det: ln det C of the eliminated columns.
    """

    matrix: NDArray
    log_det: float = 0.0

    def eliminate(self, columns: NDArray, prior_std: NDArray | float) -> "Products":
        """Marginalise some of the unknowns.

        Args:
            columns: indices of their columns.
            prior_std: prior standard deviations; inf is a flat prior, whose columns
                must be independent and add nothing to ``log_det``.

        Returns:
            Inner products with C^-1 as metric; zero for the eliminated columns.
        """
        own = np.asarray(columns)
        std = np.broadcast_to(np.asarray(prior_std, dtype=float), own.shape)
        flat = np.isinf(std)
        block = self.matrix[np.ix_(own, own)]
        s = np.where(flat, np.diag(block) ** -0.5 if flat.any() else 1.0, std)
        M = block * np.outer(s, s) + np.diag(1.0 - flat)
        factor = cho_factor(M, lower=True)
        beside = self.matrix[own] * s[:, None]
        left = self.matrix - beside.T @ cho_solve(factor, beside)
        left[own], left[:, own] = 0.0, 0.0
        log_det = 0.0 if flat.any() else 2 * float(np.log(np.diag(factor[0])).sum())
        return Products(left, self.log_det + log_det)

    def log_evidence(self, count: int, freedom: float = math.inf) -> float:
        """Return ln p(z) of n readings after all unknowns are eliminated."""
        return log_evidence(float(self.matrix[-1, -1]), self.log_det, count, freedom)

    def posterior(
        self, columns: NDArray, prior_std: NDArray | float
    ) -> tuple[NDArray, NDArray]:
        """Return posterior mean and covariance of unknowns that are not eliminated."""
        own = np.asarray(columns)
        std = np.broadcast_to(np.asarray(prior_std, dtype=float), own.shape)
        precision = np.diag(std**-2.0)
        covariance = np.linalg.inv(self.matrix[np.ix_(own, own)] + precision)
        return covariance @ self.matrix[own, -1], covariance


def log_evidence(
    squares: float, log_det: float, count: int, freedom: float = math.inf
) -> float:
    """Return ln p(z) of n readings from z' C^-1 z and ln det C."""
    if math.isinf(freedom):
        return -0.5 * (squares + log_det + count * math.log(2 * math.pi))
    constant = gammaln((freedom + count) / 2) - gammaln(freedom / 2)
    constant -= count / 2 * math.log(freedom * math.pi) + log_det / 2
    return float(constant - deviance(squares, count, freedom) / 2)


def deviance(squares: NDArray | float, count: int, freedom: float) -> NDArray | float:
    """Return -2 ln p(z) without the terms that do not depend on z' C^-1 z."""
    return (freedom + count) * np.log1p(np.asarray(squares) / freedom)


@dataclass(frozen=True, eq=False)
class Marginal:
    """A model with its unknowns marginalised, for scoring many candidates.

    Attributes:
        factor_columns: (n, p) U, so that B'C^-1 B = B'B - (U'B)'(U'B).
        held: (n,) C^-1 z.
        squares: z' C^-1 z.
    """

    factor_columns: NDArray
    held: NDArray
    squares: float


def marginalise(columns: NDArray, std: NDArray, z: NDArray, flat: NDArray) -> Marginal:
    """Marginalise columns (n, k) of prior std (k,); flat: (n, f), orthonormal."""
    X = columns * std
    M = X.T @ X
    M[np.diag_indices(len(M))] += 1.0
    L = np.linalg.cholesky(M)
    U = solve_triangular(L, X.T, lower=True, check_finite=False).T
    held = z - U @ (U.T @ z)
    return Marginal(np.hstack([flat, U]), held, float(z @ held))


def leave_block_out(
    marginal: Marginal, blocks: NDArray, tau: float = 1.0
) -> tuple[NDArray, NDArray]:
    """Predict each block of readings by a fit to all others, exactly.

    Args:
        marginal: of n readings.
        blocks: (n,) block of each reading.
        tau: scale of the noise.

    Returns:
        (n,) prediction errors and (blocks,) ln predictive densities.
    """
    errors, densities = np.empty_like(marginal.held), []
    for name in np.unique(blocks):
        own = np.flatnonzero(blocks == name)
        U = marginal.factor_columns[own]
        left = np.eye(len(own)) - U @ U.T
        errors[own] = np.linalg.solve(left, marginal.held[own])
        size = np.linalg.slogdet(left)[1] - len(own) * math.log(2 * math.pi * tau**2)
        square = float(errors[own] @ marginal.held[own]) / tau**2
        densities.append(0.5 * (size - square))
    return errors, np.array(densities)


def evidence_gains(
    gram: NDArray, along: NDArray, most: NDArray, bounded: NDArray | bool,
    marginal: Marginal, freedom: float,
) -> NDArray:  # fmt: skip
    """Return log evidence ratios of candidates, averaged over prior sizes.

    Args:
        gram: (c, m, m) B'C^-1 B of c candidates, columns scaled to norm about 1.
        along: (c, m) B'C^-1 z.
        most: (c,) largest plausible prior standard deviation, in that scale.
        bounded: (c,) whether the single unknown cannot be negative.
        marginal: what is known.
        freedom: degrees of freedom of the noise scale's prior.

    Returns:
        (c,) logarithms; -inf where no plausible size is visible.
    """
    count = len(marginal.held)
    if gram.shape[1] == 1:
        values, turned = gram[:, 0], along
    else:
        values, vectors = np.linalg.eigh(gram)
        turned = np.einsum("cmk,cm->ck", vectors, along)
    seen = values > _SEEN
    values = np.where(seen, values, 0.0)
    squares = np.where(seen, turned**2, 0.0)
    t2 = SIZES[:, None, None] ** 2
    grown = 1 + t2 * values
    left = marginal.squares - (squares * t2 / grown).sum(axis=2)
    left = np.maximum(left, 1e-9 * marginal.squares)
    base = deviance(marginal.squares, count, freedom)
    gains = 0.5 * (base - deviance(left, count, freedom) - np.log(grown).sum(axis=2))
    if gram.shape[1] == 1 and np.any(bounded):
        spread = np.sqrt(t2[:, :, 0] / grown[:, :, 0])
        tau = np.sqrt((freedom + left) / (freedom + count))
        score = turned[:, 0] * spread / tau
        gains += np.where(bounded, log_ndtr(score) + math.log(2.0), 0.0)
    plausible = SIZES[:, None] <= most
    largest = np.where(plausible, gains, -1e300).max(axis=0)
    shares = np.where(plausible, np.exp(np.minimum(gains - largest, 0.0)), 0.0)
    total, sizes = shares.sum(axis=0), plausible.sum(axis=0)
    average = largest + np.log(np.maximum(total, 1e-300) / np.maximum(sizes, 1))
    return np.where(sizes > 0, average, -np.inf)


def size_penalty(determined: float) -> float:
    """Return the penalty of an optimised prior size (Laplace approximation).

    Args:
        determined: number of well determined unknowns that share the size.

    Returns:
        Logarithm of the ratio of maximum and average over the range of sizes.
    """
    return math.log(SPAN) + 0.5 * math.log(max(determined, 1.0) / math.pi)
