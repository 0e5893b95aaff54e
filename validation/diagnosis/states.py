"""Models of the search and their log posterior.

A model has elements (effects and functions) and, in use or not, geometric errors and
springs:

    score = ln p(z) - cost of optimised standard deviations + bounds + ln prior
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr
from scipy.stats import rankdata

from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Element
from validation.diagnosis.gaussian import (
    Marginal,
    deviance,
    leave_block_out,
    marginalise,
    scale,
)
from validation.diagnosis.prior_sizes import Sizes, best_sizes
from validation.diagnosis.weighted_readings import NARROW, WeightedReadings

Mode = tuple[bool, bool]  # geometric errors in use, springs in use
MORE = math.log(2.0)  # prior odds of one element fewer
IN_USE = math.log(10.0), math.log(10.0)  # prior odds against geometry, springs
_GROUPS = 4  # of nuisance parameters


@dataclass(frozen=True, eq=False)
class State:
    """A model with optimised prior standard deviations.

    Attributes:
        elements: effects and functions.
        mode: whether geometry and springs are in use.
        used: (k,) mask of the nuisance parameters in use.
        sizes: standard deviations and posterior of all unknowns.
        score: log posterior, up to a constant.
        tau: true over stated sigma.
        fit: readings and weights.
    """

    elements: tuple[Element, ...]
    mode: Mode
    used: NDArray
    sizes: Sizes
    score: float
    tau: float
    fit: "Fitting"

    def _columns(self) -> NDArray:
        """(n, k) of all unknowns; not kept, they may be hundreds of megabytes."""
        f = self.fit
        return np.hstack([f.small[:, self.used], *(f.own(e) for e in self.elements)])

    @cached_property
    def marginal(self) -> Marginal:
        """Model with its unknowns marginalised, in the fitted cells."""
        z = self.fit.readings(self.elements)
        return marginalise(self._columns(), self.sizes.std, z, self.fit.flat)

    @cached_property
    def sample_marginal(self) -> Marginal:
        """Model with its unknowns marginalised, in the sampled rows."""
        f = self.fit
        if f.sampled.all():
            return self.marginal
        X, z = self._columns()[f.sampled], f.readings(self.elements)[f.sampled]
        flat = np.linalg.qr(f.flat[f.sampled])[0]
        X, z = X - flat @ (flat.T @ X), z - flat @ (flat.T @ z)
        return marginalise(X, self.sizes.std, z, flat)

    def forget(self) -> None:
        """Release the memory of the marginal model; it is recomputed if needed."""
        for name in ("marginal", "sample_marginal"):
            self.__dict__.pop(name, None)

    @cached_property
    def fitted(self) -> NDArray:
        """(n,) contribution of the model to the readings, whitened and weighted."""
        f = self.fit
        return self._columns() @ self.sizes.mean + (f.z - f.readings(self.elements))

    @cached_property
    def left(self) -> NDArray:
        """(n,) residual of independent noise, unweighted."""
        f = self.fit
        fitted = self._columns() @ self.sizes.mean
        return (f.readings(self.elements) - fitted) / f.root

    def own(self, k: int) -> slice:
        """Return the slice of the k-th element's unknowns."""
        counts = [e.columns.shape[1] for e in self.elements]
        begin = int(self.used.sum()) + sum(counts[:k])
        return slice(begin, begin + counts[k])

    def expected_squares(self) -> NDArray:
        """Return the (n,) expected squared residuals, unweighted."""
        X = self._columns()
        spread = np.einsum("ij,ij->i", X @ self.sizes.covariance, X)
        return self.left**2 + spread * self.tau**2 / self.fit.weights


def prediction_gain(one: State, other: State, blocks: NDArray) -> float:
    """Return how surely one model predicts better than another.

    A few blocks often make up most of a gain and of its scatter; that nearly all of the
    others gain as well is seen by their signed ranks only (Wilcoxon 1945).

    Args:
        one: model.
        other: another model of the same readings.
        blocks: (n,) block of each reading; each is predicted by a fit to the others.

    Returns:
        By how many standard errors the log predictive densities of blocks gain: of
        their mean, or of their signed ranks if these say more; 0 of a single block,
        whose gain has no known error.
    """
    densities = []
    for state in (one, other):
        densities.append(leave_block_out(state.marginal, blocks, one.tau)[1])
        state.forget()
    gains = densities[0] - densities[1]
    if len(gains) < 2:
        return 0.0
    error = max(float(gains.std(ddof=1)) * np.sqrt(len(gains)), 1e-300)
    ranks = rankdata(np.abs(gains))
    by_ranks = float(np.sign(gains) @ ranks) / float(np.linalg.norm(ranks))
    by_mean = float(gains.sum()) / error
    return max(by_mean, by_ranks) if by_mean > 0 else by_mean


class Fitting(WeightedReadings):
    """Weighted readings of the fitted cells, and models of them."""

    def __init__(
        self, columns: Columns, z: NDArray, cells: NDArray, weights: NDArray,
        common: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """Start with an empty cache of models; arguments as of the readings."""
        super().__init__(columns, z, cells, weights, common)
        self._states: dict[object, State] = {}

    def forget(self) -> None:
        """Drop what can be computed again: models seen and products of columns."""
        for state in self._states.values():
            state.forget()
        self._states.clear()
        super().forget()

    def modes(self) -> list[Mode]:
        """Return the combinations of nuisance parameters in use."""
        small = self.columns.nuisance
        springs = [False, True] if small.spring.any() else [False]
        geometry = [False, True] if (~small.spring).any() else [False]
        geometry = [True] if small.declared else geometry
        return [(g, s) for g in geometry for s in springs]

    def state(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None = None
    ) -> State:
        """Return the model with optimised standard deviations.

        Args:
            elements: effects and functions.
            mode: nuisance parameters in use.
            start: model whose standard deviations are the start values.

        Returns:
            The model, from a cache.
        """
        key = frozenset(elements), mode
        if key not in self._states:
            self._states[key] = self._fitted(elements, mode, start)
        return self._states[key]

    def best(self, elements: tuple[Element, ...], start: State) -> State:
        """Return the best mode among those that differ in one group at most."""
        g, s = start.mode
        near = [m for m in self.modes() if m in {(g, s), (not g, s), (g, not s)}]
        states = [self.state(elements, m, start) for m in near]
        return max(states, key=lambda state: state.score)

    def _fitted(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None
    ) -> State:
        """Optimise standard deviations; remove springs of negative compliance."""
        small = self.columns.nuisance
        used = np.where(small.spring, mode[1], mode[0])
        begin: dict[int, float] = {}
        if start is not None:
            begin = {g: s for g, s in start.sizes.of_group.items() if g < _GROUPS}
            if start.mode == mode:
                used = start.used.copy()
            for k, e in enumerate(start.elements):
                if e in elements:
                    number = _GROUPS + elements.index(e)
                    begin[number] = start.sizes.of_group.get(_GROUPS + k, np.nan)
            begin = {g: s for g, s in begin.items() if np.isfinite(s)}
        z = self.readings(elements)
        counts = [e.columns.shape[1] for e in elements]
        with_small, inner = self.products(elements)
        with_z = np.concatenate([np.zeros(0), *(self.own(e).T @ z for e in elements)])
        small_z = self.small.T @ z
        element = np.repeat(np.arange(len(elements)), counts)
        given = np.concatenate([np.zeros(0), *(e.given for e in elements)])
        most = np.repeat([e.most for e in elements], counts)
        eigen = {
            _GROUPS + k: self.eigen(e)
            for k, e in enumerate(elements)
            if e.columns.shape[1] > NARROW and np.isnan(e.given).all()
        }
        while True:
            beside = with_small[used]
            gram = np.block([
                [self.gram[np.ix_(used, used)], beside],
                [beside.T, inner],
            ])
            sizes = best_sizes(
                gram, np.append(small_z[used], with_z), float(z @ z),
                self.count,
                np.append(small.group[used], _GROUPS + element),
                np.append(small.given[used], given), np.append(small.most[used], most),
                begin, eigen,
            )  # fmt: skip
            begin = sizes.of_group
            kept = np.flatnonzero(used)
            wrong = small.spring[kept] & (sizes.mean[: len(kept)] < 0)
            if not wrong.any():
                break
            used[kept[wrong]] = False
        tau = scale(sizes.squares, self.count)[0]
        score = self._score(elements, sizes, used, tau)
        return State(elements, mode, used, sizes, score, tau, self)

    def _score(
        self, elements: Sequence[Element], sizes: Sizes, used: NDArray, tau: float
    ) -> float:
        """Return the log posterior up to a constant."""
        small = self.columns.nuisance
        evidence = float(deviance(sizes.squares, self.count)) + sizes.log_det
        score = -0.5 * evidence - sizes.cost
        for spring, cost in ((False, IN_USE[0]), (True, IN_USE[1])):
            declared = small.declared and not spring
            if used[small.spring == spring].any() and not declared:
                score -= cost
        at = int(used.sum())
        for e in elements:
            own = slice(at, at + e.columns.shape[1])
            at = own.stop
            if e.bounded.any():
                spread = np.sqrt(np.diag(sizes.covariance)[own]) * tau
                ratio = sizes.mean[own] / np.maximum(spread, 1e-300)
                score += float((log_ndtr(ratio) + math.log(2.0))[e.bounded].sum())
            score += e.log_prior
        return score - MORE * (len(elements) + 1)
