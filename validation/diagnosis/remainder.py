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
from validation.diagnosis.holdout import blocks_of, gain_over_blocks
from validation.diagnosis.small_terms import SmallTerm

_FOLDS = 5
_PROVEN = 2.0  # standard errors by which a fold's rows must be foretold better
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

    def _worth(self, block: Block) -> float:
        """What a block of columns is worth beside what is known."""
        if block.size == 0.0:
            return -np.inf
        values, vectors = np.linalg.eigh(block.gram / (block.size * self._noise) ** 2)
        along = (vectors.T @ block.along / block.size) ** 2
        t = (_SIZES[:, None] * self._noise) ** 2
        grown = 1 + t * np.maximum(values, 0.0)
        left = self._squares - (along * t / grown).sum(axis=1)
        # the noise is what this candidate leaves, and no less than sigma says
        noise = np.clip(left / self.count, self._noise**-2.0, 1.0)
        gains = self._squares - left / noise - self.count * np.log(noise)
        return float((gains - np.log(grown).sum(axis=1)).max() / 2)

    def foretells(self, one: Candidate) -> bool:
        """Whether a candidate foretells rows that it was not fitted to.

        Args:
            one: any.

        Returns:
            Whether errors in folds over blocks of rows fall, beside all that is
            known fitted anew in each.
        """
        where = blocks_of(self.campaign)[0][np.nonzero(self.campaign.cells)[0]]
        names = np.random.default_rng(1).permutation(np.unique(where))
        if len(names) < 2:
            return False
        folds = np.array_split(names, min(_FOLDS, len(names)))
        parts = [np.flatnonzero(np.isin(where, fold)) for fold in folds]
        order = np.concatenate(parts)  # fold after fold: each is a slice
        X, known = self._beside(one, order)
        z = self._all.residual[self._cells][order]
        ends = np.cumsum([0, *map(len, parts)])
        without, beside = _foretold(X, z, ends, known) / self._noise**2
        gain, error = gain_over_blocks(without, beside, where[order])
        return gain > _PROVEN * error

    def _beside(self, one: Candidate, order: NDArray) -> tuple[NDArray, int]:
        """Columns (N, k) of unknowns of size one, cells in some order.

        Returns:
            The columns, a candidate's last, and how many are not the candidate's.
        """
        B = in_cells(self.sensitivities, one, self.campaign)
        B = B[order] * self._likeliest(one, B)
        cells = np.flatnonzero(self._cells)[order]
        effects = self._all.effects[cells]
        norm = np.linalg.norm(effects, axis=0)
        flat = effects * (_FLAT / np.where(norm > 0, norm, 1.0))
        X = self._all.scaled(self._prior, cells, flat, B)
        return X, X.shape[1] - B.shape[1]

    def _likeliest(self, one: Candidate, B: NDArray) -> NDArray:
        """(m,) likeliest sizes of a candidate's unknowns."""
        axis = self.sensitivities.axes(one)
        ((_, block),) = self._blocks.of([one])
        gram = block.gram / self._noise**2
        evidence = Evidence([function_term("", axis, B)], self.count, gram)
        prior = evidence.best_of(block.along, self._squares)
        return sizes_in_use(evidence.terms, prior)


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
