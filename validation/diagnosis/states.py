"""Define the models of the search and compute their log posteriors.

A model consists of effects and functions. It may also contain geometric errors of
frames, joint springs, or both. Its score is the log posterior:

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

from forcefit.validation.diagnosis.elements import Element
from forcefit.validation.diagnosis.gaussian import (
    Marginal,
    deviance,
    leave_block_out,
    marginalise,
    scale,
)
from forcefit.validation.diagnosis.prior_sizes import Grouped, Sizes, best_sizes
from forcefit.validation.diagnosis.weighted_readings import NARROW, WeightedReadings

# Two booleans: whether a model includes geometric errors, and whether it includes
# springs.
Mode = tuple[bool, bool]
MORE = math.log(2.0)  # decrease of the log prior for each additional effect or function
# Decrease of the log prior for including geometric errors, and for including springs.
IN_USE = math.log(10.0)
_GROUPS = 4  # number of groups of nuisance parameters


@dataclass(frozen=True, eq=False)
class State:
    """Model of the readings with optimised prior standard deviations.

    Attributes:
        elements: effects and functions.
        mode: two booleans, whether geometric errors are included, and whether springs
            are included.
        used: (k,) mask of the included nuisance parameters.
        sizes: standard deviations and posterior of all unknowns.
        score: log posterior, up to a constant.
        tau: ratio of the true to the declared sigma.
        readings: the readings to which the model is fitted.
    """

    elements: tuple[Element, ...]
    mode: Mode
    used: NDArray
    sizes: Sizes
    score: float
    tau: float
    readings: WeightedReadings

    def _columns(self) -> NDArray:
        """Return the design matrix (n, k) of all unknowns. The result is not cached."""
        r = self.readings
        return np.hstack([r.small[:, self.used], *(r.own(e) for e in self.elements)])

    def _z(self) -> NDArray:
        """Return the readings (n,) minus the offsets of all effects."""
        return self.readings.without_offsets(self.elements)

    @cached_property
    def marginal(self) -> Marginal:
        """Linear model of the fitted readings with its unknowns integrated out."""
        flat = self.readings.flat
        return marginalise(self._columns(), self.sizes.std, self._z(), flat)

    @cached_property
    def sample_marginal(self) -> Marginal:
        """Linear model of the sampled readings with its unknowns integrated out."""
        some = self.readings.sampled
        if some.all():
            return self.marginal
        X, z = self._columns()[some], self._z()[some]
        flat = np.linalg.qr(self.readings.flat[some])[0]
        X, z = X - flat @ (flat.T @ X), z - flat @ (flat.T @ z)
        return marginalise(X, self.sizes.std, z, flat)

    def forget(self) -> None:
        """Release the memory of the cached linear models."""
        for name in ("marginal", "sample_marginal"):
            self.__dict__.pop(name, None)

    @cached_property
    def fitted(self) -> NDArray:
        """Readings (n,) that the model predicts, whitened and weighted."""
        return self._columns() @ self.sizes.mean + (self.readings.z - self._z())

    @cached_property
    def left(self) -> NDArray:
        """Whitened residual (n,) before weighting."""
        return (self.readings.z - self.fitted) / self.readings.root

    def own(self, k: int) -> slice:
        """Return the slice of the k-th effect or function in the vector of unknowns."""
        counts = [e.columns.shape[1] for e in self.elements]
        begin = int(self.used.sum()) + sum(counts[:k])
        return slice(begin, begin + counts[k])

    @property
    def errors(self) -> NDArray:
        """Estimated geometric errors (n, 6) [rad, m] of the frames."""
        columns = self.readings.columns
        small = columns.nuisance.take(self.used)
        errors = np.zeros((len(columns.campaign.robot.frames), 6))
        x = np.where(small.spring, 0.0, self.sizes.mean[: len(small.spring)])
        np.add.at(errors, (small.frame, small.axis), x)
        return errors

    def without(self, some: Sequence[Element]) -> tuple[Element, ...]:
        """Return the effects and functions of the model, except the given ones."""
        return tuple(e for e in self.elements if e not in some)

    @property
    def names(self) -> tuple[str, ...]:
        """Sorted list of the effect names and of the descriptions of functions."""
        names = [
            e.name or "of " + ", ".join(e.candidate.parts[0].variables)
            for e in self.elements
        ]
        return tuple(sorted(names))

    @property
    def supported(self) -> bool:
        """Whether all effects are within their bounds."""
        means = [self.sizes.mean[self.own(k)] for k in range(len(self.elements))]
        return not any(map(_at_bounds, self.elements, means))

    def sizes_for(self, elements: Sequence[Element]) -> dict[int, float]:
        """Return prior standard deviations as start values for another model."""
        own = self.sizes.of_group
        found = {g: s for g, s in own.items() if g < _GROUPS}
        for k, e in enumerate(self.elements):
            if e in elements and _GROUPS + k in own:
                found[_GROUPS + elements.index(e)] = own[_GROUPS + k]
        return found

    def expected_squares(self) -> NDArray:
        """Return the expected squares (n,) of the unweighted residuals."""
        X = self._columns()
        spread = np.einsum("ij,ij->i", X @ self.sizes.covariance, X)
        return self.left**2 + spread * self.tau**2 / self.readings.weights


def _at_bounds(e: Element, mean: NDArray) -> bool:
    """Return whether parameters of an effect are at a bound.

    The result is true if all parameters, or one nonlinear parameter such as a time
    constant, are at a bound.
    """
    if not e.name or not e.columns.shape[1]:
        return False
    at, x = (mean <= e.lower) | (mean >= e.upper), e.values(mean)
    if at[np.isnan(e.given)].all():
        return True
    return any(
        not slot.unknown.lower * 1.001 < x[j] < slot.unknown.upper * 0.999
        for j, slot in enumerate(e.hypothesis.slots)
        if slot.shape
    )


def prediction_gain(one: State, other: State, blocks: NDArray) -> float:
    """Return how much better a model predicts than another model, in standard errors.

    Each block (n,) of readings is predicted by a fit to all other blocks.  The gain is
    the mean difference of the log predictive densities over its standard error, or
    Wilcoxon's signed-rank statistic (1945) if it is larger.  The gain is 0 for a single
    block.
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


class Models:
    """Fits models to weighted readings and caches the results."""

    def __init__(self, readings: WeightedReadings) -> None:
        """Create an empty cache."""
        self.readings, self._small = readings, readings.columns.nuisance
        self._states: dict[object, State] = {}

    def forget(self) -> None:
        """Release cached models and inner products."""
        for state in self._states.values():
            state.forget()
        self._states.clear()
        self.readings.forget()

    def modes(self) -> list[Mode]:
        """Return the combinations of nuisance parameters that a model may include."""
        small = self._small
        springs = [False, True] if small.spring.any() else [False]
        geometry = [False, True] if (~small.spring).any() else [False]
        geometry = [True] if small.declared else geometry
        return [(g, s) for g in geometry for s in springs]

    def state(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None = None
    ) -> State:
        """Return the model with optimised standard deviations.

        The optimisation starts at the standard deviations of ``start``.
        """
        key = frozenset(elements), mode
        if key not in self._states:
            self._states[key] = self._fitted(elements, mode, start)
        return self._states[key]

    def best(self, elements: tuple[Element, ...], start: State) -> State:
        """Return the best model, with or without geometric errors or springs.

        Compared with ``start``, either the use of geometric errors or the use of
        springs may change, but not both.
        """
        g, s = start.mode
        near = [m for m in self.modes() if m in {(g, s), (not g, s), (g, not s)}]
        states = [self.state(elements, m, start) for m in near]
        return max(states, key=lambda state: state.score)

    def _fitted(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None
    ) -> State:
        """Optimise standard deviations and remove springs with negative compliance."""
        spring, begin = self._small.spring, dict[int, float]()
        used = np.where(spring, mode[1], mode[0])
        if start is not None:
            begin = start.sizes_for(elements)
            used = start.used.copy() if start.mode == mode else used
        model = self._linear(elements, used)
        eigen = {
            _GROUPS + k: self.readings.eigen(e)
            for k, e in enumerate(elements)
            if e.columns.shape[1] > NARROW and np.isnan(e.given).all()
        }
        while True:
            sizes = best_sizes(model, begin, eigen)
            begin, kept = sizes.of_group, np.flatnonzero(used)
            wrong = spring[kept] & (sizes.mean[: len(kept)] < 0)
            if not wrong.any():
                break
            used[kept[wrong]] = False
            model = model.without(np.flatnonzero(wrong))
        tau = scale(sizes.squares, model.count)[0]
        score = self._score(elements, sizes, used, tau)
        return State(elements, mode, used, sizes, score, tau, self.readings)

    def _linear(self, elements: tuple[Element, ...], used: NDArray) -> Grouped:
        """Return the linear model of nuisance parameters, effects and functions."""
        readings, small = self.readings, self._small
        z = readings.without_offsets(elements)
        with_small, inner = readings.products(elements)
        beside = with_small[used]
        empty, counts = np.zeros(0), [e.columns.shape[1] for e in elements]
        own = _GROUPS + np.repeat(np.arange(len(elements)), counts)
        with_z = [empty, *(readings.own(e).T @ z for e in elements)]
        given = [empty, *(e.given for e in elements)]
        most = np.repeat([e.most for e in elements], counts)
        return Grouped(
            gram=np.block([
                [readings.gram[np.ix_(used, used)], beside], [beside.T, inner]
            ]),
            along=np.concatenate([(readings.small.T @ z)[used], *with_z]),
            squares=float(z @ z),
            count=readings.count,
            group=np.append(small.group[used], own),
            given=np.concatenate([small.given[used], *given]),
            most=np.append(small.most[used], most),
        )  # fmt: skip

    def _score(
        self, elements: Sequence[Element], sizes: Sizes, used: NDArray, tau: float
    ) -> float:
        """Return the log posterior of a model, up to a constant."""
        small, count = self._small, self.readings.count
        score = -0.5 * (float(deviance(sizes.squares, count)) + sizes.log_det)
        score -= sizes.cost
        geometry, springs = used & ~small.spring, used & small.spring
        score -= IN_USE * (geometry.any() and not small.declared)
        score -= IN_USE * springs.any()
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
