"""Which effects explain a residual: every small set of hypotheses, scored.

The score of a set S of hypotheses with k unknowns is the extended Bayesian information
criterion, in logarithms of probability,

    -RSS/2 - (k/2) ln n - ln C(m, |S|) - (|S| - 1) ln 10
        - sum of ln(ways in which each effect may act),

and an effect's probability is the posterior weight of all sets that have it.  Unknowns
stay within their bounds: a negative compliance explains nothing.

Sources:
    Chen, Chen (2008), Extended Bayesian information criteria for model selection with
    large model spaces, Biometrika 95, 759.
"""

import math
from collections import Counter
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from validation.diagnosis.hypotheses import Slot
from validation.diagnosis.signatures import Signature

_WAYS = 2  # ways of each effect that are tried in pairs, beside its most general
_BEST = 8  # sets of each size that are enlarged by anything
_APART = 1e-3  # sine of the angle between a column and those before it
FINITE = next(name for name, effect in LIBRARY.items() if effect.finite)
_FURTHER = math.log(10.0)  # of each effect beyond the first: a tenth as likely
_DIGITS = 2  # of a score; refits of one model reached by two ways differ below
_RANK = 1e-9  # relative eigenvalue below which columns are one


@dataclass(frozen=True, eq=False)
class Scored:
    """A set of hypotheses with its fit.

    Attributes:
        members: rows of the signatures, ascending.
        values: the fitted unknowns, one after the other.
        rss: [-] squared whitened residual left.
        rank: number of unknowns that the readings can tell apart.
        score: logarithm of the posterior weight, up to a constant.
    """

    members: tuple[int, ...]
    values: NDArray
    rss: float
    rank: int
    score: float


class Screen:
    """Signatures and residual as inner products, from which any set is fitted."""

    def __init__(self, residual: NDArray, signatures: Sequence[Signature]) -> None:
        """Take inner products.

        Args:
            residual: (N,) whitened, nuisances projected out.
            signatures: the hypotheses, nuisances projected out.
        """
        self.signatures = list(signatures)
        self.count = len(residual)
        self._slices, blocks, at = [], [], 0
        for s in signatures:
            # the offset is a column that always has the factor one
            blocks += [s.columns, s.offset[:, None]]
            k = s.columns.shape[1]
            self._slices.append((at, at + k))
            at += k + 1
        self._columns = np.column_stack([*blocks, np.zeros(self.count)])
        self._columns[:, -1] = residual
        self._gram = self._columns.T @ self._columns
        self._bounds = [s.hypothesis.bounds for s in signatures]
        self.effects = [s.hypothesis.effect for s in signatures]
        ways = Counter(self.effects)
        self._ways = [math.log(ways[e]) for e in self.effects]
        self._m = len(ways)
        self._fitted: dict[tuple[int, ...], Scored] = {}

    def with_residual(self, residual: NDArray) -> "Screen":
        """The same signatures for another residual.

        Args:
            residual: (N,) whitened; nuisances are taken out of it as out of the first.

        Returns:
            A screen that shares what does not change.
        """
        other = copy(self)
        other._columns = self._columns.copy()
        other._columns[:, -1] = residual
        other._fitted = {}
        other._gram = self._gram.copy()
        other._gram[-1] = other._gram[:, -1] = other._columns.T @ residual
        return other

    def shown(self, one: Scored) -> NDArray:
        """What a fitted set adds to the readings.

        Args:
            one: fitted by this screen.

        Returns:
            (N,) whitened.
        """
        signal = np.zeros(self.count)
        at = 0
        for i in one.members:
            s = self.signatures[i]
            k = s.columns.shape[1]
            signal += s.offset + s.columns @ one.values[at : at + k]
            at += k
        return signal

    def fit(self, members: Sequence[int]) -> Scored:
        """Fit a set of hypotheses, unknowns within their bounds.

        Args:
            members: rows of the signatures, of different effects.

        Returns:
            The set with its score.
        """
        members = tuple(sorted(members))
        if members not in self._fitted:
            self._fitted[members] = self._fit(members)
        return self._fitted[members]

    def _fit(self, members: tuple[int, ...]) -> Scored:
        columns: list[int] = []
        # what is left to fit: the residual minus the offsets of all members
        left = [len(self._gram) - 1]
        for i in members:
            begin, end = self._slices[i]
            columns += range(begin, end)
            left.append(end)
        sign = np.full(len(left), -1.0)
        sign[0] = 1.0
        # np.ix_ takes several times as long, and this is done thousands of times
        rows = self._gram.take(columns, axis=0)
        G = rows.take(columns, axis=1)
        b = rows.take(left, axis=1) @ sign
        rest = float(sign @ self._gram.take(left, axis=0).take(left, axis=1) @ sign)
        empty = np.zeros(0)
        lower = np.concatenate([empty, *(self._bounds[i][0] for i in members)])
        upper = np.concatenate([empty, *(self._bounds[i][1] for i in members)])
        x, rank = _within(G, b, lower, upper)
        rss = max(0.0, rest - 2 * float(b @ x) + float(x @ G @ x))
        shapes = sum(s.shape for i in members for s in self._slots(i))
        return Scored(
            members, x, rss, rank + shapes, self._score(members, rss, rank + shapes)
        )

    def _slots(self, i: int) -> tuple[Slot, ...]:
        return self.signatures[i].hypothesis.slots

    def _score(self, members: tuple[int, ...], rss: float, k: int) -> float:
        ways = sum(self._ways[i] for i in members)
        several = math.log(math.comb(self._m, len(members)))
        several += max(len(members) - 1, 0) * _FURTHER
        return -rss / 2 - k / 2 * math.log(self.count) - several - ways

    def rescored(self, one: Scored, rss: float, values: NDArray) -> Scored:
        """A set with the squared residual of another, better fit."""
        score = self._score(one.members, rss, one.rank)
        return Scored(one.members, values, rss, one.rank, score)

    def search(self, largest: int = 3) -> list[Scored]:
        """Fit the sets worth fitting.

        All single hypotheses; all pairs of each effect's best ways to act, and of the
        best single hypotheses with any; of larger sets, the best with one more member.

        Args:
            largest: number of effects in a set at most.

        Returns:
            Sets, best score first.
        """
        scored: dict[tuple[int, ...], Scored] = {(): self.fit(())}
        indices = range(len(self.signatures))
        for i in indices:
            scored[(i,)] = self.fit((i,))
        alone = sorted(indices, key=lambda i: -scored[(i,)].score)
        ways: dict[str, list[int]] = {}
        for i in indices:  # the first way of every effect is its most general
            ways.setdefault(self.effects[i], []).append(i)
        chosen = {own[0] for own in ways.values()}
        for own in ways.values():
            chosen.update(sorted(own, key=alone.index)[:_WAYS])
        pairs: set[tuple[int, ...]] = {*combinations(sorted(chosen), 2)}
        pairs |= {(i, j) for i in alone[:_BEST] for j in indices}
        self._enlarge(scored, pairs)
        for size in range(3, largest + 1):
            best = [s for s in scored.values() if len(s.members) == size - 1]
            best.sort(key=lambda s: -s.score)
            self._enlarge(
                scored, {(*s.members, j) for s in best[:_BEST] for j in chosen}
            )
        return sorted(scored.values(), key=self.order)

    def order(self, one: Scored) -> tuple[float, int]:
        """Best score first; of equal ones, the one that acts at fewer frames.

        Args:
            one: a set.

        Returns:
            What to sort sets by.
        """
        where = sum(len(self.signatures[i].hypothesis.where) for i in one.members)
        return -round(one.score, _DIGITS), where

    def _enlarge(
        self, scored: dict[tuple[int, ...], Scored], sets: set[tuple[int, ...]]
    ) -> None:
        """Fit sets of different effects that are not yet found."""
        for members in sorted({tuple(sorted(one)) for one in sets}):
            effects = {self.effects[i] for i in members}
            if len(effects) == len(members) and members not in scored:
                scored[members] = self.fit(members)


def _within(
    G: NDArray, b: NDArray, lower: NDArray, upper: NDArray
) -> tuple[NDArray, int]:
    """Least squares from normal equations; unknowns that leave their bounds are held.

    Returns:
        (k,) unknowns, and how many the equations can tell apart.
    """
    if not len(b):
        return np.zeros(0), 0
    held = np.zeros(len(b), dtype=bool)
    x, rank = _solve(G, b)
    while True:
        low, high = ~held & ~(x >= lower), ~held & ~(x <= upper)
        if not (low | high).any():
            return x, rank + int(held.sum())
        held |= low | high
        x = np.where(low, lower, np.where(high, upper, np.where(held, x, 0.0)))
        free, rank = np.flatnonzero(~held), 0
        if len(free):
            rows = G.take(free, axis=0)
            x[free], rank = _solve(rows.take(free, axis=1), b[free] - rows @ x)


def _solve(G: NDArray, b: NDArray) -> tuple[NDArray, int]:
    """Least norm solution of scaled normal equations, and their rank."""
    size = np.sqrt(np.diag(G))
    size[size == 0] = 1.0
    scaled = G / np.outer(size, size)
    try:
        # cheap where the columns are clearly apart, which they almost always are
        if np.diag(np.linalg.cholesky(scaled)).min() > _APART:
            return np.linalg.solve(scaled, b / size) / size, len(b)
    except np.linalg.LinAlgError:
        pass
    values, vectors = np.linalg.eigh(scaled)
    kept = values > _RANK * values[-1]
    y = vectors[:, kept].T @ (b / size) / values[kept]
    return vectors[:, kept] @ y / size, int(kept.sum())


def posterior(sets: Sequence[Scored]) -> NDArray:
    """(len(sets),) probabilities from scores."""
    scores = np.array([s.score for s in sets])
    weights = np.exp(scores - scores.max())
    return weights / weights.sum()


def inclusion(screen: Screen, sets: Sequence[Scored]) -> dict[str, float]:
    """Probability of every effect: the weight of all sets that have it."""
    scored = dict.fromkeys(screen.effects, 0.0)
    for one, weight in zip(sets, posterior(sets), strict=True):
        for name in named(screen, one):
            scored[name] += float(weight)
    return scored


def named(screen: Screen, one: Scored) -> tuple[str, ...]:
    """Names of a set's effects, in alphabetical order.

    Finite motions beside an effect that explains more than they do only refine the
    model in which it is fitted (near singularities they show at any load).

    Args:
        screen: whose set.
        one: the set.

    Returns:
        The names.
    """
    names = sorted(screen.effects[i] for i in one.members)
    others = [i for i in one.members if screen.effects[i] != FINITE]
    finite = [i for i in one.members if screen.effects[i] == FINITE]
    if others and finite and screen.fit(others).rss <= screen.fit(finite).rss:
        names.remove(FINITE)
    return tuple(names)
