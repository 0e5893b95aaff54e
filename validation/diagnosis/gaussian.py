r"""Score Gaussian linear models with marginalised unknowns.

The readings are z = X u + noise with u ~ N(0, s^2) and noise ~ N(0, 1).  Both are in
units of the noise scale tau.  With S = diag(s) and C = 1 + X S^2 X':

======  ==================  =======  =================================================
symbol  code                shape    meaning
======  ==================  =======  =================================================
M                           (p, p)   1 + S X'X S
U       ``factor_columns``  (n, p)   X S L^-T with L L' = M, so that C^-1 = 1 - U U'
Q       ``squares``                  z' C^-1 z
======  ==================  =======  =================================================

The prior of tau^2 is a scaled inverse chi-square distribution about 1.  Therefore z has
a multivariate t distribution.

Sources:
    Gelman et al., Bayesian Data Analysis, sections 3.3, 14.8 (scale, prior as rows).
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

# Degrees of freedom of the prior of tau^2.
FREEDOM = 20.0
# [sigma] Standard deviations of the change of the readings due to an effect. The
# evidence is averaged over these values.
SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)
SPAN = math.log(SIZES[-1] / SIZES[0])
_SEEN = 1e-8  # eigenvalue of a normalised Gram matrix that is treated as zero


def deviance(squares: NDArray | float, count: int) -> NDArray | float:
    """Return the term of -2 ln p(z) that depends on z' C^-1 z."""
    return (FREEDOM + count) * np.log1p(np.asarray(squares) / FREEDOM)


def scale(squares: float, count: int) -> tuple[float, float]:
    """Return the estimated noise scale tau and its standard deviation."""
    freedom = FREEDOM + count
    tau = np.sqrt((FREEDOM + squares) / max(freedom - 2.0, 1.0))
    return float(tau), float(tau / np.sqrt(2 * freedom))


@dataclass(frozen=True, eq=False)
class Marginal:
    """Linear model of readings with the Gaussian unknowns integrated out."""

    factor_columns: NDArray
    held: NDArray
    squares: float


def marginalise(columns: NDArray, std: NDArray, z: NDArray, flat: NDArray) -> Marginal:
    """Return the linear model of readings with the Gaussian unknowns integrated out.

    Args:
        z: (n,) readings, orthogonal to ``flat``.
        columns: (n, k) design matrix of the unknowns.
        std: (k,) prior standard deviations of the unknowns.
        flat: (n, f) orthonormal design matrix of the unknowns with a flat prior.
    """
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
    """Predict each block of readings (n,) by a fit to the readings of all other blocks.

    Returns:
        (n,) prediction errors, and (blocks,) logarithms of the predictive densities.
    """
    errors, densities = np.empty_like(marginal.held), []
    for name in np.unique(blocks):
        own = blocks == name
        U, held = marginal.factor_columns[own], marginal.held[own]
        if len(U) <= U.shape[1]:
            left = np.eye(len(U)) - U @ U.T
            errors[own] = np.linalg.lstsq(left, held, rcond=None)[0]
        else:  # Woodbury identity
            left = np.eye(U.shape[1]) - U.T @ U
            errors[own] = held + U @ np.linalg.lstsq(left, U.T @ held, rcond=None)[0]
        size = np.linalg.slogdet(left)[1] - len(U) * math.log(2 * math.pi * tau**2)
        densities.append(0.5 * (size - float(errors[own] @ held) / tau**2))
    return errors, np.array(densities)


def evidence_gains(
    gram: NDArray, along: NDArray, most: NDArray, bounded: NDArray | bool,
    marginal: Marginal,
) -> NDArray:  # fmt: skip
    """Return log evidence ratios, averaged over prior standard deviations.

    Args:
        gram: (c, m, m) matrices B'C^-1 B of c candidates, with columns scaled to a norm
            of about 1.
        along: (c, m) vectors B'C^-1 z.
        most: (c,) largest plausible prior standard deviation of the scaled unknowns.
        bounded: (c,) bool, True for a single unknown that cannot be negative.
        marginal: model to which the candidates are added.

    Returns:
        (c,) log evidence ratios, -inf if a candidate cannot change the readings
        visibly.
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
    base = deviance(marginal.squares, count)
    gains = 0.5 * (base - deviance(left, count) - np.log(grown).sum(axis=2))
    if gram.shape[1] == 1 and np.any(bounded):
        spread = np.sqrt(t2[:, :, 0] / grown[:, :, 0])
        tau = np.sqrt((FREEDOM + left) / (FREEDOM + count))
        score = turned[:, 0] * spread / tau
        gains += np.where(bounded, log_ndtr(score) + math.log(2.0), 0.0)
    plausible = SIZES[:, None] <= most
    largest = np.where(plausible, gains, -1e300).max(axis=0)
    shares = np.where(plausible, np.exp(np.minimum(gains - largest, 0.0)), 0.0)
    total, sizes = shares.sum(axis=0), plausible.sum(axis=0)
    average = largest + np.log(np.maximum(total, 1e-300) / np.maximum(sizes, 1))
    return np.where(sizes > 0, average, -np.inf)


def size_penalty(determined: float) -> float:
    """Return the penalty on the log evidence for optimising a standard deviation.

    The penalty is the logarithm of the maximum evidence divided by the average evidence
    over all prior standard deviations, by Laplace's approximation. ``determined`` is
    the number of well-determined unknowns with this standard deviation.
    """
    return math.log(SPAN) + 0.5 * math.log(max(determined, 1.0) / math.pi)
