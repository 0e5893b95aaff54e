r"""Small unknowns behind everything that is scored, by a prior of known size.

With unknowns g of covariance S^2 and readings z = model + J g + noise, the covariance
of z - model is C = I + J S^2 J'.  Everything is scored with that covariance, so that no
other effect is claimed for what small unknowns may do.

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
J       ``columns``      (N, k)  change of the whitened readings per small unknown
S       ``size``         (k,)    standard deviations of the prior
V, l    ``turn, gains``  (k, r)  J S = U sqrt(l) V', so that C = I + U l U'
W                        (N, N)  C^-1/2 = I - U (1 - 1/sqrt(1 + l)) U'
======  ===============  ======  =====================================================

U f(l) U' = J S V f(l)/l V' S J' without U (N, r), which would be as large as J.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.evidence import Prior, sizes_of
from validation.diagnosis.small_terms import SmallTerm

_FAINT = 1e-8  # a gain below it changes nothing


@dataclass(frozen=True, eq=False)
class Background:
    """Small terms with the sizes of their priors.

    Attributes:
        terms: those in use, each with the unknowns in use.
        size: (k,) [rad, m, rad/(N m), m/N] standard deviations of all priors.
        scales: of rotations and of translations that were asked for, by term.
        gains: (r,) variances along orthonormal axes U, of noise 1.
        turn: (k, r) orthonormal: unknowns over their size along those axes.
        score: what the terms cost, to be added to a score: -ln det C / 2 - penalties.
    """

    terms: tuple[SmallTerm, ...]
    size: NDArray
    scales: dict[str, tuple[float, float]]
    gains: NDArray
    turn: NDArray
    score: float

    def __bool__(self) -> bool:
        return bool(self.terms)

    @property
    def unknowns(self) -> float:
        """How many combinations of the unknowns the readings say, and not the prior."""
        return float(self.known.sum())

    def whitened(self, columns: NDArray) -> NDArray:
        """W times columns (N,) or (N, m)."""
        if not len(self.gains):
            return columns
        shrink = 1 - 1 / np.sqrt(1 + self.gains)
        away = self._along(shrink / self.gains, columns)
        return np.subtract(columns, away, out=away)

    def raw(self, whitened: NDArray) -> NDArray:
        """A residual r (N,) from W r."""
        if not len(self.gains):
            return whitened
        grow = np.sqrt(1 + self.gains) - 1
        return whitened + self._along(grow / self.gains, whitened)

    def left(self, whitened: NDArray) -> NDArray:
        """What the most probable small unknowns leave of a residual r.

        Args:
            whitened: (N,) W r.

        Returns:
            (N,) r - J g.
        """
        return self.whitened(whitened)

    def values(self, whitened: NDArray) -> list[NDArray]:
        """The most probable unknowns of every term, from W r (N,)."""
        if not self.terms:
            return []
        return self._by_term(self._seen(1 / np.sqrt(1 + self.gains), whitened))

    def _seen(self, share: NDArray, columns: NDArray) -> NDArray:
        """(k,) or (k, m) unknowns S V share V' S J' of columns."""
        size, share = (
            x.reshape(-1, *[1] * (columns.ndim - 1)) for x in (self.size, share)
        )
        shown = np.concatenate([term.columns.T @ columns for term in self.terms])
        return size * (self.turn @ (share * (self.turn.T @ (size * shown))))

    def _along(self, share: NDArray, columns: NDArray) -> NDArray:
        """J S V share V' S J' times columns (N,) or (N, m)."""
        unknowns = self._by_term(self._seen(share, columns))
        total = self.terms[0].columns @ unknowns[0]
        for term, own in zip(self.terms[1:], unknowns[1:], strict=True):
            total += term.columns @ own
        return total

    def lost(self, raw: NDArray, values: Sequence[NDArray]) -> float:
        """Twice the negative logarithm of how likely unknowns are, but for a constant.

        Args:
            raw: (N,) residual without the small unknowns.
            values: (k,) of every term.

        Returns:
            Squares of what they leave and of themselves over their prior.
        """
        moved = np.concatenate([np.zeros(0), *values])
        known = self.size > 0.0
        left = raw.copy()
        for term, x in zip(self.terms, values, strict=True):
            left -= term.columns @ x
        return float(left @ left + np.sum((moved[known] / self.size[known]) ** 2))

    def deviations(self) -> list[NDArray]:
        """Standard deviations of the unknowns of every term."""
        kept = 1 - np.einsum("kr,r->k", self.turn**2, self.known)
        return self._by_term(self.size * np.sqrt(np.maximum(kept, 0.0)))

    @property
    def known(self) -> NDArray:
        """(r,) share of each combination that the readings and not the prior say."""
        return self.gains / (1 + self.gains)

    def identified(self) -> list[NDArray]:
        """(k,) of every term, the share of each unknown that the readings say."""
        return self._by_term(np.einsum("kr,r->k", self.turn**2, self.known))

    def _by_term(self, values: NDArray) -> list[NDArray]:
        ends = np.cumsum([len(term) for term in self.terms])
        return np.split(values, ends[:-1]) if self.terms else []


NOTHING = Background(
    terms=(),
    size=np.zeros(0),
    scales={},
    gains=np.zeros(0),
    turn=np.zeros((0, 0)),
    score=0.0,
)


def background(terms: Sequence[SmallTerm], prior: Prior) -> Background:
    """Terms with the sizes of a prior.

    Args:
        terms: those that the prior was found for, in any cells.
        prior: their sizes.

    Returns:
        The background.
    """
    used = zip(terms, prior.used, strict=True)
    kept = [t if on.all() else t.take(on) for t, on in used if on.any()]
    if not kept:
        return NOTHING
    size = np.concatenate([sizes_of(term, prior.scales[term.name]) for term in kept])
    gram = np.block([[one.columns.T @ other.columns for other in kept] for one in kept])
    gains, turn = np.linalg.eigh(size[:, None] * gram * size)
    shown = gains > _FAINT
    gains, turn = gains[shown], turn[:, shown]
    return Background(
        terms=tuple(kept),
        size=size,
        scales=prior.scales,
        gains=gains,
        turn=turn,
        score=prior.cost,
    )
