r"""What is left in some rows, and what a candidate is worth there.

Effects and small unknowns are taken out of residual and candidates
once, for all candidates together:

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
Q                        (N, e)  orthonormal basis of what effects can do
S                        (N, k)  small columns without that, times their sizes
Y                        (N, p)  Q and S L^-T with L L' = I + S'S, so that what counts
                                 of columns B is B'P B with P = I - Y Y'
b       ``held``         (N,)    P z
======  ===============  ======  =====================================================

A block of m columns with a prior of one size t is then worth, in logarithms of
probability,

    (z'P z - L/v - n ln v - sum ln(1 + t^2 l_i))/2,
    L = z'P z - sum b_i^2 t^2/(1 + t^2 l_i),

l the eigenvalues of B'P B, b that of B'P z along its eigenvectors, v the noise.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.blas import dtrsm

from validation.campaign.campaign import Campaign
from validation.diagnosis.blocks import Block, Blocks
from validation.diagnosis.candidates import Candidate, Sensitivities
from validation.diagnosis.evidence import Evidence, Prior, sizes_in_use
from validation.diagnosis.holdout import SPANS, blocks_of, gain_over_blocks
from validation.diagnosis.small_terms import SmallTerm

_FOLDS = 5
_PROVEN = 2.0  # standard errors by which a fold's rows must be foretold better
_ROUNDED = 10.0  # times the least eigenvalue, where that is negative
_LARGEST = 100.0  # times the residual: what an unknown may do
_CLEAR = 1e6  # [sigma] above which squares beside those of noise are lost to rounding
_FLAT = 1e4  # [sigma] size of unknowns of effects in a fold
_SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)  # of a block, where its columns have norm 1


@dataclass(frozen=True, eq=False)
class Unexplained:
    """What a set of effects leaves in the N cells fitted.

    Attributes:
        terms: small terms, with all their unknowns.
        residual: (N,) whitened readings minus the set of effects.
        effects: (N, k) whitened change per unknown of that set and the device's frame.
    """

    terms: Sequence[SmallTerm]
    residual: NDArray
    effects: NDArray

    def scaled(self, prior: Prior, cells: NDArray, *further: NDArray) -> NDArray:
        """(n, k) small columns in use, by a prior's sizes, in n cells; and others."""
        size = sizes_in_use(self.terms, prior)
        width = len(size) + sum(columns.shape[1] for columns in further)
        scaled = np.empty((len(cells), width), order="F")
        at = 0
        for term, used in zip(self.terms, prior.used, strict=True):
            for k in np.flatnonzero(used):
                np.multiply(term.columns[cells, k], size[at], out=scaled[:, at])
                at += 1
        for columns in further:
            scaled[:, at : at + columns.shape[1]] = columns
            at += columns.shape[1]
        return scaled


class Remainder:
    """What is left in some rows beside effects and small unknowns of known size."""

    def __init__(
        self, campaign: Campaign, sensitivities: Sensitivities, left: Unexplained,
        cells: NDArray, prior: Prior, noise: float,
    ) -> None:  # fmt: skip
        """Take out what is known.

        Args:
            campaign: of the rows looked at.
            sensitivities: of these rows.
            left: in these rows and others.
            cells: mask over its readings, of these rows.
            prior: of its terms.
            noise: [sigma] that stays.
        """
        self.campaign, self.sensitivities = campaign, sensitivities
        self.count = int(cells.sum())
        self._all, self._cells = left, cells
        self._known_errors: dict[tuple[Candidate, ...], NDArray] = {}
        self._prior, self._noise = prior, noise
        Q = np.linalg.qr(left.effects[cells])[0]

        small = left.scaled(prior, np.flatnonzero(cells))
        small -= Q @ (Q.T @ small)
        small /= noise
        M = small.T @ small
        M[np.diag_indices(len(M))] += 1.0
        if len(M):
            L = cholesky(M, lower=True, overwrite_a=True, check_finite=False)
            # in place: small columns are most of what there is
            small = dtrsm(1.0, L, small, side=1, lower=1, trans_a=1, overwrite_b=1)
        z = left.residual[cells]
        z = z - Q @ (Q.T @ z)
        held = (z - small @ (small.T @ z)) / noise**2
        self._squares = float(z @ held)
        self._held, self._taken_out = held, (Q, small)
        self._blocks = Blocks(campaign, sensitivities, (Q, small), held)

    def worths(self, candidates: Sequence[Candidate]) -> NDArray:
        """How much likelier each candidate makes the readings.

        Args:
            candidates: any number.

        Returns:
            (len(candidates),) logarithms; -inf of what the readings do not see.
        """
        worths = np.empty(len(candidates))
        for i, block in self._blocks.of(candidates):
            worths[i] = self._worth(block)
        return worths

    def worths_of_pairs(
        self, candidates: Sequence[Candidate], pairs: Sequence[tuple[int, int]]
    ) -> NDArray:
        """How much likelier two candidates of one size make the readings together.

        Args:
            candidates: few, for all their columns stand side by side.
            pairs: places of two among them.

        Returns:
            (len(pairs),) logarithms.
        """
        blocks = [in_cells(self.sensitivities, c, self.campaign) for c in candidates]
        # columns of two variables differ in size: those of each are made as large as 1
        blocks = [B / max(np.linalg.norm(B), np.finfo(float).tiny) for B in blocks]
        gram, along = self._products(blocks)
        ends = np.cumsum([0, *(B.shape[1] for B in blocks)]).tolist()
        columns = [np.arange(*own) for own in pairwise(ends)]
        both = [np.append(columns[i], columns[j]) for i, j in pairs]
        return np.array([
            self._worth(Block(gram[np.ix_(own, own)], along[own], 1.0)) for own in both
        ])

    def _products(self, blocks: Sequence[NDArray]) -> tuple[NDArray, NDArray]:
        """(k, k) B'P B and (k,) B'P z of columns (N, k1), (N, k2) .. side by side."""
        B = np.hstack(blocks)
        gram, along = B.T @ B, B.T @ self._held
        for Y in self._taken_out:
            shown = Y.T @ B
            gram -= shown.T @ shown
        return gram, along

    def _worth(self, block: Block) -> float:
        """What a block of columns is worth beside what is known."""
        if block.size == 0.0:
            return -np.inf
        values, vectors = _seen(block.gram / (block.size * self._noise) ** 2)
        along = (vectors.T @ block.along / block.size) ** 2
        t = (_SIZES[:, None] * self._noise) ** 2
        grown = 1 + t * values
        left = self._squares - (along * t / grown).sum(axis=1)
        # the noise is what this candidate leaves, and no less than sigma says
        noise = np.clip(left / self.count, self._noise**-2.0, 1.0)
        gains = self._squares - left / noise - self.count * np.log(noise)
        return float((gains - np.log(grown).sum(axis=1)).max() / 2)

    @property
    def successive(self) -> bool:
        """Whether rows that are foretold are apart from others in time only."""
        return blocks_of(self.campaign)[1] == SPANS

    def foretells(self, some: Sequence[Candidate]) -> bool:
        """Whether candidates foretell rows that they were not fitted to.

        Args:
            some: any, together.

        Returns:
            Whether errors fall by more than twice what they scatter.
        """
        gain, error = self.gain(some)
        return gain > _PROVEN * error

    def gain(
        self, some: Sequence[Candidate], others: Sequence[Candidate] = ()
    ) -> tuple[float, float]:
        """How much likelier candidates make rows that they were not fitted to.

        Args:
            some: any, together.
            others: than by these; than by none if empty.

        Returns:
            :func:`.holdout.gain_over_blocks` in folds over blocks of rows, beside all
            that is known, fitted anew in each; zeros if there is but one block.
        """
        folds = self._folds()
        if len(folds) < 2:
            return 0.0, 0.0
        where = self._blocks_of_cells()[np.concatenate(folds)]
        without, beside = self._errors(tuple(some))
        if others:
            without = self._errors(tuple(others))[1]
        return gain_over_blocks(without, beside, where)

    def _errors(self, some: tuple[Candidate, ...]) -> NDArray:
        """(2, N) squared errors in folds without and with candidates, found once."""
        if some not in self._known_errors:
            folds = self._folds()
            order = np.concatenate(folds)
            self._known_errors[some] = self._foretold(folds, self._columns(some, order))
        return self._known_errors[some]

    def forecast(self) -> float:
        """What all that is known makes of rows that it was not fitted to.

        Returns:
            Errors in folds over blocks of rows, each fitted anew to the others, as a
            cost by Student's t, least is best; zero if there is but one block.
        """
        folds = self._folds()
        if len(folds) < 2:
            return 0.0
        nothing = np.zeros((self.count, 0))
        squares = self._foretold(folds, nothing)[0] * self._noise**2
        together = np.zeros(self.count)
        return -gain_over_blocks(np.zeros_like(squares), squares, together)[0]

    def _blocks_of_cells(self) -> NDArray:
        """(N,) block of every reading."""
        return blocks_of(self.campaign)[0][np.nonzero(self.campaign.cells)[0]]

    def _folds(self) -> list[NDArray]:
        """Readings of each fold: some of the blocks, in an order drawn once."""
        where = self._blocks_of_cells()
        names = np.random.default_rng(1).permutation(np.unique(where))
        parts = np.array_split(names, min(_FOLDS, len(names)))
        return [np.flatnonzero(np.isin(where, part)) for part in parts]

    def _foretold(self, folds: Sequence[NDArray], further: NDArray) -> NDArray:
        """Errors in folds by what is known, and with further columns (N, m) beside it.

        Returns:
            (2, N) squares over that of the noise, fold after fold.
        """
        order = np.concatenate(folds)
        X = self._beside(order, further)
        z = self._all.residual[self._cells][order]
        ends = np.cumsum([0, *map(len, folds)])
        known = X.shape[1] - further.shape[1]
        return _foretold(X, z, ends, known) / self._noise**2

    def _columns(self, some: Sequence[Candidate], order: NDArray) -> NDArray:
        """(N, m) columns of candidates' unknowns of size one, cells in some order."""
        blocks = [in_cells(self.sensitivities, one, self.campaign) for one in some]
        return np.hstack(blocks)[order] * self._likeliest(some, blocks)

    def _beside(self, order: NDArray, further: NDArray) -> NDArray:
        """(N, k) columns of all unknowns of size one, further ones last."""
        cells = np.flatnonzero(self._cells)[order]
        effects = self._all.effects[cells]
        norm = np.linalg.norm(effects, axis=0)
        flat = effects * (_FLAT / np.where(norm > 0, norm, 1.0))
        X = self._all.scaled(self._prior, cells, flat, further)
        # larger ones are flat already, and lost to rounding in their products
        norm = np.sqrt(np.einsum("ij,ij->j", X, X))
        most = _LARGEST * float(np.linalg.norm(self._all.residual))
        most = min(max(_FLAT, most), _CLEAR)
        X *= np.minimum(1.0, most / np.where(norm > 0, norm, 1.0))
        return X

    def _likeliest(
        self, some: Sequence[Candidate], blocks: Sequence[NDArray]
    ) -> NDArray:
        """(m,) likeliest sizes of candidates' unknowns, by their columns (N, m1) .."""
        gram, along = self._products(blocks)
        values, vectors = _seen(gram / self._noise**2)
        gram, seen = (vectors * values) @ vectors.T, vectors @ vectors.T
        terms = [
            function_term(str(k), self.sensitivities.axes(one), B)
            for k, (one, B) in enumerate(zip(some, blocks, strict=True))
        ]
        prior = Evidence(terms, self.count, gram).best_of(seen @ along, self._squares)
        return sizes_in_use(terms, prior)


def _seen(gram: NDArray) -> tuple[NDArray, NDArray]:
    """Directions in which a block (m, m) differs from what is known.

    What a block shares with what is known cancels, but for rounding: as negative as the
    least eigenvalue, others are as large.

    Returns:
        (k,) eigenvalues and (m, k) eigenvectors.
    """
    values, vectors = np.linalg.eigh(gram)
    clear = values > _ROUNDED * max(0.0, -values[0])
    return values[clear], vectors[:, clear]


def in_cells(
    sensitivities: Sensitivities, one: Candidate, campaign: Campaign
) -> NDArray:
    """What a candidate of m unknowns adds to the readings.

    Args:
        sensitivities: of the campaign's rows.
        one: the candidate.
        campaign: of R rows, N measured cells.

    Returns:
        (N, m) in the cells, over sigma.
    """
    changes = np.moveaxis(sensitivities.changes(one), 2, 0) / campaign.sigma
    columns = changes.reshape(len(changes), -1)
    if not campaign.cells.all():
        columns = columns[:, campaign.cells.ravel()]
    return columns.T


def function_term(name: str, axis: NDArray, columns: NDArray) -> SmallTerm:
    """A function's m unknowns as a small term.

    Args:
        name: of the term.
        axis: (m,) component that each acts in.
        columns: (N, m) what each adds to the readings, over sigma.

    Returns:
        The term; its sizes are to be found, and it is in use whatever they are.
    """
    m = len(axis)
    return SmallTerm(
        name, np.zeros(m, int), axis, columns, np.full(m, np.nan), -np.inf, sure=True
    )


def _foretold(X: NDArray, z: NDArray, ends: NDArray, known: int) -> NDArray:
    """Squared errors of cells by fits to other folds, with unknowns of size one.

    Args:
        X: (N, k) columns, fold after fold.
        z: (N,) readings.
        ends: (folds + 1,) where folds begin and end.
        known: how many columns are there anyway.

    Returns:
        (2, N) by the first ``known`` columns, and by all of them.
    """
    folds = [slice(begin, end) for begin, end in pairwise(ends.tolist())]
    grams = [X[fold].T @ X[fold] for fold in folds]
    gram, everywhere = sum(grams[1:], start=grams[0]), X.T @ z
    squares = np.zeros((2, len(z)))
    for fold, own in zip(folds, grams, strict=True):
        A = gram - own
        A[np.diag_indices(len(A))] += 1.0
        L = cholesky(A, lower=True, overwrite_a=True, check_finite=False)
        wanted = everywhere - X[fold].T @ z[fold]
        x = np.zeros((2, len(A)))
        for count, part in zip((known, len(A)), x, strict=True):
            part[:count] = _by_factor(L[:count, :count], wanted[:count])
        # a second time: products of columns lose what nearly equal ones tell
        left = z - x @ X.T
        left[:, fold] = 0.0
        wanted = left @ X - x
        for count, part, more in zip((known, len(A)), x, wanted, strict=True):
            part[:count] += _by_factor(L[:count, :count], more[:count])
        squares[:, fold] = (z[fold] - x @ X[fold].T) ** 2
    return squares


def _by_factor(L: NDArray, b: NDArray) -> NDArray:
    """(L L')^-1 b."""
    y = solve_triangular(L, b, lower=True, check_finite=False)
    return solve_triangular(L, y, lower=True, trans=1, check_finite=False)
