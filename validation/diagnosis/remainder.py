r"""What is left in some rows, and what a candidate is worth there.

Effects and small unknowns are taken out of residual and candidates
once, for all candidates together:

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
Q                        (N, e)  orthonormal basis of what effects can do
S                        (N, k)  small columns without that, times their sizes
Y       ``_known``       (N, p)  Q and S L^-T with L L' = I + S'S, so that what counts
                                 of columns B is B'P B with P = I - Y Y'
b       ``_left``        (N,)    P z
======  ===============  ======  =====================================================

A block of m columns with a prior of one size t is then worth, in logarithms of
probability,

    (z'P z - L/v - n ln v - sum ln(1 + t^2 l_i))/2,
    L = z'P z - sum b_i^2 t^2/(1 + t^2 l_i),

l the eigenvalues of B'P B, b that of B'P z along its eigenvectors, v the noise.

Sources:
    MacKay (1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.linalg.blas import dtrsm

from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Candidate, Sensitivities
from validation.diagnosis.evidence import Evidence, Prior, sizes_in_use
from validation.diagnosis.holdout import blocks_of, gain_over_blocks
from validation.diagnosis.small_terms import SmallTerm

_FOLDS = 5
_PROVEN = 2.0  # standard errors by which a fold's rows must be foretold better
_FLAT = 1e4  # [sigma] size of unknowns of effects in a fold
_SIZES = 10.0 ** np.arange(-0.5, 4.1, 0.5)  # of a block, where its columns have norm 1
_AT_ONCE = 500  # columns, so that they are multiplied together and memory stays small


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

    def scaled(self, prior: Prior, cells: NDArray) -> NDArray:
        """(n, k) small columns in use, by a prior's sizes, in a mask's n cells."""
        size = sizes_in_use(self.terms, prior)
        scaled = np.empty((int(cells.sum()), len(size)), order="F")
        at = 0
        for term, used in zip(self.terms, prior.used, strict=True):
            for k in np.flatnonzero(used):
                scaled[:, at] = term.columns[cells, k] * size[at]
                at += 1
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

        small = left.scaled(prior, cells)
        small -= Q @ (Q.T @ small)
        small /= noise
        M = small.T @ small
        M[np.diag_indices(len(M))] += 1.0
        if len(M):
            L = cholesky(M, lower=True, overwrite_a=True, check_finite=False)
            # in place: small columns are most of what there is
            small = dtrsm(1.0, L, small, side=1, lower=1, trans_a=1, overwrite_b=1)
        self._known = Q, small
        z = left.residual[cells]
        z = z - Q @ (Q.T @ z)
        self._left = (z - small @ (small.T @ z)) / noise**2
        self._squares = float(z @ self._left)

    def worths(self, candidates: Sequence[Candidate]) -> NDArray:
        """How much likelier each candidate makes the readings.

        Args:
            candidates: any number.

        Returns:
            (len(candidates),) logarithms; -inf of what the readings do not see.
        """
        worths: list[float] = []
        for blocks in self._together(candidates):
            every = self._along(np.hstack(blocks))
            ends = np.cumsum([block.shape[1] for block in blocks])
            for block, Y in zip(
                blocks, np.split(every, ends[:-1], axis=1), strict=True
            ):
                worths.append(self._worth(block, block.T @ block - Y.T @ Y))
        return np.array(worths)

    def _along(self, columns: NDArray) -> NDArray:
        """(p, m) Y' times columns (N, m)."""
        return np.vstack([known.T @ columns for known in self._known])

    def _together(self, candidates: Sequence[Candidate]) -> Iterator[list[NDArray]]:
        """Columns of candidates, some hundred at once."""
        blocks, width = [], 0
        for one in candidates:
            block = in_cells(self.sensitivities, one, self.campaign)
            blocks.append(block)
            width += block.shape[1]
            if width > _AT_ONCE:
                yield blocks
                blocks, width = [], 0
        if blocks:
            yield blocks

    def _worth(self, block: NDArray, gram: NDArray) -> float:
        """What columns (N, m) with products (m, m) beside what is known are worth."""
        size = np.sqrt(np.einsum("nm,nm->m", block, block).max(initial=0.0))
        if size == 0.0:
            return -np.inf
        values, vectors = np.linalg.eigh(gram / (size * self._noise) ** 2)
        along = (vectors.T @ (block.T @ self._left) / size) ** 2
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
        B = in_cells(self.sensitivities, one, self.campaign)
        size = self._likeliest(one, B)
        if len(names) < 2:
            return False
        effects = self._all.effects[self._cells]
        norm = np.linalg.norm(effects, axis=0)
        flat = effects * (_FLAT / np.where(norm > 0, norm, 1.0))
        X = np.hstack([flat, self._all.scaled(self._prior, self._cells), B * size])
        known = X.shape[1] - len(size)
        z = self._all.residual[self._cells]
        gram = X.T @ X
        squares = np.zeros((2, len(where)))
        for fold in np.array_split(names, min(_FOLDS, len(names))):
            kept = np.isin(where, fold)
            squares[:, kept] = _foretold(X, z, gram, kept, known)
        without, beside = squares / self._noise**2
        gain, error = gain_over_blocks(without, beside, where)
        return gain > _PROVEN * error

    def _likeliest(self, one: Candidate, B: NDArray) -> NDArray:
        """(m,) likeliest sizes of a candidate's unknowns."""
        axis = self.sensitivities.axes(one)
        Y = self._along(B)
        gram = (B.T @ B - Y.T @ Y) / self._noise**2
        evidence = Evidence([function_term("", axis, B)], self.count, gram)
        prior = evidence.best_of(B.T @ self._left, self._squares)
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


def _foretold(
    X: NDArray, z: NDArray, gram: NDArray, kept: NDArray, known: int
) -> tuple[NDArray, NDArray]:
    """Squared errors of cells kept out of a fit with unknowns of size one.

    Returns:
        By the first ``known`` columns, and by all of them.
    """
    aside = X[kept]
    A = gram - aside.T @ aside
    A[np.diag_indices(len(A))] += 1.0
    L = cholesky(A, lower=True, overwrite_a=True)
    errors = []
    for count in (known, len(A)):
        own, x = L[:count, :count], np.zeros(count)
        # a second time: products of columns lose what nearly equal ones tell
        for _ in range(2):
            left = np.where(kept, 0.0, z - X[:, :count] @ x)
            wanted = X[:, :count].T @ left - x
            y = solve_triangular(own, wanted, lower=True, check_finite=False)
            x += solve_triangular(own, y, lower=True, trans=1, check_finite=False)
        errors.append((z[kept] - aside[:, :count] @ x) ** 2)
    return errors[0], errors[1]
