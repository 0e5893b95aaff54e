r"""Small unknowns behind everything that is scored, by a prior of known size.

With unknowns g of covariance S^2 and readings z = model + J g + noise, the covariance
of z - model is C = I + J S^2 J'.  Everything is scored with that covariance, so that no
other effect is claimed for what small unknowns may do.

======  ===============  ======  =====================================================
symbol  code             shape   meaning
======  ===============  ======  =====================================================
J       ``columns``      (N, k)  change of the whitened readings per small unknown
S       ``size``         (k,)    standard deviations of the prior
U, l    ``axes, gains``  (N, r)  J S = U sqrt(l) V', so that C = I + U l U'
W                        (N, N)  C^-1/2 = I - U (1 - 1/sqrt(1 + l)) U'
======  ===============  ======  =====================================================
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
        axes: (N, r) orthonormal.
        gains: (r,) variances along them, of noise 1.
        turn: (k, r) orthonormal: unknowns over their size along those axes.
        score: what the terms cost, to be added to a score: -ln det C / 2 - penalties.
    """

    terms: tuple[SmallTerm, ...]
    size: NDArray
    scales: dict[str, tuple[float, float]]
    axes: NDArray
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
        away = self.axes @ (shrink * (self.axes.T @ columns).T).T
        return np.subtract(columns, away, out=away)

    def raw(self, whitened: NDArray) -> NDArray:
        """A residual r (N,) from W r."""
        if not len(self.gains):
            return whitened
        grow = np.sqrt(1 + self.gains) - 1
        return whitened + self.axes @ (grow * (self.axes.T @ whitened))

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
        along = self.axes.T @ whitened * np.sqrt(self.gains / (1 + self.gains))
        return self._by_term(self.size * (self.turn @ along))

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
    axes=np.zeros((0, 0)),
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
    scaled = np.empty((len(kept[0].columns), len(size)), order="F")
    ends = np.cumsum([len(term) for term in kept])[:-1]
    for part, own, term in zip(
        np.split(scaled, ends, axis=1), np.split(size, ends), kept, strict=True
    ):
        np.multiply(term.columns, own, out=part)
    gains, turn = np.linalg.eigh(scaled.T @ scaled)
    shown = gains > _FAINT
    gains, turn = gains[shown], turn[:, shown]
    axes = scaled @ (turn / np.sqrt(gains))
    return Background(
        terms=tuple(kept),
        size=size,
        scales=prior.scales,
        axes=axes,
        gains=gains,
        turn=turn,
        score=prior.cost,
    )
