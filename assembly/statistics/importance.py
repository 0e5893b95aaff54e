"""Importance of errors: variance-based sensitivity (Sobol) indices.

The first-order index of an error is the fraction of the variance of a result that this
error alone explains. The total index includes interactions with other errors.
Saltelli's design estimates both indices from (groups + 2) x draws evaluations. For a
result ``sum_j a_j e_j`` of independent errors e_j, both indices of e_i equal ``a_i^2
var_i / sum_j a_j^2 var_j``.

A base draw is discarded if it, or a mixed draw compared with it, has no solution. The
errors of the remaining draws are not independent, so no indices are reported if too
many draws are discarded.

Sources:
    Saltelli et al. (2010), Variance based sensitivity analysis of model output, table 2
    (formula b for the first-order index, f for the total index, by Jansen).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.error_distributions import ErrorSources
from forcefit.assembly.statistics.callout_sources import CalloutSources, Sources
from forcefit.assembly.statistics.ranking import group_of

# random number streams of A and B
STREAMS = (2, 3)
# largest accepted fraction of discarded draws
MOST_FAILED = 0.05
_RESAMPLES = 200


@dataclass(frozen=True, eq=False)
class Importance:
    """Sobol indices of s results for d groups of errors.

    Attributes:
        groups: names of the groups.
        first: (s, d, 3) first-order indices, each with value, lower and upper bound.
        total: (s, d, 3) total indices, in the same format.
        variance: (s,) variances of the results.
        failed: (s, d) fraction of base draws that are discarded. If it exceeds
            :data:`MOST_FAILED`, the indices are NaN.
    """

    groups: tuple[str, ...]
    first: NDArray
    total: NDArray
    variance: NDArray
    failed: NDArray


@dataclass(frozen=True, eq=False)
class SaltelliDesign:
    """Saltelli's design of two samples A and B, and a mixed sample for each group.

    Attributes:
        A: (k, m) first sample of the errors.
        B: (k, m) second, independent sample of the errors.
        groups: name and column indices of each of d groups.
    """

    A: NDArray
    B: NDArray
    groups: Sequence[tuple[str, NDArray]]

    def __len__(self) -> int:
        return len(self.A) * (len(self.groups) + 2)

    def rows(self, first: int, count: int) -> NDArray:
        """Return rows ``first`` to ``first + count - 1`` of the design, (count, m)."""
        matrix, base = np.divmod(np.arange(first, first + count), len(self.A))
        rows = np.where((matrix == 1)[:, None], self.B[base], self.A[base])
        for g, (_, columns) in enumerate(self.groups):
            some = np.flatnonzero(matrix == g + 2)
            rows[np.ix_(some, columns)] = self.B[np.ix_(base[some], columns)]
        return rows


def sobol_importance(
    evaluate: Callable[[NDArray], NDArray],
    sample: Callable[[int, int], NDArray],
    groups: Sequence[tuple[str, NDArray]],
    count: int,
    level: float = 0.95,
) -> Importance:
    """Estimate the Sobol indices of any function of independent variables.

    Args:
        evaluate: function that maps variables (k, m) to results (k, s); NaN for a draw
            without a solution.
        sample: function that returns ``count`` independent draws, (count, m), for the
            arguments ``stream`` and ``count``.
        groups: name and column indices of each group of variables.
        count: number of base draws; (groups + 2) x count draws are evaluated.
        level: confidence level of the bootstrap intervals.

    Returns:
        The indices; NaN for a result that does not vary.
    """
    A, B = (sample(stream, count) for stream in STREAMS)
    design = SaltelliDesign(A, B, groups)
    return sobol_indices(design, evaluate(design.rows(0, len(design))), level)


def sobol_indices(
    design: SaltelliDesign, results: NDArray, level: float = 0.95
) -> Importance:
    """Estimate the Sobol indices from the results of a design.

    Args:
        design: design of k base draws and d groups.
        results: (k (d + 2), s) results for the rows of the design; NaN or infinite for
            a draw without a solution.
        level: confidence level of the bootstrap intervals.

    Returns:
        The indices; NaN for a result that is constant or fails in too many draws.
    """
    d, s, count = len(design.groups), results.shape[1], len(design.A)
    f = results.reshape(d + 2, count, s)
    names = tuple(name for name, _ in design.groups)
    first, total = np.full((s, d, 3), np.nan), np.full((s, d, 3), np.nan)
    variance, failed = np.full(s, np.nan), np.ones((s, d))
    rng = np.random.default_rng(1)
    weights = rng.multinomial(count, np.full(count, 1 / count), _RESAMPLES)
    weights = np.vstack([np.ones(count), weights])
    for q in range(s):
        answered = np.isfinite(f[:, :, q])
        both = f[:2, :, q][answered[:2]]
        failed[q] = 1.0 - (answered[0] & answered[1] & answered[2:]).mean(axis=1)
        if not len(both):
            continue
        variance[q] = both.var()
        if not variance[q] > 1e-24 * (both**2).mean():
            continue
        for g in np.flatnonzero(failed[q] <= MOST_FAILED).tolist():
            kept = answered[0] & answered[1] & answered[g + 2]
            some = weights[:, kept] / weights[:, kept].sum(axis=1, keepdims=True)
            three = f[[0, 1, g + 2]][:, kept, q] - both.mean()
            first[q, g], total[q, g] = _shares(three, some, level)
    return Importance(names, first, total, variance, failed)


def _shares(f: NDArray, weights: NDArray, level: float) -> tuple[NDArray, NDArray]:
    """Estimate both indices of a group from results of A, B and mixed draws."""
    alone, left = f[1] * (f[2] - f[0]), 0.5 * (f[2] - f[0]) ** 2
    mean = weights @ (f[0] + f[1]) / 2
    variance = weights @ (f[0] ** 2 + f[1] ** 2) / 2 - mean**2
    tail = [(1 - level) / 2, (1 + level) / 2]
    indices = []
    for product in (alone, left):
        shares = (weights @ product) / variance
        indices.append(np.array([shares[0], *np.quantile(shares[1:], tail)]))
    return indices[0], indices[1]


def linear_importance(
    slopes: NDArray, sources: ErrorSources, groups: Sequence[tuple[str, NDArray]]
) -> NDArray:
    """Compute the Sobol indices of results that are linear in the errors.

    Args:
        slopes: (s, m) derivatives of the results with respect to each source.
        sources: the m sources.
        groups: name and column indices of each group.

    Returns:
        Fractions of the variance, (s, d). They equal the first-order and the total
        indices.
    """
    parts = slopes**2 * sources.variance
    shares = np.stack([parts[:, columns].sum(axis=1) for _, columns in groups], axis=1)
    return shares / parts.sum(axis=1, keepdims=True)


def source_groups(sources: Sources, by: str) -> list[tuple[str, NDArray]]:
    """Group errors by source, by frame or by kind.

    Args:
        sources: the errors of a robot.
        by: ``"source"``, ``"frame"`` or ``"kind"``. Errors of the same kind have the
            same component and the same frame name in different legs.

    Returns:
        Name and column indices of each group.

    Raises:
        ValueError: ``by`` has another value.
    """
    if by not in {"source", "frame", "kind"}:
        raise ValueError(f"by is {by!r}, expected 'source', 'frame' or 'kind'")
    if isinstance(sources, CalloutSources):
        keys = sources.groups_by(by)
    else:
        keys = [group_of(label, by) for label in sources.labels]
    names = list(dict.fromkeys(keys))
    return [(n, np.flatnonzero([k == n for k in keys])) for n in names]
