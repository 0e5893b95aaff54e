r"""Sizes of the priors of small unknowns, found by the evidence.

Of readings z = J g + noise with unknowns g of covariance S^2, covariance and its
determinant are C = I + J S^2 J' and det M: everything is said by inner products.

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
J       ``columns``      (N, k)  change of the whitened readings per small unknown
S       ``size``         (k,)    standard deviations of the prior
G       ``gram``         (k, k)  J'J
b       ``along``        (k,)    J'z
M                        (k, k)  I + S G S; z' C^-1 z = z'z - b'S M^-1 S b
======  ===============  ======  =====================================================

Unknowns of one size may be any orthonormal combinations of those asked for: their part
of G may be made diagonal beforehand, and is then eliminated at little cost.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from validation.diagnosis.equations import Equations
from validation.diagnosis.small_terms import SmallTerm

_PASSES = 6  # of leaving out springs that would be stiffer than declared
_LEAST, _MOST = -6.0, 14.0  # logarithms of sizes over those that show as noise does
_FIRST = 1.5  # from which they are looked for
_GLANCES = (-1.5, 0.0, 1.5)  # likewise, at which a further term is looked at
_NEAR = 20.0  # by how much less likely a choice may look that is then fitted
_FURTHER = np.log(10.0)  # of each term: a tenth as likely


@dataclass(frozen=True, eq=False)
class Prior:
    """Which small unknowns are in use, and how large they are thought to be.

    Attributes:
        used: a mask over each term's unknowns.
        scales: [rad, m] or [rad/(N m), m/N] of rotations and of translations, by term
            in use; where a frame's own tolerance says it, that is used instead.
        cost: -ln det C / 2 minus what choosing terms and sizes costs.
        evidence: logarithm of the probability of the readings, that cost included.
    """

    used: tuple[NDArray, ...]
    scales: dict[str, tuple[float, float]]
    cost: float
    evidence: float


def sizes_of(term: SmallTerm, scales: Sequence[float]) -> NDArray:
    """(k,) standard deviations of a term's unknowns, from those asked for."""
    asked = np.array(scales)[term.axis // 3]
    return np.where(np.isfinite(term.given), term.given, asked)


class Evidence:
    """What residuals say about the sizes of small terms."""

    def __init__(
        self, terms: Sequence[SmallTerm], cells: int, gram: NDArray | None = None
    ) -> None:
        """Take inner products once.

        Args:
            terms: with their columns as they are to be scored.
            cells: number of readings N.
            gram: (k, k) inner products of these columns, where they are known.
        """
        self.terms = tuple(terms)
        self._sure = [term.sure for term in terms]
        self._penalty = 0.5 * np.log(max(cells, 2))  # of each size asked for
        self._begin = np.cumsum([0, *(len(term) for term in terms)])
        group = [
            np.where(t.group < 0, t.group, 2 * i + t.group) for i, t in enumerate(terms)
        ]
        self._group = np.concatenate([np.zeros(0, int), *group])
        self._most = np.array([size for t in terms for size in t.most])
        self._given = np.concatenate([np.zeros(0), *(t.given for t in terms)])
        self._gram = gram_of([t.columns for t in terms]) if gram is None else gram
        self._apart = _largest_diagonal(self._gram, self._group)

    def best(self, residual: NDArray) -> Prior:
        """The terms that a residual asks for, with their likeliest sizes.

        Springs that would have to be stiffer than declared are left out.

        Args:
            residual: (N,) whitened, of readings minus what other effects do.

        Returns:
            The prior; terms with tolerances of their own are always in it.
        """
        along = [t.columns.T @ residual for t in self.terms]
        return self.best_of(
            np.concatenate([np.zeros(0), *along]), float(residual @ residual)
        )

    def best_of(
        self, along: NDArray, squares: float, start: Prior | None = None
    ) -> Prior:
        """The same from inner products.

        Args:
            along: (k,) of columns and residual.
            squares: of the residual.
            start: of the same terms with nearly the same residual: its choice of terms,
                and those that differ by one, are looked at, sizes from there; unknowns
                that it left out come in where they are called for now.

        Returns:
            The prior.
        """
        if start is None:
            choices = product(*((True,) if s else (False, True) for s in self._sure))
            priors = [self._fitted(chosen, along, squares) for chosen in choices]
            return max(priors, key=lambda prior: prior.evidence)
        on = [bool(used.any()) for used in start.used]
        priors = [self._surely_fitted(on, along, squares, start)]
        for k in np.flatnonzero(~np.array(self._sure, dtype=bool)):
            other = [o ^ (i == k) for i, o in enumerate(on)]
            with suppress(np.linalg.LinAlgError):  # it would show by rounding alone
                near = self._at_a_glance(other, priors[0], along, squares)
                if near > priors[0].evidence - _NEAR:
                    priors.append(self._fitted(other, along, squares, start))
        return max(priors, key=lambda prior: prior.evidence)

    def _surely_fitted(
        self, chosen: Sequence[bool], along: NDArray, squares: float, start: Prior
    ) -> Prior:
        """The likeliest sizes of terms that are in use, whatever rounding says.

        Nearly equal columns of large unknowns leave products that are not positive
        definite: the nearest ones that are semidefinite stand for them.

        Returns:
            The prior.

        Sources:
            Higham (1988), Computing a nearest symmetric positive semidefinite matrix,
            Linear Algebra Appl. 103, 103.
        """
        try:
            return self._fitted(chosen, along, squares, start)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(self._gram)
            self._gram = (vectors * np.maximum(values, 0.0)) @ vectors.T
            self._apart = np.zeros(len(self._gram), dtype=bool)
            return self._fitted(chosen, along, squares, start)

    def _at_a_glance(
        self, chosen: Sequence[bool], near: Prior, along: NDArray, squares: float
    ) -> float:
        """About the evidence of a choice, at the sizes of another one near to it."""
        mask = np.concatenate([np.zeros(0, bool), *self._of(chosen, near)])
        group, given = self._group[mask], self._given[mask]
        known, shows = self._scales(near), self._shows(mask)
        equations, b = self._equations(mask, along), along[mask]
        evidence = -np.inf
        for log in _GLANCES:
            new = np.minimum(shows * np.exp(log), self._most)
            scales = np.where(np.isfinite(known), known, new)
            s = np.where(group < 0, given, scales[group])
            x, cost, _ = equations.solved(s)
            evidence = max(evidence, -0.5 * (squares - float(x @ (s * b))) - cost)
        return evidence

    def _of(self, chosen: Sequence[bool], near: Prior) -> list[NDArray]:
        """Unknowns of chosen terms: those that another prior uses, where it does."""
        return [
            was if on and was.any() else np.full(len(was), on)
            for on, was in zip(chosen, near.used, strict=True)
        ]

    def _scales(self, prior: Prior) -> NDArray:
        """Sizes that a prior found, by group of unknowns; NaN of others."""
        unknown = np.nan, np.nan
        return np.array([
            s for t in self.terms for s in prior.scales.get(t.name, unknown)
        ])

    def _shows(self, mask: NDArray) -> NDArray:
        """Sizes that show as much as noise does, by group of the unknowns in use."""
        shows, squares = np.ones(2 * len(self.terms)), np.diag(self._gram)
        for g in np.unique(self._group[mask & (self._group >= 0)]):
            shown = float(np.mean(squares[mask & (self._group == g)]))
            shows[g] = 1 / np.sqrt(shown) if shown > 0.0 else 1.0
        return shows

    def _equations(self, mask: NDArray, along: NDArray) -> Equations:
        """Of the unknowns in use."""
        G, apart = self._gram, self._apart[mask]
        return Equations(G[np.ix_(mask, mask)], along[mask], apart)

    @property
    def always(self) -> bool:
        """Whether a term is there whatever the readings say."""
        return any(self._sure)

    def none(self) -> Prior:
        """The prior of a machine made exactly as declared."""
        return Prior(tuple(np.zeros(len(t), bool) for t in self.terms), {}, 0.0, 0.0)

    def posterior(self, prior: Prior, along: NDArray) -> tuple[NDArray, float]:
        """The most probable unknowns.

        Args:
            prior: of these terms.
            along: (k,) inner products of columns and residual.

        Returns:
            (k,) values, zero of those not in use, and how many combinations of them
            the readings say.
        """
        mask = np.concatenate([np.zeros(0, bool), *prior.used])
        size = sizes_in_use(self.terms, prior)
        values = np.zeros(len(mask))
        if not len(size):
            return values, 0.0
        x, _, inverse = self._equations(mask, along).solved(size)
        values[mask] = size * x
        return values, float(len(size) - inverse.sum())

    def _fitted(
        self, chosen: Sequence[bool], along: NDArray, squares: float,
        start: Prior | None = None,
    ) -> Prior:  # fmt: skip
        """The likeliest sizes of chosen terms."""
        used = [np.full(len(t), on) for t, on in zip(self.terms, chosen, strict=True)]
        scales = np.full(2 * len(self.terms), np.nan)
        if start is not None:
            used, scales = self._of(chosen, start), self._scales(start)
        for turn in range(_PASSES):
            prior, values, scales = self._sized(used, along, squares, scales)
            parts = np.split(values, self._begin[1:-1])
            wrong = [x < t.lower for t, x in zip(self.terms, parts, strict=True)]
            again = self._called_for(used, along, values) if start and not turn else []
            if not any(w.any() for w in (*wrong, *again)):
                break
            used = [u & ~w for u, w in zip(used, wrong, strict=True)]
            used = [u | a for u, a in zip(used, again or used, strict=True)]
        return prior

    def _called_for(
        self, used: Sequence[NDArray], along: NDArray, values: NDArray
    ) -> list[NDArray]:
        """Unknowns left out of terms in use that what is left would make positive."""
        left = np.split(along - self._gram @ values, self._begin[1:-1])
        return [u.any() & ~u & (b > 0.0) for u, b in zip(used, left, strict=True)]

    def _sized(
        self, used: Sequence[NDArray], along: NDArray, squares: float, start: NDArray
    ) -> tuple[Prior, NDArray, NDArray]:
        """The likeliest sizes of the unknowns in use, from ``start`` where it says one.

        Returns:
            The prior, (k,) values of all unknowns, and all sizes.
        """
        mask = np.concatenate([np.zeros(0, bool), *used])
        equations, b = self._equations(mask, along), along[mask]
        group, given = self._group[mask], self._given[mask]
        asked = np.unique(group[group >= 0])
        shows = self._shows(mask)

        @lru_cache(maxsize=2)  # what a search ends with is asked for once more
        def solved(some: bytes) -> tuple[NDArray, NDArray, float, NDArray]:
            logs = np.zeros(len(shows))
            logs[asked] = np.frombuffer(some)
            s = np.where(group < 0, given, (shows * np.exp(logs))[group])
            return s, *equations.solved(s)

        def against(some: NDArray) -> tuple[float, NDArray]:
            s, x, log, inverse = solved(some.tobytes())
            slope = x**2 - (1 - inverse)
            value = 0.5 * (squares - float(x @ (s * b))) + log
            return value, -np.array([slope[group == g].sum() for g in asked])

        known = np.isfinite(start) & (start > 0.0)
        logs = np.full(len(shows), _FIRST)
        logs[known] = np.log(start[known] / shows[known])
        if len(asked):
            most = np.log(self._most[asked] / shows[asked])
            bounds = [(_LEAST, float(np.clip(m, _LEAST, _MOST))) for m in most]
            options = {"ftol": 1e-7, "maxiter": 40}
            begin = np.clip(logs[asked], *np.transpose(bounds))
            logs[asked] = minimize(
                against, begin, jac=True, method="L-BFGS-B", bounds=bounds,
                options=options,
            ).x  # fmt: skip
        s, x, cost, _ = solved(logs[asked].tobytes())
        values = np.zeros(len(mask))
        values[mask] = s * x
        evidence = -0.5 * (squares - float(x @ (s * b)))
        cost += self._penalty * float(np.sum(logs[asked] > _LEAST + 1e-3))
        scales, every = {}, shows * np.exp(logs)
        for i, (term, u) in enumerate(zip(self.terms, used, strict=True)):
            own = [2 * i, 2 * i + 1]
            if u.any():
                size = np.where(np.isin(own, asked), every[own], 0.0)
                scales[term.name] = (float(size[0]), float(size[1]))
                cost += 0.0 if term.sure else _FURTHER
        return Prior(tuple(used), scales, -cost, evidence - cost), values, every


def sizes_in_use(terms: Sequence[SmallTerm], prior: Prior) -> NDArray:
    """Standard deviations of all unknowns that a prior of these terms uses."""
    sizes = [np.zeros(0)]
    for term, used in zip(terms, prior.used, strict=True):
        if used.any():
            sizes.append(sizes_of(term, prior.scales[term.name])[used])
    return np.concatenate(sizes)


def gram_of(blocks: Sequence[NDArray]) -> NDArray:
    """Inner products of the columns of blocks (N, k1), (N, k2) .., (k, k) of all."""
    begin = np.cumsum([0, *(block.shape[1] for block in blocks)])
    gram = np.zeros((begin[-1], begin[-1]))
    for i, a in enumerate(blocks):
        for j, b in enumerate(blocks[: i + 1]):
            own = slice(begin[i], begin[i + 1]), slice(begin[j], begin[j + 1])
            gram[own] = a.T @ b
            gram[own[::-1]] = gram[own].T
    return gram


def _largest_diagonal(gram: NDArray, group: NDArray) -> NDArray:
    """(k,) bool, the largest group of unknowns whose products are diagonal, if any."""
    largest = np.zeros(len(group), dtype=bool)
    for g in np.unique(group[group >= 0]):
        own = np.flatnonzero(group == g)
        if len(own) > max(1, int(largest.sum())):
            block = gram[np.ix_(own, own)]
            if np.count_nonzero(block) == np.count_nonzero(np.diag(block)):
                largest[:] = False
                largest[own] = True
    return largest
