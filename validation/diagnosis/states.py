"""A model of the search: its elements, geometry and springs, sizes, and its score.

score = ln p(z) at the sizes found - their cost + bounds + ln prior of the model
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Element
from validation.diagnosis.gaussian import (
    Taken,
    leave_block_out,
    likeness,
    take_out,
)
from validation.diagnosis.noise import FREEDOM, scale
from validation.diagnosis.prior_sizes import Sizes, best_sizes

Mode = tuple[bool, bool]  # whether geometry, whether springs are in use
MORE = math.log(2.0)  # an element more is half as likely
IN_USE = math.log(10.0), math.log(10.0)  # geometry, springs: one campaign in ten
_GROUPS = 4
_RANK = 1e-9
_GLANCED = 500  # rows by which functions are looked for first, drawn once


@dataclass(frozen=True, eq=False)
class State:
    """A model, its sizes at the likeliest.

    Attributes:
        elements: effects and functions.
        mode: whether geometry and springs are in use.
        used: (k,) unknowns of geometry and springs in use.
        sizes: of these and of the elements' unknowns.
        score: log posterior, up to a constant.
        tau: true over stated sigma.
        fit: whose cells and weights.
    """

    elements: tuple[Element, ...]
    mode: Mode
    used: NDArray
    sizes: Sizes
    score: float
    tau: float
    fit: "Fitting"

    @cached_property
    def taken(self) -> Taken:
        """What is left beside this model."""
        f, z = self.fit, self.fit.readings(self.elements)
        columns = [f.small[:, self.used], *(f.own(e) for e in self.elements)]
        X = np.hstack(columns)
        return take_out(X, self.sizes.std, z, f.flat)

    @cached_property
    def glance(self) -> Taken:
        """The same in the rows of a first look."""
        f = self.fit
        if f.glanced.all():
            return self.taken
        columns = [f.small[:, self.used], *(f.own(e) for e in self.elements)]
        X, z = np.hstack(columns)[f.glanced], f.readings(self.elements)[f.glanced]
        flat = np.linalg.qr(f.flat[f.glanced])[0]
        X, z = X - flat @ (flat.T @ X), z - flat @ (flat.T @ z)
        return take_out(X, self.sizes.std, z, flat)

    @cached_property
    def fitted(self) -> NDArray:
        """(n,) what the model adds to the readings, whitened and weighted."""
        f = self.fit
        X = np.hstack([f.small[:, self.used], *(f.own(e) for e in self.elements)])
        return X @ self.sizes.mean + (f.z - f.readings(self.elements))

    @cached_property
    def left(self) -> NDArray:
        """(n,) residual, unweighted."""
        f = self.fit
        X = np.hstack([f.small[:, self.used], *(f.own(e) for e in self.elements)])
        return (f.readings(self.elements) - X @ self.sizes.mean) / f.root

    def own(self, k: int) -> slice:
        """Unknowns of the k-th element among all."""
        counts = [e.columns.shape[1] for e in self.elements]
        begin = int(self.used.sum()) + sum(counts[:k])
        return slice(begin, begin + counts[k])

    def expected_squares(self) -> NDArray:
        """(n,) squared residuals of the cells unweighted, with what is not known."""
        f = self.fit
        X = np.hstack([f.small[:, self.used], *(f.own(e) for e in self.elements)])
        spread = np.einsum("ij,ij->i", X @ self.sizes.covariance, X)
        return self.left**2 + spread * self.tau**2 / f.weights


def foretold(one: State, other: State, blocks: NDArray) -> tuple[float, float]:
    """How much better a model foretells blocks of rows that it was not fitted to.

    Args:
        one: that model.
        other: of the same readings.
        blocks: (n,) whose each reading is.

    Returns:
        Sum of differences of ln densities at the first one's tau, sizes held, and its
        standard error from block to block.
    """
    densities = [leave_block_out(s.taken, blocks, one.tau)[1] for s in (one, other)]
    gains = densities[0] - densities[1]
    return float(gains.sum()), float(gains.std(ddof=1) * np.sqrt(len(gains)))


class Fitting:
    """Readings of some cells with weights; models of them."""

    def __init__(
        self, columns: Columns, z: NDArray, cells: NDArray, weights: NDArray
    ) -> None:
        """Weight, and take out the measuring frame.

        Args:
            columns: of all N cells.
            z: (n,) whitened residual of those fitted.
            cells: (N,) mask of these.
            weights: (n,) precision of each beside that of a good one.
        """
        self.columns, self.cells, self.weights = columns, cells, weights
        rows = columns.row[cells]
        number = np.unique(rows, return_inverse=True)[1]
        order = np.random.default_rng(0).permutation(number.max(initial=0) + 1)
        self.glanced = order[number] < _GLANCED
        self.root = np.sqrt(weights)
        flat = columns.flat[cells] * self.root[:, None]
        flat = flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        left, size, _ = np.linalg.svd(flat, full_matrices=False)
        self.flat = left[:, size > _RANK * size.max(initial=0.0)]
        self.z = self._without_flat(z * self.root)
        self.count = len(z) - self.flat.shape[1]
        self.small = self._without_flat(
            columns.nuisance.columns[cells] * self.root[:, None]
        )
        self._gram = self.small.T @ self.small
        self._own: dict[Element, tuple[NDArray, NDArray, NDArray]] = {}
        self._offset: dict[Element, NDArray] = {}
        self._states: dict[object, State] = {}

    def _without_flat(self, columns: NDArray) -> NDArray:
        return columns - self.flat @ (self.flat.T @ columns)

    def own(self, e: Element) -> NDArray:
        """(n, m) an element's columns in the cells fitted."""
        return self._products(e)[0]

    def _products(self, e: Element) -> tuple[NDArray, NDArray, NDArray]:
        """An element's columns, and their products with themselves and small ones."""
        if e not in self._own:
            B = self._without_flat(e.columns[self.cells] * self.root[:, None])
            self._own[e] = B, B.T @ B, self.small.T @ B
        return self._own[e]

    def readings(self, elements: Sequence[Element]) -> NDArray:
        """(n,) readings without what no unknown of the elements scales."""
        z = self.z
        for e in elements:
            if e.offset is not None:
                if e not in self._offset:
                    o = e.offset[self.cells] * self.root
                    self._offset[e] = self._without_flat(o)
                z = z - self._offset[e]
        return z

    def modes(self) -> list[Mode]:
        """Ways in which geometry and springs may be in use."""
        small = self.columns.nuisance
        springs = [False, True] if small.spring.any() else [False]
        geometry = [False, True] if (~small.spring).any() else [False]
        geometry = [True] if small.declared else geometry
        return [(g, s) for g in geometry for s in springs]

    def state(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None = None
    ) -> State:
        """A model with the likeliest sizes.

        Args:
            elements: of it.
            mode: whether geometry and springs are in use.
            start: from whose sizes to go on.

        Returns:
            The model, found once.
        """
        key = frozenset(elements), mode
        if key not in self._states:
            self._states[key] = self._fitted(elements, mode, start)
        return self._states[key]

    def best(self, elements: tuple[Element, ...], start: State) -> State:
        """The best of a model's modes that differ from another's in one at most."""
        g, s = start.mode
        near = [m for m in self.modes() if m in {(g, s), (not g, s), (g, not s)}]
        states = [self.state(elements, m, start) for m in near]
        return max(states, key=lambda state: state.score)

    def _fitted(
        self, elements: tuple[Element, ...], mode: Mode, start: State | None
    ) -> State:
        """Sizes found, springs that would be negative left out."""
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
        made = [self._products(e) for e in elements]
        E = np.hstack([np.zeros((len(z), 0)), *(B for B, _, _ in made)])
        counts = [B.shape[1] for B, _, _ in made]
        across = np.hstack([np.zeros((len(self._gram), 0)), *(c for _, _, c in made)])
        inner, with_z = E.T @ E, E.T @ z
        small_z = self.small.T @ z
        element = np.repeat(np.arange(len(elements)), counts)
        given = np.concatenate([np.zeros(0), *(e.given for e in elements)])
        most = np.repeat([e.most for e in elements], counts)
        while True:
            beside = across[used]
            gram = np.block([
                [self._gram[np.ix_(used, used)], beside],
                [beside.T, inner],
            ])
            sizes = best_sizes(
                gram, np.append(small_z[used], with_z), float(z @ z),
                self.count, FREEDOM,
                np.append(small.group[used], _GROUPS + element),
                np.append(small.given[used], given), np.append(small.most[used], most),
                begin,
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
        """Log posterior of a model, up to a constant."""
        small = self.columns.nuisance
        evidence = float(likeness(sizes.squares, self.count, FREEDOM)) + sizes.log_det
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
